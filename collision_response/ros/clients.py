"""Who asks, and who of them is still there.

A client that has left cannot be answered: Fast DDS waits a tenth of a second for it with each answer, and
everybody else waits too.
"""

from __future__ import annotations

import ctypes
import time
from typing import Any

from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

INTERVAL = 0.01
"""Least time [s] between two looks at who is there: one takes most of a millisecond."""

MOST = 1000
"""Clients remembered that were answered and never discovered, such as those of other middleware; and of those
that could not be answered."""

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

    Only Fast DDS names clients by that subscription; with another middleware all count as present.
    """

    def __init__(self, node: Node, service_name: str) -> None:
        self._node = node
        self._answers = f"rr{service_name}Reply"
        self._tells = "fastrtps" in get_rmw_implementation_identifier()
        self._present: set[bytes] = set()
        self._gone: set[bytes] = set()
        self._reached: dict[bytes, float] = {}  # when last, and in that order
        self._missed: dict[bytes, float] = {}
        self._looked = 0.0

    def is_there(self, client: bytes) -> bool:
        """Whether a client can be answered. One that has just come may have to be discovered first."""
        if client in self._present or client in self._reached or client == NOBODY or not self._tells:
            return True
        if time.perf_counter() - self._looked > INTERVAL:
            self._look()
        return client in self._present

    def reached(self, client: bytes) -> None:
        """A client could be answered: it is there, whether or not it has been discovered."""
        if client not in self._present:
            _note_last(self._reached, client)

    def missed(self, client: bytes) -> None:
        """A client could not be answered."""
        self._reached.pop(client, None)
        _note_last(self._missed, client)

    def has_left(self, client: bytes, heard: float) -> bool:
        """Whether one that is not there could not be answered since it was heard of."""
        return self._missed.get(client, heard) > heard and not self.is_there(client)

    def departed(self) -> set[bytes]:
        """The clients that have left since the last call."""
        if self._present:
            self._look()
        gone, self._gone = self._gone, set()
        return gone

    def _look(self) -> None:
        endpoints = self._node.get_subscriptions_info_by_topic(self._answers, no_mangle=True)
        present = {bytes(endpoint.endpoint_gid[:16]) for endpoint in endpoints}
        self._gone = (self._gone | self._present) - present
        for client in self._reached.keys() & present:
            del self._reached[client]  # from now on it would be missed
        self._present = present
        self._looked = time.perf_counter()


def _note_last(times: dict[bytes, float], client: bytes) -> None:
    """Remember it as the last of so many."""
    times.pop(client, None)
    times[client] = time.perf_counter()
    if len(times) > MOST:
        del times[next(iter(times))]
