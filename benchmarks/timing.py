"""Comparable times: in each round, all calls are timed one after the other."""

from __future__ import annotations

import random
import time
import timeit
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, TypeVar

Call = Callable[[], Any]
T = TypeVar("T")

Samples = dict[str, list[float]]
"""Times of one call [s], one for each round, by name. Entries with the same index are of the same round."""


def interleaved(
    calls: Mapping[T, Call],
    *,
    rounds: int = 101,
    seconds: float = 0.001,
    clock: Callable[[], float] = time.process_time,
) -> dict[T, list[float]]:
    """Time every call in every round, each for about ``seconds``, in a random order.

    The default clock is processor time, which stops while another process has the core.
    """
    numbers = {name: _repetitions(call, seconds) for name, call in calls.items()}
    samples: dict[T, list[float]] = {name: [] for name in calls}
    order, draw = list(calls), random.Random(0)
    for _ in range(rounds):
        draw.shuffle(order)
        for name in order:
            spent = timeit.timeit(calls[name], timer=clock, number=numbers[name])
            samples[name].append(spent / numbers[name])
    return samples


def _repetitions(call: Call, seconds: float) -> int:
    call()  # so that one-time setup is not measured
    start, number = time.perf_counter(), 0
    while (spent := time.perf_counter() - start) < seconds:
        call()
        number += 1
    return max(1, round(number * seconds / spent))


def spread(values: Sequence[float]) -> dict[str, float]:
    """Least, median and maximum."""
    return {"min": min(values), "median": median(values), "max": max(values)}


def ratio(samples: Mapping[Any, list[float]], of: Any, to: Any) -> dict[str, float] | None:
    """Quotients of two times of the same round; ``None`` if one of them was not measured."""
    if of not in samples or to not in samples:
        return None
    return spread([a / b for a, b in zip(samples[of], samples[to], strict=True)])
