"""Who asks, and who of them is still there.

A client that has left cannot be answered: Fast DDS waits a tenth of a second for it with each answer, and
everybody else waits too.
"""

from __future__ import annotations

import ctypes
from typing import Any

from rclpy.node import Node

NOBODY = b""
"""The client of every request where the middleware does not tell them apart."""


class _ServiceInfo(ctypes.Structure):
    """``rmw_service_info_t`` of rmw/types.h."""

    _fields_ = (
        ("source_timestamp", ctypes.c_int64),
        ("received_timestamp", ctypes.c_int64),
        ("writer_guid", ctypes.c_uint8 * 16),
        ("sequence_number", ctypes.c_int64),
    )


class _Instance(ctypes.Structure):
    """The start of an object made by pybind11."""

    _fields_ = (
        ("ob_refcnt", ctypes.c_ssize_t),
        ("ob_type", ctypes.c_void_p),
        ("value", ctypes.POINTER(_ServiceInfo)),
    )


def client_of(header: Any) -> bytes:
    """The identity of the client that sent a request, 16 bytes.

    rclpy keeps it in the header and shows the rest of that alone, so it is read from memory. If what rclpy
    shows is not found beside it, the answer is ``NOBODY``.
    """
    info = _Instance.from_address(id(header)).value.contents
    shown = header.source_timestamp, header.received_timestamp, header.request_id.sequence_number
    if (info.source_timestamp, info.received_timestamp, info.sequence_number) != shown:
        return NOBODY
    return bytes(info.writer_guid)


class Presence:
    """Which clients of a service are there: those whose subscription to its answers is matched.

    Only a client that has been seen there can be missed: with a middleware that names them otherwise, all
    count as present.
    """

    def __init__(self, node: Node, service_name: str) -> None:
        self._node = node
        self._answers = f"rr{service_name}Reply"
        self._asked: set[bytes] = set()
        self._seen: set[bytes] = set()

    def note(self, client: bytes) -> None:
        """A client has asked."""
        if client not in self._seen and client not in self._asked:
            self._asked.add(client)
            self._look()

    def departed(self) -> set[bytes]:
        """The clients that have left since the last call."""
        gone = self._seen - self._look() if self._seen or self._asked else set()
        self._seen -= gone
        self._asked.clear()
        return gone

    def _look(self) -> set[bytes]:
        endpoints = self._node.get_subscriptions_info_by_topic(self._answers, no_mangle=True)
        present = {bytes(endpoint.endpoint_gid[:16]) for endpoint in endpoints}
        self._seen |= self._asked & present
        return present
