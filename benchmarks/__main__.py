"""``make bench``: measure times, errors and targets in one run.

The results go to benchmarks/results, and as tables and plots to docs/trade-off.md and docs/scenes.md. Then
the other pages with measured tables and pictures are made again: docs/stability.md, docs/impact-laws.md and
docs/square-on-incline.md. If parts are named, as in ``make bench ARGS='one batch'``, only those are measured,
and printed to the terminal only.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
import time
from importlib import import_module
from typing import Any

import pages
import service
from machine import machine, versions

PARTS = {
    "one": "one impact, against pinocchio, MuJoCo, pybullet and pymunk",
    "batch": "batches, against C",
    "package": "how tight the bounds are, how long the package is",
    "service": "the service, against an echo",
    "trade": "time against true error",
    "scenes": "several contacts at once, against MuJoCo, pinocchio and Siconos",
}
"""Modules, and what ``measure(skipped, say)`` measures: it notes what it skips and prints by ``say``."""

OTHERS = ("benchmarks/stability.py", "docs/impact_laws.py", "docs/scenes.py", "docs/square_on_incline.py")
"""Scripts that make the other pages."""

PACKAGES = ("pin", "mujoco", "pybullet", "pymunk", "numpy", "python-flint")
"""The peers and the numeric packages, whose versions are reported."""


def main() -> int:
    """Measure and write."""
    if sys.argv[1:2] and sys.argv[1] in service.CHILDREN:
        service.CHILDREN[sys.argv[1]]()
        return 0
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "parts", nargs="*", help=f"parts to measure, of {', '.join(PARTS)}; all, and the pages, by default"
    )
    names = parser.parse_args().parts
    if unknown := set(names) - set(PARTS):
        parser.error(f"unknown part {', '.join(unknown)}; the parts are {', '.join(PARTS)}")
    sys.path.append(str(pages.ROOT / "test"))  # the oracle of the tests knows the exact answers
    results = measure(names or list(PARTS))
    import report
    import scenes

    if names:
        texts = report.parts(results) | (scenes.parts(results) if "scenes" in results else {})
        for text in texts.values():
            say(f"\n{text}")
        return 0
    write(results)
    found = [subprocess.run([sys.executable, "-I", pages.ROOT / script]).returncode for script in OTHERS]
    say(f"\n{report.targets(results)}")
    return max(found)


def measure(names: list[str]) -> dict[str, Any]:
    """Measure the named parts, one after the other."""
    start, skipped = time.monotonic(), dict[str, str]()
    results: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "versions": versions(PACKAGES),
        "skipped": skipped,
    }
    for number, name in enumerate(names, 1):
        say(f"==> {number} of {len(names)}: {PARTS[name]} ...")
        began = time.monotonic()
        results[name] = import_module(name).measure(skipped, say)
        say(f"==> {name} took {time.monotonic() - began:.0f} s")
    for what, why in skipped.items():
        say(f"==> skipped: {what}: {why}")
    results["seconds"] = round(time.monotonic() - start)
    return results


def write(results: dict[str, Any]) -> None:
    """Write the results, the tables and the plots."""
    import report
    import scenes
    import trade_plot

    model = f"{results['machine']['processor']} {results['machine']['cores']} cores"
    slug = re.sub(r"[^a-z0-9.]+", "-", re.sub(r"\(\w+\)|@", " ", model.lower())).strip("-")
    pages.store(results, pages.RESULTS / f"{results['date']}-{slug}.json")
    pages.rewrite(pages.DOCS / "trade-off.md", report.parts(results))
    trade_plot.draw(results["trade"]["plot"])
    say("==> wrote docs/trade-off.md")
    scenes.write(results)


def say(line: str) -> None:
    """Print a line of progress."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
