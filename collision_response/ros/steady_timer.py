"""Timers of the machine's steady clock."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rclpy.clock import Clock, ClockType  # type: ignore[attr-defined]  # where Jazzy, too, has it
from rclpy.node import Node

from .take_all import InvalidHandle


def create_steady_timer(node: Node, period: float, callback: Callable[[], Any]) -> Any:
    """Create a timer with a period [s] that also runs while simulated time stands still."""

    def call() -> None:
        with suppress(InvalidHandle):  # of a node that another thread destroys meanwhile
            callback()

    return node.create_timer(period, call, clock=Clock(clock_type=ClockType.STEADY_TIME))
