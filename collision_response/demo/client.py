"""A client node: it publishes body states, calls the services and subscribes to the results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from operator import attrgetter
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.time import Time
from std_msgs.msg import Header

from ..msg import BodyState, CollisionResult, SceneResult
from ..srv import ResolveCollision, ResolveScene

KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""With a limited history, some of many simultaneous calls would never be answered."""

RESULT_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Results from before the subscription existed are delivered, too."""

DEADLINE = 15.0
"""Longest time to wait for anything [s]."""


def header_at(nanoseconds: int) -> Header:
    """Header of a time [ns], in the frame of the demo."""
    return Header(stamp=Time(nanoseconds=nanoseconds).to_msg(), frame_id="world")


class NoAnswer(Exception):
    """The service refused a request, or did not answer."""


class Client:
    """A node with its own context; use it as a context manager.

    While it waits, it calls ``check``, which may raise.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("demo", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._states = self._node.create_publisher(BodyState, "body_states", KEEP_ALL)
        self._services: dict[type, Any] = {
            kind.Request: self._node.create_client(kind, f"collision_response/{name}", qos_profile=KEEP_ALL)
            for kind, name in ((ResolveCollision, "resolve_collision"), (ResolveScene, "resolve_scene"))
        }
        self.answers: list[Any] = []
        self._results: list[Any] = []
        for kind, topic in ((CollisionResult, "result"), (SceneResult, "scene_result")):
            name = f"collision_response/{topic}"
            self._node.create_subscription(kind, name, self._results.append, RESULT_QOS)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for_node(self) -> None:
        """Wait until the services exist and the node subscribes to body states."""
        for service in self._services.values():
            self._until(service.service_is_ready, "no service")
        self._until(self._states.get_subscription_count, "nobody subscribes to body_states")

    def now(self) -> int:
        """Time of the node's clock [ns]."""
        return self._node.get_clock().now().nanoseconds

    def publish(self, states: Iterable[BodyState]) -> None:
        """Publish states of bodies."""
        for state in states:
            self._states.publish(state)

    def call(self, request: Any) -> Any:
        """Call the service of a request and return its result."""
        future = self._services[type(request)].call_async(request)
        self._until(future.done, "no answer")
        response = future.result()
        self.answers.append(response.result)
        if not response.success:
            status = response.result.status
            raise NoAnswer(f"status {status.code}: {status.message}")
        return response.result

    def topics_agree(self) -> bool:
        """Whether the result topics delivered exactly the answers of the services."""
        self._until(lambda: len(self._results) >= len(self.answers), "too few results on the topics")
        return sorted(self._results, key=attrgetter("sequence")) == self.answers

    def _until(self, condition: Callable[[], Any], complaint: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not condition():
            self._check()
            if time.monotonic() > deadline:
                raise NoAnswer(f"{complaint} within {DEADLINE:g} s")
            self._executor.spin_once(timeout_sec=0.02)
