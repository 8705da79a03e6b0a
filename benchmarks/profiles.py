"""Where the time of a call goes, as a tree of the functions it calls."""

from __future__ import annotations

import cProfile
import pstats
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

LEAST = 0.06
"""Share of the whole from which on a function is worth a line."""

DEEPEST = 3
Key = tuple[str, int, str]


class Line(NamedTuple):
    """One function of the tree.

    Attributes:
        depth: 0 for the call itself.
        name: of the function.
        share: of the time of the whole, what it calls included.
        itself: of the time of the whole, what it calls left out.
        calls: for one call of the whole.
    """

    depth: int
    name: str
    share: float
    itself: float
    calls: float


def profile(call: Callable[[], Any], root: str, number: int = 500) -> list[Line]:
    """The tree under the function named ``root``.

    A profiler makes small functions look dearer than they are.
    """
    call()
    profiler = cProfile.Profile()
    profiler.enable()
    for _ in range(number):
        call()
    profiler.disable()
    stats: dict[Key, Any] = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    top = max((key for key in stats if key[2] == root), key=lambda key: stats[key][3])
    return list(_lines(stats, top, stats[top][3], 0, 1.0, number, {top}))


def _lines(
    stats: dict[Key, Any], key: Key, total: float, depth: int, share: float, number: int, above: set[Key]
) -> Iterator[Line]:
    """This function and, of those it calls, the ones that matter.

    What a function called from many places calls is only known on the average over them.
    """
    _, calls, own, cumulative, _ = stats[key]
    part = share * total / cumulative if cumulative else 0.0
    yield Line(depth, _name(key), share, own * part / total, calls / number)
    if depth == DEEPEST:
        return
    called = [
        (stats[other][4][key][3] * part / total, other)
        for other in stats
        if key in stats[other][4] and other not in above
    ]
    for part_of_it, other in sorted(called, reverse=True):
        if part_of_it >= LEAST:
            yield from _lines(stats, other, total, depth + 1, part_of_it, number, {*above, other})


def _name(key: Key) -> str:
    file, _, function = key
    return function if file.startswith("~") else f"{Path(file).stem}.{function}"
