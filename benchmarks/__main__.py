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
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import pages
import service
from machine import machine

Skipped = dict[str, str]


def measure_one(skipped: Skipped) -> dict[str, Any]:
    import one

    return one.measure(skipped)


def measure_batch(_: Skipped) -> dict[str, Any]:
    import batch

    return batch.measure(say)


def measure_package(_: Skipped) -> dict[str, Any]:
    import package

    return package.measure()


def measure_service(skipped: Skipped) -> dict[str, Any] | None:
    try:
        return service.in_own_process()
    except ImportError as missing:
        skipped["service"] = str(missing)
        return None


def measure_trade(skipped: Skipped) -> dict[str, Any]:
    import trade

    return trade.measure(skipped, say)


def measure_scenes(_: Skipped) -> dict[str, Any]:
    import scenes

    return scenes.measure(say)


PARTS: dict[str, tuple[str, Callable[[Skipped], Any]]] = {
    "one": ("one impact, against pinocchio, MuJoCo, pybullet and pymunk", measure_one),
    "batch": ("batches, against C", measure_batch),
    "package": ("how tight the bounds are, how long the package is", measure_package),
    "service": ("the service, against an echo", measure_service),
    "trade": ("time against true error", measure_trade),
    "scenes": ("several contacts at once, against MuJoCo, pinocchio and Siconos", measure_scenes),
}
OTHERS = ("benchmarks/stability.py", "docs/impact_laws.py", "docs/scenes.py", "docs/square_on_incline.py")
"""What makes the other pages."""

PACKAGES = ("pin", "mujoco", "pybullet", "pymunk", "numpy", "python-flint")


def main() -> int:
    """Measure, and write."""
    if sys.argv[1:2] == [service.COMMANDS["echo"]]:
        service.echo()
        return 0
    for command, measure_it in (("measure", service.measure), ("measure batch", service.measure_batch)):
        if sys.argv[1:2] == [service.COMMANDS[command]]:
            print(json.dumps(measure_it()))
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
    start, skipped = time.monotonic(), Skipped()
    results: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "versions": versions(),
        "skipped": skipped,
    }
    for number, name in enumerate(names, 1):
        what, part = PARTS[name]
        say(f"==> {number} of {len(names)}: {what} ...")
        began = time.monotonic()
        results[name] = part(skipped)
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
