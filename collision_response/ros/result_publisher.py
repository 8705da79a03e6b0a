"""Publishing results, at no cost while nobody subscribes."""

from __future__ import annotations

from collections import deque
from copy import copy
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, QoSPublisherMatchedInfo
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

RESULT_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""A late subscriber still gets the last results."""


class ResultPublisher:
    """Publishes results while there is a subscriber, and keeps the last ones while there is none.

    As many results are kept as the depth of the publisher. The first subscriber gets them, even with volatile
    durability. Later subscribers get the last results from DDS, as usual.

    Attributes:
        topic: the resolved name of the topic.

    Args:
        node: the node that publishes.
        kind: the type of the messages.
        topic: the name of the topic, not yet resolved.
    """

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._publisher = node.create_publisher(
            kind,
            topic,
            copy(RESULT_QOS),  # rclpy writes the overrides into it
            event_callbacks=PublisherEventCallbacks(matched=self._matched, use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        self._waiting: deque[Any] = deque(maxlen=self._publisher.qos_profile.depth)
        self.topic: str = self._publisher.topic_name

    def publish(self, result: Any) -> None:
        """Publish a result, now or as soon as there is a subscriber."""
        if self._publisher.get_subscription_count():
            self._publish_waiting()
            self._publisher.publish(result)
        else:
            self._waiting.append(result)

    def _matched(self, subscriptions: QoSPublisherMatchedInfo) -> None:
        if subscriptions.current_count:
            self._publish_waiting()

    def _publish_waiting(self) -> None:
        while self._waiting:
            self._publisher.publish(self._waiting.popleft())
