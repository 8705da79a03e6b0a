"""Numbering, publishing and recording the answers of the node."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import count
from typing import Any

from rclpy.node import Node

from ..msg import CollisionResult, SceneResult
from ..recording import Recorder, Refusal
from ..recording.record import Entry
from ..status import StatusCode
from .result_publisher import ResultPublisher
from .serialized import nanoseconds


class AnswerLog:
    """Numbers the answers of all services, and publishes and records them once they are sent.

    Attributes:
        topics: the resolved names of the topics of the results.
        recorder: records the answers; ``None``: they are not recorded.

    Args:
        node: the node that publishes the results.
        now: returns the time of the node's clock [ns].
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
        """Publish and record the results that were added.

        To be called when their responses have been sent, so that no client waits for this.
        """
        while self._unpublished:
            result, entry = self._unpublished.popleft()
            self._publishers[type(result)].publish(result)
            if self.recorder is not None:
                stamp = nanoseconds(result.header.stamp) or self._now()
                self.recorder.add(entry(stamp, result.sequence))
