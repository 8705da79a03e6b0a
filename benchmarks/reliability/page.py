"""The tables of docs/reliability.md, made from the measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from machine import described
from pages import significant, table

from collision_response import StatusCode

Found = dict[str, Any]
REFUSED_FOR_NOW = ("BUDGET_EXCEEDED", "SHUTTING_DOWN")
TIMES = ("median [ms]", "99 % [ms]", "maximum [ms]")


def parts(stored: Mapping[str, Found]) -> dict[str, str]:
    """The generated parts of the page; a part without measurements says so."""
    return {
        name: write(stored[part]) if part in stored else f"Not measured yet: run `make {part}`."
        for part, writers in PARTS.items()
        for name, write in writers.items()
    }


def _measured(found: Found) -> str:
    machine, broken = found["machine"], found["broken"]
    on = described(machine)
    line = (
        f"Measured on {found['date']}: {on}, load average {found['load']:.1f} before. "
        f"Promises broken: {len(broken)}."
    )
    return "\n".join([line, *(f"* {promise}" for promise in broken)])


def milliseconds(seconds: float | None) -> str:
    """A time in milliseconds, with two digits."""
    return "" if seconds is None else significant(seconds * 1e3)


def _spread(spread: dict[str, float] | None) -> list[str]:
    return [milliseconds(spread[name]) for name in ("p50", "p99", "max")] if spread else [""] * 3


def refusals(codes: Mapping[Any, int]) -> dict[str, int]:
    """Number of refusals by the name of their code."""
    named = {StatusCode(int(code)): n for code, n in codes.items()}
    return {code.name: n for code, n in named.items() if not code.is_answer}


# Faults ---------------------------------------------------------------------------------------


def faults(found: Found) -> str:
    """Table with a row for each case."""
    rows = []
    for name, row in found["cases"].items():
        apart = "" if row["apart"] is None else "{1:,} of {0:,}".format(*row["apart"])
        refused = refusals(row["codes"])
        notes = [f"{refused[code]:,} {code}" for code in REFUSED_FOR_NOW if code in refused]
        notes += [row["notes"]] if row["notes"] else []
        rows.append(
            [
                name,
                f"{row['asked']:,}",
                f"{row['asked'] - row['answered']:,}",
                apart,
                *_spread(row["latency"]),
                "" if row["peak"] is None else f"{row['peak']:.0f}",
                "; ".join(notes),
            ]
        )
    return table(["case", "requests", "unanswered", "apart", *TIMES, "peak memory [MiB]", "notes"], rows)


# Hostile input --------------------------------------------------------------------------------


def fuzz(found: Found) -> str:
    """Table with a row for each part."""
    rows = []
    for name, row in found["parts"].items():
        how, what = name.split()
        sender = "values by rclpy" if how == "values" else "bytes by Cyclone DDS"
        faults = sum(row["counts"].values())
        memory = "the node died"
        if row["after"]:
            memory = f"{row['before']:.0f} → {row['after']:.0f}, at most {row['peak']:.0f}"
        numbers = [f"{n:,}" for n in (row["sent"], faults, row["unanswered"], row["other"])]
        rows.append([f"{sender}, `{what}`", *numbers, *_spread(row["latency"]), memory])
    head = ["messages", "sent", "wrong answers", "unanswered", "requests of the other client"]
    return table([*head, *TIMES, "memory [MiB]"], rows)


# Soak -----------------------------------------------------------------------------------------


def soak(found: Found) -> str:
    """Table with a row for each kind of client."""
    rows = []
    for name, row in found["clients"].items():
        refused = ", ".join(f"{n:,} {code}" for code, n in refusals(row["codes"]).items())
        left = row["asked"] - row["answered"]
        numbers = [f"{number:,}" for number in (row["asked"], row["answered"], left)]
        rows.append([name, *numbers, refused, *_spread(row["latency"])])
    for name, (asked, answered) in found["apart"].items():
        rows.append([f"apart: {name}", f"{asked:,}", f"{answered:,}", "", "", "", "", ""])
    head = ["clients", "requests", "answered", "unanswered", "refusals among the answers"]
    seconds, code = found["exit"]
    slope = (
        "" if found["slope"] is None else f" Memory in the second half: {found['slope']:+.1f} MiB per hour."
    )
    return (
        f"{table([*head, *TIMES], rows)}\n\n"
        f"{found['minutes']:.1f} minutes, {found['faults']} faults, {found['states']:,} body states, "
        f"{found['log_lines']:,} log lines.{slope} SIGTERM at the end: exit code {code} after "
        f"{significant(seconds)} s."
    )


def over_time(found: Found) -> str:
    """Table with a row for each interval of time."""
    rows = [
        [
            f"{row['minutes']:.1f}",
            significant(row["answers"] / row["seconds"], 3),
            *_spread(row["latency"]),
            f"{row['memory']:.1f}",
            f"{row['descriptors']:.0f}",
            f"{row['threads']:.0f}",
        ]
        for row in found["over time"]
    ]
    head = ["until minute", "answers per second", *TIMES, "memory [MiB]", "descriptors", "threads"]
    return table(head, rows)


# States ---------------------------------------------------------------------------------------


def states(found: Found) -> str:
    """Table with a row for each rate."""
    rows = []
    for row in found["rows"]:
        node, bare = row["node"], row["bare"]
        numbers = [
            significant(one[key], 3) for one, key in ((node, "offered"), (node, "heard"), (bare, "heard"))
        ]
        said = node["said lost"]
        rows.append(
            [
                f"`{row['type']}`",
                *numbers,
                f"{100 * node['lost']:.1f} %",
                "" if said is None else f"{int(said):,}",
                *_spread(node["latency"]),
            ]
        )
    head = ["type", "sent per second", "received by the node", "by a bare subscription", "lost by the node"]
    head += ["losses that the node counted", *TIMES]
    return table(head, rows)


def capacity(found: Found) -> str:
    """Table with a row for each rate, and the largest rates."""
    rows = []
    for row in found["capacity"]:
        node, bare = row["node"], row["bare"]
        offered = min(node["offered"], bare["offered"])
        rows.append(
            [
                significant(offered, 3),
                *(significant(one["heard"], 3) for one in (node, bare)),
                *(significant(one["processor"] * 1e6) for one in (node, bare)),
            ]
        )
    head = ["sent per second", "received by the node", "by a bare subscription"]
    head += ["processor time per state [µs], node", "subscription"]
    node, bare = found["most"]["node"], found["most"]["bare"]
    return (
        f"{table(head, rows)}\n\nThe node received at most {significant(node, 3)} `BodyState` per second, "
        f"the bare subscription {significant(bare, 3)}: {significant(node / bare)} times as many."
    )


# Tests ----------------------------------------------------------------------------------------


def twice(found: Found) -> str:
    """A sentence about the rounds."""
    seconds = sorted(found["seconds"])
    return (
        f"{len(seconds)} times two suites at once: {len(found['failed'])} failed. "
        f"Each round took {seconds[0]:.0f} to {seconds[-1]:.0f} s."
    )


PARTS: dict[str, dict[str, Callable[[Found], str]]] = {
    "faults": {"faults measured": _measured, "faults": faults},
    "fuzz": {"fuzz measured": _measured, "fuzz": fuzz},
    "states": {"states measured": _measured, "states": states, "capacity": capacity},
    "soak": {"soak measured": _measured, "soak": soak, "over time": over_time},
    "twice": {"twice measured": _measured, "twice": twice},
}
"""The generated parts of the page, by the program that measures them."""
