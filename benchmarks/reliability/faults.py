"""Crowds of clients, clients that leave, stop or read slowly, long requests, and SIGTERM during all of this.

Each case has its own node. The clients count: each knows which requests it has sent.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
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


# Crowds ---------------------------------------------------------------------------------------


def first(stage: Stage) -> Row:
    node = stage.node()
    return row(node, [], others=calls(stage, 60))


def crowd(stage: Stage, clients: int, **order: Any) -> Row:
    """Clients that send requests at the same time."""
    node, crowd = stage.node(), [stage.client(seed=seed, **order) for seed in range(clients)]
    stage.start(*crowd)
    return row(node, [client.report() for client in crowd])


def newcomers(stage: Stage) -> Row:
    node = started(stage)
    return row(node, [stage.child("new_clients", number=60).report()])


def next_to_another(
    stage: Stage, parameters: dict[str, Any] | None = None, wait: float | None = LONGEST_WAIT, **order: Any
) -> Row:
    """A client next to another one, which waits at most some seconds; ``None``: as long as it takes."""
    node, other = started(stage, **parameters or {}), steady(stage)
    client = stage.client(**order)
    stage.start(other, client)
    found = client.report()
    took = found.latency()
    notes = f"the request took {took['max']:.2g} s" if took and found.asked == 1 else ""
    return row(node, [found], others=stopped(other), wait=wait, notes=notes)


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


def leave_at_once(stage: Stage, number: int) -> tuple[int, int]:
    """The same for many clients, one after the other, that leave before the node can see them."""
    with closing(stage.child("leaving_clients", number=number, pause=0.01)) as clients:
        stage.start(clients)
        report = clients.report()
    return report.asked, report.answered


def apart(stage: Stage, fault: Callable[[Stage, int], tuple[int, int]]) -> Row:
    node, other = started(stage), steady(stage)
    stage.start(other)
    apart = fault(stage, 500)
    calls(stage, 500)
    return row(node, [], others=stopped(other), apart=apart)


def stopped_client(stage: Stage, seconds: float) -> Row:
    node, other, found = started(stage), steady(stage), list[Report]()
    stage.start(other)
    apart = stop(stage, 3000, seconds, lambda: found.append(stopped(other)))
    return row(node, [], others=found[0], apart=apart, notes=f"stopped for {seconds:.0f} s or more")


def results_reader(stage: Stage) -> Child:
    """A subscriber of the results."""
    topic = f"{NAMESPACE}/collision_response/result"
    return stage.child("subscriber", topic=topic, type="CollisionResult", reliable=True)


def results_unread(stage: Stage) -> Row:
    node = stage.node()
    subscriber, client = results_reader(stage), stage.client(kinds=SMALL, requests=5000, window=1)
    subscriber.until("ready")
    calls(stage, 10)  # so that it has received something
    subscriber.hold()
    stage.start(client)
    return row(node, [], others=client.report())


# The end --------------------------------------------------------------------------------------


def terminated(stage: Stage, parameters: dict[str, Any], seconds: float, **order: Any) -> Row:
    """SIGTERM some seconds after a client has sent its requests."""
    node, client = stage.node(**parameters), stage.client(**order)
    stage.start(client)
    client.until("sent")
    time.sleep(seconds)  # until the node has received them and computes
    took, code = node.terminate(120.0)
    must = {f"it took {took:.1f} s to exit": took <= LONGEST_EXIT, f"it exited with {code}": code == 0}
    return row(node, [client.report()], must=must, notes=f"exit code {code} after {took:.2g} s")


# Running --------------------------------------------------------------------------------------

LONG = {"requests": 1, "patience": 300.0}
CASES: dict[str, Callable[[Stage], Row]] = {
    "the first requests to a new node": first,
    "a burst of 5000 requests": partial(crowd, clients=1, kinds=MIXED, requests=5000, window=5000),
    "16 client processes, 500 requests each, 50 pending": partial(
        crowd, clients=16, kinds=SMALL, requests=500, window=50
    ),
    "a burst of 5000 requests, and another client": partial(
        next_to_another, kinds=SMALL, requests=5000, window=5000
    ),
    "60 clients that call as soon as they see the service": newcomers,
    "a client leaves with 500 pending": partial(apart, fault=leave),
    "500 clients send a request and leave at once": partial(apart, fault=leave_at_once),
    "a client is killed with 500 pending": partial(apart, fault=kill),
    "a client is stopped for 5 s with 3000 pending": partial(stopped_client, seconds=5.0),
    "a client is stopped for 40 s with 3000 pending": partial(stopped_client, seconds=40.0),
    "a client reads an answer every 5 ms, 2000 pending": partial(
        next_to_another, requests=2000, window=2000, pause=0.005
    ),
    "a subscriber of the results is stopped": results_unread,
    "a scene of 240 contacts": partial(next_to_another, kinds=("stack of 60",), **LONG),
    "a batch of 2e5, SPATIAL, EXTENDED": partial(next_to_another, kinds=("extended batch of 2e5",), **LONG),
    "a batch of 1e6, over the budget": partial(next_to_another, kinds=("extended batch of 1e6",), **LONG),
    # DDS sends answers of up to 130 MB in one piece, and other clients wait for that.
    "a batch of 1e6, POINT, ample budget": partial(
        next_to_another, parameters=AMPLE, wait=None, kinds=("point batch of 1e6",), **LONG
    ),
    "a batch of 1e6, SPATIAL, EXTENDED, ample budget": partial(
        next_to_another, parameters=AMPLE, wait=None, kinds=("extended batch of 1e6",), **LONG
    ),
    "SIGTERM in a burst of 5000": partial(
        terminated, parameters={}, seconds=0.0, kinds=SMALL, requests=5000, window=5000, patience=10.0
    ),
    "SIGTERM in a scene of 240 contacts": partial(
        terminated, parameters={}, seconds=0.1, kinds=("stack of 60",), requests=1, patience=10.0
    ),
    "SIGTERM in a batch of 2e5, ROUTH, EXTENDED": partial(
        terminated, parameters=AMPLE, seconds=3.0, kinds=("routh batch of 2e5",), requests=1, patience=20.0
    ),
}


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
