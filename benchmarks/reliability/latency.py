"""How long answers took, kept in little space however many there are."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterable

SECONDS = 5
"""Of the clock in one interval. The clock is that of the machine, so intervals of processes are the same."""

BINS = 24
"""To each doubling of the time: what is read off is right to 1.5 %."""

Intervals = dict[int, Counter[int]]


class Latencies:
    """Counts of times, by interval of the clock.

    Attributes:
        intervals: by the number of the interval, how many times fell in each bin.
    """

    def __init__(self, intervals: Intervals | None = None) -> None:
        self.intervals: Intervals = {} if intervals is None else intervals

    def add(self, seconds: float) -> None:
        """One that ends now."""
        interval = self.intervals.setdefault(int(time.monotonic() // SECONDS), Counter())
        interval[round(BINS * math.log2(max(seconds, 1e-6) * 1e6))] += 1

    def to_json(self) -> dict[int, dict[int, int]]:
        """As :meth:`from_json` takes it, after a journey through JSON."""
        return {number: dict(interval) for number, interval in self.intervals.items()}

    @classmethod
    def from_json(cls, found: dict[str, dict[str, int]]) -> Latencies:
        """What another process has counted."""
        return cls({int(k): Counter({int(b): n for b, n in bins.items()}) for k, bins in found.items()})

    @classmethod
    def together(cls, several: Iterable[Latencies]) -> Latencies:
        """Of several clients."""
        merged = cls()
        for one in several:
            for number, interval in one.intervals.items():
                merged.intervals.setdefault(number, Counter()).update(interval)
        return merged

    def spread(self) -> dict[str, float] | None:
        """Over all intervals: see :func:`spread`."""
        return spread(sum(self.intervals.values(), Counter()))


def spread(bins: Counter[int]) -> dict[str, float] | None:
    """The time that half, that 99 of 100, and that all stayed within [s]; ``None`` if there is none."""
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
