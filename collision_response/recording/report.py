"""Summary of a recording, in words and as an HTML page with plots that needs no other file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, NamedTuple

import numpy as np

from ..body_numbers import ROWS
from .colours import BLUE, GREY, ORANGE, REGIMES, Colour
from .rerun_sdk import compute, pa
from .table import divide, rows_of
from .viewer_layout import CAUSES

SHOWN = 3000
"""Greatest number of points in a plot. Of more impacts, evenly spaced ones are shown; the tables use all."""

LISTED = 10

TWIST_SIZE = 6
"""Number of the last rows of a body, which are its twist."""

MOST = 1e300
"""Values beyond this are drawn at the edge of a plot, so that the range of an axis does not overflow."""

Row = dict[str, Any]


class Summary(NamedTuple):
    """The tables of a recording.

    Attributes:
        answers: impacts with an answer, without their requests.
        refusals: refused requests.
        residuals: for each answer, by how much the energies before, after and lost disagree, relative to the
            energy before. NaN if an immovable body moves: then it does work.
        scenes: scenes, each with an answer.
    """

    answers: pa.Table
    refusals: pa.Table
    residuals: np.ndarray
    scenes: pa.Table

    @classmethod
    def of(cls, impacts: pa.Table, scenes: pa.Table) -> Summary:
        """Sort the tables that ``read`` of ``recording.table`` and of ``recording.scenes`` return."""
        answers, refusals = divide(impacts)
        before, after = _column(answers, "kinetic_energy_before"), _column(answers, "kinetic_energy_after")
        restitution, friction = (_column(answers, f"energy_lost_{cause}") for cause in CAUSES)
        with np.errstate(over="ignore"):
            gap = abs(before - after - restitution - friction)
            gap[_is_driven(answers, "request_a") | _is_driven(answers, "request_b")] = math.nan
            residuals = np.divide(gap, before, out=np.zeros_like(gap), where=before > 0)
        shown = [name for name in answers.column_names if not name.startswith("request_")]
        return cls(answers.select(shown), refusals, residuals, scenes)


def in_words(summary: Summary) -> list[str]:
    """Lines of text that describe what happened."""
    answers, scenes = summary.answers, summary.scenes
    lines = [f"{len(answers)} impacts, {len(summary.refusals)} refusals"]
    if answers:
        with np.errstate(over="ignore"):
            lost, lost_by_friction = (_column(answers, f"energy_lost_{cause}").sum() for cause in CAUSES)
        slowest, loosest = (_largest(answers, name)[:1] for name in ("duration", "error_bound"))
        lines += [
            f"laws: {_counted(answers['law'])}",
            f"regimes: {_counted(answers['regime'])}",
            f"energy lost: {lost:.6g} J by restitution, {lost_by_friction:.6g} J by friction",
            f"energy unaccounted for: at most {_greatest(summary.residuals):.2g} of that before an impact",
            *(f"error bound: at most {row['error_bound']:.2g} (answer {row['answer']})" for row in loosest),
            *(f"slowest: {_microseconds(row)} us (answer {row['answer']})" for row in slowest),
        ]
        adjusted = answers["adjustments"].filter(compute.not_equal(answers["adjustments"], "NONE"))
        if len(adjusted):
            lines.append(f"adjusted: {_counted(adjusted)}")
    if scenes:
        loosest = _largest(scenes, "error_bound")[:1]
        contacts = len(compute.list_flatten(scenes["regimes"]))
        lines += [
            f"{len(scenes)} scenes of {contacts} contacts in all, by {_counted(scenes['law'])}",
            *(
                f"error bound of scenes: at most {row['error_bound']:.2g} (answer {row['answer']})"
                for row in loosest
            ),
        ]
    lines += [f"refused {number} times: {what}" for what, number in _refused(summary).most_common(LISTED)]
    return lines


def page(summary: Summary, files: Sequence[str]) -> str:
    """Make the HTML page; the names of the files are its title."""
    words = "\n".join(in_words(summary))
    title = escape(", ".join(files))
    body = "\n".join([f"<pre>{escape(words)}</pre>", *_plots(summary), *_tables(summary)])
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Impacts of {title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>
<body><h1>Impacts of {title}</h1>
{body}
</body></html>
"""


def _plots(summary: Summary) -> list[str]:
    count = len(summary.answers)
    if not count:
        return []
    shown = _evenly_chosen(count)
    plots = (make(summary, shown) for make in (_energy_plot, _residual_plot, _time_plot, _cone_plot))
    note = f"<p>The plots show {len(shown)} of {count} impacts.</p>" if len(shown) < count else ""
    return [f'<div class="plots">{"".join(plot.svg() for plot in plots if plot is not None)}</div>{note}']


def _energy_plot(summary: Summary, shown: np.ndarray) -> SvgPlot:
    number = _column(summary.answers, "answer")
    with np.errstate(over="ignore"):
        lost = {cause: _column(summary.answers, f"energy_lost_{cause}").cumsum() for cause in CAUSES}
    y = _limits(np.concatenate([*lost.values(), [0.0]]))
    plot = SvgPlot("Energy lost so far [J]", "answer", _limits(number), y)
    for cause, values in lost.items():
        plot.line(number[shown], values[shown], CAUSES[cause], cause)
    return plot


def _residual_plot(summary: Summary, shown: np.ndarray) -> SvgPlot:
    number, bounds = (_column(summary.answers, name) for name in ("answer", "error_bound"))
    key = {"found": BLUE, "error bound of the answer": ORANGE}
    title = "Energy unaccounted for, relative"
    plot = SvgPlot(title, "answer", _limits(number), (-18.0, 0.0), log_y=True, key=key)
    titles = [*map(_label, rows_of(summary.answers.take(shown)))]
    for colour, values in ((ORANGE, bounds), (BLUE, summary.residuals)):
        heights = np.log10(np.clip(values[shown], 1e-18, 1.0))
        plot.points(number[shown], heights, [colour] * len(shown), titles)
    return plot


def _time_plot(summary: Summary, shown: np.ndarray) -> SvgPlot | None:
    """The durations, or ``None`` if none is known."""
    rows, number = summary.answers.take(shown), _column(summary.answers, "answer")
    duration = _column(rows, "duration")
    if not np.isfinite(duration).any():
        return None
    plot = SvgPlot("Time to compute [s]", "answer", _limits(number), (-6.0, 0.0), log_y=True)
    plot.impacts(number[shown], np.log10(np.clip(duration, 1e-6, 1.0)), rows)
    return plot


def _cone_plot(summary: Summary, shown: np.ndarray) -> SvgPlot | None:
    """The slopes of the impulses, or ``None`` if no impulse has a friction cone."""
    rows = summary.answers.take(shown)
    mu, along, across = (_column(rows, name) for name in ("friction", "normal_impulse", "tangential_impulse"))
    has_cone = (mu > 0) & (along > 0)
    if not has_cone.any():
        return None
    with np.errstate(over="ignore"):
        slope = np.divide(across, along, out=np.full_like(across, np.nan), where=has_cone)
    limits = _limits(1.05 * np.minimum([0.0, *mu[has_cone], *slope[has_cone]], MOST))
    title = "Impulses in their cones: tangential over normal"
    plot = SvgPlot(title, "friction", limits, limits)
    plot.line(np.array(limits), np.array(limits), GREY, "edge of the cone")
    plot.impacts(mu, slope, rows)
    return plot


def _tables(summary: Summary) -> Iterator[str]:
    """Tables, each with its heading. Tables without rows are left out."""
    answers, residuals = summary.answers, summary.residuals
    worst = np.argsort(-residuals)[:LISTED]
    with_residuals = zip(rows_of(answers.take(worst)), residuals[worst], strict=True)
    unbalanced = [row | {"residual": residual} for row, residual in with_residuals]
    loosest_scenes = _largest(summary.scenes, "error_bound")
    for title, columns, rows in (
        ("Worst residuals of energy", (*IMPACT_COLUMNS, "residual"), unbalanced),
        ("Largest error bounds", IMPACT_COLUMNS, _largest(answers, "error_bound")),
        ("Slowest answers", IMPACT_COLUMNS, _largest(answers, "duration")),
        ("Several contacts at once: largest error bounds", SCENE_COLUMNS, loosest_scenes),
        ("Refused requests", REFUSAL_COLUMNS, [*rows_of(summary.refusals[:100])]),
    ):
        if rows:
            yield f"<h2>{title}</h2>"
            yield _table(columns, ([CELLS[column](row) for column in columns] for row in rows))


@dataclass
class SvgPlot:
    """A plot as SVG.

    Attributes:
        across: label of the x axis.
        x, y: limits of the axes.
        log_y: whether the y values are decimal logarithms of the quantity shown.
        marks: SVG elements of curves and points.
        key: meaning of each colour.
    """

    title: str
    across: str
    x: tuple[float, float]
    y: tuple[float, float]
    log_y: bool = False
    marks: list[str] = field(default_factory=list)
    key: dict[str, Colour] = field(default_factory=dict)

    def line(self, x: np.ndarray, y: np.ndarray, colour: Colour, name: str) -> None:
        """Add a curve."""
        places = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(*self._places(x, y), strict=True))
        self.marks.append(f'<polyline points="{places}" stroke="{_css(colour)}"/>')
        self.key[name] = colour

    def points(self, x: np.ndarray, y: np.ndarray, colours: Sequence[Colour], titles: Sequence[str]) -> None:
        """Add dots, whose titles appear under the mouse pointer."""
        for a, b, colour, title in zip(*self._places(x, y), colours, titles, strict=True):
            if math.isfinite(b):
                dot = f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.5" fill="{_css(colour)}">'
                self.marks.append(f"{dot}<title>{escape(title)}</title></circle>")

    def impacts(self, x: np.ndarray, y: np.ndarray, rows: pa.Table) -> None:
        """Add a dot for each impact, with the colour of its regime; grey: a regime of another version."""
        regimes = rows["regime"].to_pylist()
        colours = [REGIMES.get(regime, GREY) for regime in regimes]
        self.points(x, y, colours, [*map(_label, rows_of(rows))])
        self.key |= dict(sorted(zip(regimes, colours, strict=True)))

    def svg(self) -> str:
        """SVG text of the plot."""
        parts = [f'<text class="title" x="{LEFT}" y="16">{escape(self.title)}</text>']
        for value in _ticks(*self.x):
            at = self._places(np.array([value]), np.array([self.y[0]]))[0][0]
            parts.append(f'<text class="x" x="{at:.1f}" y="{HEIGHT - BOTTOM + 15}">{value:g}</text>')
        for value in _ticks(*self.y):
            at = self._places(np.array([self.x[0]]), np.array([value]))[1][0]
            label = f"1e{value:g}" if self.log_y else f"{value:g}"
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}"/>')
            parts.append(f'<text class="y" x="{LEFT - 6}" y="{at + 4:.1f}">{label}</text>')
        parts.append(
            f'<text class="x" x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 4}">{escape(self.across)}</text>'
        )
        at = LEFT
        for name, colour in self.key.items():
            parts.append(f'<rect x="{at}" y="24" width="10" height="10" fill="{_css(colour)}"/>')
            parts.append(f'<text x="{at + 14}" y="33">{escape(name)}</text>')
            at += 26 + 7 * len(name)
        return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}">{"".join(parts + self.marks)}</svg>'

    def _places(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        across = (np.clip(x, *self.x) - self.x[0]) / (self.x[1] - self.x[0])
        up = (np.clip(y, *self.y) - self.y[0]) / (self.y[1] - self.y[0])
        return LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM)


WIDTH, HEIGHT = 560, 320
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 44, 40

STYLE = """
:root { color-scheme: light dark; font: 15px/1.5 system-ui, sans-serif }
body { max-width: 1180px; margin: 1.5em auto; padding: 0 1em }
pre { font-size: 14px } h1 { font-size: 1.5em } h2 { font-size: 1.1em; margin-bottom: .3em }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(440px, 100%), 1fr)); gap: 1em }
svg { width: 100%; fill: currentColor; font-size: 12px }
svg .title { font-weight: 600; font-size: 14px } svg .x { text-anchor: middle } svg .y { text-anchor: end }
svg .grid { stroke: currentColor; opacity: .15 } svg polyline { fill: none; stroke-width: 2 }
table { border-collapse: collapse } th, td { text-align: left; padding: .15em .9em .15em 0 }
td { font-variant-numeric: tabular-nums } th { font-weight: 600; border-bottom: 1px solid }
.wide { overflow-x: auto }
"""


CELLS: dict[str, Callable[[Row], object]] = {
    "answer": lambda row: row["answer"],
    "bodies": lambda row: (
        ", ".join(row["bodies"]) if "bodies" in row else f"{row['body_a']} on {row['body_b']}"
    ),
    "contacts": lambda row: len(row["regimes"]),
    "law": lambda row: row["law"],
    "regime": lambda row: row["regime"],
    "energy before [J]": lambda row: f"{row['kinetic_energy_before']:.6g}",
    "lost [J]": lambda row: f"{row['energy_lost_restitution'] + row['energy_lost_friction']:.6g}",
    "error bound": lambda row: f"{row['error_bound']:.2g}",
    "time [us]": lambda row: _microseconds(row),
    "residual": lambda row: f"{row['residual']:.2g}",
    "code": lambda row: row["status"],
    "why": lambda row: row["message"] or "",
}
"""What the tables show of a row, by the heading of the column."""

OF_ALL = "energy before [J]", "lost [J]", "error bound"
IMPACT_COLUMNS = ("answer", "bodies", "law", "regime", *OF_ALL, "time [us]")
SCENE_COLUMNS = ("answer", "bodies", "contacts", "law", *OF_ALL)
REFUSAL_COLUMNS = ("answer", "code", "why")


def _is_driven(answers: pa.Table, request: str) -> np.ndarray:
    """Whether a body of each answer is immovable and moves."""
    if not len(answers):
        return np.zeros(0, bool)
    body = compute.list_flatten(answers[request]).to_numpy().reshape(len(answers), ROWS)
    return np.asarray((body[:, 0] == math.inf) & body[:, -TWIST_SIZE:].any(axis=1))


def _css(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _limits(values: np.ndarray) -> tuple[float, float]:
    """Least and greatest of some values, far enough apart for about six round numbers between them."""
    low, high = (max(-MOST, min(float(end), MOST)) for end in (values.min(), values.max()))
    room = 1e-9 * max(abs(low), abs(high), 1e-290)
    return (low, high) if high - low > room else (low - max(0.5, room), high + max(0.5, room))


def _ticks(low: float, high: float) -> Iterable[float]:
    """About six round numbers between two limits."""
    rough = (high - low) / 6
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(n for n in (1, 2, 5, 10) if n * power >= rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def _evenly_chosen(count: int) -> np.ndarray:
    """Indices of all points, or of ``SHOWN`` evenly spaced ones that include the last."""
    return np.unique(np.linspace(0, count - 1, min(count, SHOWN)).round().astype(int))


def _column(rows: pa.Table, name: str) -> np.ndarray:
    """Return the numbers of a column. A table without rows may lack it."""
    return np.asarray(rows[name] if len(rows) else [], float)


def _largest(rows: pa.Table, name: str) -> list[Row]:
    """Rows with the largest values of a column."""
    values = _column(rows, name)
    order = np.argsort(-values, kind="stable")[:LISTED]  # NaN comes last
    return [*rows_of(rows.take(order[~np.isnan(values[order])]))]


def _greatest(values: np.ndarray) -> float:
    return max(values[~np.isnan(values)], default=0.0)


def _label(row: Row) -> str:
    return f"{row['answer']}: {row['body_a']} on {row['body_b']}, {row['regime']} by {row['law']}"


def _microseconds(row: Row) -> str:
    return "" if math.isnan(row["duration"]) else f"{row['duration'] * 1e6:.1f}"


def _counted(words: pa.ChunkedArray) -> str:
    return ", ".join(f"{number} {word}" for word, number in Counter(words.to_pylist()).most_common())


def _refused(summary: Summary) -> Counter[str]:
    rows = rows_of(summary.refusals)
    return Counter(f"{row['status']} {(row['message'] or '').partition(':')[0]}" for row in rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows]
    return f'<div class="wide"><table>{"".join(f"<tr>{line}</tr>" for line in lines)}</table></div>'
