"""Routh's law against published values and the oracle, and its error bound."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

pytest.importorskip("mpmath")

from bounded import ROUNDING, Bounded
from mpmath import mp
from oracle.laws import impulse

from collision_response import (
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Precision,
    StatusCode,
    resolve,
    resolve_contact,
)
from collision_response.in_python import arbitrary_precision
from collision_response.physics.effective_mass import ContactNumbers
from collision_response.physics.laws import Coefficients, Law, Outcome, Settings
from collision_response.physics.laws.routh import routh
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

LAWS = Law.ROUTH_POISSON, Law.ROUTH_STRONGE
MOST_ERROR = 3e-12
"""Relative error of an impulse: the path is followed to 1e-12, and the rest is rounding at condition numbers
below 1e3."""
MOST_BOUND = 1e-8
"""The bound multiplies the error of the path by the condition number of K."""


Problem = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
"""``K``, ``u`` and ``n``."""


def contact_numbers(
    problem: Problem, number: Callable[[float], Any] = float, once: Callable = float
) -> ContactNumbers:
    """The contact as a law gets it; ``n.u`` and ``n.K n`` are rounded once."""
    K, u, n = problem
    exact_K, exact_u, exact_n = Symmetric3(*map(Fraction, K)), *(Vec3(*map(Fraction, v)) for v in (u, n))
    n_u, n_Kn = float(exact_n.dot(exact_u)), float(exact_n.dot(exact_K @ exact_n))
    return ContactNumbers(
        Vec3(*map(number, n)), Vec3(*map(number, u)), once(n_u), once(n_Kn), Symmetric3(*map(number, K))
    )


def run(law: Law, problem: Problem, e: float, mu: float) -> Outcome:
    return routh(contact_numbers(problem), Coefficients(e, mu, Settings(law=law)))


def run_bounded(law: Law, problem: Problem, e: float | Bounded, mu: float) -> Outcome:
    contact = contact_numbers(problem, Bounded, lambda x: Bounded(x, abs(x) * ROUNDING))
    e = e if isinstance(e, Bounded) else Bounded(e)
    return routh(contact, Coefficients(e, Bounded(mu), Settings(law=law)))


def oracle(law: Law, problem: Problem, e: float, mu: float):
    (xx, xy, xz, yy, yz, zz), u, n = problem
    digits = 20 if mu < 100 else 30 if mu < 1e5 else 150 if mu < 1e100 else 330
    return impulse(law.name.lower(), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], u, n, e, mu, digits=digits)


def rod(angle: float) -> tuple[float, ...]:
    """``K`` of a uniform rod of mass and length 1 that strikes with its end; the normal is along y."""
    c, s = math.cos(angle), math.sin(angle)
    return (1 + 3 * s * s, -3 * s * c, 0.0, 1 + 3 * c * c, 0.0, 1.0)


def box(draw: random.Random) -> list[list[float]]:
    """``K`` of a slender, flat or compact box, struck at a corner or inside."""
    edges = draw.choice(
        [
            [draw.uniform(0.2, 2) for _ in "xyz"],
            [0.02, 0.02, draw.uniform(1, 3)],
            [0.02, draw.uniform(0.5, 2), draw.uniform(0.5, 2)],
            [1.0, 1.0, 1.0],
        ]
    )
    mass, squares = draw.uniform(0.2, 5), [edge * edge for edge in edges]
    moments = [mass / 12 * (sum(squares) - square) for square in squares]
    q = [draw.gauss(0, 1) for _ in range(4)]
    x, y, z, w = (c / math.hypot(*q) for c in q)
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    is_corner = draw.random() < 0.5
    at = [(draw.choice([-0.5, 0.5]) if is_corner else draw.uniform(-0.5, 0.5)) * edge for edge in edges]
    r = Vec3(*(sum(R[i][j] * at[j] for j in range(3)) for i in range(3)))
    arms = [(r.cross(Vec3(*(R[i][k] for i in range(3)))), moments[k]) for k in range(3)]
    return [
        [(i == j) / mass + sum(arm[i] * arm[j] / moment for arm, moment in arms) for j in range(3)]
        for i in range(3)
    ]


def oblique(draw: random.Random, grazing: float = 0.0) -> Problem:
    """Any contact in space; the approach may be down to ``10**grazing`` of the slip."""
    bodies = [box(draw)] + ([box(draw)] if draw.random() < 0.5 else [])
    K = [[sum(body[i][j] for body in bodies) for j in range(3)] for i in range(3)]
    n, u = (Vec3(*(draw.gauss(0, 1) for _ in "xyz")) for _ in "nu")
    down = 10 ** draw.uniform(grazing, 0) if grazing else abs(u.dot(n)) / n.norm()
    u = u - n * (u.dot(n) / n.dot(n)) - n * (down / n.norm())
    return (K[0][0], K[0][1], K[0][2], K[1][1], K[1][2], K[2][2]), tuple(u), tuple(n)


def planar(draw: random.Random) -> Problem:
    turn, scale = draw.uniform(0, 7), draw.uniform(0.3, 3)
    xx, xy, _, yy, _, zz = (scale * k for k in rod(draw.uniform(0, math.pi)))
    c, s, ux, uy = math.cos(turn), math.sin(turn), draw.uniform(-2, 2), -draw.uniform(0.1, 2)
    K = (c * c * xx - 2 * c * s * xy + s * s * yy, c * s * (xx - yy) + (c * c - s * s) * xy, 0.0,
         s * s * xx + 2 * c * s * xy + c * c * yy, 0.0, zz)  # fmt: skip
    return K, (c * ux - s * uy, s * ux + c * uy, 0.0), (-s, c, 0.0)


def slow(draw: random.Random) -> Problem:
    """A contact with hardly any slip."""
    K, u, n = oblique(draw)
    u, n = Vec3(*u), Vec3(*n)
    along = n * (u.dot(n) / n.dot(n))
    return K, tuple((u - along) * 10 ** draw.uniform(-16, -3) + along), tuple(n)


def head_on(draw: random.Random) -> Problem:
    K, _, n = oblique(draw)
    return K, tuple(-1.5 * x for x in n), n


FRICTION = (0.1, 0.3, 1.0, 5.0)
JAMMING = 3.0


def jammed(draw: random.Random) -> Problem:
    """Friction of ``JAMMING`` presses the bodies together, to an impulse far above that of the approach."""
    while True:
        K, u, n = problem = oblique(draw, -9)
        up = Vec3(*n) / Vec3(*n).norm()
        slip = Vec3(*u) - up * up.dot(Vec3(*u))
        push = up - slip * (JAMMING / slip.norm())
        if up.dot(Symmetric3(*K) @ push) < 0:
            return problem


FAMILIES = {
    "planar": (planar, (0.0, *FRICTION)),
    "space": (oblique, FRICTION),
    "grazing": (lambda draw: oblique(draw, -12), FRICTION),
    "slow": (slow, FRICTION),
    "head_on": (head_on, FRICTION),
    "rough": (oblique, (1e4, 1e60, 1e300)),
    "smooth": (oblique, (0.0, 1e-300, 1e-8)),
    "jammed": (jammed, (JAMMING, 2 * JAMMING)),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("family", FAMILIES)
def test_impulse_and_bound(family, law):
    make, frictions = FAMILIES[family]
    draw, compared = random.Random(family), 0
    for _ in range(4 if make is planar else 2):
        problem = make(draw)
        e, mu = draw.choice([0.0, 1e-8, 0.5, 1.0, draw.random()]), draw.choice(frictions)
        try:
            P, report = oracle(law, problem, e, mu)
        except ArithmeticError:  # two roots of the oracle coincide
            continue
        compared += 1
        size = float(mp.norm(P))
        oracles = 1e-18 * size  # the oracle's own error
        plain, bounded = run(law, problem, e, mu), run_bounded(law, problem, e, mu)
        assert not plain.unfinished
        for x, y, z in zip(plain.impulse, bounded.impulse, P, strict=True):
            assert abs(x - z) <= MOST_ERROR * size
            assert y.covers(z, oracles)
            assert y.error <= MOST_BOUND * size
        lost = bounded.energy_lost_restitution + bounded.energy_lost_friction
        assert lost.covers(-report.energy, -report.un_before * oracles)
        assert plain.energy_lost_friction >= 0
        if law is Law.ROUTH_STRONGE:
            assert plain.energy_lost_restitution >= 0
    assert compared >= 1


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_bound_covers_any_error_of_restitution(family, law):
    """At a restitution threshold, e is 0 or itself: one of them with the other as its error."""
    make, frictions = FAMILIES[family]
    draw = random.Random(family)
    for value, error in (
        (0.0, 0.5),
        (0.0, 1.0),
        (0.0, 1e-9),
        (0.5, 0.5),
        (1e-6, 1e-6),
        (0.25, 0.125),
        (1.0, 0.5),
    ):
        problem, mu = make(draw), draw.choice(frictions)
        bounded = run_bounded(law, problem, Bounded(value, error), mu)
        for part in (-1, -0.5, 0.5, 1):
            e = value + part * error
            if 0 <= e <= 1:
                for x, y in zip(run(law, problem, e, mu).impulse, bounded.impulse, strict=True):
                    assert y.covers(x, MOST_ERROR * abs(x)), (value, error, e)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("family", ["space", "grazing", "slow", "jammed"])
def test_the_bound_of_more_digits_covers_steps_in_floats(family, law):
    """EXTENDED follows slip that turns in floats, and only the rest of the path in 32 digits."""
    make, frictions = FAMILIES[family]
    draw, compared = random.Random(family), 0
    for _ in range(3):
        problem = make(draw)
        e, mu = draw.choice([0.0, 0.5, 1.0]), draw.choice(frictions)
        try:
            P, _ = oracle(law, problem, e, mu)
        except ArithmeticError:  # two roots of the oracle coincide
            continue
        compared += 1
        (xx, xy, xz, yy, yz, zz), u, n = problem
        K = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        impact = resolve_contact(K, u, n, e, mu, ImpactModel(law, precision=Precision.EXTENDED))
        with mp.workdps(40):
            error = mp.norm([x - y for x, y in zip(impact.impulse, P, strict=True)])
            assert error <= impact.error_bound * mp.norm(P)
        assert impact.error_bound <= MOST_BOUND
    assert compared >= 1


REFERENCE = (
    (
        math.pi / 4, 0.5, (1.0, -1.0, 0.0),
        (-0.11412429, 0.50847458, -0.19609148), (-0.11288499, 0.51260558, -0.19430798),
    ),
    (
        math.atan(2), 0.9, (0.5, -1.0, 0.0),
        (0.25, 1.28378378, -0.11918828), (0.25579294, 1.30309359, -0.10551032),
    ),
    (
        math.atan(2), 1.0, (0.5, -1.0, 0.0),
        (0.27027027, 1.35135135, -0.06939372), (0.27670687, 1.3728067, -0.05244936),
    ),
    (math.pi / 4, 0.5, (0.0, -1.0, 0.0), (9 / 41, 30 / 41, -0.243159), (9 / 41, 30 / 41, -0.243159)),
)  # fmt: skip


@pytest.mark.parametrize(("angle", "e", "u", "poisson", "stronge"), REFERENCE)
def test_rod_on_plane(angle, e, u, poisson, stronge):
    for law, (x, y, energy) in zip(LAWS, (poisson, stronge), strict=True):
        outcome = run(law, (rod(angle), u, (0.0, 1.0, 0.0)), e, 0.3)
        assert outcome.impulse == pytest.approx((x, y, 0), abs=6e-9)  # half of the last digit given
        assert outcome.energy_lost_restitution + outcome.energy_lost_friction == pytest.approx(
            -energy, abs=6e-7
        )


@pytest.mark.parametrize("law", LAWS)
def test_everyday_numbers(law):
    outcome = run(law, ((1.0, 0.0, 0.0, 1.0, 0.0, 1.0), (-3.0, -2.1, 0.0), (1.0, 0.7, 0.0)), 0.5, 0.5)
    assert outcome.impulse == pytest.approx((4.5, 3.15, 0), rel=1e-15)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("e", [1e-100, 1e-170, 1e-300, 5e-324])
def test_tiny_restitution_equals_none(law, e):
    """Its square may underflow."""
    draw = random.Random(3)
    for _ in range(6):
        problem = oblique(draw)
        outcome, plastic = run(law, problem, e, 0.3), run(law, problem, 0.0, 0.3)
        assert not outcome.unfinished
        assert outcome.impulse == pytest.approx(plastic.impulse, rel=1e-11, abs=1e-12)


def test_planar_slip_needs_no_loop(monkeypatch):
    monkeypatch.setitem(routh.__globals__, "step", pytest.fail)
    draw = random.Random(1)
    for _ in range(50):
        run(Law.ROUTH_STRONGE, planar(draw), 0.5, draw.choice((0.0, 0.3, 3.0)))


@pytest.mark.parametrize("law", [*LAWS, Law.COMPLIANT])
def test_no_digits_are_tried_that_cannot_help(monkeypatch, law):
    """The error of the steps remains with any number of digits, which took 1 ms."""
    monkeypatch.setattr(arbitrary_precision, "resolve", pytest.fail)
    top = Body.box(1.0, (0.3, 0.2, 0.1), velocity=(1.0, 0.5, -2.0), angular_velocity=(3.0, -1.0, 2.0))
    contact = Contact.of((0.1, 0.08, -0.05), (0.0, 0.0, 1.0), 0.5, 0.2)
    found = [
        resolve(top, Body.static(), contact, ImpactModel(law, precision=precision, tolerance=1e-15))
        for precision in (Precision.AUTO, Precision.EXTENDED)
    ]
    assert [answer.status for answer in found] == [StatusCode.TOLERANCE_NOT_MET] * 2
    assert all(answer.error_bound < 1e-9 for answer in found)


def test_the_bound_covers_errors_of_the_input():
    """The bound must contain the answer to other data within the given errors."""
    draw = random.Random(2)
    for _ in range(5):
        K, u, n = problem = oblique(draw)
        mu, law, part = draw.choice((0.1, 0.3, 1.0, 3.0)), draw.choice(LAWS), 10 ** draw.uniform(-13, -8)
        k, v, nn = max(map(abs, K)) * part, max(map(abs, u)) * part, sum(map(abs, n))
        contact = contact_numbers(problem, Bounded)
        contact = contact._replace(
            K=Symmetric3(*(Bounded(x, k) for x in K)),
            u=Vec3(*(Bounded(x, v) for x in u)),
            n_u=Bounded(contact.n_u, v * nn),
            n_Kn=Bounded(contact.n_Kn, k * nn * nn),
        )
        outcome = routh(contact, Coefficients(Bounded(0.5), Bounded(mu), Settings(law=law)))
        other_K = tuple(x + 0.99 * k * draw.choice((-1, 1)) for x in K)
        other_u = tuple(x + 0.99 * v * draw.choice((-1, 1)) for x in u)
        P, _ = oracle(law, (other_K, other_u, n), 0.5, mu)
        for x, z in zip(outcome.impulse, P, strict=True):
            assert x.covers(z)
            assert x.error < math.inf


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("slip", [0.0, 1e-20, 1e-18, 1e-16, 1e-15, 1e-12])
@pytest.mark.parametrize("lever", [2.0**10, 2.0**20, 2.0**30])
def test_the_bound_covers_slip_below_its_own_rounding(lever, slip, law):
    """Friction stops the slip. At such a lever the normal impulse is so small that this impulse counts."""
    body = Body.dynamic(1.0, (1.0, 0, 0, 1.0, 0, 1.0), (-lever, 0.0, 0.0), velocity=(slip, -1.0, 0.0))
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), restitution=0.5, friction=0.5)
    P_n = Fraction(3, 2) / (1 + Fraction(lever) ** 2)
    P_t = -min(Fraction(slip), P_n / 2)
    for precision in Precision:
        try:
            impact = resolve(body, Body.static(), contact, ImpactModel(law, precision=precision))
        except ImpactError:  # nothing is known at this precision
            continue
        x, y, _ = map(Fraction, impact.impulse)
        error = math.hypot(x - P_t, y - P_n) / math.hypot(P_t, P_n)
        assert error <= impact.error_bound
