"""A long run with load and faults: counts requests and answers, and measures the node's use of resources.

Clients that stay must get every answer. Requests of clients that left, were killed or were stopped are
counted separately.
"""

from __future__ import annotations

import argparse
import itertools
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from functools import partial
from itertools import pairwise
from statistics import linear_regression
from typing import Any

import numpy as np

from . import results
from .child_process import NAMESPACE
from .client import Report, spread
from .faults import LONGEST_WAIT, kill, leave, results_reader, stop
from .processes import Child, NodeProcess, Stage, with_profile
from .request_kinds import MIXED, SMALL

WINDOWS = {1: 1, 4: 2, 16: 4}
"""Numbers of pending requests of the clients that call all the time, and their shares of the requests."""

LONGEST = 3600.0
"""Longest time of a run with a given number of requests [s]."""

SAMPLES = 5.0
"""Time between two samples of the node's resources [s]."""

ROWS = 10
"""Rows of the table over time."""

MOST_GROWTH = 20.0
"""Largest growth of the memory from the middle of the run to its end [MiB]."""


class Soak:
    """One run: the node, the clients that stay, and the counts of those that did not."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.node: NodeProcess = stage.node()
        self.reports: dict[str, list[Report]] = defaultdict(list, steady=[])
        self.apart: dict[str, list[tuple[int, int]]] = defaultdict(list)
        self.faults = 0
        self._samples: list[list[float]] = []
        self._is_over = threading.Event()
        self._watch = threading.Thread(target=self._sample, daemon=True)

    def _sample(self) -> None:
        while not self._is_over.wait(SAMPLES):
            if usage := self.node.usage():
                self._samples.append([time.monotonic(), *usage])

    def run(self, seconds: float, requests: int) -> dict[str, Any]:
        """Run for a time [s], or until a number of requests has been sent."""
        stage = self.stage
        topic = f"{NAMESPACE}/body_states"
        publisher = stage.child(
            "publisher", type="BodyState", topic=topic, rate=500, first=0, bodies=1000, number=10**9
        )
        stage.start(publisher)
        steady = [
            stage.client(
                kinds=(*MIXED, "named"),
                requests=-(-requests * share // sum(WINDOWS.values())) or 10**9,
                window=window,
                seconds=seconds,
                seed=window,
            )
            for window, share in WINDOWS.items()
        ]
        stage.start(*steady)
        self._watch.start()
        began, done = time.monotonic(), {}
        faults = itertools.cycle(FAULTS.items())
        while len(done) < len(steady) and time.monotonic() < began + seconds + 120.0 and self.node.is_alive():
            self._fault(*next(faults))
            for client in steady:
                if client not in done and (report := finished_report(client)):
                    done[client] = report
        for client in steady:
            if client not in done:
                client.tell("stop")
                done[client] = client.report()
        took = time.monotonic() - began
        self._is_over.set()
        self._watch.join()
        publisher.tell("stop")
        self.reports["steady"] = [done[client] for client in steady]
        alive = self.node.is_alive()
        ended = self.node.terminate()
        return self._found(took, began, alive, ended, publisher.until("sent")["states"])

    def _fault(self, name: str, fault: Callable[[Stage], Report | tuple[int, int] | None]) -> None:
        try:
            found = fault(self.stage)
        except (TimeoutError, ChildProcessError) as error:  # the clients that stay notice faults of the node
            print(f"    {name}: {error}", flush=True)
            return
        self.faults += 1
        if isinstance(found, Report):
            self.reports[name].append(found)
        elif found is not None:
            self.apart[name].append(found)

    def _found(
        self, took: float, began: float, alive: bool, ended: tuple[float, int | None], states: int
    ) -> dict[str, Any]:
        first = self.reports["steady"][0].latency()
        return {
            "minutes": took / 60,
            "alive": alive,
            "exit": ended,
            "states": states,
            "faults": self.faults,
            "log_lines": self.node.log().count("\n"),
            "clients": {name: _summary(Report.together(reports)) for name, reports in self.reports.items()},
            "apart": {
                name: [sum(n) for n in zip(*counts, strict=True)] for name, counts in self.apart.items()
            },
            "one at a time": first,
            "over time": self._over_time(began),
            "slope": slope(self._samples),
        }

    def _over_time(self, began: float) -> list[dict[str, Any]]:
        """Rows for equal intervals of time."""
        times = Report.together(self.reports["steady"]).times
        if not times or not self._samples:
            return []
        rows = []
        for begin, end in pairwise(np.linspace(began, max(at for at, _ in times), ROWS + 1).tolist()):
            waits = [seconds for at, seconds in times if begin < at <= end]
            sample = min(self._samples, key=lambda sample, end=end: abs(sample[0] - end))
            _, memory, _, threads, descriptors, _ = sample
            rows.append(
                {
                    "minutes": (end - began) / 60,
                    "answers": len(waits),
                    "seconds": end - begin,
                    "latency": spread(waits),
                    "memory": memory,
                    "threads": threads,
                    "descriptors": descriptors,
                }
            )
        return rows


def _summary(report: Report) -> dict[str, Any]:
    return {
        "asked": report.asked,
        "answered": report.answered,
        "codes": dict(sorted(report.by_code().items())),
        "wrong": dict(report.wrong),
        "latency": report.latency(),
    }


def slope(samples: list[list[float]]) -> float | None:
    """Growth of the memory in the second half of the run, by least squares [MiB/h]."""
    half = samples[len(samples) // 2 :]
    if len(half) < 3:
        return None
    return 3600 * linear_regression([s[0] for s in half], [s[1] for s in half]).slope


def finished_report(client: Child) -> Report | None:
    """The report of a client; ``None`` while it has not finished."""
    try:
        return client.report(0.01)
    except TimeoutError:
        return None


# Faults ---------------------------------------------------------------------------------------


def stay(stage: Stage, **order: Any) -> Report:
    """Run a client that stays until it has all answers."""
    with closing(stage.client(**order)) as client:
        stage.start(client)
        return client.report(120.0)


def unread(stage: Stage) -> None:
    """Stop a subscriber of the results for some seconds, and end it."""
    with closing(results_reader(stage)) as subscriber:
        subscriber.until("ready", 60.0)
        subscriber.hold()
        time.sleep(3.0)


FAULTS: dict[str, Callable[[Stage], Report | tuple[int, int] | None]] = {
    "bursts of 1000": partial(stay, kinds=SMALL, requests=1000, window=1000),
    "left with 200 pending": partial(leave, pending=200),
    "extended batches of 1e4": partial(stay, kinds=("extended batch of 1e4",), requests=2),
    "killed with 200 pending": partial(kill, pending=200),
    "slow readers": partial(stay, kinds=("full",), requests=300, window=300, pause=0.005),
    "stopped subscribers": unread,
    "stopped for 5 s with 500 pending": partial(stop, pending=500, seconds=5.0),
}
"""Each returns the report of a client that stayed, or the requests and answers of one that did not."""


# Running --------------------------------------------------------------------------------------


def broken(found: dict[str, Any]) -> list[str]:
    """The promises that were broken."""
    rows = found["over time"]
    growth = rows[-1]["memory"] - rows[len(rows) // 2]["memory"] if rows else 0.0
    longest = found["one at a time"] and found["one at a time"]["max"]
    promises = {
        "the node died": found["alive"],
        f"exit {found['exit']}": found["exit"][1] == 0,
        f"the client with one request at a time waited {longest or 0:.2g} s": longest is None
        or longest <= LONGEST_WAIT,
        f"{growth:.0f} MiB more at the end than in the middle": growth <= MOST_GROWTH,
    }
    for name, row in found["clients"].items():
        left = row["asked"] - row["answered"]
        promises[f"{name}: {left} unanswered"] = left == 0
        promises[f"{name}: wrong answers {row['wrong']}"] = not row["wrong"]
    return [what for what, holds in promises.items() if not holds]


def main(arguments: list[str]) -> int:
    """Run once."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--requests", type=int, default=0, help="number of requests, instead of a time")
    asked = parser.parse_args(arguments)
    seconds = LONGEST if asked.requests else 60 * asked.minutes
    print(f"==> soak, {asked.requests or f'{asked.minutes:g} minutes'} ...", flush=True)
    with with_profile() as variables, Stage(variables) as stage:
        found = Soak(stage).run(seconds, asked.requests)
    is_whole = not arguments or asked.requests >= 1_000_000
    return results.finish("soak", found, is_whole=is_whole, broken=broken(found))
