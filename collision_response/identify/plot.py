"""Draw a fit to measured impacts."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..optional import missing
from .estimates import DEVIATIONS
from .identification import Identification
from .measurements import Measurements, informative

INK, BLUE, ORANGE, GREY = "#222222", "#0072b2", "#d55e00", "#8a8a8a"
MARKERS = "sD^v"


def draw(found: Identification, measured: Measurements, path: Path) -> None:
    """Draw a fit to measured impacts, and write the picture to a file, whose suffix gives the format.

    The left half shows the predictions over the measurements. The right half shows the coefficients: fits of
    the bootstrap, the best fit with its formal interval, and the fits to other kinds of residuals.

    Raises:
        ImportError: if matplotlib is not installed.
        OSError: if the file cannot be written.
        ValueError: if there is no suffix, or matplotlib does not know its format.
    """
    if not path.suffix or path.is_dir():
        raise ValueError("must be the name of a file that ends in .png, .svg or .pdf")
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise missing("matplotlib", "matplotlib") from None
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    used = informative(measured, found.kind)
    sizes, off = used.sizes(found.kind), used.residuals(found.law, found.values, found.kind)
    shown = used.is_measured(found.kind)
    left.axline((0, 0), slope=1, color=GREY, lw=1)
    left.plot(sizes[shown], (sizes + off)[shown], "o", ms=4, alpha=0.6, color=BLUE, mew=0)
    left.set_title(f"{found.law.name}: misfit {found.misfit:.1%}", loc="left", color=INK)
    left.set(xlabel=f"measured ({found.kind})", ylabel="predicted")
    names = list(found.coefficients)
    across, up = names[0], names[-1]
    cloud = dict(zip(names, found.resampled.T, strict=True))
    if across == up:
        known = found.resampled[~np.isnan(found.resampled)]
        right.hist(known, bins=30, color=BLUE, alpha=0.6, label="bootstrap")
    else:
        right.plot(cloud[across], cloud[up], ".", ms=4, color=BLUE, alpha=0.4, label="bootstrap")
        right.set_ylabel(up)
        best, formal = found.values, [DEVIATIONS * found.coefficients[name].formal for name in (across, up)]
        if all(map(math.isfinite, formal)):
            cross = {"xerr": formal[0], "yerr": formal[1], "fmt": "o", "capsize": 3}
            right.errorbar(best[across], best[up], color=INK, label=f"{found.kind}, formal 95 %", **cross)
        both = {kind: values for kind, values in found.others.items() if {across, up} <= values.keys()}
        for marker, (kind, values) in zip(MARKERS, both.items(), strict=False):
            right.plot(values[across], values[up], marker, color=ORANGE, label=f"residuals {kind}")
    right.set_xlabel(across)
    right.set_title("what is known of them", loc="left", color=INK)
    right.legend(frameon=False)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)
