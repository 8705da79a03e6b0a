"""``collision_response replay``: compute the answers of a recording again, and compare."""

from __future__ import annotations

import argparse
import math
import sys
from itertools import chain
from typing import Any

from ..answer import format_name
from ..recording import scenes, table

DESCRIPTION = """Computes all impacts and scenes of recordings again, in this process, and reports every
answer that differs. So a recording made with one version is a regression test for the next. The exit code is
1 if there is a difference. Refusals are not computed again."""

LONG = 24
"""Of a list with more values than this, only the one that differs most is printed."""

MOST_NAMES = 8
"""Of a scene with more bodies than this, only the names of so many are printed."""


def main(arguments: list[str]) -> int:
    """Compute the answers again and print what differs."""
    parser = argparse.ArgumentParser(prog="collision_response replay", description=DESCRIPTION)
    parser.add_argument("files", nargs="+", metavar="FILE.rrd")
    parser.add_argument(
        "--tolerance",
        type=_tolerance,
        default=0.0,
        metavar="T",
        help="relative difference of a number that is not reported; default: 0",
    )
    given = parser.parse_args(arguments)
    try:
        (impacts, _), scene_table = table.divide(table.read(given.files)), scenes.read(given.files)
    except (OSError, RuntimeError, ValueError) as error:
        print(f"collision_response replay: {error}", file=sys.stderr)
        return 2
    differing = 0
    answers = chain(
        ((row, table.differences, f"{row['body_a']} on {row['body_b']}") for row in table.rows_of(impacts)),
        (
            (row, scenes.differences, f"scene of {_listed(row['bodies'])}")
            for row in table.rows_of(scene_table)
        ),
    )
    for row, differences, name in answers:
        try:
            reported = [d for d in differences(row) if not _is_within(given.tolerance, *d[1:])]
        except ValueError as error:
            print(f"collision_response replay: answer {row['answer']}: {error}", file=sys.stderr)
            return 2
        differing += bool(reported)
        for column, before, now in reported:
            print(f"answer {row['answer']}, {format_name(name)}: {_difference(column, before, now)}")
    computed = f"{len(impacts)} impacts" + (f" and {len(scene_table)} scenes" if scene_table else "")
    print(f"{computed} computed again, {differing} of them with different answers")
    return 1 if differing else 0


def _listed(names: list[str]) -> str:
    """The names of the bodies of a scene, or the first ones of many."""
    others = len(names) - MOST_NAMES
    return ", ".join(names) if others <= 0 else f"{', '.join(names[:MOST_NAMES])} and {others} others"


def _difference(column: str, before: Any, now: Any) -> str:
    """Say how a column differs: of a long list, only the value that differs most; of texts, the first."""
    if not isinstance(before, list) or len(before) != len(now) or len(before) <= LONG:
        return f"{column} was {before}, is {now}"
    changes = {
        i: math.inf if isinstance(old, str) or math.isnan(new - old) else abs(new - old)
        for i, (old, new) in enumerate(zip(before, now, strict=True))
        if not (old == new or (old != old and new != new))  # NaN differs from itself
    }
    worst = max(changes, key=changes.__getitem__)
    values = f"{column}[{worst}] was {before[worst]}, is {now[worst]}"
    return f"{values}; {len(changes)} of {len(before)} values differ"


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = math.nan
    if not 0 <= tolerance < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number of at least 0, is {text!r}")
    return tolerance


def _is_within(tolerance: float, before: Any, after: Any) -> bool:
    """Whether two numbers or lists that differ do so by at most ``tolerance``, relative to the first."""
    before, after = (before, after) if isinstance(before, list) else ([before], [after])
    if not tolerance or len(before) != len(after) or isinstance(before[0], str):
        return False
    size = math.hypot(*before)
    return 0 < size < math.inf and math.dist(before, after) / size <= tolerance
