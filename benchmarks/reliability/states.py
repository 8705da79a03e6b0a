"""Body states at a given rate: how many the node receives, compared with a bare rclpy subscription.

It also measures how fast the node answers requests meanwhile.

Every state belongs to a different body. Afterwards the node is asked for each body by name; a body that it
does not know was lost. A table replaces the previous one, so for tables the node's own count is used.
"""

from __future__ import annotations

import argparse
from typing import Any

from . import results
from .child_process import NAMESPACE
from .faults import LONGEST_WAIT, started, steady, stopped
from .processes import Process, Stage, with_profile
from .publisher import TABLE

KINDS = {
    "BodyState": (f"{NAMESPACE}/body_states", (2_000, 5_000, 10_000, 20_000)),
    "BodyStates": (f"{NAMESPACE}/all_body_states", (20_000, 100_000)),
}
"""Topic, and states sent per second, by type."""

CAPACITY_RATES = (2_000, 10_000, 20_000, 40_000, 80_000)
"""States sent per second when the node has nothing else to do."""

MOST = 20_000
"""Largest number of states per second of one publisher; higher rates use several."""

SECONDS = 4.0
GOAL = 5.0
"""Target for the rate of the node divided by that of the bare subscription."""

Row = dict[str, Any]


def by_the_node(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """Number of states that the node received, and response times of its service."""
    number = int(rate * seconds)
    node = started(stage, max_bodies=2 * number)
    other, publishers = steady(stage), _publishers(stage, kind, rate, number)
    stage.start(other, *publishers)
    sent = _sent(publishers)
    found = stopped(other)
    # A table replaces the previous one: only the node knows how many it received.
    known = None if kind == "BodyStates" else _known(stage, sent["states"])
    values = stage.child("diagnostics").until("found")  # after all states have been read
    return {
        **_row(sent, int(values["states"]) * TABLE if known is None else known),
        "alive": node.is_alive(),
        "unanswered": found.unanswered,
        "latency": found.latency(),
        "said lost": values.get("states lost on the way"),
    }


def by_a_subscription(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """Number of states that a bare subscription received, and processor time per state [s]."""
    subscriber = stage.child("subscriber", topic=KINDS[kind][0], type=kind, reliable=False)
    publishers = _publishers(stage, kind, rate, int(rate * seconds))
    subscriber.until("ready")
    sent, processor = _sent_to(subscriber, stage, publishers)
    subscriber.tell("stop")
    heard = subscriber.until("heard")
    return {**_row(sent, heard), "processor": processor / heard}


def by_the_node_alone(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """The same for a node that gets no requests meanwhile."""
    number = int(rate * seconds)
    node = started(stage, max_bodies=2 * number)
    sent, processor = _sent_to(node, stage, _publishers(stage, kind, rate, number))
    heard = _known(stage, sent["states"])
    return {**_row(sent, heard), "processor": processor / heard}


def _sent_to(process: Process, stage: Stage, publishers: list[Any]) -> tuple[dict[str, Any], float]:
    """Counts of what was sent, and the processor time [s] of a process meanwhile."""
    before = process.usage()
    stage.start(*publishers)
    sent = _sent(publishers)
    after = process.usage()
    if before is None or after is None:
        raise ChildProcessError("the receiving process has ended")
    return sent, after.processor_seconds - before.processor_seconds


def _known(stage: Stage, bodies: int) -> int:
    return stage.child("known_bodies", bodies=bodies).until("known", 300.0)


def _publishers(stage: Stage, kind: str, rate: int, number: int) -> list[Any]:
    """Enough publishers that they do not limit the rate."""
    several = -(-rate // MOST) if kind == "BodyState" else 1
    return [
        stage.child(
            "publisher",
            type=kind,
            topic=KINDS[kind][0],
            rate=rate // several,
            first=first * (number // several),
            bodies=number // several,
            number=number // several,
        )
        for first in range(several)
    ]


def _sent(publishers: list[Any]) -> dict[str, Any]:
    sent = [publisher.until("sent", 120.0) for publisher in publishers]
    return {"states": sum(one["states"] for one in sent), "seconds": max(one["seconds"] for one in sent)}


def _row(sent: dict[str, Any], heard: int) -> Row:
    states, seconds = sent["states"], sent["seconds"]
    return {"offered": states / seconds, "heard": heard / seconds, "lost": 1 - heard / states}


def _capacity(variables: dict[str, str], seconds: float) -> list[Row]:
    """For each rate, the states received by the node and by a bare subscription."""
    rows = []
    for rate in CAPACITY_RATES:
        print(f"==> {rate:,} per second, no requests ...", flush=True)
        row: Row = {"rate": rate}
        for who, run in (("node", by_the_node_alone), ("bare", by_a_subscription)):
            with Stage(variables) as stage:
                row[who] = run(stage, "BodyState", rate, seconds)
        rows.append(row)
    return rows


def measure(seconds: float) -> dict[str, Any]:
    """Measure each rate, first with the node, then with a bare subscription."""
    rows = []
    with with_profile() as variables:
        for kind, (_, rates) in KINDS.items():
            for rate in rates:
                print(f"==> {rate:,} per second, {kind} ...", flush=True)
                row = {"type": kind, "rate": rate}
                for who, run in (("node", by_the_node), ("bare", by_a_subscription)):
                    with Stage(variables) as stage:
                        row[who] = run(stage, kind, rate, seconds)
                rows.append(row)
        capacity = _capacity(variables, seconds)
    most = {who: max(row[who]["heard"] for row in capacity) for who in ("node", "bare")}
    return {"rows": rows, "capacity": capacity, "most": most}


def broken(found: dict[str, Any]) -> list[str]:
    """The promises that were broken."""
    times = found["most"]["node"] / found["most"]["bare"]
    promises = {f"{times:.1f} times the bare subscription; the goal is {GOAL:g}": times >= GOAL}
    for row in found["rows"]:
        node, what = row["node"], f"{row['rate']:,} {row['type']} per second"
        promises[f"{what}: the node died"] = node["alive"]
        promises[f"{what}: {node['unanswered']} unanswered"] = node["unanswered"] == 0
        wait = node["latency"] and node["latency"]["max"]
        promises[f"{what}: the other client waited {wait or 0:.2g} s"] = wait is None or wait <= LONGEST_WAIT
    return [what for what, holds in promises.items() if not holds]


def main(arguments: list[str]) -> int:
    """Measure all rates."""
    parser = argparse.ArgumentParser(prog="make states", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="duration of each rate")
    found = measure(parser.parse_args(arguments).seconds)
    return results.finish("states", found, is_whole=not arguments, broken=broken(found))
