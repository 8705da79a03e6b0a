"""Makes the pictures and tables of impact-laws.md with the package.

``.venv/bin/python -I docs/impact_laws.py`` writes the pictures to docs/images and the tables into the page.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import numpy as np
from figures import GREY, INK, arrow, plt, save
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from pages import rewrite, table
from timing import interleaved

from collision_response import Body, Contact, Impact, ImpactModel, Law, resolve, resolve_contact
from collision_response.physics import restitution
from collision_response.physics.effective_mass import ContactKinematics
from collision_response.physics.mass_properties import box, rod
from collision_response.physics.stiffness import Elastic, stiffness_ratio

PAGE = Path(__file__).with_name("impact-laws.md")
CONE, COMPRESSION, STICKING, ENERGY = "#dfe8f2", "#2a7f9e", "#8c564b", "#6a3d9a"
PATH, ANSWER, RAW = "#d95f02", "#b30000", "#e7298a"
LAWS = [law for law in Law if law is not Law.AUTO]


class Case(NamedTuple):
    """A thin rod of 1 kg and 1 m whose end strikes a fixed plane, and the window of its drawing."""

    name: str
    angle: float
    velocity: tuple[float, float]
    e: float
    mu: float
    window: tuple[float, float, float, float]

    def rod(self) -> Body:
        half_turn = self.angle / 2
        return Body.dynamic(
            1.0,
            rod(1.0, 1.0).inertia,
            (math.cos(self.angle) / 2, math.sin(self.angle) / 2, 0.0),
            (0.0, 0.0, math.sin(half_turn), math.cos(half_turn)),
            (*self.velocity, 0.0),
        )

    def contact(self) -> Contact:
        return Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), self.e, self.mu)

    def resolve(self, law: Law) -> Impact:
        return resolve(self.rod(), Body.static(), self.contact(), ImpactModel(law=law))

    def title(self) -> str:
        degrees, (u_t, u_n) = math.degrees(self.angle), self.velocity
        return f"{self.name}:  θ = {degrees:.3g}°, μ = {self.mu:g}, e = {self.e:g}, u = ({u_t:g}, {u_n:g})"


T1 = Case("T1", math.pi / 4, (0.0, -1.0), 0.5, 0.3, (0, 0, 0, 0))
T2 = Case("T2", math.pi / 4, (1.0, -1.0), 0.5, 0.3, (-0.35, 0.33, -0.06, 0.84))
T3 = Case("T3", math.atan(2.0), (0.5, -1.0), 0.9, 0.3, (-0.56, 0.70, -0.07, 1.60))
CASES = (T2, T3)


# The impulse plane ----------------------------------------------------------------------------


def kinetics(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """``K`` and ``u`` in contact axes (t, n)."""
    contact = ContactKinematics.of(case.rod(), Body.static(), case.contact())
    k, u = contact.inverse_effective_mass(), contact.u
    return np.array([[k.xx, k.xy], [k.xy, k.yy]]), np.array([u.x, u.y])


def energy_change(case: Case, p: np.ndarray) -> float:
    """Change of the energy of the rod by an impulse ``p`` [J]."""
    K, u = kinetics(case)
    return float(p @ (2 * u + K @ p) / 2)


def draw_plane(ax: Axes, case: Case) -> None:
    """Draw what is the same for every law: friction cone, compression, sticking, energy."""
    K, u = kinetics(case)
    left, right, bottom, top = case.window
    ax.fill([0, case.mu * 2 * top, -case.mu * 2 * top], [0, 2 * top, 2 * top], color=CONE, zorder=0)
    span = np.array([2 * left, 2 * right])
    ax.plot(span, (-u[1] - K[1, 0] * span) / K[1, 1], color=COMPRESSION, ls="--", lw=1.4)
    ax.plot(span, (-u[0] - K[0, 0] * span) / K[0, 1], color=STICKING, ls="-.", lw=1.4)
    ax.plot(*equal_energy(K, u), color=ENERGY, lw=1.4)
    ax.axhline(0, color=GREY, lw=0.6)
    ax.axvline(0, color=GREY, lw=0.6)
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    ax.set_xlabel("$p_t$  [N s]")
    ax.set_title(case.title(), fontsize=9)
    ax.tick_params(labelsize=8)


def equal_energy(K: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The ellipse ``P.(2 u + K P) = 0`` of impulses that do not change the energy."""
    centre = -np.linalg.solve(K, u)
    radius = math.sqrt(-centre @ u)
    turn = np.linspace(0, 2 * math.pi, 400)
    unit = radius * np.array([np.cos(turn), np.sin(turn)])
    ellipse: np.ndarray = centre[:, None] + np.linalg.solve(np.linalg.cholesky(K).T, unit)
    return ellipse


def draw_path(ax: Axes, points: np.ndarray) -> None:
    """Draw the path of the impulse, with an arrow head in the middle of every long leg."""
    ax.plot(points[:, 0], points[:, 1], color=PATH, lw=2.4, zorder=4, solid_capstyle="round")
    length = np.ptp(points[:, 1]) + np.ptp(points[:, 0])
    for a, b in pairwise(points):
        if np.abs(b - a).sum() > 0.07 * length:
            arrow(ax, a + 0.45 * (b - a), a + 0.62 * (b - a), PATH, lw=2.4)


def mark(
    ax: Axes, at: np.ndarray, text: str, offset: tuple[float, float], color: str = INK, marker: str = "o"
) -> None:
    """Draw a point with its name; ``offset`` is in points, and its sign decides the side of the text."""
    ax.plot(*at, marker=marker, ms=6, color=color, mec="white", mew=0.8, zorder=6, ls="none")
    ax.annotate(
        text,
        xy=at,
        xytext=offset,
        textcoords="offset points",
        ha="left" if offset[0] > 0 else "right" if offset[0] < 0 else "center",
        va="center",
        fontsize=8.5,
        color=color,
        zorder=7,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
        arrowprops={"arrowstyle": "-", "color": color, "lw": 0.6, "shrinkA": 0, "shrinkB": 3},
    )


def legend_handles(*extra: Line2D, path: str = "path") -> list[Line2D | Patch]:
    return [
        Patch(color=CONE, label=r"friction cone $|p_t| \leq \mu\, p_n$"),
        Line2D([], [], color=COMPRESSION, ls="--", label="$u_n = 0$: greatest compression"),
        Line2D([], [], color=STICKING, ls="-.", label="$u_t = 0$: sticking"),
        Line2D([], [], color=ENERGY, label="equal energy (outside: gained)"),
        Line2D([], [], color=PATH, lw=2.4, label=path),
        Line2D([], [], color=ANSWER, marker="o", ls="none", label="answer"),
        *extra,
    ]


def picture(name: str, draw: Callable[[Axes, Case], None], *extra: Line2D, path: str = "path") -> None:
    """Draw one law, with T2 on the left and T3 on the right."""
    figure, axes = plt.subplots(1, 2, figsize=(8, 6.3 if extra else 5.9), layout="constrained")
    for ax, case in zip(axes, CASES, strict=True):
        draw_plane(ax, case)
        draw(ax, case)
    axes[0].set_ylabel("$p_n$  [N s]")
    figure.legend(
        handles=legend_handles(*extra, path=path),
        loc="outside lower center",
        ncols=3,
        fontsize=8.5,
        frameon=False,
    )
    save(figure, name)


# One drawing per law --------------------------------------------------------------------------


def answer(case: Case, law: Law) -> np.ndarray:
    return np.array(case.resolve(law).impulse[:2])


def raw_moreau(case: Case) -> np.ndarray:
    """Moreau's own answer to T2 and T3, in which the contact sticks: ``u+ = -e u_n n``."""
    K, u = kinetics(case)
    P: np.ndarray = np.linalg.solve(K, np.array([0.0, -case.e * u[1]]) - u)
    assert abs(P[0]) <= case.mu * P[1]
    return P


def corners(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """``P_I`` and ``P_II``: the frictionless plastic impulse, and that which brings the contact to rest."""
    K, u = kinetics(case)
    return np.array([0.0, -u[1] / K[1, 1]]), -np.linalg.solve(K, u)


def draw_frictionless(ax: Axes, case: Case) -> None:
    P, (P_1, _) = answer(case, Law.FRICTIONLESS), corners(case)
    draw_path(ax, np.array([[0, 0], P_1, P]))
    mark(ax, P_1, "$P_I$", (16, -10))
    mark(ax, P, "$(1+e)\\,P_I$", (22, 8), ANSWER)


def draw_coulomb(ax: Axes, case: Case) -> None:
    P, (P_1, P_2) = answer(case, Law.COULOMB), corners(case)
    stuck = (1 + case.e) * P_1 + P_2 - P_1
    draw_path(ax, np.array([[0, 0], (1 + case.e) * P_1, P]))
    ax.plot(*np.array([(1 + case.e) * P_1, stuck]).T, color=PATH, lw=1, ls=":", zorder=3)
    ax.plot(*np.array([P_1, P_2]).T, color=GREY, lw=1, ls=":", zorder=3)
    mark(ax, P_1, "$P_I$", (18, 12) if P_2[0] < 0 else (-18, 8))
    mark(ax, P_2, "$P_{II}$", (14, -14))
    mark(ax, (1 + case.e) * P_1, "$(1+e)\\,P_I$", (20, 12) if P_2[0] < 0 else (-22, 6))
    if np.allclose(stuck, P):
        mark(ax, P, "$P$,  κ = 1", (18, 16), ANSWER)
    else:
        mark(ax, stuck, "κ = 1", (-10, 14), GREY)
        mark(ax, P, "$P$", (-14, 16), ANSWER)


def draw_moreau(ax: Axes, case: Case) -> None:
    K, u = kinetics(case)
    raw, P = raw_moreau(case), answer(case, Law.MOREAU)
    span = np.array(case.window[:2])
    ax.plot(span, (-(1 + case.e) * u[1] - K[1, 0] * span) / K[1, 1], color=COMPRESSION, lw=1.2)
    if not np.allclose(raw, P):
        gain = energy_change(case, raw)
        ax.plot(*np.array([[0, 0], raw]).T, color=RAW, lw=1.6, ls=":", zorder=4)
        mark(ax, raw, f"Moreau's answer\ngains {gain:.5f} J", (-30, 13), RAW, "X")
        draw_path(ax, np.array([[0, 0], P]))
        mark(ax, P, "given instead:\nCOULOMB", (-50, 24), ANSWER)
    else:
        draw_path(ax, np.array([[0, 0], P]))
        mark(ax, P, "$P$: sticks", (-22, 26), ANSWER)


def draw_routh(law: Law, end: str) -> Callable[[Axes, Case], None]:
    def draw(ax: Axes, case: Case) -> None:
        P = answer(case, law)
        legs, rest = path(case, P[1])
        assert np.allclose(legs[-1], P)
        draw_path(ax, legs)
        slope = 1 if case is T2 else -1
        mark(ax, legs[1], "slip stops", (22, -12))
        mark(ax, rest, "compression\nends, $p_c$", (26 * slope, -8 if case is T2 else 12))
        mark(ax, P, end, (16 * slope, 18), ANSWER)

    return draw


def path(case: Case, p_end: float) -> tuple[np.ndarray, np.ndarray]:
    """Start, bend and end of Routh's path, and the end of compression, if slip stops and reverses."""
    K, u = kinetics(case)
    start = np.zeros(2)
    first = np.array([-case.mu * np.sign(u[0]), 1.0])
    stop = first * (-u[0] / (K @ first)[0])
    second = first * (-1, 1)
    assert 0 < stop[1] < p_end
    assert (K @ second)[0] * u[0] < 0, "it would stick"
    legs = np.array([start, stop, stop + second * (p_end - stop[1])])
    u_n = u[1] + (K @ stop)[1]
    rest = first * (-u[1] / (K @ first)[1]) if u_n > 0 else stop + second * (-u_n / (K @ second)[1])
    return legs, rest


# The other pictures ---------------------------------------------------------------------------


def draw_comparison() -> None:
    """Draw all answers together."""
    figure, axes = plt.subplots(1, 2, figsize=(8, 4.6), layout="constrained")
    labels = {
        T2: {
            Law.FRICTIONLESS: (20, 10),
            Law.COULOMB: (-12, 26),
            Law.MOREAU: (22, 0),
            Law.ROUTH_POISSON: (26, -20),
            Law.ROUTH_STRONGE: (-16, -30),
        },
        T3: {
            Law.FRICTIONLESS: (-16, 10),
            Law.COULOMB: (4, -40),
            Law.ROUTH_POISSON: (18, -22),
            Law.ROUTH_STRONGE: (22, 6),
        },
    }
    for ax, case in zip(axes, CASES, strict=True):
        draw_plane(ax, case)
        for law, offset in labels[case].items():
            mark(ax, answer(case, law), law.name, offset, ANSWER)
    mark(axes[1], raw_moreau(T3), "MOREAU, raw", (-40, 14), RAW, "X")
    axes[0].set(xlim=(-0.38, 0.24), ylim=(0.27, 0.8125))
    axes[1].set(xlim=(-0.5, 0.7), ylim=(0.60, 1.65))
    axes[0].set_ylabel("$p_n$  [N s]")
    handles = [h for h in legend_handles() if h.get_label() != "path"]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8.5, frameon=False)
    save(figure, "impact-law-comparison.png")


def draw_rods() -> None:
    """Draw the rods of T2 and T3."""
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.0), layout="constrained")
    for ax, case in zip(axes, CASES, strict=True):
        end = np.array([math.cos(case.angle), math.sin(case.angle)])
        ax.fill_between([-0.6, 1.2], -0.14, 0, color="#dddddd", lw=0)
        ax.plot([-0.6, 1.2], [0, 0], color=INK, lw=1.2)
        ax.plot(*np.array([[0, 0], end]).T, color=INK, lw=5, solid_capstyle="round")
        ax.plot(*(end / 2), marker="o", color="white", mec=INK, ms=6)
        arrow(ax, end / 2, end / 2 + np.array(case.velocity) * 0.3, PATH, "$u$", (9, 3))
        arrow(ax, (0, 0), (0, 0.4), COMPRESSION, "$n$", (9, 3))
        arrow(ax, (0, 0), (0.4, 0), STICKING, "$t$", (0, -9))
        turn = np.linspace(0, case.angle, 40)
        ax.plot(0.2 * np.cos(turn), 0.2 * np.sin(turn), color=GREY, lw=1)
        middle = case.angle / 2
        ax.text(0.28 * math.cos(middle), 0.28 * math.sin(middle), "θ", color=GREY, ha="center", va="center")
        ax.set(xlim=(-0.6, 1.2), ylim=(-0.14, 1.0), aspect="equal")
        ax.set_axis_off()
        ax.set_title(case.title(), fontsize=9)
    save(figure, "impact-law-rods.png")


SPHERE = [[3.5, 0.0, 0.0], [0.0, 3.5, 0.0], [0.0, 0.0, 1.0]]
"""Inverse effective mass of a solid sphere of 1 kg at its contact; the normal is z."""

with PAGE.with_name("kharaz-2001.csv").open(newline="") as _file:
    KHARAZ = [(float(row["incidence"]), float(row["ratio"])) for row in csv.DictReader(_file) if row["ratio"]]
"""Angle of incidence [deg], and tangential velocity of the centre after the impact over that before."""


def rebound(degrees: float, law: Law, kappa: float) -> tuple[float, float]:
    """Slip of a sphere of speed 1 after the impact; tangential velocity of its centre, after over before."""
    u_t, u_n = math.sin(math.radians(degrees)), -math.cos(math.radians(degrees))
    model = ImpactModel(law, stiffness_ratio=kappa)
    impact = resolve_contact(SPHERE, (u_t, 0, u_n), (0, 0, 1), 0.98, 0.092, model)
    return impact.velocity_after.x, (u_t + impact.impulse.x) / u_t


def draw_compliant() -> None:
    """Draw the slip of a sphere after the impact, and the velocity of its centre with measurements."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    angles, own = np.linspace(0.5, 65, 200), stiffness_ratio(Elastic(0.23), Elastic(0.23))
    curves = [
        ("COMPLIANT, κ = 0.87", Law.COMPLIANT, own, ANSWER, "-"),
        ("COMPLIANT, κ = 20", Law.COMPLIANT, 20.0, PATH, "--"),
        ("ROUTH_STRONGE, COULOMB", Law.ROUTH_STRONGE, own, COMPRESSION, "-."),
    ]
    for label, law, kappa, color, style in curves:
        slips, ratios = zip(*(rebound(angle, law, kappa) for angle in angles), strict=True)
        axes[0].plot(angles, slips, color=color, ls=style, lw=1.8, label=label)
        axes[1].plot(angles, ratios, color=color, ls=style, lw=1.8)
    axes[0].axhline(0, color=GREY, lw=0.8)
    axes[0].set(xlim=(0, 50), ylim=(-0.17, 0.4), ylabel="slip after, over the speed before")
    axes[0].legend(loc="upper left", fontsize=8.5, frameon=False)
    axes[1].plot(*zip(*KHARAZ, strict=True), "o", color=INK, ms=5, label="measured (Kharaz et al. 2001)")
    axes[1].set(xlim=(0, 65), ylim=(0.5, 1), ylabel="tangential velocity of the centre, after / before")
    axes[1].legend(loc="upper left", fontsize=8.5, frameon=False)
    for ax in axes:
        ax.set_xlabel("angle of incidence from the normal  [°]")
    save(figure, "impact-law-compliant.png")


def draw_restitution() -> None:
    """Draw the coefficients that depend on the approach speed."""
    figure, ax = plt.subplots(figsize=(8, 3.4), layout="constrained")
    v = np.geomspace(1e-3, 30, 400)
    curves = {
        "viscoelastic(beta=0.1)": (restitution.viscoelastic(0.1), COMPRESSION),
        "viscoelastic(beta=0.4)": (restitution.viscoelastic(0.4), ENERGY),
        "plastic(yield_speed=0.01)": (restitution.plastic(0.01), PATH),
        "plastic(yield_speed=0.1)": (restitution.plastic(0.1), STICKING),
    }
    for label, (e, color) in curves.items():
        ax.semilogx(v, [e(x) for x in v], color=color, lw=2, label=label)
    ax.set(xlim=(v[0], v[-1]), ylim=(0, 1.05), xlabel="approach speed $v$  [m/s]", ylabel="$e(v)$")
    ax.grid(color="#e5e5e5")
    ax.legend(loc="lower left", fontsize=9)
    save(figure, "impact-law-restitution.png")


# The tables -----------------------------------------------------------------------------------


HEAD = "case", "law", "$p_t$", "$p_n$", "$u_t^+$", "$u_n^+$", "ΔE", "by restitution", "by friction", "regime"


def values() -> Iterator[list[str]]:
    """Rows of the answers to T1, T2, T3 and T3 with e = 1; energies are gains."""
    for case in (T1, T2, T3, T3._replace(name="T3, $e=1$", e=1.0)):
        for law in LAWS:
            impact = case.resolve(law)
            lost = [impact.energy_lost_restitution, impact.energy_lost_friction]
            gained = [-sum(lost), *(-x for x in lost)]
            P = np.array(impact.impulse[:2])
            name = f"`{law.name}`"
            if impact.model.law is not law:
                raw = raw_moreau(case)
                yield row_of(case, f"{name}, raw", raw, [energy_change(case, raw)])
                name += ", as answered"
            yield row_of(case, name, P, gained, impact.regime.name)


def row_of(case: Case, law: str, P: np.ndarray, energies: list[float], regime: str = "") -> list[str]:
    K, u = kinetics(case)
    numbers = [decimals(x) for x in (*P, *(u + K @ P), *energies)]
    return [case.name, law, *numbers, *[""] * (3 - len(energies)), regime]


def decimals(x: float) -> str:
    """Text with five decimals; rounding errors become 0."""
    return "0" if abs(x) < 1e-12 else f"{x:.5f}"


COSTS = "law", "`resolve()`, plane", "`resolve()`, space"


def costs() -> Iterator[list[str]]:
    """Rows of the times of a call [µs], the fastest of 15, and the ratio to the frictionless law."""
    requests = {"plane": (T2.rod(), Body.static(), T2.contact()), "space": tumbling_box()}
    calls = {
        (law, where): partial(resolve, *request, ImpactModel(law))
        for law in LAWS
        for where, request in requests.items()
    }
    fastest = {key: 1e6 * min(times) for key, times in interleaved(calls, rounds=15, seconds=0.02).items()}
    for law in LAWS:
        pairs = [(fastest[law, where], fastest[Law.FRICTIONLESS, where]) for where in requests]
        yield [f"`{law.name}`", *(f"{us:.1f} µs ({us / base:.1f})" for us, base in pairs)]


def tumbling_box() -> tuple[Body, Body, Contact]:
    """A box on its corner, in space: the slip turns and then stops."""
    body = Body.dynamic(
        2.0,
        box(2.0, (1.0, 0.6, 0.3)).inertia,
        (0.1, -0.2, 0.5),
        (0.2, 0.4, 0.1, 0.9),
        (1.0, 0.5, -2.0),
        (1.0, -2.0, 0.5),
    )
    return body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)


def main() -> None:
    draw_rods()
    picture("impact-law-frictionless.png", draw_frictionless)
    picture("impact-law-coulomb.png", draw_coulomb)
    bounce = Line2D([], [], color=COMPRESSION, lw=1.2, label="$u_n^+ = -e\\,u_n$: Newton's end")
    picture("impact-law-moreau.png", draw_moreau, bounce, path="from the origin to the answer")
    picture("impact-law-routh-poisson.png", draw_routh(Law.ROUTH_POISSON, "$p = (1+e)\\,p_c$"))
    picture("impact-law-routh-stronge.png", draw_routh(Law.ROUTH_STRONGE, "$W = (1-e^2)\\,W_c$"))
    draw_compliant()
    draw_comparison()
    draw_restitution()
    rewrite(PAGE, {"values": table(HEAD, values()), "cost": table(COSTS, costs())})
    print(f"==> wrote docs/{PAGE.name}")


if __name__ == "__main__":
    main()
