"""The style of the pictures on the pages, and where they are written."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pages import DOCS

INK, GREY = "#222222", "#8a8a8a"

plt.rcParams.update({"font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False})


def save(figure: Figure, name: str, dpi: int = 120) -> None:
    """Write a picture to docs/images."""
    figure.savefig(DOCS / "images" / name, dpi=dpi, metadata={"Software": None})
    plt.close(figure)
    print(f"==> wrote docs/images/{name}")


def arrow(
    ax: Axes,
    start: Any,
    end: Any,
    color: str,
    text: str = "",
    offset: tuple[float, float] = (0, 0),
    **style: Any,
) -> None:
    """Draw an arrow between two points; ``offset`` is that of the text from the end, in points."""
    style = {"arrowstyle": "-|>", "color": color, "lw": 1.8, "shrinkA": 0, "shrinkB": 0, **style}
    ax.annotate("", xy=end, xytext=start, arrowprops=style, zorder=5)
    place = {"textcoords": "offset points", "ha": "center", "va": "center"}
    ax.annotate(text, xy=end, xytext=offset, color=color, fontsize=11, **place)
