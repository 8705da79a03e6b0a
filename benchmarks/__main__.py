"""``make bench``: times, errors and targets, side by side in one run.

It writes them to benchmarks/results, and to docs/trade-off.md and docs/scenes.md as tables and plots. Then it
makes the other pages with measured tables and pictures anew: docs/stability.md, docs/impact-laws.md and
docs/square-on-incline.md. Named parts measure only those, for a look: ``make bench ARGS='one batch'``; then
only the terminal is written to.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import re
import subprocess
import sys
import time
from importlib import import_module
from typing import Any

import pages
import service
from machine import machine

PARTS = {
    "one": "one impact, against pinocchio, MuJoCo, pybullet and pymunk",
    "batch": "batches, against C",
    "package": "how tight the bounds are, how long the package is",
    "service": "the service, against an echo",
    "trade": "time against true error",
    "scenes": "several contacts at once, against MuJoCo, pinocchio and Siconos",
}
"""Modules, and what their ``measure()`` finds. It is told where to note what it skips, and how to speak."""

OTHERS = ("benchmarks/stability.py", "docs/impact_laws.py", "docs/scenes.py", "docs/square_on_incline.py")
"""What makes the other pages."""

PACKAGES = ("pin", "mujoco", "pybullet", "pymunk", "numpy", "python-flint")


def main() -> int:
    """Measure, and write."""
    if sys.argv[1:2] and sys.argv[1] in service.CHILDREN:
        service.CHILDREN[sys.argv[1]]()
        return 0
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "parts", nargs="*", help=f"of {', '.join(PARTS)}; all, and the pages, if none is named"
    )
    asked = parser.parse_args().parts
    if unknown := set(asked) - set(PARTS):
        parser.error(f"no part {', '.join(unknown)}: there are {', '.join(PARTS)}")
    results = measure(asked or list(PARTS))
    import report
    import scenes

    if asked:
        texts = report.parts(results) | (scenes.parts(results) if "scenes" in results else {})
        for text in texts.values():
            say(f"\n{text}")
        return 0
    write(results)
    found = [subprocess.run([sys.executable, "-I", pages.ROOT / script]).returncode for script in OTHERS]
    say(f"\n{report.targets(results)}")
    return max(found)


def measure(names: list[str]) -> dict[str, Any]:
    """The named parts, one after the other."""
    start, skipped = time.monotonic(), dict[str, str]()
    results: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "versions": versions(),
        "skipped": skipped,
    }
    for number, name in enumerate(names, 1):
        say(f"==> {number} of {len(names)}: {PARTS[name]} ...")
        began = time.monotonic()
        results[name] = import_module(name).measure(skipped, say)
        say(f"==> {name} took {time.monotonic() - began:.0f} s")
    for what, why in skipped.items():
        say(f"==> left out: {what}: {why}")
    results["seconds"] = round(time.monotonic() - start)
    return results


def versions() -> dict[str, str]:
    """Of the peers and of what computes here."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def write(results: dict[str, Any]) -> None:
    """The numbers, the tables and the picture."""
    import report
    import scenes
    import trade_plot

    model = f"{results['machine']['processor']} {results['machine']['cores']} cores"
    slug = re.sub(r"[^a-z0-9.]+", "-", re.sub(r"\(\w+\)|@", " ", model.lower())).strip("-")
    pages.store(results, pages.ROOT / "benchmarks" / "results" / f"{results['date']}-{slug}.json")
    pages.rewrite(pages.DOCS / "trade-off.md", report.parts(results))
    trade_plot.draw(results["trade"]["plot"], pages.DOCS / "images" / "trade-off.png")
    say("==> wrote docs/trade-off.md and its plot")
    scenes.write(results)


def say(line: str) -> None:
    """Progress."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
