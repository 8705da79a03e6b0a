"""What the services count, for /diagnostics and the log."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np

from ..status import StatusCode

LATENCIES = 1000
"""Number of requests whose latency is kept."""


@dataclass
class Counters:
    """Counts since the start of the node.

    Attributes:
        requests: requests received.
        answers: answers sent, by status code.
        unsent: answers that the middleware did not accept.
        dropped: requests dropped because their client left before the answer.
        at_risk: answers sent to a client between the last sign of life from it and the discovery that it has
            left.
        unreadable: requests that could not be read: malformed, or larger than memory allows.
        latencies: of the last requests: time from receiving the request to sending the answer [s].
    """

    requests: int = 0
    answers: Counter[StatusCode] = field(default_factory=Counter)
    unsent: int = 0
    dropped: int = 0
    at_risk: int = 0
    unreadable: int = 0
    latencies: deque[float] = field(default_factory=lambda: deque(maxlen=LATENCIES))

    def percentiles(self) -> dict[str, float]:
        """Percentiles of the latencies [ms]; empty before the first answer."""
        if not self.latencies:
            return {}
        p50, p99, worst = np.percentile(self.latencies, (50, 99, 100)) * 1e3
        return {"p50": float(p50), "p99": float(p99), "max": float(worst)}
