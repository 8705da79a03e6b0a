"""``collision_response replay``: recordings as regression tests."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from ..recording import scenes, table

DESCRIPTION = """Asks again what a recording holds, in this process, and reports every answer that is now
another one. So a recording made with one version is a test of the next. The exit code is 1 if there is a
difference. Refusals are not asked again."""


def main(arguments: list[str]) -> int:
    """Compare, and print what differs."""
    parser = argparse.ArgumentParser(prog="collision_response replay", description=DESCRIPTION)
    parser.add_argument("files", nargs="+", metavar="FILE.rrd")
    parser.add_argument(
        "--tolerance",
        type=_tolerance,
        default=0.0,
        metavar="T",
        help="forgive a number that differs by this part of itself; 0: none",
    )
    given = parser.parse_args(arguments)
    try:
        impacts, several = (table.rows_of(of.read(given.files)) for of in (table, scenes))
    except (OSError, RuntimeError, ValueError) as error:
        print(f"collision_response replay: {error}", file=sys.stderr)
        return 2
    differing = 0
    asked = [
        (row, table.differences, f"{row['body_a']} on {row['body_b']}")
        for row in impacts
        if row.get("request_a") is not None
    ]
    asked += [(row, scenes.differences, f"scene of {', '.join(row['bodies'])}") for row in several]
    for row, differences, name in asked:
        found = [d for d in differences(row) if _distance(*d[1:]) > given.tolerance]
        differing += bool(found)
        for column, was, now in found:
            print(f"answer {row['answer']}, {name}: {column} was {was}, is {now}")
    what = f"{len(asked) - len(several)} impacts" + (f" and {len(several)} scenes" if several else "")
    print(f"{what} asked again, {differing} of them answered differently")
    return 1 if differing else 0


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = math.nan
    if not 0 <= tolerance < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number of at least 0, is {text!r}")
    return tolerance


def _distance(was: Any, now: Any) -> float:
    """Of numbers or vectors, relative to their size; infinite for words that differ."""
    before, after = (was, now) if isinstance(was, list) else ([was], [now])
    if isinstance(before[0], str):
        return math.inf
    size = math.hypot(*before)
    return math.dist(before, after) / size if 0 < size < math.inf else math.inf
