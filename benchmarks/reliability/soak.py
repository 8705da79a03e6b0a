"""A long run with load and faults: counts requests and answers, and measures the node's use of resources.

Clients that stay must get every answer. Requests of clients that left, were killed or were stopped are
counted separately.
"""

from __future__ import annotations

import argparse
import itertools
import threading
import time
from collections.abc import Callable
from statistics import linear_regression
from typing import Any

from . import results
from .child_process import NAMESPACE
from .client import Report
from .faults import LONGEST_WAIT
from .latency import SECONDS, spread
from .processes import Child, Environment, NodeProcess, Stage
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
        self.reports: dict[str, list[Report]] = {"steady": [], "bursts of 1000": [], "slow readers": []}
        self.apart: dict[str, list[tuple[int, int]]] = {}
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
        faults = itertools.cycle(FAULTS)
        while len(done) < len(steady) and time.monotonic() < began + seconds + 120.0 and self.node.is_alive():
            self._fault(next(faults))
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

    def _fault(self, fault: Callable[[Soak], None]) -> None:
        try:
            fault(self)
            self.faults += 1
        except (TimeoutError, ChildProcessError) as error:  # the clients that stay notice faults of the node
            print(f"    {fault.__name__}: {error}", flush=True)

    def _found(
        self, took: float, began: float, alive: bool, ended: tuple[float, int | None], states: int
    ) -> dict[str, Any]:
        first = self.reports["steady"][0].latencies.spread()
        return {
            "minutes": took / 60,
            "alive": alive,
            "exit": ended,
            "states": states,
            "faults": self.faults,
            "log_lines": self.node.log().count("\n"),
            "clients": {
                name: _summary(Report.together(reports)) for name, reports in self.reports.items() if reports
            },
            "apart": {
                name: [sum(n) for n in zip(*counts, strict=True)] for name, counts in self.apart.items()
            },
            "one at a time": first,
            "over time": self._over_time(began),
            "slope": slope(self._samples),
        }

    def _over_time(self, began: float) -> list[dict[str, Any]]:
        """Rows for equal intervals of time."""
        everyone = Report.together(self.reports["steady"]).latencies.intervals
        if not everyone or not self._samples:
            return []
        numbers = range(min(everyone), max(everyone) + 1)
        step = -(-len(numbers) // ROWS)
        rows = []
        for begin in numbers[::step]:
            bins = Report.together([]).by_code()
            for number in range(begin, begin + step):
                bins.update(everyone.get(number, {}))
            end = (begin + step) * SECONDS
            sample = min(self._samples, key=lambda sample, end=end: abs(sample[0] - end))
            _, memory, _, threads, descriptors, _ = sample
            rows.append(
                {
                    "minutes": (end - began) / 60,
                    "answers": sum(bins.values()),
                    "seconds": step * SECONDS,
                    "latency": spread(bins),
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
        "latency": report.latencies.spread(),
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


def burst(soak: Soak) -> None:
    run_client(soak, "bursts of 1000", kinds=SMALL, requests=1000, window=1000)


def slow(soak: Soak) -> None:
    run_client(soak, "slow readers", kinds=("full",), requests=300, window=300, pause=0.005)


def run_client(soak: Soak, name: str, **order: Any) -> None:
    """Run a client that stays until it has all answers."""
    client = soak.stage.client(**order)
    soak.stage.start(client)
    soak.reports[name].append(client.report(120.0))
    client.close()


def leaves(soak: Soak) -> None:
    client = soak.stage.client(kinds=("full",), requests=200, window=200, leaves=True)
    soak.stage.start(client)
    report = client.report(60.0)
    soak.apart.setdefault("left with 200 pending", []).append((report.asked, report.answered))
    client.close()


def killed(soak: Soak) -> None:
    client = soak.stage.client(kinds=("full",), requests=200, window=200)
    soak.stage.start(client)
    client.until("sent", 60.0)
    client.kill()
    soak.apart.setdefault("killed with 200 pending", []).append((200, 0))
    client.close()


def stopped(soak: Soak) -> None:
    client = soak.stage.client(kinds=("full",), requests=500, window=500, patience=20.0)
    soak.stage.start(client)
    client.until("sent", 60.0)
    client.hold()
    time.sleep(5.0)
    client.resume()
    report = client.report(120.0)
    soak.apart.setdefault("stopped for 5 s with 500 pending", []).append((report.asked, report.answered))
    client.close()


def long_batch(soak: Soak) -> None:
    soak.reports.setdefault("extended batches of 1e4", [])
    run_client(soak, "extended batches of 1e4", kinds=("extended batch of 1e4",), requests=2, window=1)


def unread(soak: Soak) -> None:
    topic = f"{NAMESPACE}/collision_response/result"
    subscriber = soak.stage.child("subscriber", topic=topic, type="CollisionResult", reliable=True)
    subscriber.until("ready", 60.0)
    subscriber.hold()
    time.sleep(3.0)
    subscriber.close()


FAULTS = (burst, leaves, long_batch, killed, slow, unread, stopped)


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
    with Environment() as environment, Stage(environment) as stage:
        found = Soak(stage).run(seconds, asked.requests)
    is_whole = not arguments or asked.requests >= 1_000_000
    return results.finish("soak", found, is_whole=is_whole, broken=broken(found))
