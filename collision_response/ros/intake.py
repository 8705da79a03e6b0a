"""Takes all that waits on a subscription or a service, whenever anything does.

rclpy's executors take one message of each in a cycle. So a request overtakes the states that were published
before it, and a state costs ten times as much as taking it does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable

RCLError: type[Exception] = rclpy_implementation.RCLError

UNREADABLE = (RCLError, MemoryError, UnicodeError, ValueError)
"""What taking a message may raise that is broken, or larger than memory allows."""


LONGEST = 0.05
"""Time [s] to take messages for, that come faster than they can be taken."""


class OutOfReach(CallbackGroup):
    """For what the executor is to leave alone, since an :class:`Intake` takes it."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing has begun."""


def by_the_intake(*_: Any) -> None:
    """The callback of what is out of reach."""
    raise AssertionError("the executor leaves this to the intake")


class Intake(Waitable):  # type: ignore[type-arg]  # that of Jazzy takes none
    """What waits for messages or requests in place of the executor.

    Args:
        node: that is spun.
        source: a service or a raw subscription of the node, in the callback group :class:`OutOfReach`.
        handle: is given each that was taken: ``(request, header)``, or ``(serialized message, its info)``.
        after: called when all have been handled.
        unreadable: called with the error for one that cannot be taken.
    """

    def __init__(
        self,
        node: Node,
        source: Service[Any, Any] | Subscription[Any],
        handle: Callable[[Any, Any], object],
        after: Callable[[], None],
        unreadable: Callable[[Exception], None],
    ) -> None:
        super().__init__(node.default_callback_group)
        self._source = source
        self._handle = handle
        self._after = after
        self._unreadable = unreadable
        self._is_service = isinstance(source, Service)
        self._index: int | None = None
        node.add_waitable(self)

    def take_all(self) -> int:
        """Handle all that waits now, and say how many those were.

        What comes as fast as it can be handled must wait for the next time.
        """
        number, end = 0, time.perf_counter() + LONGEST
        with self._source.handle:
            while time.perf_counter() < end:
                try:
                    taken = self._take()
                except UNREADABLE as error:
                    self._unreadable(error)
                    continue
                if taken is None:
                    break
                self._handle(*taken)
                number += 1
        return number

    def _take(self) -> tuple[Any, Any] | None:
        if isinstance(self._source, Service):
            request, header = self._source.handle.service_take_request(self._source.srv_type.Request)
            return None if header is None else (request, header)
        return self._source.handle.take_message(self._source.msg_type, True)

    # Waitable

    def __enter__(self) -> None:
        self._source.handle.__enter__()

    def __exit__(self, *error: Any) -> None:
        self._source.handle.__exit__(*error)

    def get_num_entities(self) -> NumberOfEntities:
        """One of its kind."""
        return NumberOfEntities(num_services=1) if self._is_service else NumberOfEntities(num_subs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Have the wait set wake up for it."""
        add = wait_set.add_service if self._is_service else wait_set.add_subscription
        self._index = add(self._source.handle)

    def is_ready(self, wait_set: Any) -> bool:
        """Whether anything waits."""
        kind = "service" if self._is_service else "subscription"
        return self._index is not None and wait_set.is_ready(kind, self._index)

    def take_data(self) -> None:
        """Nothing yet: it is taken where it is handled."""

    async def execute(self, taken_data: None) -> None:
        """Handle all that waits."""
        self.take_all()
        self._after()
