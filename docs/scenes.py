"""Makes the pictures and the table of laws of scenes.md with the package.

``.venv/bin/python -I docs/scenes.py`` writes the pictures to docs/images and the table into the page. Costs
and peers on the page come from benchmarks/scenes.py.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import numpy as np
from figures import GREY, INK, arrow, plt, save
from matplotlib.patches import Circle, Rectangle
from pages import rewrite, table

from collision_response import Body, Contact, ImpactModel, Law, SceneImpact, resolve_scene
from collision_response.demo.simultaneous import RADIUS, tight_rack
from collision_response.physics.vector import Vec3
from collision_response.scene.order_sensitivity import resolve_sequentially

PAGE = Path(__file__).with_name("scenes.md")
PALE = "#dfe8f2"
BLUE, ORANGE, GREEN, RED = "#2a7f9e", "#d95f02", "#3a8f5c", "#b30000"

Options = dict[str, Any]
WAYS: dict[str, tuple[Law, Options, str]] = {
    "`FRICTIONLESS`": (Law.FRICTIONLESS, {}, "the shock goes through"),
    "`MOREAU`": (Law.MOREAU, {}, "all that touch it leave together"),
    "`ROUTH_STRONGE`, exponent 1.5": (Law.ROUTH_STRONGE, {}, "Hertzian springs: the shock disperses"),
    "`ROUTH_STRONGE`, exponent 1": (Law.ROUTH_STRONGE, {"exponent": 1.0}, "linear springs: more so"),
}
COLOURS = (BLUE, ORANGE, GREEN, "#6a9f3c")


def cradle(speeds: Sequence[float], e: float, law: Law, options: Options) -> list[float]:
    """Speeds of equal touching balls in a row after the impact."""
    bodies = [
        Body.dynamic(1.0, position=(float(i), 0.0, 0.0), velocity=(v, 0.0, 0.0)) for i, v in enumerate(speeds)
    ]
    contacts = [Contact.of((i + 0.5, 0.0, 0.0), (-1.0, 0.0, 0.0), e) for i in range(len(speeds) - 1)]
    pairs = [(i, i + 1) for i in range(len(contacts))]
    return [t.linear.x for t in resolve_scene(bodies, pairs, contacts, ImpactModel(law), **options).twists]


def draw_cradle() -> None:
    """Draw bars of the velocities, with a panel for each law."""
    figure, grid = plt.subplots(1, 4, figsize=(9, 2.9), sharey=True, layout="constrained")
    for ax, (name, (law, options, what)), colour in zip(grid, WAYS.items(), COLOURS, strict=True):
        elastic, half = (cradle((1.0, 0.0, 0.0, 0.0, 0.0), e, law, options) for e in (1.0, 0.5))
        places = np.arange(1, 6)
        ax.bar(places - 0.2, elastic, 0.38, color=colour)
        ax.bar(places + 0.2, half, 0.38, color=colour, alpha=0.4)
        ax.axhline(0, color=INK, lw=0.8)
        title, _, spring = name.replace("`", "").partition(", ")
        ax.set_title(title + (f"\n{spring}" if spring else f"\n{what}"), fontsize=9)
        ax.set(ylim=(-0.7, 1.1), xticks=places)
        ax.tick_params(labelsize=8, length=0)
        ax.spines[["bottom", "left"]].set_visible(False)
        ax.grid(axis="y", color="#e5e5e5")
        ax.set_axisbelow(True)
        ax.set_xlabel("ball", fontsize=8.5)
    grid[0].set_ylabel("speed after [m/s]", fontsize=9)
    handles = [Rectangle((0, 0), 1, 1, color=GREY, alpha=alpha) for alpha in (1.0, 0.4)]
    grid[0].legend(handles, ["e = 1", "e = 0.5"], loc="upper left", fontsize=8, frameon=False)
    save(figure, "scenes-cradle.png")


# The flat box ---------------------------------------------------------------------------------

CORNERS = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
CUBE = Body.box(1.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=(0.0, 0.0, -1.0))


def flat_box() -> tuple[list[Body], list[tuple[int, int]], list[Contact]]:
    """A cube that lands on its four corners at 1 m/s, e = 1."""
    contacts = [Contact.of((x, y, 0.0), (0.0, 0.0, 1.0)) for x, y in CORNERS]
    return [CUBE, Body.static()], [(0, 1)] * 4, contacts


def spins() -> Counter[tuple[float, float, float]]:
    """Spin about x and y and upward speed for all 24 orders, with the number of orders that give them."""
    found: Counter[tuple[float, float, float]] = Counter()
    for order in permutations(range(4)):
        change, _ = resolve_sequentially(*flat_box(), ImpactModel(), order)
        up = CUBE.velocity.z + change.linear.z
        found[round(change.angular.x, 9), round(change.angular.y, 9), round(up, 9)] += 1
    return found


def draw_box() -> None:
    """Draw the corners, and the spin for each order in which they are resolved."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.7), width_ratios=[1, 1.5], layout="constrained")
    left.add_patch(Rectangle((-0.5, -0.5), 1, 1, fc=PALE, ec=INK, lw=1.2))
    for i, (x, y) in enumerate(CORNERS):
        left.plot(x, y, "o", color=INK, ms=7)
        left.annotate(f"{i}", (x, y), (x * 1.28, y * 1.28), ha="center", va="center", fontsize=10)
    left.set(xlim=(-0.85, 0.85), ylim=(-0.85, 0.85), aspect="equal")
    left.set_title("a cube from above:\nfour corners touch the floor", fontsize=9.5)
    left.set_axis_off()
    change, _ = resolve_sequentially(*flat_box(), ImpactModel(), range(4))
    right.annotate("0, 1, 2, 3", change.angular[:2], (-14, -13), textcoords="offset points", fontsize=8.5)
    for (x, y, _), count in spins().items():
        right.plot([0, x], [0, y], color=RED, lw=0.8, alpha=0.45, zorder=1)
        right.scatter(x, y, 16 + 14 * count, color=RED, zorder=2, lw=0)
    answer = resolve_scene(*flat_box())
    spin = answer.twists[0].angular
    right.plot(spin.x, spin.y, "*", ms=17, color=BLUE, mec="white", zorder=4)
    right.annotate(
        "all four at once: no spin", (spin.x, spin.y), (0.0, -0.42), ha="center", color=BLUE, fontsize=9,
        bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1.0}, zorder=3,
    )  # fmt: skip
    right.axhline(0, color=GREY, lw=0.6, zorder=0)
    right.axvline(0, color=GREY, lw=0.6, zorder=0)
    right.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    right.set(xlabel="spin about x [rad/s]", ylabel="spin about y [rad/s]")
    right.set_title("one corner after another: the spin by the order", fontsize=9.5)
    right.tick_params(labelsize=8)
    save(figure, "scenes-box.png")


# The rack -------------------------------------------------------------------------------------


def racked(law: Law) -> list[Vec3]:
    """The velocities of the balls after a break, e = 0.95."""
    bodies, _, pairs, contacts, _ = tight_rack(Vec3(0.0, 0.0, 0.0))
    answer = resolve_scene([*bodies.values()], pairs, contacts, ImpactModel(law))
    return [twist.linear for twist in answer.twists]


def racked_in_turn() -> list[Vec3]:
    """The same, with one contact resolved after another, in the order of the list."""
    bodies, _, pairs, contacts, _ = tight_rack(Vec3(0.0, 0.0, 0.0))
    balls = [*bodies.values()]
    changes = resolve_sequentially(balls, pairs, contacts, ImpactModel(), range(len(pairs)))
    return [ball.velocity + change.linear for ball, change in zip(balls, changes, strict=True)]


def draw_rack() -> None:
    """Draw the velocities of the balls, with a panel for each way."""
    at = [ball.position for ball in tight_rack(Vec3(0.0, 0.0, 0.0)).bodies.values()]
    panels: dict[str, tuple[Callable[[], list[Vec3]], str]] = {
        "one contact after another": (racked_in_turn, RED),
        "FRICTIONLESS": (lambda: racked(Law.FRICTIONLESS), BLUE),
        "MOREAU": (lambda: racked(Law.MOREAU), ORANGE),
        "ROUTH_STRONGE": (lambda: racked(Law.ROUTH_STRONGE), GREEN),
    }
    figure, grid = plt.subplots(2, 2, figsize=(8, 4.9), sharex=True, sharey=True, layout="constrained")
    for ax, (title, (velocities, colour)) in zip(grid.flat, panels.items(), strict=True):
        for p in at:
            ax.add_patch(Circle((p.x, p.y), RADIUS, fc=PALE, ec=GREY, lw=0.6))
        for p, v in zip(at, velocities(), strict=True):
            if v.norm() > 0.01:
                arrow(ax, p[:2], (p + 0.55 * v)[:2], colour, lw=1.4, mutation_scale=8)
        ax.set(xlim=(-0.62, 0.8), ylim=(-0.47, 0.42), aspect="equal")
        ax.set_title(title, fontsize=10, color=colour)
        ax.set_axis_off()
    save(figure, "scenes-rack.png")


# The table ------------------------------------------------------------------------------------


def law_table() -> str:
    """Table of the speeds of cradles with three and five balls."""
    cradles = {"three, e = 1": (3, 1.0), "three, e = 0.5": (3, 0.5), "five, e = 1": (5, 1.0)}
    rows = []
    for name, (law, options, what) in WAYS.items():
        speeds = (cradle((1.0, *[0.0] * (n - 1)), e, law, options) for n, e in cradles.values())
        rows.append([name, *map(speeds_of, speeds), what])
    return table(["law", *cradles, ""], rows)


def speeds_of(speeds: Sequence[float]) -> str:
    return ", ".join("0" if abs(v) < 1e-12 else f"{v:.4f}".rstrip("0").rstrip(".") for v in speeds)


def example() -> SceneImpact:
    """The answer that the example of the page prints."""
    text = PAGE.read_text()
    code = text.partition("```python\n")[2].partition("```")[0]
    scope: dict[str, Any] = {"print": lambda _: None}
    exec(code, scope)
    answer: SceneImpact = scope["answer"]
    return answer


def facts() -> Iterator[str]:
    """The sentences below the picture of the box."""
    found = spins()
    still = sum(count for (x, y, _), count in found.items() if x == y == 0)
    ups = sorted({up for *_, up in found})
    largest = max(math.hypot(x, y) for x, y, _ in found)
    yield (
        f"Of the 24 orders, {still} leave the cube without spin. The others make it turn at up to "
        f"{largest:.2f} rad/s, in {sum(1 for x, y, _ in found if x or y)} directions, and throw it back at "
        f"{' or '.join(f'{up:.4g}' for up in ups[:-1])} m/s instead of 1."
    )
    sensitivity = resolve_scene(*flat_box(), orders=8).order_sensitivity
    yield f"`order_sensitivity` is {sensitivity:.2f}."


def main() -> None:
    """Draw the pictures and write the tables."""
    draw_cradle()
    draw_box()
    draw_rack()
    rewrite(PAGE, {"laws": law_table(), "orders": "\n".join(facts()), "example": f"```\n{example()}\n```"})
    print(f"==> wrote docs/{PAGE.name}")


if __name__ == "__main__":
    main()
