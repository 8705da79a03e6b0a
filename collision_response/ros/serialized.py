"""Serialized states of bodies, which are read only as far and only when they are needed.

ROS 2 serializes messages in CDR (OMG, "DDS-XTypes" 1.3, 7.4): four bytes that give the byte order, then the
fields, each aligned to its size.
"""

from __future__ import annotations

import struct
from functools import cached_property
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message

from ..body_numbers import ROWS
from ..msg import BodyState, BodyStates
from .convert import state_from

MAX_STATE_SIZE = 4096
"""Largest ``BodyState`` accepted [bytes]. Only long names can make a message that large."""

MAX_TABLE_SIZE = 1 << 24
"""Largest ``BodyStates`` accepted [bytes]."""


class MalformedMessage(ValueError):
    """A message that cannot be read as its type."""


class Serialized:
    """A serialized message that starts with a header.

    Attributes:
        stamp: stamp of the header [ns].
        arrival: when the message was received [s].
        publisher: identity of its publisher.

    Raises:
        MalformedMessage: if the message is too short or too long.
    """

    arrival = 0.0
    publisher = b""

    def __init__(self, message: bytes, max_size: int) -> None:
        if len(message) > max_size:
            raise MalformedMessage(f"it has {len(message)} bytes, more than {max_size}")
        self._message = message
        self._byte_order = "<" if len(message) > 1 and message[1] & 1 else ">"
        self._end = 4  # where the fields read so far end
        seconds, nanoseconds = self._read_integer(signed=True), self._read_integer()
        self.stamp = seconds * 1_000_000_000 + nanoseconds
        self._read_string()  # frame_id

    def _read_integer(self, *, signed: bool = False) -> int:
        start = -(-self._end // 4) * 4
        self._end = start + 4
        try:
            return struct.unpack_from(self._byte_order + ("i" if signed else "I"), self._message, start)[0]
        except struct.error:
            raise MalformedMessage("it ends too early") from None

    def _read_string(self) -> str:
        size = self._read_integer()
        start, self._end = self._end, self._end + size
        if self._end > len(self._message):
            raise MalformedMessage("a string in it reaches beyond its end")
        try:
            return self._message[start : max(start, self._end - 1)].decode()  # without the 0 at its end
        except UnicodeDecodeError as error:
            raise MalformedMessage(str(error)) from None


class SerializedState(Serialized):
    """A serialized ``BodyState``."""

    def __init__(self, message: bytes) -> None:
        super().__init__(message, MAX_STATE_SIZE)
        self.name = self._read_string()

    @cached_property
    def state(self) -> BodyState:
        """The whole message."""
        return _deserialized(self._message, BodyState)


class SerializedTable(Serialized):
    """A serialized ``BodyStates``, of ``size`` bodies."""

    def __init__(self, message: bytes) -> None:
        super().__init__(message, MAX_TABLE_SIZE)
        self.size = self._read_integer()
        names_size = 8 * self.size  # bytes that this number of names has at least
        if names_size > len(message):
            raise MalformedMessage(f"its names alone need {names_size} bytes, but it has {len(message)}")

    @cached_property
    def columns(self) -> dict[str, int]:
        """Column of each body by its name; empty if the message cannot be read."""
        try:
            return {name: column for column, name in enumerate(self._table.names)}
        except MalformedMessage:
            return {}

    def state_of(self, name: str) -> BodyState:
        """Return the state of one of the bodies.

        Raises:
            MalformedMessage: if the message cannot be read, or does not have one state of this body.
        """
        table = self._table
        size, column = len(table.names), self.columns[name]
        if len(table.numbers) != ROWS * size or len(table.motion_types) not in (0, size):
            raise MalformedMessage(
                f"it has {len(table.numbers)} numbers and {len(table.motion_types)} motion types "
                f"for {size} bodies"
            )
        if len(self.columns) < size and table.names.count(name) > 1:
            raise MalformedMessage("it has this name more than once")
        numbers = np.asarray(table.numbers).reshape(ROWS, size)[:, column].tolist()
        motion_type = table.motion_types[column] if table.motion_types else BodyState.DYNAMIC
        return state_from(numbers, BodyState(header=table.header, name=name, motion_type=motion_type))

    @cached_property
    def _table(self) -> BodyStates:
        return _deserialized(self._message, BodyStates)


def _deserialized(message: bytes, kind: type) -> Any:
    try:
        return deserialize_message(message, kind)
    except Exception as error:  # the typesupport raises all kinds of errors for malformed bytes
        raise MalformedMessage(str(error)) from None
