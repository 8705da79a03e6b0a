"""Runs the test suite twice at once, while every core is busy: no test may depend on time."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pages

from . import results

ROUNDS = 10
LONGEST = 3600.0
"""Longest time of one round [s]."""

SUITE = ["-m", "pytest", "-q", "-n", "auto", "--dist", "loadscope", "-p", "no:cacheprovider"]
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


@contextmanager
def busy_cores() -> Iterator[None]:
    """Keep each core busy with a process that computes all the time."""
    burners = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)
    ]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def run_both() -> list[tuple[int, str]]:
    """Run two suites at once; return the exit code and the output of each."""
    suites = [
        subprocess.Popen(
            [sys.executable, "-I", *SUITE],
            cwd=pages.ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for _ in range(2)
    ]
    try:
        outputs = [suite.communicate(timeout=LONGEST)[0] for suite in suites]
    finally:
        for suite in suites:
            suite.kill()
            suite.wait()
    return [(suite.returncode, output) for suite, output in zip(suites, outputs, strict=True)]


def main(arguments: list[str]) -> int:
    """Run the rounds."""
    parser = argparse.ArgumentParser(prog="make twice", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    rounds = parser.parse_args(arguments).rounds
    found: dict[str, Any] = {"seconds": [], "failed": []}
    with busy_cores():
        for number in range(1, rounds + 1):
            print(f"==> round {number} of {rounds} ...", flush=True)
            began = time.monotonic()
            for code, output in run_both():
                if code:
                    found["failed"].append(FAILED.findall(output) or [f"exit code {code}"])
                    print(output[-20_000:], flush=True)
            found["seconds"].append(time.monotonic() - began)
            print(f"    {found['seconds'][-1]:.0f} s, {len(found['failed'])} failed so far", flush=True)
    broken = [f"a suite failed: {', '.join(tests)}" for tests in found["failed"]]
    return results.finish("twice", found, is_whole=not arguments, broken=broken)
