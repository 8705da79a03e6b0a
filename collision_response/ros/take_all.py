"""Taking all messages that wait on a subscription or service at once.

rclpy's executors take one message from each subscription and service per cycle. With them a request would
overtake states that were published before it, and each state would cost ten times as much.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable
from std_msgs.msg import Empty

RCLError: type[Exception] = rclpy_implementation.RCLError
InvalidHandle: type[Exception] = rclpy_implementation.InvalidHandle

UNREADABLE = (RCLError, MemoryError, UnicodeError, ValueError)
"""Errors that taking a message raises if it is malformed or larger than memory allows."""

MAX_TIME = 0.05
"""Longest time [s] to take messages in one go, in case they arrive faster than they can be taken."""


def error_in_rclpy(error: SystemError) -> BaseException:
    """Error that occurred in Python code called by rclpy, such as the ``KeyboardInterrupt`` of Ctrl-C.

    In some places rclpy does not notice such an error, and Python raises a ``SystemError`` in its place.
    """
    return error.__cause__ or error


@cache
def _unread(kind: Any) -> Any:
    """Return a stand-in for the type of a message, with which rclpy takes the message but reads no field."""
    for each in (kind, Empty):
        type(each).__import_type_support__()
    metaclass = type("Unread", (type(kind),), {"_CONVERT_TO_PY": type(Empty)._CONVERT_TO_PY})
    return metaclass("Unread", (), {})


class TakeAllWaitable(Waitable):  # type: ignore[type-arg]  # that of Jazzy takes none
    """Wakes the executor for a service or subscription, and then takes all messages that wait there.

    Args:
        node: the node that is spun.
        source: a service or a raw subscription of the node, in a mutually exclusive callback group of its
            own. Its callback is called with ``(request, header)`` or ``(serialized message, message info)``.
        after: called when all messages have been handled.
        on_unreadable: called with the error if a message cannot be taken.
    """

    def __init__(
        self,
        node: Node,
        source: Service[Any, Any] | Subscription[Any],
        after: Callable[[], None],
        on_unreadable: Callable[[Exception], None],
    ) -> None:
        super().__init__(node.default_callback_group)
        self._source = source
        self._handle: Any = source.callback
        self._after = after
        self._on_unreadable = on_unreadable
        self._is_service = isinstance(source, Service)
        self._index: int | None = None
        source.callback_group.beginning_execution(source)  # for ever: so the executor leaves it alone
        node.add_waitable(self)

    def take_all(self) -> int:
        """Handle all messages that wait, for at most ``MAX_TIME``, and return how many there were."""
        number, end = 0, time.perf_counter() + MAX_TIME
        with suppress(InvalidHandle), self._source.handle:  # of a node that another thread has destroyed
            while time.perf_counter() < end:
                try:
                    taken = self._take()
                except UNREADABLE as error:
                    self._on_unreadable(error)
                    continue
                if taken is None:
                    break
                self._handle(*taken)
                number += 1
        return number

    def take_unread(self, end: float) -> Iterator[Any]:
        """Take the requests that wait until a time [s], and yield only their headers.

        rclpy spends nearly all the time of a take on the fields of the request.
        """
        with suppress(InvalidHandle), self._source.handle:  # as above
            while time.perf_counter() < end:
                try:
                    taken = self._take(unread=True)
                except UNREADABLE as error:
                    self._on_unreadable(error)
                    continue
                if taken is None:
                    break
                yield taken[1]

    def _take(self, *, unread: bool = False) -> tuple[Any, Any] | None:
        source = self._source
        if not isinstance(source, Service):
            return source.handle.take_message(source.msg_type, True)
        kind = source.srv_type.Request
        try:
            request, header = source.handle.service_take_request(_unread(kind) if unread else kind)
        except SystemError as error:
            raise error_in_rclpy(error) from None
        return None if header is None else (request, header)

    # The interface of Waitable

    def __enter__(self) -> None:
        self._source.handle.__enter__()

    def __exit__(self, *error: Any) -> None:
        self._source.handle.__exit__(*error)

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(num_services=1) if self._is_service else NumberOfEntities(num_subs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        add = wait_set.add_service if self._is_service else wait_set.add_subscription
        self._index = None
        with suppress(InvalidHandle), self._source.handle:  # as above
            self._index = add(self._source.handle)

    def is_ready(self, wait_set: Any) -> bool:
        kind = "service" if self._is_service else "subscription"
        return self._index is not None and wait_set.is_ready(kind, self._index)

    def take_data(self) -> None:
        """Take nothing yet: :meth:`execute` takes and handles the messages."""

    async def execute(self, taken_data: None) -> None:
        try:
            self.take_all()
        finally:
            self._after()
