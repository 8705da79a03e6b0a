"""What the node counts, for /diagnostics and for the log."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from ..status import StatusCode

RECENT = 1000
"""Requests whose latency is remembered."""


class Tally:
    """Counts since the start.

    Attributes:
        requests: taken from the middleware.
        answers: sent, by status code.
        unsent: answers that the middleware did not take.
        dropped: requests of clients that left before they were answered.
        at_risk: answers sent to clients after they were last heard of, and before they were found gone.
        unreadable: requests that could not be read: broken, or larger than memory allows.
        latencies: from taking the last requests to sending their answers [s].
    """

    def __init__(self) -> None:
        self.requests = 0
        self.answers: Counter[StatusCode] = Counter()
        self.unsent = 0
        self.dropped = 0
        self.at_risk = 0
        self.unreadable = 0
        self.latencies: deque[float] = deque(maxlen=RECENT)

    def percentiles(self) -> dict[str, float]:
        """Latencies of the last requests [ms]; empty before the first."""
        if not self.latencies:
            return {}
        p50, p99, worst = np.percentile(self.latencies, (50, 99, 100)) * 1e3
        return {"p50": float(p50), "p99": float(p99), "max": float(worst)}
