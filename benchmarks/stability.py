"""The stability report: ``make stability`` measures everything anew and rewrites docs/stability.md.

    python benchmarks/stability.py [--quick]

It needs ``pip install '.[test,plots]'``, and takes what else is installed of ``gmpy2``. With
``--quick`` it measures a hundredth of it, for a look, and writes to a directory of its own.
"""

from __future__ import annotations

import argparse
import datetime
import json
import multiprocessing
import platform
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(ROOT / "test")]

import stability_drift  # noqa: E402
import stability_measure  # noqa: E402
import stability_page  # noqa: E402
import stability_random  # noqa: E402
from stability_arithmetics import compare  # noqa: E402

REQUESTS, NEARLY_PLANAR, SAMPLES = 100_000, 10_000, 600
"""Of each law, wild and nearly planar; of one kind of ill condition."""

IMPACTS = {"float32": 100_000, "SINGLE": 1_000_000, "DOUBLE": 1_000_000, "EXTENDED": 1_000_000}
"""Of each drift."""

CORES = 2


class Job(NamedTuple):
    """A call for another process."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("--quick", action="store_true", help="a hundredth of the work, to build/stability")
    share = 100 if arguments.parse_args().quick else 1
    start = time.monotonic()
    results: dict[str, Any] = {"date": datetime.date.today().isoformat(), "machine": machine(), **timed()}
    results |= checked(share)
    results["seconds"] = round(time.monotonic() - start)
    write(results, ROOT if share == 1 else ROOT / "build" / "stability")
    violations = results["random"]["violations"]
    for violation in violations:
        print("VIOLATION", violation)
    print(f"{len(violations)} violations; {results['seconds']} s")
    return bool(violations)


def timed() -> dict[str, Any]:
    """What is timed, one after the other and nothing else."""
    return {
        "extremes": say("extremes", stability_measure.all_extremes),
        "tolerances": say("tolerances", stability_measure.tolerances),
        "cost": say("cost of the bound", stability_measure.cost_of_the_bound),
        "arithmetics": say("arithmetics", compare),
    }


def checked(share: int) -> dict[str, Any]:
    """What takes long, on all cores."""
    pieces = stability_random.pieces(REQUESTS // share, NEARLY_PLANAR // share)
    long = {tier: Job(stability_drift.drift, (tier, impacts // share)) for tier, impacts in IMPACTS.items()}
    long["conditions"] = Job(stability_measure.by_condition, (SAMPLES // share,))
    jobs = _mixed([*reversed(long.values())], [Job(stability_random.run, (piece,)) for piece in pieces])
    tally, others, done = stability_random.nothing(), {}, 0
    with multiprocessing.Pool(CORES) as pool:
        for job, result in pool.imap_unordered(_done, jobs):
            if isinstance(result, stability_random.Tally):
                tally.add(result)
            else:
                others[job] = result
            done += 1
            if done % 10 == 0 or done == len(jobs):
                print(f"\r{done} of {len(jobs)}, {len(tally.violations)} violations ", end="", flush=True)
    print()
    return {
        "drift": {tier: others[long[tier]] for tier in IMPACTS},
        "conditions": others[long["conditions"]],
        "random": {
            "counts": _by_tier(tally.counts),
            "tightest": tally.tightest,
            "violations": tally.violations,
            "requests of each law": REQUESTS // share,
            "wildest": stability_random.WILDEST,
        },
    }


def _mixed(long: list[Job], short: list[Job]) -> list[Job]:
    """Each long job before an equal share of the short ones: then there is always some progress to see."""
    share = -(-len(short) // len(long))
    return [job for i, first in enumerate(long) for job in (first, *short[i * share : (i + 1) * share])]


def _done(job: Job) -> tuple[Job, Any]:
    return job, job.function(*job.arguments)


def _by_tier(counts: dict[tuple[str, str], int]) -> dict[str, dict[str, int]]:
    tiers: dict[str, dict[str, int]] = {}
    for (tier, outcome), count in sorted(counts.items()):
        tiers.setdefault(tier, {})[outcome] = count
    return tiers


def say(what: str, measure: Callable[[], Any]) -> Any:
    print(f"{what} ...", flush=True)
    return measure()


def machine() -> dict[str, str]:
    """What the times depend on."""
    import flint
    import numpy

    names = dict(_cpu_lines())
    return {
        "processor": names.get("model name", platform.machine()),
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "python-flint": flint.__version__,
    }


def _cpu_lines() -> Iterator[tuple[str, str]]:
    path = Path("/proc/cpuinfo")
    for line in path.read_text().splitlines() if path.exists() else []:
        key, _, value = line.partition(":")
        yield key.strip(), value.strip()


def write(results: dict[str, Any], root: Path) -> None:
    """The numbers as JSON, without the samples of the plots; the pictures; the tables in the page."""
    path = root / "benchmarks" / "results" / f"stability-{results['date']}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    kept = {key: value for key, value in results.items() if key != "conditions"}
    parts = (f"{json.dumps(key)}: {json.dumps(_rounded(value))}" for key, value in kept.items())
    path.write_text("{\n" + ",\n".join(parts) + "\n}\n")
    stability_page.write(results, ROOT / "docs" / "stability.md", root / "docs")
    print(f"wrote {path.relative_to(ROOT)} and {(root / 'docs' / 'stability.md').relative_to(ROOT)}")


def _rounded(value: Any) -> Any:
    """Three digits are enough to read, and change less from run to run."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return float(f"{value:.3g}") if isinstance(value, float) else value


if __name__ == "__main__":
    sys.exit(main())
