"""Running a node as a process: its arguments, its timers, its memory, and the signals that end it."""

from __future__ import annotations

import os
import re
import resource
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from rclpy.clock import Clock, ClockType  # type: ignore[attr-defined]  # where Jazzy, too, has it
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .take_all import InvalidHandle, RCLError
from .throttled_warnings import WARNING_INTERVAL

AnyNode = TypeVar("AnyNode", bound=Node)

PAUSE_AFTER_ERROR = 0.001
"""Pause [s] after an error in a callback, in case the error occurs again and again."""

KEPT_STACKS = 4
"""Number of threads that can start when there is no memory left."""


class StartError(Exception):
    """The node cannot start. The message is for the user."""


UnknownArguments: type[Exception] = rclpy_implementation.UnknownROSArgsError

START_ERRORS = (StartError, ParameterException, NameValidationException, RCLError, UnicodeEncodeError)
"""Errors that starting a node raises if its arguments are invalid or cannot be used."""


def run(
    make: Callable[[], AnyNode], args: list[str] | None, end: Callable[[AnyNode], Any] = Node.destroy_node
) -> int:
    """Make a node, spin it until SIGINT, SIGTERM or SIGHUP, and end it. Return 0, or 1 if it cannot start.

    Without ``args``, the ROS arguments are those of this process.
    """
    open_standard_streams()
    stop = shutdown_requested()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except (UnknownArguments, *START_ERRORS) as error:
        print("collision_response:", _why_not_started(error), file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    try:
        spin(node, stop)
    finally:
        end(node)
        rclpy.try_shutdown()
    return 0


def _why_not_started(error: Exception) -> str:
    """Reason why the node cannot start, on one line."""
    if isinstance(error, UnknownArguments):
        return f"unknown arguments: {error}"
    if isinstance(error, UnicodeEncodeError):
        return f"an argument is not text in UTF-8: {error.object!r}"
    return " ".join(str(error).split())


def open_standard_streams() -> None:
    """Open standard streams that are closed, as /dev/null.

    Otherwise the next file or socket would get the number of a standard stream, and the log would go there.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  # open until the process ends


def shutdown_requested() -> Future[None]:
    """Make a future that is done after SIGINT, SIGTERM or SIGHUP. Call this in the main thread.

    SIGHUP is sent when the terminal is closed. If it is ignored at the start, as by ``nohup``, it stays
    ignored.

    rclpy's own signal handlers are not used: they wake the executor before they shut the context down, so it
    may go to sleep again for ever, and they shut the context down while the node still needs it. A Python
    handler would not run while the main thread waits for DDS. What Python writes to the wake-up pipe arrives
    at once.
    """
    stop: Future[None] = Future()
    source, sink = os.pipe()
    os.set_blocking(sink, False)
    signal.set_wakeup_fd(sink)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: None)

    def wait() -> None:
        os.read(source, 1)
        stop.set_result(None)

    threading.Thread(target=wait, name="signals", daemon=True).start()
    return stop


def spin(node: Node, stop: Future[None]) -> None:
    """Spin a node until ``stop`` is done.

    Errors in callbacks are logged and do not end the node: rclpy's own callbacks raise them for requests that
    anybody can send, such as a parameter without a type.
    """
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        while node.context.ok() and not stop.done():
            try:
                executor.spin_until_future_complete(stop)
            except ExternalShutdownException:
                return
            except Exception:
                node.get_logger().error(traceback.format_exc(), throttle_duration_sec=WARNING_INTERVAL)
                time.sleep(PAUSE_AFTER_ERROR)
    finally:
        executor.shutdown()


def create_steady_timer(node: Node, period: float, callback: Callable[[], Any]) -> Any:
    """Create a timer with a period [s] that also runs while simulated time stands still."""

    def call() -> None:
        with suppress(InvalidHandle):  # of a node that another thread destroys meanwhile
            callback()

    return node.create_timer(period, call, clock=Clock(clock_type=ClockType.STEADY_TIME))


def limit_memory(mebibytes: int, needed: int = 0) -> None:
    """Make allocations fail beyond a limit, so that no request can exhaust the memory of the machine.

    The limit is on private writable memory, without libraries and the shared memory of DDS. 0: none. The
    process is about to need as much as ``needed`` [MiB] more.

    Raises:
        StartError: if the process would have nothing left: DDS would end it at the next request.
    """
    if not mebibytes:
        return
    _keep_stacks()
    used, limit = private_memory() + (needed << 20), mebibytes << 20
    if limit <= used:
        raise StartError(f"memory_limit: is {mebibytes} MiB, but the node needs {(used >> 20) + 1} to start")
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _keep_stacks() -> None:
    """Start some threads at once and end them: glibc keeps their stacks for other threads.

    Fast DDS starts one at the first error that it logs, such as that there is no memory. Without a stack for
    it, it waits for ever.
    """
    all_run = threading.Barrier(KEPT_STACKS)
    threads = [threading.Thread(target=all_run.wait) for _ in range(KEPT_STACKS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def private_memory() -> int:
    """Memory that the process uses, of the kind that is limited [bytes]."""
    match = re.search(r"^VmData:\s*(\d+) kB$", Path("/proc/self/status").read_text(), re.MULTILINE)
    return int(match[1]) << 10 if match else 0
