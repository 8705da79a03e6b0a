"""Runs the test suite twice at once, while every core is busy: no test may depend on time."""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from contextlib import ExitStack
from subprocess import DEVNULL, PIPE, STDOUT, Popen
from typing import Any

import pages

from . import results

ROUNDS = 10
SUITE = ["-I", "-m", "pytest", "-q", "-n", "auto", "--dist", "loadscope", "-p", "no:cacheprovider"]
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


def start_suite() -> Popen[str]:
    """Start the tests."""
    pipes = {"stdin": DEVNULL, "stdout": PIPE, "stderr": STDOUT}
    return Popen([sys.executable, *SUITE], cwd=pages.ROOT, text=True, **pipes)


def main(arguments: list[str]) -> int:
    """Run the rounds, with a process on each core that computes all the time."""
    parser = argparse.ArgumentParser(prog="make twice", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    rounds = parser.parse_args(arguments).rounds
    found: dict[str, Any] = {"seconds": [], "failed": []}
    with ExitStack() as stack:
        for _ in range(os.cpu_count() or 1):
            stack.callback(stack.enter_context(Popen([sys.executable, "-c", "while True: pass"])).kill)
        for number in range(1, rounds + 1):
            print(f"==> round {number} of {rounds} ...", flush=True)
            began = time.monotonic()
            with start_suite() as one, start_suite() as other:
                for suite in (one, other):
                    output, _ = suite.communicate()
                    if suite.returncode:
                        found["failed"].append(FAILED.findall(output) or [f"exit code {suite.returncode}"])
                        print(output[-20_000:], flush=True)
            found["seconds"].append(time.monotonic() - began)
            print(f"    {found['seconds'][-1]:.0f} s, {len(found['failed'])} failed so far", flush=True)
    broken = [f"a suite failed: {', '.join(tests)}" for tests in found["failed"]]
    return results.finish("twice", found, is_whole=not arguments, broken=broken)
