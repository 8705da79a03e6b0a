"""A topic of results, on which nothing is published that nobody hears."""

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
"""Whoever subscribes late still gets the last results."""


class Results:
    """Publishes results while anybody subscribes; until then the last ones wait, as many as the depth.

    Whoever subscribes first gets those that wait, even one whose durability is volatile. Later ones
    get theirs from DDS.

    Attributes:
        topic: its name.

    Args:
        node: that publishes.
        kind: of messages.
        topic: its name, not yet resolved.
    """

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._publisher = node.create_publisher(
            kind,
            topic,
            copy(RESULT_QOS),  # rclpy writes what overrides say into it
            event_callbacks=PublisherEventCallbacks(matched=self._matched, use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        self._waiting: deque[Any] = deque(maxlen=self._publisher.qos_profile.depth)
        self.topic: str = self._publisher.topic_name

    def publish(self, result: Any) -> None:
        """Publish a result, after those before it: now, or as soon as somebody subscribes."""
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
