"""The clients of a service: which one sent a request, and which are still connected.

A client that has left should not be answered: Fast DDS waits a tenth of a second with each such answer, and
all other clients wait with it.
"""

from __future__ import annotations

import ctypes
import time
from typing import Any

from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

REFRESH_INTERVAL = 0.01
"""Shortest time [s] between two queries for the connected clients: one takes most of a millisecond."""

MAX_REMEMBERED = 1000
"""Number of clients that are remembered as answered but never discovered (those of other middleware are not
discovered), and number that are remembered as unreachable."""

UNKNOWN_CLIENT = b""
"""The client of every request, if the middleware does not say which client sent it."""


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


def client_id(header: Any) -> bytes:
    """Identity of the client that sent a request: 16 bytes.

    rclpy keeps it in the header, but gives access to the other fields only. So it is read from memory. The
    other fields are read the same way: if they differ from what rclpy says, the result is ``UNKNOWN_CLIENT``.
    """
    info = _Instance.from_address(id(header)).value.contents
    expected = header.source_timestamp, header.received_timestamp, header.request_id.sequence_number
    if (info.source_timestamp, info.received_timestamp, info.sequence_number) != expected:
        return UNKNOWN_CLIENT
    return bytes(info.writer_guid)


class ConnectedClients:
    """Which clients of a service are connected: those whose subscription to the answers is matched.

    Only Fast DDS identifies clients by that subscription. With another middleware all clients count as
    connected.
    """

    def __init__(self, node: Node, service_name: str) -> None:
        self._node = node
        self._answers = f"rr{service_name}Reply"
        self._identifies = "fastrtps" in get_rmw_implementation_identifier()
        self._connected: set[bytes] = set()
        self._departed: set[bytes] = set()
        self._reached: dict[bytes, float] = {}  # when last; ordered by that time
        self._unreachable: dict[bytes, float] = {}  # the same
        self._refreshed = 0.0

    def is_connected(self, client: bytes) -> bool:
        """Whether a client can be answered. A new client may have to be discovered first."""
        if (
            client in self._connected
            or client in self._reached
            or client == UNKNOWN_CLIENT
            or not self._identifies
        ):
            return True
        if time.perf_counter() - self._refreshed > REFRESH_INTERVAL:
            self._refresh()
        return client in self._connected

    def note_reached(self, client: bytes) -> None:
        """Note that an answer was sent to a client: it is connected, even if it is not discovered yet."""
        if client not in self._connected:
            _set_latest(self._reached, client)

    def note_unreachable(self, client: bytes) -> None:
        """Note that an answer could not be sent to a client."""
        self._reached.pop(client, None)
        _set_latest(self._unreachable, client)

    def has_left(self, client: bytes, since: float) -> bool:
        """Whether a client is not connected and was found unreachable since a time [s]."""
        return self._unreachable.get(client, since) > since and not self.is_connected(client)

    def take_departed(self) -> set[bytes]:
        """Clients that have left since the last call."""
        if self._connected:
            self._refresh()
        departed, self._departed = self._departed, set()
        return departed

    def _refresh(self) -> None:
        endpoints = self._node.get_subscriptions_info_by_topic(self._answers, no_mangle=True)
        connected = {bytes(endpoint.endpoint_gid[:16]) for endpoint in endpoints}
        self._departed = (self._departed | self._connected) - connected
        for client in self._reached.keys() & connected:
            del self._reached[client]  # it is discovered: from now on its departure is noticed
        self._connected = connected
        self._refreshed = time.perf_counter()


def _set_latest(times: dict[bytes, float], client: bytes) -> None:
    """Note the present time for a client as the last entry, and limit the number of entries."""
    times.pop(client, None)
    times[client] = time.perf_counter()
    if len(times) > MAX_REMEMBERED:
        del times[next(iter(times))]
