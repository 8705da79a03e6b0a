"""Numbering, publishing and recording the answers of a service."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..recording import Recorder, Refusal
from ..recording.record import Entry
from ..status import StatusCode
from .result_publisher import ResultPublisher
from .serialized import nanoseconds


@dataclass
class AnswerLog:
    """Numbers, publishes and records the answers of one service.

    Attributes:
        publisher: publishes the results.
        recorder: records them; ``None``: they are not recorded.
        sequence: counts the answers of the node.
        now: returns the time of the node's clock [ns].
    """

    publisher: ResultPublisher
    recorder: Recorder | None
    sequence: Iterator[int]
    now: Callable[[], int]

    def add(self, result: Any, entry: Callable[[int, int], Entry]) -> None:
        """Number, publish and record a result.

        Args:
            result: a message with a header and a sequence number, which is set here.
            entry: makes the entry to record from the stamp of the result [ns] (now, if it has none) and its
                sequence number. Called only if there is a recorder.
        """
        result.sequence = next(self.sequence)
        self.publisher.publish(result)
        if self.recorder is not None:
            stamp = nanoseconds(result.header.stamp) or self.now()
            self.recorder.add(entry(stamp, result.sequence))

    def add_refusal(self, result: Any, code: StatusCode) -> None:
        """Number, publish and record a result that says why the request was refused."""
        reason = f"{code.name}: {result.status.message}"
        self.add(result, lambda stamp, sequence: Refusal(stamp, sequence, reason))
