"""A histogram of response times, whose size does not grow with their number."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterable

SECONDS = 5
"""Length of one interval of the clock. All processes share the machine's clock, and so its intervals."""

BINS = 24
"""Bins for each doubling of the time, so that times are accurate to 1.5 %."""

Intervals = dict[int, Counter[int]]


class Latencies:
    """Histograms of times, one for each interval of the clock.

    Attributes:
        intervals: by the number of the interval, the number of times in each bin.
    """

    def __init__(self, intervals: Intervals | None = None) -> None:
        self.intervals: Intervals = {} if intervals is None else intervals

    def add(self, seconds: float) -> None:
        """Add a time that ends now."""
        interval = self.intervals.setdefault(int(time.monotonic() // SECONDS), Counter())
        interval[round(BINS * math.log2(max(seconds, 1e-6) * 1e6))] += 1

    def to_json(self) -> dict[int, dict[int, int]]:
        """The argument of :meth:`from_json`, before it is written as JSON."""
        return {number: dict(interval) for number, interval in self.intervals.items()}

    @classmethod
    def from_json(cls, found: dict[str, dict[str, int]]) -> Latencies:
        """Histograms of another process."""
        return cls({int(k): Counter({int(b): n for b, n in bins.items()}) for k, bins in found.items()})

    @classmethod
    def together(cls, several: Iterable[Latencies]) -> Latencies:
        """The sum of several histograms."""
        merged = cls()
        for one in several:
            for number, interval in one.intervals.items():
                merged.intervals.setdefault(number, Counter()).update(interval)
        return merged

    def spread(self) -> dict[str, float] | None:
        """Median, 99th percentile and maximum over all intervals: see :func:`spread`."""
        return spread(sum(self.intervals.values(), Counter()))


def spread(bins: Counter[int]) -> dict[str, float] | None:
    """Median, 99th percentile and maximum [s]; ``None`` if there are no times."""
    if not bins:
        return None
    ordered, total, below = sorted(bins), sum(bins.values()), 0
    found = {"max": _seconds(ordered[-1])}
    for one in ordered:
        below += bins[one]
        for name, share in (("p50", 0.5), ("p99", 0.99)):
            if name not in found and below >= share * total:
                found[name] = _seconds(one)
    return {name: found[name] for name in ("p50", "p99", "max")}


def _seconds(number: int) -> float:
    return 2 ** (number / BINS) / 1e6
