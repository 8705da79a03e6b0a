"""Another node: it publishes body states, calls the service and listens to the results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..msg import BodyState, CollisionResult, Status
from ..srv import ResolveCollision

SERVICE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""What the node uses too: with a limited history, of many calls at once some would never be answered."""

STATE_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)

RESULT_QOS = QoSProfile(
    depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""TRANSIENT_LOCAL: results from before this subscription came up are delivered too."""

DEADLINE = 15.0
"""How long anything may take [s]."""


HEAD_START = 0.05
"""For states that have just been published, on their way to the node [s]."""


class NoAnswer(Exception):
    """The service refused, or did not answer."""


class Client:
    """A node of its own context, to be used as a context manager.

    Args:
        check: is called while the service does not answer; may raise.

    Attributes:
        answers: of the service, refusals included.
        results: what came on the result topic.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("demo", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._service: Any = self._node.create_client(
            ResolveCollision, "collision_response/resolve_collision", qos_profile=SERVICE_QOS
        )
        self._states = self._node.create_publisher(BodyState, "body_states", STATE_QOS)
        self.answers: list[CollisionResult] = []
        self.results: list[CollisionResult] = []
        self._node.create_subscription(
            CollisionResult, "collision_response/result", self.results.append, RESULT_QOS
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for_node(self) -> None:
        """Until the service is there, and listens to states."""
        self._until(self._service.service_is_ready, "no service")
        self._until(self._states.get_subscription_count, "nobody listens to body_states")

    def now(self) -> int:
        """By the node's clock [ns]."""
        return self._node.get_clock().now().nanoseconds

    def publish(self, states: Iterable[BodyState]) -> None:
        """Send states, for whoever listens."""
        for state in states:
            self._states.publish(state)

    def call(self, request: ResolveCollision.Request, *named: BodyState) -> CollisionResult:
        """The answer to a request.

        Args:
            request: what to resolve.
            named: bodies of the request that are in it by name only. A topic and a service are two
                ways, and either may be the quicker one: they are published until the node knows them.

        Raises:
            NoAnswer: it is a refusal, or none came.
        """
        deadline = time.monotonic() + DEADLINE
        status = Status(code=Status.UNKNOWN_BODY)
        while status.code == Status.UNKNOWN_BODY and time.monotonic() < deadline:
            future = self._service.call_async(request)
            self._until(future.done, "no answer")
            self.answers.append(future.result().result)
            if future.result().success:
                return self.answers[-1]
            status = self.answers[-1].status
            if not named:
                break
            self.publish(named)
            time.sleep(HEAD_START)
        raise NoAnswer(f"status {status.code}: {status.message}")

    def call_all(self, requests: Iterable[ResolveCollision.Request]) -> list[CollisionResult]:
        """The answers to many requests, sent at once.

        Raises:
            NoAnswer: one is a refusal, or not all came.
        """
        futures = [self._service.call_async(request) for request in requests]
        for future in futures:
            self._until(future.done, "not all answers")
        for answer in (future.result() for future in futures):
            if not answer.success:
                raise NoAnswer(f"status {answer.result.status.code}: {answer.result.status.message}")
        return [future.result().result for future in futures]

    def topic_agrees(self) -> bool:
        """Whether the result topic has brought every answer, and nothing else."""
        self._until(lambda: len(self.results) >= len(self.answers), "too few results on the topic")
        return self.results == self.answers

    def _until(self, condition: Callable[[], Any], complaint: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while not condition():
            self._check()
            if time.monotonic() > deadline:
                raise NoAnswer(f"{complaint} within {DEADLINE:g} s")
            self._executor.spin_once(timeout_sec=0.02)
