"""``.venv/bin/python -I docs/square_on_incline.py`` makes the picture and table of square-on-incline.md."""

from __future__ import annotations

import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import numpy as np
from figures import GREY, INK, arrow, plt, save
from matplotlib.axes import Axes

from collision_response import Body, Impact, resolve
from collision_response.demo.systems import System, s2

SHOWN = math.radians(20)
"""Corner angle in the sketch [rad]."""
EVERY = 0.5
"""Step of the corner angle in the picture [degrees]."""
QUANTITIES = {
    "twist_a.linear.x": ("$v_x^+$  [m/s]", "#2a7f9e"),
    "twist_a.linear.y": ("$v_y^+$  [m/s]", "#d95f02"),
    "twist_a.angular.z": (r"$\omega^+$  [rad/s]", "#6a3d9a"),
}


def answer(system: System) -> Impact:
    return resolve(system.body_a, system.body_b, system.contact)


def computed(impact: Impact) -> list[float]:
    return [impact.twist_a.linear.x, impact.twist_a.linear.y, impact.twist_a.angular.z]


def closed_form(system: System) -> list[float]:
    return [system.expected[name] for name in QUANTITIES]


def draw(degrees: np.ndarray, solved: np.ndarray, expected: np.ndarray) -> None:
    figure, grid = plt.subplot_mosaic(
        [["sketch", 0], ["sketch", 1], ["sketch", 2]],
        figsize=(8, 5.6),
        width_ratios=[1, 1.7],
        layout="constrained",
    )
    sketch(grid["sketch"])
    axes = [grid[i] for i in range(3)]
    before = s2(0.0).body_a
    starts = [before.velocity.x, before.velocity.y, before.angular_velocity.z]
    for ax, (label, color), got, formula, start in zip(
        axes, QUANTITIES.values(), solved.T, expected.T, starts, strict=True
    ):
        ax.plot(degrees, formula, color=color, lw=2, label="closed form")
        ax.plot(degrees[::10], got[::10], "o", color="white", mec=color, ms=6, label="resolve()")
        ax.axhline(start, color=GREY, lw=1, ls="--", label="before the impact")
        ax.set_ylabel(label)
        ax.grid(color="#e5e5e5")
        ax.margins(x=0.01)
        ax.set_xticks(range(-45, 46, 15))
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[-1].set_xlabel("corner angle φ, positive uphill  [degrees]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
    save(figure, "square-on-incline.png")


def sketch(ax: Axes) -> None:
    """Draw the square at the moment of contact, at one corner angle."""
    system = s2(SHOWN)
    com = np.array(system.body_a.position[:2])
    normal = np.array(system.contact.normal[:2])
    uphill = np.array([normal[1], -normal[0]])
    to_corner = -com
    across = np.array([-to_corner[1], to_corner[0]])
    corners = com + np.array([to_corner, across, -to_corner, -across])
    foot = com - normal * (com @ normal)
    ground = np.array([-0.9 * uphill, 0.9 * uphill])
    ax.fill(*np.vstack([ground, ground[::-1] - 0.12 * normal]).T, color="#dddddd", lw=0)
    ax.plot(*ground.T, color=INK, lw=1.4)
    ax.fill(*corners.T, fc="#eef3f8", ec=INK, lw=1.6)
    ax.plot(*np.array([com, [0, 0]]).T, color=INK, lw=1)
    ax.plot(*np.array([com, foot]).T, color=GREY, lw=1, ls="--")
    start, end = (math.atan2(*(x - com)[::-1]) for x in (foot, np.zeros(2)))
    turn = np.linspace(start, end, 30)
    ax.plot(*(com[:, None] + 0.5 * np.array([np.cos(turn), np.sin(turn)])), color=GREY, lw=1)
    ax.text(*(com + 0.6 * np.array([math.cos(turn[15]), math.sin(turn[15])])), "φ", ha="center", va="center")
    velocity = 0.16 * np.array(system.body_a.velocity[:2])
    arrow(ax, com - velocity, com, "#d95f02", "$v$", (-2, 13))
    arrow(ax, (0, 0), 0.45 * normal, "#2a7f9e", "$n$", (-9, 8))
    ax.plot(*com, "o", color="white", mec=INK, ms=6)
    ax.set_title(f"φ = {math.degrees(SHOWN):.0f}°", fontsize=10)
    ax.set(aspect="equal")
    ax.set_axis_off()


def print_table() -> None:
    print("| corner angle | $v_x^+$ [m/s] | $v_y^+$ [m/s] | $\\omega^+$ [rad/s] | $J$ [N s] |")
    print("|---|---|---|---|---|")
    for angle in range(-45, 46, 15):
        impact = answer(s2(math.radians(angle)))
        v_x, v_y, w = computed(impact)
        print(f"| {angle}° | {v_x:.6f} | {v_y:.6f} | {w:.6f} | {impact.normal_impulse:.6f} |")


def energy_error(impact: Impact) -> float:
    return abs(impact.kinetic_energy_after / impact.kinetic_energy_before - 1)


def main() -> None:
    degrees = np.arange(-45, 45 + EVERY, EVERY)
    systems = [s2(math.radians(angle)) for angle in degrees]
    assert all(system.body_b == Body.static() for system in systems)
    impacts = [answer(system) for system in systems]
    solved = np.array([computed(impact) for impact in impacts])
    expected = np.array([closed_form(system) for system in systems])
    draw(degrees, solved, expected)
    print_table()
    print(f"\ngreatest difference from the closed form: {np.abs(solved - expected).max():.1e}")
    print(f"greatest relative change of energy: {max(map(energy_error, impacts)):.1e}")


if __name__ == "__main__":
    main()
