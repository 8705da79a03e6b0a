"""A process of this room, as itself: how it talks to the one that started it."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

DEADLINE = 120.0
"""Seconds for anything to happen that should take much less, on a machine that is busy with all this."""


class Parent:
    """Who started this process: told by lines on standard output, heard by lines on standard input."""

    def __init__(self) -> None:
        self._said: set[str] = set()
        self._heard = threading.Condition()
        self._is_gone = False
        threading.Thread(target=self._listen, name="parent", daemon=True).start()

    def _listen(self) -> None:
        for line in sys.stdin:
            with self._heard:
                self._said.add(line.strip())
                self._heard.notify_all()
        with self._heard:
            self._is_gone = True
            self._heard.notify_all()

    def say(self, word: str, what: Any = None) -> None:
        """A word, and what there is to it."""
        print(word, json.dumps(what, default=list), flush=True)

    def has_said(self, word: str) -> bool:
        return word in self._said

    def is_gone(self) -> bool:
        """Whether there is nobody left to talk to."""
        return self._is_gone

    def wait_for(self, word: str, seconds: float = DEADLINE) -> None:
        """Raises: TimeoutError: it was not said, or there is nobody to say it."""
        with self._heard:
            if not self._heard.wait_for(lambda: word in self._said or self._is_gone, seconds):
                raise TimeoutError(f"{word} was not said")
        if word not in self._said:
            raise TimeoutError(f"{word} will not be said")

    def pause(self, seconds: float) -> None:
        """Do nothing for a while, but not longer than there is somebody to do it for."""
        with self._heard:
            self._heard.wait_for(lambda: self._is_gone, seconds)

    def wait_until(self, condition: Callable[[], Any]) -> None:
        """Raises: TimeoutError: the condition never held."""
        end = time.monotonic() + DEADLINE
        while not condition():
            if time.monotonic() > end or self._is_gone:
                raise TimeoutError("this did not happen")
            self.pause(0.01)


NAMESPACE = "/reliability"
"""Of the node under test."""


def service_client(node: Any, service: str) -> Any:
    """A client of a service of the node under test, that loses no answer."""
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    from collision_response import srv

    kinds = {"resolve_collision": srv.ResolveCollision, "resolve_collision_batch": srv.ResolveCollisionBatch}
    qos = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    name = f"{NAMESPACE}/collision_response/{service}"
    return node.create_client(kinds[service], name, qos_profile=qos)


@contextmanager
def ros_node(name: str, context: Any = None) -> Iterator[tuple[Any, Any]]:
    """A node of ROS, and what spins it; both end with the block.

    Args:
        name: of the node.
        context: of rclpy; left out, that of the process.
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
