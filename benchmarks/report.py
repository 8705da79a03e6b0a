"""The tables of docs/trade-off.md, made from the measurements."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from machine import described
from pages import RESULTS, power, significant, table, times

Results = dict[str, Any]


def parts(results: Results) -> dict[str, str]:
    """The generated parts of the page for which there are results."""
    return {name: part(results) for name, (needs, part) in PARTS.items() if results.get(needs) is not None}


def machine(results: Results) -> str:
    """Date, machine and versions of the measurement."""
    listed = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    took, on = f"{results['seconds'] / 60:.0f} minutes", described(results["machine"])
    lines = [f"Measured on {results['date']} in {took}: {on}; {listed}."]
    lines += [f"* Skipped: {what}: {why}." for what, why in results["skipped"].items()]
    return "\n".join(lines)


def targets(results: Results) -> str:
    """Table of the targets and their measured values, also on machines with other processors."""
    others = {
        f"{other['machine']['processor']}, {other['date']}": {one["what"]: one for one in targets_of(other)}
        for other in latest_of_others(results)
    }
    rows = []
    for target in targets_of(results):
        what, most, least = target["what"], target.get("most"), target.get("least")
        limit = f"≤ {most:g}" if least is None else f"≥ {least:g}"
        elsewhere = [_measured(found[what]) if what in found else "" for found in others.values()]
        rows.append([what, limit, _measured(target, with_range=True), _verdict(target), *elsewhere])
    return table(["what", "target", "measured (min … max)", "verdict", *others], rows)


def targets_of(results: Results) -> Iterator[dict[str, Any]]:
    """The targets of all parts that were measured."""
    for part in ("one", "batch", "package", "service", "scenes"):
        yield from (results.get(part) or {}).get("targets", [])


def latest_of_others(results: Results) -> list[Results]:
    """The stored results with other processors, the latest of each."""
    found: dict[str, Results] = {}
    for path in sorted(RESULTS.glob("20*.json")):
        other = json.loads(path.read_text(encoding="utf-8"))
        found[other["machine"]["processor"]] = other
    found.pop(results["machine"]["processor"], None)
    return list(found.values())


def _measured(target: dict[str, Any], *, with_range: bool = False) -> str:
    value = target["measured"]
    if value is None:
        return ""
    if with_range and isinstance(value, dict):
        return times(value, digits=3)
    middle = significant(_middle(target), 3)
    return f"**{middle}**" if with_range else f"{middle}{'' if _is_met(target) else ', **missed**'}"


def _verdict(target: dict[str, Any]) -> str:
    if target["measured"] is None:
        return "not measured"
    return "met" if _is_met(target) else "**missed**"


def _is_met(target: dict[str, Any]) -> bool:
    middle = _middle(target)
    return middle <= target["most"] if target.get("least") is None else middle >= target["least"]


def _middle(target: dict[str, Any]) -> float:
    value = target["measured"]
    return value["median"] if isinstance(value, dict) else value


def one_impact(results: Results) -> str:
    """Table with a row for each program: its time and error in each scene."""
    import one

    scenes = results["one"]["scenes"]
    rows = []
    for way in one.WAYS:
        if any(way in found for found in scenes.values()):
            row = [way]
            for found in scenes.values():
                measured = found.get(way)
                row += [times(measured["s"], 1e6), power(measured["error"])] if measured else ["", ""]
            rows.append(row)
    head = [heading for scene in scenes for heading in (f"{scene} [µs]", "error")]
    return table(["one frictionless impact", *head], rows)


def requests(results: Results) -> str:
    """Table of times by kind of request."""
    rows = [[what, times(spent, 1e6)] for what, spent in results["one"]["s"].items()]
    return table(["`resolve()`, two turned bodies", "µs"], rows)


def batch(results: Results) -> str:
    """Table of times per contact, by size of the batch."""
    found = results["batch"]["ns"]
    names = list(dict.fromkeys(name for runs in found.values() for name in runs))
    rows = [[name, *(times(runs[name]) if name in runs else "" for runs in found.values())] for name in names]
    return table(["ns per contact", *(f"N = {size}" for size in found)], rows)


def service(results: Results) -> str:
    """Table with a row for each kind of server."""
    found = results["service"]
    rows = []
    for name, what in (("echo", "echo"), ("plain", "the node"), ("recording", "the node, recording")):
        row = [what]
        for kind in ("1 client", "8 clients"):
            spent, quotient = found["s"][f"{name}, {kind}"], found["ratios"].get(f"{name}, {kind}")
            row += [times(spent, 1e6), times(quotient) if quotient else ""]
        rows.append(row)
    head = ["server", "1 client [µs]", "ratio to the echo", "8 clients, per answer [µs]", "ratio to the echo"]
    answered, echoed = (times(found["s"][f"{name}, batch"], 1e3) for name in ("plain", "echo"))
    return (
        f"{table(head, rows)}\n\nThe node's callback alone, without the transport, takes "
        f"{times(found['callback'], 1e6)} µs.\n\nFor a batch of 1e4 contacts in space the node needs "
        f"{answered} ms, the echo {echoed} ms; the ratio is {times(found['ratios']['batch'])}."
    )


def trade_table(results: Results) -> str:
    """Table with a row for each law, precision and tolerance: error and bound in each scene."""
    import trade

    points, rows = results["trade"]["points"], []
    for way in dict.fromkeys(_way(point) for point in points):
        own = {point["scene"]: point for point in points if _way(point) == way}
        spent = [point["s"]["median"] * 1e6 for point in own.values()]
        law, precision, tolerance, by = way
        asked = f" to {power(tolerance)}" if tolerance else ""
        cells = [_error_and_bound(own.get(scene)) for scene in trade.SUITE]
        time = f"{significant(min(spent))} … {significant(max(spent))}"
        rows.append([f"`{law}`", f"`{precision}`{asked}", by, time, *cells])
    above, bounded = results["trade"]["above_bound"], results["trade"]["bounded"]
    words = f"{len(above)} of {bounded} answers of `resolve()` had an error above their bound"
    words += f": {'; '.join(above)}." if above else "."
    return table(["law", "precision", "by", "µs", *trade.SUITE], rows) + f"\n\n{words}"


def _way(point: dict[str, Any]) -> tuple[Any, ...]:
    return point["law"], point["precision"], point["tolerance"], point["by"]


def _error_and_bound(point: dict[str, Any] | None) -> str:
    if point is None:
        return "refused"
    bound = point["bound"]
    return power(point["error"]) + ("" if bound is None else f" ≤ {power(bound)}")


def between_laws(results: Results) -> str:
    """Table of the differences between the laws."""
    found = results["trade"]["between_laws"]
    laws = list(next(iter(found.values())))[:-1]
    rows = [[f"`{law}`", *(power(found[scene][law], least=1e-12) for scene in found)] for law in laws]
    return table(["against `ROUTH_STRONGE`", *found], rows)


PARTS: dict[str, tuple[str, Callable[[Results], str]]] = {
    "machine": ("machine", machine),
    "targets": ("machine", targets),
    "one impact": ("one", one_impact),
    "requests": ("one", requests),
    "batch": ("batch", batch),
    "service": ("service", service),
    "trade": ("trade", trade_table),
    "between laws": ("trade", between_laws),
}
"""The generated parts of the page, each with the name of the results that it needs."""
