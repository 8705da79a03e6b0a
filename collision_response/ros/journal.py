"""What becomes of an answer besides being sent: it is numbered, published and recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..recording import Recorder, Refusal
from ..recording.record import Entry
from ..status import StatusCode
from .results import Results
from .serialized import nanoseconds


@dataclass
class Journal:
    """The answers of one service.

    Attributes:
        results: where they are published.
        recorder: or ``None``: nothing is recorded.
        sequence: counts the answers of the node.
        now: the time by the node's clock [ns].
    """

    results: Results
    recorder: Recorder | None
    sequence: Iterator[int]
    now: Callable[[], int]

    def enter(self, result: Any, entry: Callable[[int, int], Entry]) -> None:
        """Number and publish a result, and record it.

        Args:
            result: a message with a header and a sequence.
            entry: made of its stamp [ns], now if nobody said, and its number; if there is a recorder.
        """
        result.sequence = next(self.sequence)
        self.results.publish(result)
        if self.recorder is not None:
            stamp = nanoseconds(result.header.stamp) or self.now()
            self.recorder.add(entry(stamp, result.sequence))

    def refuse(self, result: Any, code: StatusCode) -> None:
        """The same for a result that says why there is none."""
        reason = f"{code.name}: {result.status.message}"
        self.enter(result, lambda stamp, sequence: Refusal(stamp, sequence, reason))
