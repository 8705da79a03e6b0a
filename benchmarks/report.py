"""The tables of docs/trade-off.md, from what was measured."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import peers
import trade

Results = dict[str, Any]


class Target(NamedTuple):
    """A ratio to be met.

    Attributes:
        what: is compared with what.
        most: the greatest ratio.
        path: to the measured one in the results, key by key.
    """

    what: str
    most: float
    path: tuple[str, ...]


PEERS, BATCH, SERVICE = ("peers", "ratios", "pair"), ("batch", "ratios"), ("service", "ratios")
TARGETS = (
    Target(
        "bare spatial frictionless law with r x n given, against pinocchio with J given",
        1.0,
        (*PEERS, "unrolled, r x n given"),
    ),
    Target("`resolve()` against pinocchio with J built by hand", 2.0, (*PEERS, "resolve")),
    Target(
        "`resolve_batch`, NumPy, spatial float64, N = 1e6, against C", 3.5, (*BATCH, "NumPy / C, N = 1e6")
    ),
    Target("the same against `np.cross` + `solve`", 0.2, (*BATCH, "NumPy / cross and solve, N = 1e6")),
    Target("the same, compiled, against C, N = 1e6", 1.5, (*BATCH, "compiled / C, N = 1e6")),
    Target("the same, compiled, against C, N = 1e3", 1.5, (*BATCH, "compiled / C, N = 1e3")),
    Target("its loop alone against C, N = 1e3", 1.5, (*BATCH, "its loop alone / C, N = 1e3")),
    Target("EXTENDED batch, compiled, against C float64", 10.0, (*BATCH, "EXTENDED compiled / C, N = 1e6")),
    Target("planar against spatial, NumPy", 0.45, (*BATCH, "planar / spatial, NumPy")),
    Target("point mass against spatial, NumPy", 0.25, (*BATCH, "point / spatial, NumPy")),
    Target("service round trip against the echo", 1.15, (*SERVICE, "plain, 1 client")),
    Target("the same, recording", 1.35, (*SERVICE, "recording, 1 client")),
    Target("batch service, 1e4 contacts, against the echo of the same bytes", 1.6, (*SERVICE, "batch")),
    Target(
        "memory of a batch of 1e6 beyond input and output [MiB]",
        64.0,
        (*BATCH, "extra memory at 1e6, NumPy [MiB]"),
    ),
)


def write(results: Results, page: Path) -> None:
    """Replace the generated parts of the page for which there are results."""
    text = page.read_text()
    for name, (part, write_part) in PARTS.items():
        if results.get(part) is not None:
            text = _replaced(text, name, write_part(results))
    page.write_text(text)


def _replaced(text: str, name: str, part: str) -> str:
    pattern = re.compile(rf"(<!-- generated: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"the page has no place for {name!r}")
    return pattern.sub(lambda match: f"{match[1]}\n{part}\n\n{match[2]}", text)


# Parts ----------------------------------------------------------------------------------------


def machine(results: Results) -> str:
    """What the times depend on."""
    m, versions = results["machine"], results["versions"]
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    lines = [
        f"Measured on {results['date']} in {results['seconds'] / 60:.0f} minutes: {m['processor']}, "
        f"{m['cores']} cores, Python {m['python']}; {listed}."
    ]
    lines += [f"* Left out: {what}: {why}." for what, why in results["skipped"].items()]
    return "\n".join(lines)


def targets(results: Results) -> str:
    """Every target with its measured ratio."""
    return _table(["what", "target", "measured (min … max)", ""], target_rows(results))


def target_rows(results: Results) -> list[list[str]]:
    """A row for each target."""
    rows = []
    for target in TARGETS:
        value = _at(results, target.path)
        middle = value["median"] if isinstance(value, dict) else value
        verdict = "not measured" if middle is None else "met" if middle <= target.most else "**missed**"
        rows.append([target.what, f"≤ {target.most:g}", _ratio(value), verdict])
    return rows


def one_impact(results: Results) -> str:
    """A row for each peer, its time and error in each scene."""
    scenes = results["peers"]["scenes"]
    rows = []
    for way in peers.WAYS:
        if not any(way in found for found in scenes.values()):
            continue
        cells = [_time_and_error(scenes[scene].get(way)) for scene in scenes]
        rows.append([way, *(cell for pair in cells for cell in pair)])
    head = [heading for scene in scenes for heading in (f"{scene} [µs]", "error")]
    return _table(["one impact", *head], rows)


def _time_and_error(found: dict[str, Any] | None) -> tuple[str, str]:
    return ("", "") if found is None else (_microseconds(found["s"]), _power(found["error"]))


def batch(results: Results) -> str:
    """Nanoseconds of one contact, by size and by geometry."""
    parts = []
    for title, rows in results["batch"]["ns_per_contact"].items():
        columns = list(dict.fromkeys(column for row in rows.values() for column in row))
        cells = (
            [name, *(_significant(row[column]) if column in row else "" for column in columns)]
            for name, row in rows.items()
        )
        parts.append(_table([f"{title}: ns per contact", *columns], cells))
    return "\n\n".join(parts)


def service(results: Results) -> str:
    """A row for each kind of server."""
    found = results["service"]
    rows = []
    for name, what in (("echo", "echo"), ("plain", "the node"), ("recording", "the node, recording")):
        row = [what]
        for kind in ("1 client", "8 clients"):
            times, quotient = found["s"][f"{name}, {kind}"], found["ratios"].get(f"{name}, {kind}")
            row += [_microseconds(times), _ratio(quotient) if quotient else ""]
        rows.append(row)
    head = ["server", "1 client [µs]", "of the echo", "8 clients, per answer [µs]", "of the echo"]
    alone, quotient = found["callback"]["s"], found["ratios"]["batch"]
    answered, echoed = (_milliseconds(found["s"][f"{name}, batch"]) for name in ("plain", "echo"))
    return (
        _table(head, rows)
        + f"\n\nThe node's callback by itself, without the transport, takes {_microseconds(alone)} µs."
        + f"\n\nA batch of 1e4 contacts in space takes the node {answered} ms, the echo {echoed} ms: "
        f"{_ratio(quotient)} times as long."
    )


def profile_of(where: Callable[[Results], Sequence[Sequence[Any]]]) -> Callable[[Results], str]:
    """A profile as an indented list."""

    def write_part(results: Results) -> str:
        lines = [
            f"{'  ' * depth}{name:<{46 - 2 * depth}} {100 * share:4.0f} % {100 * itself:5.0f} % {calls:7.1f}"
            for depth, name, share, itself, calls in where(results)
        ]
        head = f"{'function':<46} {'share':>6} {'itself':>7} {'calls':>7}"
        return "\n".join(["```text", head, *lines, "```"])

    return write_part


def trade_table(results: Results) -> str:
    """A row for each way, its error in each scene."""
    points = results["trade"]["points"]
    rows = []
    for way in dict.fromkeys(_way(point) for point in points):
        own = {point["scene"]: point for point in points if _way(point) == way}
        times = [point["s"]["median"] * 1e6 for point in own.values()]
        errors = [_power(own[scene]["error"]) if scene in own else "refused" for scene in trade.SUITE]
        law, geometry, precision, tolerance, by = way
        asked = f" to {_power(tolerance)}" if tolerance else ""
        middle = f"{_significant(min(times))} … {_significant(max(times))}"
        rows.append([f"`{law}`", f"`{geometry}`", f"`{precision}`{asked}", by, middle, *errors])
    above, bounded = results["trade"]["above_bound"], results["trade"]["bounded"]
    words = f"{len(above)} of {bounded} answers in `SPATIAL` or `AUTO` had an error above their `error_bound`"
    table = _table(["law", "geometry", "precision", "by", "µs", *trade.SUITE], rows)
    return f"{table}\n\n{words}{': ' + '; '.join(above) if above else ''}."


def _way(point: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(point[field] for field in trade.Way._fields)


def between_laws(results: Results) -> str:
    """How far the laws are apart."""
    found = results["trade"]["between_laws"]
    rows = [
        [f"`{law.name}`", *(_power(found[scene][law.name], least=1e-12) for scene in found)]
        for law in trade.LAWS[:-1]
    ]
    return _table(["against `ROUTH_STRONGE`", *found], rows)


PARTS: dict[str, tuple[str, Callable[[Results], str]]] = {
    "machine": ("machine", machine),
    "targets": ("machine", targets),
    "one impact": ("peers", one_impact),
    "profile of resolve": ("peers", profile_of(lambda results: results["peers"]["profile"])),
    "batch": ("batch", batch),
    "profile of a batch": ("batch", profile_of(lambda results: results["batch"]["profile"])),
    "service": ("service", service),
    "profile of the callback": (
        "service",
        profile_of(lambda results: results["service"]["callback"]["tree"]),
    ),
    "trade": ("trade", trade_table),
    "between laws": ("trade", between_laws),
}
"""The generated parts of the page, and which results each needs."""


# Words ----------------------------------------------------------------------------------------


def _at(value: Any, path: Iterable[str]) -> Any:
    for key in path:
        value = value.get(key) if isinstance(value, dict) else None
    return value


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _microseconds(times: dict[str, float]) -> str:
    return _times(times, 1e6)


def _milliseconds(times: dict[str, float]) -> str:
    return _times(times, 1e3)


def _times(times: dict[str, float], in_a_second: float) -> str:
    least, middle, most = (_significant(times[key] * in_a_second) for key in ("min", "median", "max"))
    return f"**{middle}** ({least} … {most})"


def _ratio(value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, dict):
        return f"**{_significant(value)}**"
    return (
        f"**{_significant(value['median'])}** ({_significant(value['min'])} … {_significant(value['max'])})"
    )


def _significant(value: float) -> str:
    """Two digits, without an exponent."""
    rounded = float(f"{value:.2g}" if value < 100 else f"{value:.3g}")
    return f"{rounded:.0f}" if rounded >= 10 else f"{rounded:g}"


def _power(error: float, least: float = 0.0) -> str:
    """One digit, with an exponent where that is shorter."""
    if error <= least:
        return "0"
    return f"{error:.1g}" if 0.01 <= error < 1 else f"{error:.0f}" if 1 <= error < 100 else _exponent(error)


def _exponent(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
