"""The tables and pictures of docs/stability.md, from what was measured."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

TIERS = ("SINGLE", "DOUBLE", "EXTENDED")
LOW, HIGH = 1e-18, 30.0
"""Where an error of 0 and an infinite bound are drawn."""

ERROR, BOUND, INK, GREY = "#2a7f9e", "#d95f02", "#222222", "#8a8a8a"
DRIFT_COLOURS = {"float32": "#8c564b", "SINGLE": "#d95f02", "DOUBLE": "#6a3d9a", "EXTENDED": "#2a7f9e"}
STYLE = {
    "font.size": 8,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def write(results: dict[str, Any], template: Path, docs: Path) -> None:
    """The page with its generated parts replaced, and its pictures."""
    text = template.read_text()
    for name, part in PARTS.items():
        text = _replaced(text, name, part(results))
    images = docs / "images"
    images.mkdir(parents=True, exist_ok=True)
    (docs / template.name).write_text(text)
    with plt.rc_context(STYLE):
        _draw_conditions(results["conditions"], images / "stability-condition.png")
        _draw_drift(results["drift"], images / "stability-drift.png")


def _replaced(text: str, name: str, part: str) -> str:
    pattern = re.compile(rf"(<!-- generated: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        raise ValueError(f"the page has no place for {name!r}")
    return pattern.sub(lambda match: f"{match[1]}\n{part}\n\n{match[2]}", text)


def _machine(results: dict[str, Any]) -> str:
    m = results["machine"]
    return (
        f"Measured on {results['date']} in {results['seconds'] / 60:.0f} minutes: {m['processor']}, "
        f"Python {m['python']}, NumPy {m['numpy']}, python-flint {m['python-flint']}. "
        "All times are medians of calls of `resolve` from Python."
    )


def _random(results: dict[str, Any]) -> str:
    found = results["random"]
    rows = []
    for tier in (*TIERS, "AUTO"):
        counts = found["counts"][tier]
        refused = sum(count for outcome, count in counts.items() if outcome.startswith("refused"))
        violations = sum(violation["tier"] == tier for violation in found["violations"])
        tightest = found["tightest"].get(tier)
        rows.append([
            f"`{tier}`" + (", nearly planar, with a tolerance" if tier == "AUTO" else ""),
            f"{counts['asked']:,}",
            f"{counts['with a bound']:,}",
            f"{counts['answered'] - counts['with a bound']:,}",
            f"{refused:,}",
            f"**{violations}**",
            f"{tightest:.2g}" if tightest else "no error above an ulp",
        ])  # fmt: skip
    head = [
        "tier",
        "impacts",
        "with a bound",
        "no bound",
        "refused",
        "above the bound",
        "closest: bound / error",
    ]
    return _table(head, rows)


def _extremes(law: str) -> Callable[[dict[str, Any]], str]:
    def table(results: dict[str, Any]) -> str:
        rows = [
            [
                _code(row["extreme"]),
                *(_cell(row["answers"][tier]) for tier in TIERS),
                _default(row["answers"]["AUTO"]),
            ]
            for row in results["extremes"]
            if row["law"] == law
        ]
        return _table(["extreme", *(f"`{tier}`" for tier in TIERS), "default"], rows)

    return table


def _cell(answer: dict[str, Any]) -> str:
    if "refused" in answer:
        return f"`{answer['refused']}`"
    bound = "no bound" if answer["bound"] is None else f"≤ {_power(answer['bound'])}"
    return f"{_power(answer['error'])} {bound}, {_time(answer['microseconds'])}"


def _default(answer: dict[str, Any]) -> str:
    return f"`{answer.get('refused') or answer['tier']}`"


def _drift(results: dict[str, Any]) -> str:
    rows = [
        [f"`{tier}`" if tier in TIERS else tier, f"{last['impacts']:,}"]
        + [_power(last[key]) for key in ("energy", "momentum", "angular momentum")]
        for tier, last in ((tier, results["drift"][tier][-1]) for tier in DRIFT_COLOURS)
    ]
    return _table(["velocities computed by", "impacts", "energy", "momentum", "angular momentum"], rows)


def _cost(results: dict[str, Any]) -> str:
    rows = [
        [
            f"`{row['geometry']}`, `{row['law']}`",
            _time(row["impact"]),
            _time(row["whole"] - row["impact"]),
            f"{100 * (row['whole'] / row['impact'] - 1):.0f} %",
        ]
        for row in results["cost"]
    ]
    return _table(["`DOUBLE`", "impact", "its bound", "bound / impact"], rows)


def _tolerances(results: dict[str, Any]) -> str:
    rows = [
        [
            _power(row["tolerance"]),
            f"`{row['tier']}`",
            _time(row["microseconds"]),
            _power(row["bound"]),
            _power(row["error"]),
            f"`{row['status']}`",
        ]
        for row in results["tolerances"]
    ]
    return _table(["tolerance", "tier", "time", "`error_bound`", "true error", "status"], rows)


def _arithmetics(results: dict[str, Any]) -> str:
    labels = list(results["arithmetics"][0]["errors"])
    rows = [
        [
            row["arithmetic"],
            _time(row["microseconds"]),
            *(_power(row["errors"][label]) for label in labels),
        ]
        for row in results["arithmetics"]
    ]
    return _table(["arithmetic", "time", *(f"error, {label}" for label in labels)], rows)


PARTS: dict[str, Callable[[dict[str, Any]], str]] = {
    "machine": _machine,
    "random": _random,
    "extremes FRICTIONLESS": _extremes("FRICTIONLESS"),
    "extremes COULOMB": _extremes("COULOMB"),
    "drift": _drift,
    "cost": _cost,
    "tolerances": _tolerances,
    "arithmetics": _arithmetics,
}


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _code(name: str) -> str:
    return name.replace("|u_n|/|u|", "`u_n / u`")


def _power(x: float) -> str:
    return "0" if x == 0 else f"{x:.0e}".replace("e-0", "e-").replace("e+0", "e")


def _time(microseconds: float) -> str:
    return f"{microseconds / 1000:.1f} ms" if microseconds >= 1000 else f"{microseconds:.0f} µs"


def _draw_conditions(conditions: dict[str, list[dict[str, Any]]], path: Path) -> None:
    titles = {
        "grazing": "grazing: slip / approach speed",
        "inertia": "slender body: greatest / least moment",
    }
    figure, axes = plt.subplots(2, 3, figsize=(8, 5.2), sharex=True, sharey=True, layout="constrained")
    for row, (kind, title) in zip(axes, titles.items(), strict=True):
        for ax, tier in zip(row, TIERS, strict=True):
            _draw_condition(ax, conditions[kind], tier)
            ax.set_xlabel(title)
        row[0].set_ylabel("relative error")
    for ax, tier in zip(axes[0], TIERS, strict=True):
        ax.set_title(tier, fontsize=9, color=INK)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, markerscale=3)
    figure.savefig(path, dpi=200)
    plt.close(figure)


def _draw_condition(ax: Axes, samples: list[dict[str, Any]], tier: str) -> None:
    x = [sample["condition"] for sample in samples]
    errors = [max(sample[tier][0], LOW) for sample in samples]
    bounds = [HIGH if sample[tier][1] is None else sample[tier][1] for sample in samples]
    ax.scatter(x, bounds, s=4, color=BOUND, alpha=0.6, linewidths=0, label="error_bound of each impact")
    ax.scatter(x, errors, s=4, color=ERROR, alpha=0.6, linewidths=0, label="its true error")
    edges, least = _lower_envelope([(a, b) for a, b in zip(x, bounds, strict=True) if b < HIGH])
    ax.plot(edges, least, color=BOUND, linewidth=1.2, label="least bound hereabouts")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(LOW / 2, 300)
    ax.set_yticks(
        [LOW, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1, HIGH],
        ["0", "1e-15", "1e-12", "1e-9", "1e-6", "1e-3", "1", "none"],
    )
    ax.minorticks_off()
    ax.set_xticks([1, 1e5, 1e10, 1e15], ["1", "1e5", "1e10", "1e15"])
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)


def _lower_envelope(points: Iterable[tuple[float, float]]) -> tuple[list[float], list[float]]:
    """The least ordinate in each half decade of the abscissa."""
    least: dict[int, float] = {}
    for a, b in points:
        place = math.floor(2 * math.log10(a))
        least[place] = min(b, least.get(place, math.inf))
    places = sorted(least)
    return [10 ** ((place + 0.5) / 2) for place in places], [least[place] for place in places]


def _draw_drift(drifts: dict[str, list[dict[str, float]]], path: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(8, 2.9), sharex=True, sharey=True, layout="constrained")
    for ax, quantity in zip(axes, ("energy", "momentum", "angular momentum"), strict=True):
        for tier, colour in DRIFT_COLOURS.items():
            rows = [row for row in drifts[tier] if row[quantity] > 0]
            ax.plot(
                [row["impacts"] for row in rows],
                [row[quantity] for row in rows],
                color=colour,
                linewidth=1.4,
                linestyle="--" if tier == "SINGLE" else "-",
                label=tier,
            )
        ax.set_title(quantity, fontsize=9, color=INK)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("elastic impacts")
        ax.grid(color="#e6e6e6", linewidth=0.6)
    axes[0].set_ylabel("relative drift")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=200)
    plt.close(figure)
