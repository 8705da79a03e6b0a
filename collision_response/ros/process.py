"""A node as a process: from its arguments to the signal that ends it."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .signals import shutdown_requested
from .take_all import RCLError
from .throttled_warnings import WARNING_INTERVAL

AnyNode = TypeVar("AnyNode", bound=Node)


BREATH = 0.001
"""Time [s] without work after an error, which may come again at once."""


class StartError(Exception):
    """What a node needs to start is not there; the message is for a person."""


UnknownArguments: type[Exception] = rclpy_implementation.UnknownROSArgsError

NOT_ALLOWED = (StartError, ParameterException, NameValidationException, RCLError)
"""What a start raises with arguments that are not allowed, or of no use here."""


def run(
    make: Callable[[], AnyNode], args: list[str] | None, end: Callable[[AnyNode], Any] = Node.destroy_node
) -> int:
    """Spin a node until SIGINT, SIGTERM or SIGHUP, then end it.

    Args:
        make: the node.
        args: of ROS; ``None``: those of this process.
        end: called with the node, that nobody spins any more.

    Returns:
        The exit code: 0, or 1 if it cannot start.
    """
    have_standard_streams()
    stop = shutdown_requested()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except UnknownArguments as error:
        print("collision_response: there are no such arguments:", error, file=sys.stderr)
        return 1
    except ValueError as error:
        if "PARAMETER_NOT_SET" not in str(error):  # so rclpy says it, and not of which parameter
            raise
        reason = "a parameter is a list without entries, which has no type; for none write ['']"
        print("collision_response:", reason, file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    except NOT_ALLOWED as error:
        print("collision_response:", *str(error).split(), file=sys.stderr)  # on one line
        rclpy.try_shutdown()
        return 1
    try:
        spin(node, stop)
    finally:
        end(node)
        rclpy.try_shutdown()
    return 0


def have_standard_streams() -> None:
    """Open those that are closed into nothing.

    Else the next file or socket takes the number of one, and what is logged goes there.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115, as long as the process


def spin(node: Node, stop: Future[None]) -> None:
    """Do what comes until told to stop.

    Anybody may send what rclpy's own callbacks raise errors of, such as a parameter of no type: they are
    logged, and end nothing.
    """
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    woken = node.create_guard_condition(lambda: None)
    stop.add_done_callback(lambda _: woken.trigger())
    try:
        while node.context.ok() and not stop.done():
            try:
                executor.spin_once()
            except ExternalShutdownException:
                return
            except Exception:
                node.get_logger().error(traceback.format_exc(), throttle_duration_sec=WARNING_INTERVAL)
                time.sleep(BREATH)
    finally:
        executor.shutdown()
