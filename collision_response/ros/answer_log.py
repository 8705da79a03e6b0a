"""Numbering, publishing and recording the answers of the node."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from copy import copy
from itertools import count
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..msg import CollisionResult, SceneResult
from ..recording import Recorder, Refusal
from ..recording.record import Entry
from ..status import StatusCode
from .convert import nanoseconds

RESULT_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""A late subscriber still gets the last results."""


class AnswerLog:
    """Numbers the answers of all services, and publishes and records them once they are sent.

    ``now`` returns the time of the node's clock [ns].
    """

    recorder: Recorder | None = None

    def __init__(self, node: Node, now: Callable[[], int]) -> None:
        self._publishers = {
            CollisionResult: ResultPublisher(node, CollisionResult, "~/result"),
            SceneResult: ResultPublisher(node, SceneResult, "~/scene_result"),
        }
        self.topics = [publisher.topic for publisher in self._publishers.values()]
        self._now = now
        self._sequence = count(1)
        self._unpublished: deque[tuple[Any, Callable[[int, int], Entry]]] = deque()

    def add(self, result: Any, entry: Callable[[int, int], Entry]) -> None:
        """Number a result, and keep it for :meth:`publish`.

        Args:
            result: a message with a header and a sequence number, which is set here.
            entry: makes the entry to record from the stamp of the result [ns] (now, if it has none) and its
                sequence number. Called only if there is a recorder.
        """
        result.sequence = next(self._sequence)
        self._unpublished.append((result, entry))

    def add_refusal(self, result: Any) -> None:
        """Add a result that says why the request was refused."""
        reason = f"{StatusCode(result.status.code).name}: {result.status.message}"
        self.add(result, lambda stamp, sequence: Refusal(stamp, sequence, reason))

    def publish(self) -> None:
        """Publish and record the results that were added, and publish those that waited for a subscriber.

        To be called when responses have been sent, so that no client waits for this, and regularly.
        """
        while self._unpublished:
            result, entry = self._unpublished.popleft()
            self._publishers[type(result)].publish(result)
            if self.recorder is not None:
                stamp = nanoseconds(result.header.stamp) or self._now()
                self.recorder.add(entry(stamp, result.sequence))
        for publisher in self._publishers.values():
            publisher.publish_waiting()


class ResultPublisher:
    """Publishes results while there is a subscriber, and keeps the last ones while there is none.

    As many results are kept as the depth of the publisher. The first subscriber gets them, even with volatile
    durability. Later subscribers get the last results from DDS, as usual.
    """

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._publisher = node.create_publisher(
            kind,
            topic,
            copy(RESULT_QOS),  # rclpy writes the overrides into it
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        self._waiting: deque[Any] = deque(maxlen=max(1, self._publisher.qos_profile.depth))
        self.topic: str = self._publisher.topic_name

    def publish(self, result: Any) -> None:
        """Publish a result, now or as soon as there is a subscriber."""
        self._waiting.append(result)
        self.publish_waiting()

    def publish_waiting(self) -> None:
        """Publish the results that were kept, if there is a subscriber by now."""
        while self._waiting and self._publisher.get_subscription_count():
            self._publisher.publish(self._waiting.popleft())
