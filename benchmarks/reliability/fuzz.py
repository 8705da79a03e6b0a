"""Hostile input: unusual values through rclpy, and invalid bytes from another DDS implementation.

Another client sends requests at the same time, and counts.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
from pathlib import Path
from typing import Any

from . import results
from .faults import LONGEST_WAIT, started, steady, stopped
from .processes import Stage, with_profile

SHARES = {"values single": 0.25, "values batch": 0.15} | dict.fromkeys(
    ("values scene", "values states", "raw single", "raw batch", "raw scene", "raw states"), 0.1
)
"""Shares of the messages."""

PACE = 500
"""Raw messages per second."""

MOST_GROWTH = 200.0
"""Largest growth of the memory [MiB], even for a moment."""

READ_ON = "raw single"
"""Part in which Fast DDS reads on after a wrong length and may take what lies in memory there for the length
of a name. How much that name takes for a moment is chance, so only what is kept counts."""

PLAIN_TYPES = (
    "<rtps><propertiesPolicy><properties><property>"
    "<name>fastdds.type_propagation</name><value>disabled</value>"
    "</property></properties></propertiesPolicy>"
)
"""Replaces ``<rtps>`` in a Fast DDS profile, which then accepts bytes from anyone who names the type."""

CYCLONE_DDS = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    '<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers>'
    "</Discovery></Domain></CycloneDDS>"
)
Row = dict[str, Any]


def values(stage: Stage, what: str, number: int, seed: int) -> Row:
    """Send messages with unusual values."""
    node, other = started(stage), steady(stage)
    fuzzer = stage.child("hostile_values", what=what, number=number, seed=seed)
    stage.start(other, fuzzer)
    before = node.usage()
    done = fuzzer.until("done", 540.0)
    return {**_row(node, before, stopped(other), done["asked"] - done["answered"]), **done}


def raw(stage: Stage, what: str, number: int, seed: int) -> Row:
    """Send invalid bytes."""
    node, other = started(stage), steady(stage)
    sender = stage.child("hostile_bytes", what=what, number=number, seed=seed, pace=PACE)
    stage.start(other, sender)
    before = node.usage()
    done = sender.until("done", 540.0)
    return {**_row(node, before, stopped(other), 0), **done, "counts": {}, "faults": {}, "codes": {}}


def _row(node: Any, before: Any, other: Any, unanswered: int) -> Row:
    after = node.usage()
    return {
        "alive": node.is_alive(),
        "unanswered": unanswered + other.unanswered,
        "other": other.asked,
        "latency": other.latency(),
        "before": before and before.memory,
        "after": after and after.memory,
        "peak": after and after.peak,
        "log_lines": node.log().count("\n"),
    }


def broken(name: str, row: Row) -> list[str]:
    """The promises that were broken."""
    wait = row["latency"] and row["latency"]["max"]
    highest = row["after" if name == READ_ON else "peak"]
    is_flat = highest is not None and highest - row["before"] <= MOST_GROWTH
    promises = {
        "the node died": row["alive"],
        f"{row['unanswered']} unanswered": row["unanswered"] == 0,
        f"the other client waited {wait or 0:.2g} s": wait is None or wait <= LONGEST_WAIT,
        f"memory up to {highest or 0:.0f} MiB": is_flat or not row["alive"],
    }
    found = [f"{name}: {what}" for what, holds in promises.items() if not holds]
    return found + [f"{name}: {n} times {kind}" for kind, n in row["counts"].items()]


def measure(number: int, seed: int, word: str) -> dict[str, Row]:
    """Run each part with its share of the messages."""
    has_cyclone = importlib.util.find_spec("cyclonedds") is not None
    if not has_cyclone:
        print("==> skipped: raw bytes, because the package cyclonedds is not installed")
    found = {}
    with with_profile() as variables, tempfile.TemporaryDirectory() as directory:
        profile = Path(directory, "fast_dds.xml")
        usual = Path(variables["FASTDDS_DEFAULT_PROFILES_FILE"])
        profile.write_text(usual.read_text().replace("<rtps>", PLAIN_TYPES))
        variables |= {"FASTDDS_DEFAULT_PROFILES_FILE": str(profile), "CYCLONEDDS_URI": CYCLONE_DDS}
        for name, share in SHARES.items():
            how, what = name.split()
            if word not in name or (how == "raw" and not has_cyclone):
                continue
            print(f"==> {name}, {round(number * share):,} ...", flush=True)
            with Stage(variables) as stage:
                run = raw if how == "raw" else values
                found[name] = run(stage, what, round(number * share), seed)
            for line in broken(name, found[name]):
                print(f"    BROKEN: {line}", flush=True)
            for fault in found[name]["faults"].values():
                print(f"    {fault}", flush=True)
    return found


def main(arguments: list[str]) -> int:
    """Run all parts or some."""
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("word", nargs="?", default="", help="only parts whose name contains this")
    parser.add_argument("--number", type=int, default=100_000, help="total number of messages")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    found = measure(asked.number, asked.seed, asked.word)
    broke = [line for name, row in found.items() for line in broken(name, row)]
    return results.finish("fuzz", {"parts": found}, is_whole=not arguments, broken=broke)
