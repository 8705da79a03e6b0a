"""The picture of the trade: time against true error, a panel for each scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

Point = dict[str, Any]

COLOURS = {
    "FRICTIONLESS": "#0072b2",
    "COULOMB": "#d55e00",
    "MOREAU": "#cc79a7",
    "ROUTH_POISSON": "#009e73",
    "ROUTH_STRONGE": "#222222",
}
MARKERS = {"POINT": "v", "PLANAR": "s", "SPATIAL": "o", "AUTO": "*"}
FLOOR, CEILING = 1e-17, 10.0
WRONG = 0.1
"""Above this error, motion that decides the answer is not modelled."""
BETWEEN = 8.0
"""A contact of a batch takes less, ``resolve()`` more [µs]."""


def microseconds(point: Point) -> float:
    """Of one impact."""
    return point["s"]["median"] * 1e6


def shown_error(point: Point) -> float:
    """Within the picture."""
    return min(max(point["error"], FLOOR), CEILING)


def front(points: Iterable[Point]) -> list[Point]:
    """Those that no other beats in both time and error, fastest first."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (microseconds(p), p["error"])):
        if not best or shown_error(point) < shown_error(best[-1]) / 1.5:
            best.append(point)
    return best


def draw(points: Sequence[Point], path: Path) -> None:
    """All panels, to a file."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    names = list(dict.fromkeys(point["scene"] for point in points))
    figure, grid = plt.subplots(3, 2, figsize=(8, 10.4), sharex=True, sharey=True)
    for axes, name in zip(grid.flat, names, strict=True):
        panel(axes, name, [point for point in points if point["scene"] == name])
    for axes in grid[:, 0]:
        axes.set_ylabel("true relative error of the impulse")
    for axes in grid[-1]:
        axes.set_xlabel("time of one impact [µs]")
    figure.legend(handles=legend(), loc="upper center", ncols=3, frameon=False, fontsize=9, columnspacing=1.2)
    figure.tight_layout(rect=(0, 0, 1, 0.915), h_pad=1.4)
    figure.savefig(path, dpi=200)
    plt.close(figure)


def panel(axes: Axes, name: str, points: Sequence[Point]) -> None:
    """One scene."""
    axes.set(xscale="log", yscale="log", xlim=(5e-3, 1.5e4), ylim=(FLOOR / 5, CEILING * 3))
    axes.set_title(name, loc="left", fontsize=10, fontweight="bold", pad=14)
    axes.axhspan(WRONG, CEILING * 3, color="#ececec", lw=0)
    axes.axvline(BETWEEN, color="#999999", lw=0.8, ls=":")
    beside = {"transform": axes.get_xaxis_transform(), "va": "bottom", "fontsize": 8, "color": "#555555"}
    axes.text(BETWEEN / 1.25, 1.01, "batch", ha="right", **beside)
    axes.text(BETWEEN * 1.25, 1.01, "resolve()", ha="left", **beside)
    axes.grid(True, lw=0.4, color="#e5e5e5")
    for law, colour in COLOURS.items():
        own = [point for point in points if point["law"] == law]
        best = front(own)
        axes.plot(
            [microseconds(p) for p in best], [shown_error(p) for p in best], color=colour, lw=1.1, alpha=0.6,
            drawstyle="steps-post",
        )  # fmt: skip
        for point in own:
            mark(axes, point, colour, is_best=point in best)


def mark(axes: Axes, point: Point, colour: str, *, is_best: bool) -> None:
    """One way to the answer."""
    rough = point["precision"] in ("SINGLE", "float32")
    axes.plot(
        microseconds(point), shown_error(point), MARKERS[point["geometry"]], color=colour,
        markerfacecolor="white" if rough else colour, markeredgewidth=1.0,
        markersize=9 if point["geometry"] == "AUTO" else 6 if is_best else 3.5,
        alpha=1.0 if is_best else 0.45, zorder=3 if is_best else 2,
    )  # fmt: skip


def legend() -> list[Artist]:
    """What the colours and the marks mean."""

    def dot(label: str, marker: str, colour: str = "#555555", face: str | None = None) -> Line2D:
        return Line2D([], [], ls="", marker=marker, color=colour, markerfacecolor=face or colour, label=label)

    laws = [Line2D([], [], color=colour, lw=2.5, label=law) for law, colour in COLOURS.items()]
    return [
        *laws,
        dot("POINT", MARKERS["POINT"]),
        dot("PLANAR", MARKERS["PLANAR"]),
        dot("SPATIAL", MARKERS["SPATIAL"]),
        dot("AUTO, by tolerance", MARKERS["AUTO"]),
        dot("hollow: SINGLE, float32", "o", face="white"),
        dot("filled: all more exact", "o"),
        Patch(color="#dddddd", label="deciding motion not modelled"),
    ]
