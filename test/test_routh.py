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
from routh_problems import FAMILIES, Problem, oblique, planar

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


STIFF = {
    "35 and 307": ((35.0, 0.0, 0.106, 307.0, -0.524, 1.0), (53.5, -0.29, -1.0), 0.51),
    "1.2 and 12": (
        (1.2272363669562472, 0.0, -0.03152744187973586, 11.985931394709885, 0.25340275167905824, 1.0),
        (2.9765833891760973, 0.10396002502344429, -1.0),
        0.52727626213374,
    ),
}
"""``K``, ``u`` and friction of slip that turns fast while it hardly slows down: the error estimate of the
steps vanishes where the error does not."""


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("e", [0.0, 0.5])
@pytest.mark.parametrize("stiff", STIFF.values(), ids=STIFF)
def test_the_bound_covers_steps_whose_error_estimate_vanishes(stiff, e, law):
    (xx, xy, xz, yy, yz, zz), u, mu = stiff
    n, K = (0.0, 0.0, 1.0), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    P, _ = oracle(law, (stiff[0], u, n), e, mu)
    for tolerance in (0.0, 1e-3, 1e-6, 1e-9, 1e-11):
        impact = resolve_contact(K, u, n, e, mu, ImpactModel(law, tolerance=tolerance))
        with mp.workdps(40):
            error = mp.norm([x - y for x, y in zip(impact.impulse, P, strict=True)])
            assert error <= impact.error_bound * mp.norm(P), tolerance


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
