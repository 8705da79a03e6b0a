"""A node as a process: from its arguments to the signal that ends it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from .intake import RCLError
from .signals import on_signal

AnyNode = TypeVar("AnyNode", bound=Node)


class Unusable(Exception):
    """What a node needs to start is not there; the message is for a person."""


NOT_ALLOWED = (Unusable, ParameterException, NameValidationException, RCLError)
"""What a start raises with arguments that are not allowed, or of no use here."""


def run(
    make: Callable[[], AnyNode],
    args: list[str] | None,
    end: Callable[[AnyNode], Any] = Node.destroy_node,
) -> int:
    """Spin a node until SIGINT or SIGTERM, then end it.

    Args:
        make: the node.
        args: of ROS; ``None``: those of this process.
        end: called with the node, that nobody spins any more.

    Returns:
        The exit code: 0, or 1 if it cannot start.
    """
    stop = on_signal()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except NOT_ALLOWED as error:
        print("collision_response:", *str(error).split(), file=sys.stderr)  # on one line
        rclpy.try_shutdown()
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin_until_future_complete(stop)
    finally:
        executor.shutdown()
        end(node)
        rclpy.try_shutdown()
    return 0
