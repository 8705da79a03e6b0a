"""The side of a child process: how it talks to the process that started it."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

DEADLINE = 120.0
"""Longest time to wait for anything [s]; generous, because the machine is busy."""


class Parent:
    """The process that started this one. Words are sent on standard output and received on standard input."""

    def __init__(self) -> None:
        self._received: set[str] = set()
        self._changed = threading.Condition()
        self._is_gone = False
        threading.Thread(target=self._listen, name="parent", daemon=True).start()

    def _listen(self) -> None:
        for line in sys.stdin:
            with self._changed:
                self._received.add(line.strip())
                self._changed.notify_all()
        with self._changed:
            self._is_gone = True
            self._changed.notify_all()

    def send(self, word: str, data: Any = None) -> None:
        """Send a word with some data."""
        print(word, json.dumps(data, default=list), flush=True)

    def has_sent(self, word: str) -> bool:
        """Whether the parent has sent a word."""
        return word in self._received

    def is_gone(self) -> bool:
        """Whether the parent has ended."""
        return self._is_gone

    def wait_for(self, word: str, seconds: float = DEADLINE) -> None:
        """Wait until the parent sends a word.

        Raises:
            TimeoutError: if the word does not arrive in time, or the parent has ended.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: word in self._received or self._is_gone, seconds):
                raise TimeoutError(f"the parent did not send {word!r} in time")
        if word not in self._received:
            raise TimeoutError(f"the parent ended without sending {word!r}")

    def pause(self, seconds: float) -> None:
        """Sleep, but wake up if the parent ends."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_gone, seconds)

    def wait_until(self, condition: Callable[[], Any]) -> None:
        """Wait until a condition holds.

        Raises:
            TimeoutError: if it does not hold in time, or the parent has ended.
        """
        end = time.monotonic() + DEADLINE
        while not condition():
            if time.monotonic() > end or self._is_gone:
                raise TimeoutError("the condition did not become true")
            self.pause(0.01)


NAMESPACE = "/reliability"
"""Namespace of the node under test."""


def service_client(node: Any, service: str, namespace: str = NAMESPACE) -> Any:
    """A client of a service of the node in a namespace; its QoS loses no answers."""
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    from collision_response import srv

    types = {
        "resolve_collision": srv.ResolveCollision,
        "resolve_collision_batch": srv.ResolveCollisionBatch,
        "resolve_scene": srv.ResolveScene,
    }
    qos = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    name = f"{namespace}/collision_response/{service}"
    return node.create_client(types[service], name, qos_profile=qos)


@contextmanager
def ros_node(name: str, context: Any = None) -> Iterator[tuple[Any, Any]]:
    """A ROS node and its executor, which end with the block.

    Args:
        name: name of the node.
        context: rclpy context; by default that of the process.
    """
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    rclpy.init(context=context)
    node, executor = Node(name, context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
