"""Crowds of clients, clients that leave, stop or read slowly, long requests, and SIGTERM during all of this.

Each case has its own node. The clients count: each knows which requests it has sent.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from contextlib import closing
from typing import Any

from . import results
from .child_process import NAMESPACE
from .client import Report
from .processes import Child, NodeProcess, Stage, with_profile
from .request_kinds import MIXED, SMALL

Row = dict[str, Any]
AMPLE = {"budget__contacts": 2_000_000, "budget__time": 600.0}
"""Budgets that allow the longest of these requests."""

LONGEST_WAIT = 1.0
"""Longest time that a client may wait because of another client [s]."""

LONGEST_EXIT = 15.0
"""Longest time to exit [s]: the default of shutdown_timeout, plus some for the cleanup."""

CASES: dict[str, Callable[[Stage], Row]] = {}


def case(name: str) -> Callable[[Callable[[Stage], Row]], Callable[[Stage], Row]]:
    """Register a case under its name."""

    def enter(run: Callable[[Stage], Row]) -> Callable[[Stage], Row]:
        CASES[name] = run
        return run

    return enter


def row(
    node: NodeProcess,
    reports: list[Report],
    *,
    others: Report | None = None,
    apart: tuple[int, int] | None = None,
    wait: float | None = LONGEST_WAIT,
    must: dict[str, bool] | None = None,
    notes: str = "",
) -> Row:
    """The result of a case, with the promises that were broken.

    Args:
        node: the node at the end of the case.
        reports: reports of the clients that stayed from beginning to end.
        others: report of the client that did nothing unusual, if there is one; the times are then its times.
        apart: requests and answers of clients that left, were killed or stopped.
        wait: longest allowed wait of the other client [s].
        must: further conditions, by name.
        notes: a remark.
    """
    everyone = Report.together(reports + ([others] if others else []))
    latency = (others or everyone).latency()
    usage = node.usage()
    promises = {
        f"{everyone.unanswered} unanswered": everyone.unanswered == 0,
        f"wrong answers {dict(everyone.wrong)}": not everyone.wrong,
        "no INTERNAL_ERROR": 100 not in everyone.by_code(),
        **(must or {"the node lives": node.is_alive()}),
    }
    if others is not None and wait is not None and latency is not None:
        promises[f"the other client waited {latency['max']:.2g} s"] = latency["max"] <= wait
    return {
        "asked": everyone.asked,
        "answered": everyone.answered,
        "codes": dict(sorted(everyone.by_code().items())),
        "apart": apart,
        "others": others is not None,
        "latency": latency,
        "peak": usage and usage.peak,
        "notes": notes,
        "broken": [what for what, holds in promises.items() if not holds],
        "log": node.log()[-1000:] if not all(promises.values()) else "",
    }


def started(stage: Stage, **parameters: Any) -> NodeProcess:
    """A node that has answered each kind of small request."""
    node = stage.node(**parameters)
    calls(stage, 60)
    return node


def calls(stage: Stage, number: int) -> Report:
    """Send a number of requests, one after the other, from a new client."""
    client = stage.client(kinds=SMALL, requests=number, window=1, seed=2)
    stage.start(client)
    return client.report()


def steady(stage: Stage) -> Child:
    """A client that sends one request after the other until it receives "stop"."""
    return stage.client(kinds=SMALL, requests=1_000_000, window=1, seconds=900.0, seed=1)


def stopped(client: Child) -> Report:
    """Stop a client and return its report."""
    client.tell("stop")
    return client.report()


@case("the first requests to a new node")
def first(stage: Stage) -> Row:
    node = stage.node()
    return row(node, [], others=calls(stage, 60))


# Crowds ---------------------------------------------------------------------------------------


@case("a burst of 5000 requests")
def burst(stage: Stage) -> Row:
    node, client = stage.node(), stage.client(kinds=MIXED, requests=5000, window=5000)
    stage.start(client)
    return row(node, [client.report()])


@case("16 client processes, 500 requests each, 50 pending")
def processes(stage: Stage) -> Row:
    node = stage.node()
    clients = [stage.client(kinds=SMALL, requests=500, window=50, seed=seed) for seed in range(16)]
    stage.start(*clients)
    return row(node, [client.report() for client in clients])


@case("a burst of 5000 requests, and another client")
def fairness(stage: Stage) -> Row:
    node, client, other = started(stage), stage.client(kinds=SMALL, requests=5000, window=5000), steady(stage)
    stage.start(other, client)
    found = client.report()
    return row(node, [found], others=stopped(other))


@case("60 clients that call as soon as they see the service")
def newcomers(stage: Stage) -> Row:
    node = started(stage)
    newcomers = stage.child("new_clients", number=60)
    return row(node, [newcomers.report()])


# Clients that leave, die, stop or read slowly ---------------------------------------------------


def leave(stage: Stage, pending: int) -> tuple[int, int]:
    """Let a client leave with requests pending; return the numbers of its requests and answers."""
    with closing(stage.client(kinds=("full",), requests=pending, window=pending, leaves=True)) as client:
        stage.start(client)
        report = client.report()
    return report.asked, report.answered


def kill(stage: Stage, pending: int) -> tuple[int, int]:
    """The same for a client that is killed."""
    with closing(stage.client(kinds=("full",), requests=pending, window=pending)) as client:
        stage.start(client)
        client.until("sent")
        client.kill()
    return pending, 0


def stop(
    stage: Stage, pending: int, seconds: float, meanwhile: Callable[[], object] = lambda: None
) -> tuple[int, int]:
    """The same for a client that is stopped for some seconds and a call, and then continues."""
    with closing(stage.client(kinds=("full",), requests=pending, window=pending, patience=30.0)) as client:
        stage.start(client)
        client.until("sent")
        client.hold()
        time.sleep(seconds)
        meanwhile()
        client.resume()
        report = client.report()
    return report.asked, report.answered


@case("a client leaves with 500 pending")
def leaves(stage: Stage) -> Row:
    return _apart(stage, leave)


@case("a client is killed with 500 pending")
def killed(stage: Stage) -> Row:
    return _apart(stage, kill)


def _apart(stage: Stage, fault: Callable[[Stage, int], tuple[int, int]]) -> Row:
    node, other = started(stage), steady(stage)
    stage.start(other)
    apart = fault(stage, 500)
    calls(stage, 500)
    return row(node, [], others=stopped(other), apart=apart)


def _stop(stage: Stage, seconds: float) -> Row:
    node, other, found = started(stage), steady(stage), list[Report]()
    stage.start(other)
    apart = stop(stage, 3000, seconds, lambda: found.append(stopped(other)))
    return row(node, [], others=found[0], apart=apart, notes=f"stopped for {seconds:.0f} s or more")


@case("a client is stopped for 5 s with 3000 pending")
def stops(stage: Stage) -> Row:
    return _stop(stage, 5.0)


@case("a client is stopped for 40 s with 3000 pending")
def stops_for_long(stage: Stage) -> Row:
    return _stop(stage, 40.0)


@case("a client reads an answer every 5 ms, 2000 pending")
def reads_slowly(stage: Stage) -> Row:
    node, other = started(stage), steady(stage)
    client = stage.client(kinds=("full",), requests=2000, window=2000, pause=0.005)
    stage.start(other, client)
    went = client.report()
    return row(node, [went], others=stopped(other))


def results_reader(stage: Stage) -> Child:
    """A subscriber of the results."""
    topic = f"{NAMESPACE}/collision_response/result"
    return stage.child("subscriber", topic=topic, type="CollisionResult", reliable=True)


@case("a subscriber of the results is stopped")
def results_unread(stage: Stage) -> Row:
    node = stage.node()
    subscriber, client = results_reader(stage), stage.client(kinds=SMALL, requests=5000, window=1)
    subscriber.until("ready")
    calls(stage, 10)  # so that it has received something
    subscriber.hold()
    stage.start(client)
    return row(node, [], others=client.report())


# Long requests --------------------------------------------------------------------------------


def _long(stage: Stage, kind: str, parameters: dict[str, Any], wait: float | None = LONGEST_WAIT) -> Row:
    node, other = started(stage, **parameters), steady(stage)
    client = stage.client(kinds=(kind,), requests=1, window=1, patience=300.0)
    stage.start(other, client)
    found = client.report()
    took = found.latency()
    notes = f"the batch took {took['max']:.2g} s" if took else ""
    return row(node, [found], others=stopped(other), wait=wait, notes=notes)


@case("a batch of 2e5, SPATIAL, EXTENDED")
def long_batch(stage: Stage) -> Row:
    return _long(stage, "extended batch of 2e5", {})


@case("a batch of 1e6, over the budget")
def over_budget(stage: Stage) -> Row:
    return _long(stage, "extended batch of 1e6", {})


@case("a batch of 1e6, POINT, ample budget")
def great_point_batch(stage: Stage) -> Row:
    return _long(stage, "point batch of 1e6", AMPLE, wait=None)


@case("a batch of 1e6, SPATIAL, EXTENDED, ample budget")
def great_batch(stage: Stage) -> Row:
    """DDS sends the answer of 130 MB in one piece, and other clients wait for that."""
    return _long(stage, "extended batch of 1e6", AMPLE, wait=None)


# The end --------------------------------------------------------------------------------------


def _end(node: NodeProcess, clients: list[Child]) -> Row:
    seconds, code = node.terminate(120.0)
    must = {f"it took {seconds:.1f} s to exit": seconds <= LONGEST_EXIT, f"it exited with {code}": code == 0}
    found = [client.report() for client in clients]
    return row(node, found, must=must, notes=f"exit code {code} after {seconds:.2g} s")


@case("SIGTERM in a burst of 5000")
def sigterm_in_burst(stage: Stage) -> Row:
    node = stage.node()
    client = stage.client(kinds=SMALL, requests=5000, window=5000, patience=10.0)
    stage.start(client)
    client.until("sent")
    return _end(node, [client])


@case("SIGTERM in a batch of 2e5, ROUTH, EXTENDED")
def sigterm_in_batch(stage: Stage) -> Row:
    node = stage.node(**AMPLE)
    client = stage.client(kinds=("routh batch of 2e5",), requests=1, window=1, patience=20.0)
    stage.start(client)
    client.until("sent")
    time.sleep(3.0)  # until the node has received it and computes
    return _end(node, [client])


# Running --------------------------------------------------------------------------------------


def measure(named: str) -> dict[str, Row]:
    """Run every case whose name contains a word."""
    found = {}
    with with_profile() as variables:
        for name, run in CASES.items():
            if named in name:
                print(f"==> {name} ...", flush=True)
                with Stage(variables, large="batch of" in name) as stage:
                    found[name] = run(stage)
                for what in found[name]["broken"]:
                    print(f"    BROKEN: {what}\n{found[name]['log']}", flush=True)
    return found


def main(arguments: list[str]) -> int:
    """Run all cases or some."""
    parser = argparse.ArgumentParser(prog="make faults", description=__doc__)
    parser.add_argument("word", nargs="?", default="", help="only cases whose name contains this")
    asked = parser.parse_args(arguments)
    found = measure(asked.word)
    broken = [f"{name}: {what}" for name, row in found.items() for what in row["broken"]]
    return results.finish("faults", {"cases": found}, is_whole=not asked.word, broken=broken)
