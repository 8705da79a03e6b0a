"""States of bodies as they come over the wire: read as far as needed, when needed.

Messages of ROS 2 are in CDR (OMG, "DDS-XTypes" 1.3, 7.4): four bytes that say the byte order, then the
fields, each aligned to its size.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message

from ..body_conversions import ROWS
from ..msg import BodyState, BodyStates

MAX_STATE_SIZE = 4096
"""Bytes of a ``BodyState``: only its names may be long."""

MAX_TABLE_SIZE = 1 << 24
"""Bytes of a ``BodyStates``."""


class MalformedMessage(ValueError):
    """A message that is none of its type."""


class Serialized:
    """A message that starts with a header.

    Attributes:
        stamp: of the header [ns].
        arrival: its number among those that arrived.

    Raises:
        MalformedMessage: it is too short or too long.
    """

    arrival = 0

    def __init__(self, message: bytes, longest: int) -> None:
        if len(message) > longest:
            raise MalformedMessage(f"it has {len(message)} bytes, more than {longest}")
        self._message = message
        self._order = "<" if len(message) > 1 and message[1] & 1 else ">"
        self.stamp, self._end = 0, 4
        seconds, nanoseconds = self._integer(signed=True), self._integer()
        self.stamp = seconds * 1_000_000_000 + nanoseconds
        self._string()  # frame_id

    def state_of(self, name: str) -> BodyState:
        """The state of a body.

        Raises:
            MalformedMessage: the rest of the message is none of its type.
        """
        raise NotImplementedError

    def _integer(self, *, signed: bool = False) -> int:
        start = -(-self._end // 4) * 4
        self._end = start + 4
        try:
            return struct.unpack_from(self._order + ("i" if signed else "I"), self._message, start)[0]
        except struct.error:
            raise MalformedMessage("it ends too early") from None

    def _string(self) -> str:
        size = self._integer()
        start, self._end = self._end, self._end + size
        if self._end > len(self._message):
            raise MalformedMessage("a text in it ends after its end")
        try:
            return self._message[start : max(start, self._end - 1)].decode()  # without the 0 at its end
        except UnicodeDecodeError as error:
            raise MalformedMessage(str(error)) from None


class SerializedState(Serialized):
    """A ``BodyState``.

    Attributes:
        name: of the body.
    """

    def __init__(self, message: bytes) -> None:
        super().__init__(message, MAX_STATE_SIZE)
        self.name = self._string()

    def state_of(self, name: str) -> BodyState:
        """The state, whatever the name."""
        return self.state

    @cached_property
    def state(self) -> BodyState:
        """All of it."""
        return _deserialized(self._message, BodyState)


class SerializedTable(Serialized):
    """A ``BodyStates``.

    Attributes:
        size: number of its bodies.
    """

    def __init__(self, message: bytes) -> None:
        super().__init__(message, MAX_TABLE_SIZE)
        self.size = self._integer()
        least = 8 * self.size  # bytes, of as many names
        if least > len(message):
            raise MalformedMessage(f"its names alone need {least} bytes, but it has {len(message)}")

    @cached_property
    def columns(self) -> dict[str, int]:
        """The columns of the bodies by their names; none if the message cannot be read."""
        try:
            return {name: column for column, name in enumerate(self._table.names)}
        except MalformedMessage:
            return {}

    def state_of(self, name: str) -> BodyState:
        """The state of one of its bodies."""
        table = self._table
        size, column = len(table.names), self.columns[name]
        if len(table.numbers) != ROWS * size or len(table.motion_types) not in (0, size):
            raise MalformedMessage(
                f"{len(table.numbers)} numbers and {len(table.motion_types)} motion types of {size} bodies"
            )
        numbers = np.asarray(table.numbers).reshape(ROWS, size)[:, column].tolist()
        motion_type = table.motion_types[column] if table.motion_types else BodyState.DYNAMIC
        return state_from(numbers, BodyState(header=table.header, name=name, motion_type=motion_type))

    @cached_property
    def _table(self) -> BodyStates:
        return _deserialized(self._message, BodyStates)


def state_from(numbers: Iterable[float], state: BodyState) -> BodyState:
    """A state with the numbers of a column of a table."""
    rest = iter(numbers)
    inertia, pose, twist = state.inertia, state.pose, state.twist
    inertia.m = next(rest)
    for field in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        setattr(inertia, field, next(rest))
    for part, axes in (
        (inertia.com, "xyz"),
        (pose.position, "xyz"),
        (pose.orientation, "xyzw"),
        (twist.linear, "xyz"),
        (twist.angular, "xyz"),
    ):
        for axis in axes:
            setattr(part, axis, next(rest))
    return state


def nanoseconds(stamp: Time) -> int:
    """A stamp as one number [ns]."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _deserialized(message: bytes, kind: type) -> Any:
    try:
        return deserialize_message(message, kind)
    except Exception as error:  # whatever the typesupport makes of broken bytes
        raise MalformedMessage(str(error)) from None
