"""The plot of time against true error, for an easy impact and for two hard ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from figures import plt, save
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

Point = dict[str, Any]

ONE, BATCH, PEER, EXACT = "#0072b2", "#009e73", "#d55e00", "#777777"
STYLES = {  # marker, size, colour, filled
    "DOUBLE": ("o", 9, ONE, True),
    "EXTENDED": ("*", 15, ONE, True),
    "batch": ("o", 7, BATCH, False),
    "batch, with bound": ("o", 8, BATCH, True),
    "batch, EXTENDED": ("*", 13, BATCH, True),
}
NAMES = {
    "pinocchio, J by hand": "pinocchio",
    "MuJoCo, one step": "MuJoCo",
    "pybullet, one step": "pybullet",
    "fractions": "Fraction",
}
LABELS = {  # offset of a name in points, if its mark is at the lower edge, and otherwise
    "C": ((-11, 0), (-11, 0)),
    "pinocchio": ((34, 34), (38, 16)),
    "MuJoCo": ((26, 0), (26, 0)),
    "pybullet": ((27, 0), (27, 0)),
    "balls": ((-12, 13), (-12, 13)),
    "Fraction": ((8, -15), (8, -15)),
}
FLOOR, CEILING = 1e-17, 3.0


def draw(points: Sequence[Point]) -> None:
    """Draw a panel for each scene."""
    plt.rcParams["font.size"] = 11
    names = list(dict.fromkeys(point["scene"] for point in points))
    figure, grid = plt.subplots(1, len(names), figsize=(12, 5.0), sharex=True, sharey=True)
    for axes, name in zip(grid, names, strict=True):
        panel(axes, name, {point["way"]: point for point in points if point["scene"] == name})
    grid[0].set_ylabel("relative error of the impulse")
    figure.legend(
        handles=legend(), loc="lower center", ncols=4, frameon=False, fontsize=10.5, columnspacing=2
    )
    figure.tight_layout(rect=(0, 0.13, 1, 1), w_pad=1.2)
    save(figure, "trade-off.png", dpi=130)


def panel(axes: Axes, name: str, points: dict[str, Point]) -> None:
    """Draw one scene."""
    axes.set(xscale="log", yscale="log", xlim=(1e-3, 2e4), ylim=(FLOOR / 30, CEILING))
    axes.set_title(name, loc="left", fontsize=12, fontweight="bold")
    axes.set_xticks([1e-2, 1, 1e2, 1e4], ["10 ns", "1 µs", "100 µs", "10 ms"])
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["1e-16", "1e-12", "1e-8", "1e-4", "1"])
    axes.minorticks_off()
    axes.set_xlabel("time of one impact")
    axes.grid(True, lw=0.5, color="#e8e8e8")
    axes.set_axisbelow(True)
    for ways in (("DOUBLE", "EXTENDED"), ("batch, with bound", "batch, EXTENDED")):
        places = [place(points[way]) for way in ways if way in points]
        axes.plot(*zip(*places, strict=True), color=STYLES[ways[0]][2], lw=1.2, ls=":", zorder=1)
    for way, point in points.items():
        mark(axes, way, point)
    start, end = (place(points[way]) for way in ("DOUBLE", "EXTENDED"))
    axes.annotate(
        f"+ {end[0] - start[0]:.1f} µs", end, xytext=(11, 0), textcoords="offset points",
        color=ONE, fontsize=12, fontweight="bold", va="center",
    )  # fmt: skip


def place(point: Point) -> tuple[float, float]:
    """Coordinates of a point: time [µs], and the error clipped to the plot."""
    return point["s"]["median"] * 1e6, shown(point["error"])


def shown(error: float) -> float:
    """An error clipped to the range of the plot."""
    return min(max(error, FLOOR), CEILING)


def mark(axes: Axes, way: str, point: Point) -> None:
    """Draw one way to the answer; a bar reaches up to its bound."""
    x, y = place(point)
    if point["bound"] is not None:
        _, _, colour, _ = STYLES[way]
        axes.plot([x, x], [y, shown(point["bound"])], color=colour, lw=1.6, alpha=0.55, zorder=2)
        axes.plot(x, shown(point["bound"]), "_", color=colour, markersize=9, markeredgewidth=1.8, zorder=2)
    if way in STYLES:
        axes.plot(x, y, **style_of(way), zorder=4)
        return
    colour, marker = (EXACT, "D") if point["kind"] == "exact" else (PEER, "X")
    axes.plot(x, y, marker, markersize=8, color=colour, markeredgecolor="white", zorder=3)
    name = NAMES.get(way, way)
    offset = LABELS[name][0 if y < 1e-15 else 1]
    line = (
        {"arrowstyle": "-", "color": colour, "lw": 0.7, "shrinkB": 5} if max(map(abs, offset)) > 30 else None
    )
    axes.annotate(
        name, (x, y), xytext=offset, textcoords="offset points", ha="center", va="center", fontsize=10.5,
        color=colour, arrowprops=line,
    )  # fmt: skip


def style_of(way: str) -> dict[str, Any]:
    """How the mark of one of our own ways is drawn."""
    marker, size, colour, filled = STYLES[way]
    face, edge = (colour, "white") if filled else ("white", colour)
    return {"ls": "", "marker": marker, "ms": size, "mfc": face, "mec": edge}


def legend() -> list[Artist]:
    """The marks and their meaning."""

    def dot(text: str, way: str) -> Line2D:
        return Line2D([], [], **style_of(way), label=text)

    return [
        dot("resolve(), DOUBLE", "DOUBLE"),
        dot("resolve(), EXTENDED", "EXTENDED"),
        dot("batch, with bound", "batch, with bound"),
        dot("batch, EXTENDED", "batch, EXTENDED"),
        dot("batch, no bound", "batch"),
        Line2D([], [], ls="-", color=ONE, lw=1.6, alpha=0.7, marker="_", markersize=9, label="error bound"),
        Line2D([], [], ls="", marker="X", markersize=8, color=PEER, label="peers and tuned C, no bound"),
        Line2D([], [], ls="", marker="D", markersize=7, color=EXACT, label="formulas on exact numbers"),
    ]
