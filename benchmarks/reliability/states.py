"""States at a rate: how many the node takes in, against a bare subscription of rclpy, and how it serves.

Every state is of another body. Afterwards each is asked for by name: one that is not known was lost. Of
tables, each of which takes the place of the one before, the node's own count has to do.
"""

from __future__ import annotations

import argparse
from typing import Any

from . import results
from .child import NAMESPACE
from .faults import LONGEST_WAIT, started, steady, stopped
from .processes import Environment, Process, Stage
from .publisher import TABLE

KINDS = {
    "BodyState": (f"{NAMESPACE}/body_states", (2_000, 5_000, 10_000, 20_000)),
    "BodyStates": (f"{NAMESPACE}/all_body_states", (20_000, 100_000)),
}
"""Topic, and states offered a second, by type."""

CAPACITY_RATES = (2_000, 10_000, 20_000, 40_000, 80_000)
"""States offered a second, when the node has nothing else to do."""

MOST = 20_000
"""States a second of one publisher; more are offered by several."""

SECONDS = 4.0
GOAL = 5.0
"""Times as many as the bare subscription takes in."""

Row = dict[str, Any]


def by_the_node(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """What the node has heard of, and how its service did."""
    number = int(rate * seconds)
    node = started(stage, max_bodies=2 * number)
    other, publishers = steady(stage), _publishers(stage, kind, rate, number)
    stage.start(other, *publishers)
    sent = _sent(publishers)
    found = stopped(other)
    values = stage.child("look").until("found")
    # A table takes the place of the one before it: what was heard only the node can tell.
    known = int(values["states"]) * TABLE if kind == "BodyStates" else _known(stage, sent["states"])
    return {
        **_row(sent, known),
        "alive": node.is_alive(),
        "unanswered": found.unanswered,
        "latency": found.latencies.spread(),
        "said lost": values.get("states lost on the way"),
    }


def by_a_subscription(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """What a bare subscription has heard of, and the processor time of each [s]."""
    listener = stage.child("listener", topic=KINDS[kind][0], type=kind, reliable=False)
    publishers = _publishers(stage, kind, rate, int(rate * seconds))
    listener.until("ready")
    sent, processor = _sent_to(listener, stage, publishers)
    listener.tell("stop")
    heard = listener.until("heard")["names"]
    return {**_row(sent, heard), "processor": processor / heard}


def by_the_node_alone(stage: Stage, kind: str, rate: int, seconds: float) -> Row:
    """The same of a node that nobody asks for anything meanwhile."""
    number = int(rate * seconds)
    node = started(stage, max_bodies=2 * number)
    sent, processor = _sent_to(node, stage, _publishers(stage, kind, rate, number))
    heard = _known(stage, sent["states"])
    return {**_row(sent, heard), "processor": processor / heard}


def _sent_to(process: Process, stage: Stage, publishers: list[Any]) -> tuple[dict[str, Any], float]:
    """What was sent, and the processor time [s] that a process took meanwhile."""
    before = process.usage()
    stage.start(*publishers)
    sent = _sent(publishers)
    after = process.usage()
    if before is None or after is None:
        raise ChildProcessError("it has ended")
    return sent, after.processor_seconds - before.processor_seconds


def _known(stage: Stage, bodies: int) -> int:
    return stage.child("known", bodies=bodies).until("known", 300.0)


def _publishers(stage: Stage, kind: str, rate: int, number: int) -> list[Any]:
    """As many as it takes, so that they are not what is measured."""
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


def _capacity(environment: Environment, seconds: float) -> list[Row]:
    """Of each rate that may be too much, what the node and a bare subscription take in."""
    rows = []
    for rate in CAPACITY_RATES:
        print(f"==> {rate:,} a second, nothing else ...", flush=True)
        row: Row = {"rate": rate}
        for who, run in (("node", by_the_node_alone), ("bare", by_a_subscription)):
            with Stage(environment) as stage:
                row[who] = run(stage, "BodyState", rate, seconds)
        rows.append(row)
    return rows


def measure(seconds: float) -> dict[str, Any]:
    """Each rate, by the node and by a bare subscription, one after the other."""
    rows = []
    with Environment() as environment:
        for kind, (_, rates) in KINDS.items():
            for rate in rates:
                print(f"==> {rate:,} a second, {kind} ...", flush=True)
                row = {"type": kind, "rate": rate}
                for who, run in (("node", by_the_node), ("bare", by_a_subscription)):
                    with Stage(environment) as stage:
                        row[who] = run(stage, kind, rate, seconds)
                rows.append(row)
        capacity = _capacity(environment, seconds)
    most = {who: max(row[who]["heard"] for row in capacity) for who in ("node", "bare")}
    return {"rows": rows, "capacity": capacity, "most": most}


def broken(found: dict[str, Any]) -> list[str]:
    """The promises that were."""
    times = found["most"]["node"] / found["most"]["bare"]
    promises = {f"{times:.1f} times the bare subscription; the goal is {GOAL:g}": times >= GOAL}
    for row in found["rows"]:
        node, what = row["node"], f"{row['rate']:,} {row['type']} a second"
        promises[f"{what}: the node died"] = node["alive"]
        promises[f"{what}: {node['unanswered']} unanswered"] = node["unanswered"] == 0
        wait = node["latency"] and node["latency"]["max"]
        promises[f"{what}: another waited {wait or 0:.2g} s"] = wait is None or wait <= LONGEST_WAIT
    return [what for what, holds in promises.items() if not holds]


def main(arguments: list[str]) -> int:
    """All rates."""
    parser = argparse.ArgumentParser(prog="make states", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each rate")
    found = measure(parser.parse_args(arguments).seconds)
    return results.finish("states", found, is_whole=not arguments, broken=broken(found))
