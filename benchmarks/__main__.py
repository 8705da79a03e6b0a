"""``make bench``: times and errors, side by side in one run.

It writes them to benchmarks/results, and to docs/trade-off.md as tables and a plot. Named parts measure
only those, for a look: ``make bench ARGS='peers service'``; then only the terminal is written to.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import peers
import report
import service

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "docs" / "trade-off.md"
IMAGE = HERE.parent / "docs" / "images" / "trade-off.png"
DIGITS = 3

Skipped = dict[str, str]


def measure_peers(skipped: Skipped) -> dict[str, Any]:
    """One impact, and where the time of ``resolve`` goes."""
    from profiles import profile

    from collision_response import resolve

    scene = peers.SCENES["pair"]
    found = peers.measure(skipped)
    found["profile"] = profile(lambda: resolve(*scene[:3]), "resolve", 2000)
    return found


def measure_batch(skipped: Skipped) -> dict[str, Any]:
    """Many impacts at once, and where the time of a small batch goes."""
    import batch
    from profiles import profile

    from collision_response import Geometry
    from collision_response.batch.backends import Backend
    from collision_response.numerics import compiled

    if not compiled.is_available():
        skipped["compiled batches"] = "numba is not installed"
    found = batch.measure(lambda line: say(f"    {line}"))
    backend = Backend.COMPILED if compiled.is_available() else Backend.NUMPY
    run = batch.by_batch(*batch.scene(Geometry.SPATIAL, 1000), backend)
    return {**found, "profile": profile(run, "resolve_batch", 1000)}


def measure_service(_: Skipped) -> dict[str, Any]:
    """Impacts over ROS."""
    return service.in_own_process()


def measure_trade(skipped: Skipped) -> dict[str, Any]:
    """Time against true error."""
    import trade

    return trade.measure(skipped, lambda scene: say(f"    {scene}"))


PARTS: dict[str, tuple[str, Callable[[Skipped], Any]]] = {
    "peers": ("one impact, against pinocchio, MuJoCo, pybullet and pymunk", measure_peers),
    "batch": ("batches, against memcpy, C and NumPy", measure_batch),
    "service": ("the service, against an echo", measure_service),
    "trade": ("time against true error", measure_trade),
}


def main() -> int:
    """Measure, and write."""
    if sys.argv[1:2] == [service.COMMANDS["echo"]]:
        service.echo()
        return 0
    if sys.argv[1:2] == [service.COMMANDS["measure"]]:
        print(json.dumps(service.measure()))
        return 0
    if sys.argv[1:2] == [service.COMMANDS["measure batch"]]:
        print(json.dumps(service.measure_batch()))
        return 0
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all, if none is named")
    asked = parser.parse_args().parts
    if unknown := set(asked) - set(PARTS):
        parser.error(f"no part {', '.join(unknown)}: there are {', '.join(PARTS)}")
    results = measure(asked or list(PARTS))
    if asked:
        show(results)
    else:
        write(results)
        show_targets(results)
    return 0


def measure(names: list[str]) -> dict[str, Any]:
    """The named parts, one after the other."""
    start, skipped = time.monotonic(), Skipped()
    results: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "machine": machine(),
        "versions": peers.versions(),
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


def machine() -> dict[str, Any]:
    """What the times depend on, but for versions."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*:\s*(.*)$", info.read_text(), re.MULTILINE) if info.exists() else None
    return {
        "processor": found[1] if found else platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }


def write(results: dict[str, Any]) -> None:
    """The numbers, the tables and the picture."""
    import trade
    import trade_plot

    model = f"{results['machine']['processor']} {results['machine']['cores']} cores"
    slug = re.sub(r"[^a-z0-9.]+", "-", re.sub(r"\(\w+\)|@", " ", model.lower())).strip("-")
    path = HERE / "results" / f"{results['date']}-{slug}.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(compact(rounded({**results, "trade": trade.summary(results["trade"])})) + "\n")
    report.write(results, PAGE)
    trade_plot.draw(results["trade"]["points"], IMAGE)
    for written in (path, PAGE, IMAGE):
        say(f"==> wrote {written.relative_to(HERE.parent)}")


def rounded(value: Any) -> Any:
    """Three digits are enough to read, and change less from run to run."""
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(part) for part in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def compact(value: Any, indent: str = "") -> str:
    """JSON with what fits in one line in one line."""
    line = json.dumps(value)
    if len(indent) + len(line) <= 150 or not isinstance(value, (dict, list)):
        return line
    inner = indent + " "
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {compact(part, inner)}" for key, part in value.items()]
    else:
        parts = [inner + compact(part, inner) for part in value]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n" + ",\n".join(parts) + f"\n{indent}{closing}"


def show(results: dict[str, Any]) -> None:
    """The tables of what was measured, to the terminal."""
    for name, (part, write_part) in report.PARTS.items():
        if results.get(part) is not None and part != "machine":
            say(f"\n{name}\n\n{write_part(results)}")


def show_targets(results: dict[str, Any]) -> None:
    """Every target, to the terminal."""
    rows = [[cell.replace("**", "").replace("`", "") for cell in row] for row in report.target_rows(results)]
    width = max(len(row[0]) for row in rows)
    for what, target, measured, verdict in rows:
        say(f"{what:<{width}}  {target:>7}  {measured:<24} {verdict}")
    for answer in results["trade"]["above_bound"]:
        say(f"ERROR ABOVE ITS BOUND: {answer}")


def say(line: str) -> None:
    """Progress."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
