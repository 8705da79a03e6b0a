"""Checks the properties of test/test_scene_properties.py on 1000 random scenes of up to 30 contacts:

    .bench-venv/bin/python -I benchmarks/scene_properties.py [--scenes N]

It prints violations as they occur. A run with all 1000 scenes rewrites the table of docs/scenes.md.
"""

from __future__ import annotations

import argparse
import inspect
import multiprocessing
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "test")]

import pages  # noqa: E402
import test_scene_properties as properties  # noqa: E402

from collision_response import Law  # noqa: E402

FIRST, SCENES = 60, 1000
"""First seed, and number of scenes; the tests use the seeds below the first one."""


class Outcome(NamedTuple):
    """Result of one check of one scene; ``fault`` is empty if the property holds."""

    seed: int
    name: str
    law: str
    fault: str


def checks() -> Iterator[tuple[str, Callable[..., None], list[Law | None]]]:
    """Name, function and laws of each check that takes a seed; the law is ``None`` if it takes none."""
    for name, check in vars(properties).items():
        of_one = getattr(check, "__wrapped__", None)  # the function that each_seed repeats
        if name.startswith("test_") and of_one is not None:
            by_law = "law" in inspect.signature(of_one).parameters
            yield name.removeprefix("test_"), of_one, list(properties.LAWS) if by_law else [None]


def outcomes(seed: int) -> list[Outcome]:
    """Results of all checks for one scene."""
    found = []
    for name, check, laws in checks():
        for law in laws:
            fault = ""
            try:
                check(seed) if law is None else check(seed, law)
            except Exception as error:  # any exception means that the property does not hold
                fault = type(error).__name__
            found.append(Outcome(seed, name, law.name if law else "", fault))
    return found


def table(found: Counter[Any], asked: Counter[Any]) -> str:
    """Table of violations by property and law."""
    laws = [law.name for law in properties.LAWS]
    rows = []
    for name in dict.fromkeys(name for name, _ in asked):
        cells = [str(found[name, law]) if asked[name, law] else "" for law in laws]
        if asked[name, ""]:
            cells = [str(found[name, ""]), "", ""]
        rows.append([name.replace("_", " "), *cells])
    return pages.table(["violations", *(f"`{law}`" for law in laws)], rows)


def main() -> int:
    """Check the scenes, print violations, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=SCENES, help=f"number of scenes, by default {SCENES}")
    scenes = parser.parse_args().scenes
    found: Counter[Any] = Counter()
    asked: Counter[Any] = Counter()
    with multiprocessing.Pool() as pool:
        for results in pool.imap(outcomes, range(FIRST, FIRST + scenes)):
            for seed, name, law, fault in results:
                asked[name, law] += 1
                if fault:
                    found[name, law] += 1
                    print(f"scene {seed}, {law or 'all laws'}: {name}: {fault}", flush=True)
    text = f"{table(found, asked)}\n\n{sum(found.values())} violations in {sum(asked.values()):,} checks."
    print(text)
    if scenes == SCENES:
        pages.rewrite(pages.DOCS / "scenes.md", {"random": text})
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
