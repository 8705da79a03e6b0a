"""A client node: it publishes body states, calls the services and subscribes to the results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..msg import BodyState, CollisionResult, SceneResult, Status
from ..srv import ResolveCollision, ResolveScene

SERVICE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""With a limited history, some of many simultaneous calls would never be answered."""

STATE_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)

RESULT_QOS = QoSProfile(
    depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""TRANSIENT_LOCAL: results from before this subscription existed are delivered too."""

DEADLINE = 15.0
"""Longest time to wait for anything [s]."""

HEAD_START = 0.05
"""Time given to published states to arrive at the node before the next request [s]."""


class NoAnswer(Exception):
    """The service refused a request, or did not answer."""


class Channel(NamedTuple):
    """The client of a service, its answers, refusals included, and the messages on the topic of results."""

    service: Any
    answers: list[Any]
    results: list[Any]


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
        self._states = self._node.create_publisher(BodyState, "body_states", STATE_QOS)
        self._channels = {
            ResolveCollision.Request: self._channel(
                ResolveCollision, "resolve_collision", CollisionResult, "result"
            ),
            ResolveScene.Request: self._channel(ResolveScene, "resolve_scene", SceneResult, "scene_result"),
        }

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for_node(self) -> None:
        """Wait until the services exist and the node subscribes to body states."""
        for channel in self._channels.values():
            self._until(channel.service.service_is_ready, "no service")
        self._until(self._states.get_subscription_count, "nobody subscribes to body_states")

    def now(self) -> int:
        """Time of the node's clock [ns]."""
        return self._node.get_clock().now().nanoseconds

    def publish(self, states: Iterable[BodyState]) -> None:
        """Publish states of bodies."""
        for state in states:
            self._states.publish(state)

    def call(self, request: Any, *named: BodyState) -> Any:
        """Call either service and return its result.

        ``named`` are the states of bodies that the request gives by name only. A request may overtake a
        state, so they are published again until the node knows them.
        """
        channel = self._channels[type(request)]
        deadline = time.monotonic() + DEADLINE
        status = Status(code=Status.UNKNOWN_BODY)
        while status.code == Status.UNKNOWN_BODY and time.monotonic() < deadline:
            future = channel.service.call_async(request)
            self._until(future.done, "no answer")
            response = future.result()
            channel.answers.append(response.result)
            if response.success:
                return response.result
            status = response.result.status
            if not named:
                break
            self.publish(named)
            time.sleep(HEAD_START)
        raise NoAnswer(f"status {status.code}: {status.message}")

    def call_all(self, requests: Iterable[ResolveCollision.Request]) -> list[CollisionResult]:
        """Send many requests at once and return their results."""
        service = self._channels[ResolveCollision.Request].service
        futures = [service.call_async(request) for request in requests]
        for future in futures:
            self._until(future.done, "not all answers")
        for answer in (future.result() for future in futures):
            if not answer.success:
                raise NoAnswer(f"status {answer.result.status.code}: {answer.result.status.message}")
        return [future.result().result for future in futures]

    def answers(self) -> list[Any]:
        """All answers of :meth:`call`, refusals included."""
        return [answer for channel in self._channels.values() for answer in channel.answers]

    def topics_agree(self) -> bool:
        """Whether the result topics delivered exactly the answers of the services."""
        for channel in self._channels.values():
            self._until(partial(_is_complete, channel), "too few results on the topic")
        return all(channel.results == channel.answers for channel in self._channels.values())

    def _channel(self, service_type: Any, service: str, result_type: Any, topic: str) -> Channel:
        client: Any = self._node.create_client(
            service_type, f"collision_response/{service}", qos_profile=SERVICE_QOS
        )
        channel = Channel(client, [], [])
        self._node.create_subscription(
            result_type, f"collision_response/{topic}", channel.results.append, RESULT_QOS
        )
        return channel

    def _until(self, condition: Callable[[], Any], complaint: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not condition():
            self._check()
            if time.monotonic() > deadline:
                raise NoAnswer(f"{complaint} within {DEADLINE:g} s")
            self._executor.spin_once(timeout_sec=0.02)


def _is_complete(channel: Channel) -> bool:
    return len(channel.results) >= len(channel.answers)
