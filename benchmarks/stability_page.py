"""The tables and pictures of docs/stability.md, made from the measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from figures import GREY, INK, plt, save
from matplotlib.axes import Axes
from pages import DOCS, RESULTS, power, rewrite, significant, store, table

LOW, HIGH = 1e-18, 30.0
"""Where the plots show an error of 0 and an infinite bound."""

ERROR, BOUND = "#2a7f9e", "#d95f02"
PRECISIONS = ("SINGLE", "DOUBLE", "EXTENDED")
DRIFT_COLOURS = {"SINGLE": "#d95f02", "DOUBLE": "#6a3d9a", "EXTENDED": "#2a7f9e"}
ANSWERS = ("OK", "SEPARATING", "TOLERANCE_NOT_MET")
WILDNESS = ("usual", "1e±3", "1e±10", "1e±30", "1e±150")
OTHER = (*ANSWERS, "asked", "bounded")


def write(results: dict[str, Any]) -> None:
    """Write the results, the tables and the pictures."""
    kept = {key: value for key, value in results.items() if key != "conditions"}
    store(kept, RESULTS / f"stability-{results['date']}.json")
    rewrite(DOCS / "stability.md", {name: part(results) for name, part in PARTS.items()})
    with plt.rc_context({"font.size": 8, "axes.edgecolor": GREY}):
        draw_conditions(results["conditions"])
        draw_drift(results["drift"])
    print("==> wrote docs/stability.md")


def _summary(results: dict[str, Any]) -> str:
    statuses = [row["statuses"] for row in results["rows"]]
    asked, bounded = (sum(one.get(name, 0) for one in statuses) for name in ("asked", "bounded"))
    above, took = len(results["violations"]), f"{results['seconds'] / 60:.0f} minutes"
    return (
        f"Measured on {results['date']} in {took}: {asked:,} requests, {bounded:,} answers with a "
        f"finite bound, {above} of them off by more than that."
    )


def _random(results: dict[str, Any]) -> str:
    rows = []
    for law in ("FRICTIONLESS", "COULOMB", "MOREAU", "ROUTH_POISSON", "ROUTH_STRONGE"):
        found = {tuple(row["key"][2:]): row for row in results["rows"] if row["key"][:2] == ["random", law]}
        for wildness in WILDNESS:
            if (wildness, "AUTO") not in found:
                continue
            own = [found[wildness, precision] for precision in (*PRECISIONS, "AUTO")]
            rows.append([
                f"`{law}`",
                wildness,
                f"{own[0]['statuses']['asked']:,}",
                *(_share(row) for row in own),
                *("" if row["looseness"] is None else significant(row["looseness"]) for row in own[1:2]),
                _worst(max(row["worst"] for row in own)),
                f"**{sum(row['violations'] for row in own)}**",
            ])  # fmt: skip
    head = ["law", "magnitudes", "impacts", *(f"bounded, `{p}`" for p in PRECISIONS), "by default",
            "bound / error, `DOUBLE`", "worst error / bound", "violations"]  # fmt: skip
    return table(head, rows)


def _share(row: dict[str, Any]) -> str:
    """Share of the impacts whose answer has a finite bound."""
    share = row["statuses"].get("bounded", 0) / row["statuses"]["asked"]
    return "all" if share == 1 else f"{100 * share:.3g} %" if share < 0.9995 else f"{100 * share:.2f} %"


def _worst(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio else ""


def _attacks(results: dict[str, Any]) -> str:
    import attacks

    rows = []
    for row in results["rows"]:
        if row["key"][0] == "attack":
            statuses = row["statuses"]
            refused = [f"{count} `{name}`" for name, count in sorted(statuses.items()) if name not in OTHER]
            rows.append([
                _described(row["key"][1], attacks.FAMILIES[row["key"][1]]),
                str(statuses["asked"]),
                *(str(statuses.get(name, "")) for name in ANSWERS),
                ", ".join(refused),
                _worst(row["worst"]),
                f"**{row['violations']}**",
            ])  # fmt: skip
    head = [
        "family",
        "cases",
        *(f"`{name}`" for name in ANSWERS),
        "refused",
        "worst error / bound",
        "violations",
    ]
    return table(head, rows)


def _described(family: str, cases: Callable[[], Any]) -> str:
    """The name of a family of attacks, and the first sentence about it."""
    sentence = " ".join((cases.__doc__ or "").split()).partition(". ")[0].rstrip(".")
    return f"**{family}**. {sentence}"


def _drift(results: dict[str, Any]) -> str:
    rows = [
        [f"`{precision}`", f"{last['impacts']:,}"]
        + [power(last[key]) for key in ("energy", "momentum", "angular momentum")]
        for precision, last in ((precision, results["drift"][precision][-1]) for precision in PRECISIONS)
    ]
    return table(["precision", "impacts", "energy", "momentum", "angular momentum"], rows)


PARTS: dict[str, Callable[[dict[str, Any]], str]] = {
    "summary": _summary,
    "random": _random,
    "attacks": _attacks,
    "drift": _drift,
}


def draw_conditions(conditions: dict[str, list[dict[str, Any]]]) -> None:
    """Plot true errors and bounds, with a row for each ill condition and a column for each precision."""
    titles = {
        "grazing": "grazing: slip / approach speed",
        "inertia": "slender body: largest / smallest moment",
    }
    figure, axes = plt.subplots(2, 3, figsize=(8, 5.2), sharex=True, sharey=True, layout="constrained")
    for row, (kind, title) in zip(axes, titles.items(), strict=True):
        for ax, precision in zip(row, PRECISIONS, strict=True):
            _draw_condition(ax, conditions[kind], precision)
            ax.set_xlabel(title)
        row[0].set_ylabel("relative error")
    for ax, precision in zip(axes[0], PRECISIONS, strict=True):
        ax.set_title(precision, fontsize=9, color=INK)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, markerscale=3)
    save(figure, "stability-condition.png", dpi=200)


def _draw_condition(ax: Axes, samples: list[dict[str, Any]], precision: str) -> None:
    x = [sample["condition"] for sample in samples]
    errors = [max(sample[precision][0], LOW) for sample in samples]
    bounds = [HIGH if sample[precision][1] is None else sample[precision][1] for sample in samples]
    ax.scatter(x, bounds, s=4, color=BOUND, alpha=0.6, linewidths=0, label="error_bound of each impact")
    ax.scatter(x, errors, s=4, color=ERROR, alpha=0.6, linewidths=0, label="its true error")
    edges, least = _lower_envelope([(a, b) for a, b in zip(x, bounds, strict=True) if b < HIGH])
    ax.plot(edges, least, color=BOUND, linewidth=1.2, label="smallest bound nearby")
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
    """Minimum of the ordinates in each half decade of the abscissa."""
    least: dict[int, float] = {}
    for a, b in points:
        place = math.floor(2 * math.log10(a))
        least[place] = min(b, least.get(place, math.inf))
    places = sorted(least)
    return [10 ** ((place + 0.5) / 2) for place in places], [least[place] for place in places]


def draw_drift(drifts: dict[str, list[dict[str, float]]]) -> None:
    """Plot the drift of what elastic impacts should conserve, against their number."""
    figure, axes = plt.subplots(1, 3, figsize=(8, 2.9), sharex=True, sharey=True, layout="constrained")
    for ax, quantity in zip(axes, ("energy", "momentum", "angular momentum"), strict=True):
        for precision, colour in DRIFT_COLOURS.items():
            rows = [row for row in drifts[precision] if row[quantity] > 0]
            numbers, found = [row["impacts"] for row in rows], [row[quantity] for row in rows]
            ax.plot(numbers, found, color=colour, linewidth=1.4, label=precision)
        ax.set_title(quantity, fontsize=9, color=INK)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("elastic impacts")
        ax.grid(color="#e6e6e6", linewidth=0.6)
    axes[0].set_ylabel("relative drift")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    save(figure, "stability-drift.png", dpi=200)
