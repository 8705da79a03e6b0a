"""Planar impacts whose effective masses, friction and slip have extreme ratios, against closed forms.

A body of mass 1 and moment 1 strikes with a lever of powers of two, so that ``K`` and ``u`` are exact. Its
friction is that of a tie between two regimes, one unit next to it, or extreme.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import pytest

pytest.importorskip("flint")
pytest.importorskip("mpmath")

import numpy as np
from exact_adapter import exact_answer, true_error
from mpmath import mp
from oracle.in_plane import coulomb_in_plane, moreau_in_plane, routh_in_plane

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.batch import body_rows, contact_rows, resolve_batch

DIGITS = 700
"""Of the closed forms: more than any of these requests can cancel."""

ROUTH = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
PRECISIONS = (Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED)
LEVERS = [
    *product((0.0, 1.0, -3.0), (0.0, 1.0, 5.0)),
    *product((2.0**20, -(2.0**30), 2.0**50), (0.0, 2.0**-20, -1.0, 2.0**10)),
    *product((2.0**-20, 1.0, 2.0**10), (2.0**20, -(2.0**30))),
]
SLIPS = (0.0, 1e-100, -1e-20, 2.0**-53, 1.0, -1e8, 1e20)
ROUNDING = 2.0**-50
"""Relative, of energies and of the cone: a few roundings of numbers that are not part of the bound."""


class Case(NamedTuple):
    """A lever from the centre of mass to the contact, the slip, and both coefficients."""

    x: float
    y: float
    slip: float
    e: float
    mu: float

    def request(self) -> tuple[Body, Body, Contact]:
        inertia = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
        body = Body.dynamic(1.0, inertia, (-self.x, -self.y, 0.0), velocity=(self.slip, -1.0, 0.0))
        return body, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), self.e, self.mu)

    def numbers(self):
        """``K``, ``u``, ``e`` and ``mu`` for the closed forms."""
        x, y, slip, e, mu = map(mp.mpf, self)
        return (1 + y * y, -x * y, 1 + x * x), (slip, mp.mpf(-1)), e, mu


def frictions(x: float, y: float) -> Iterator[float]:
    """Ties: the least friction that holds the contact, the least that jams it; and others."""
    yield from (0.5, 2.0, 1e-300, 1e8, 2.0**100)
    hold, jam = abs(x * y) / (1 + y * y), (1 + x * x) / (abs(x * y) or 1.0)
    for tie in (hold, jam):
        if tie:
            yield from (tie / 2, math.nextafter(tie, 0.0), tie, math.nextafter(tie, math.inf), 2 * tie)


def cases(slips: tuple[float, ...], frictions_of, count: int) -> list[Case]:
    """Every ``n``-th combination, so that about ``count`` remain."""
    every = [
        Case(x, y, slip, e, mu)
        for (x, y), slip, e in product(LEVERS, slips, (0.0, 0.5, 1.0, 2.0**-30))
        for mu in frictions_of(x, y)
    ]
    step = len(every) // count
    step += 1 - step % 2  # odd, so that no coefficient is passed over
    return every[::step]


def error_of(impact: Impact, P) -> mp.mpf:
    with mp.workdps(DIGITS):
        return mp.hypot(impact.impulse.x - P[0], impact.impulse.y - P[1]) / mp.hypot(*P)


def assert_sound(impact: Impact, mu: float) -> None:
    """In the cone, without energy gained, and with losses that add up."""
    assert impact.impulse.z == 0
    if impact.error_bound < 1:
        slack = min(1 + mu, 1e300) * 2 * impact.error_bound * math.hypot(*impact.impulse) + 5e-324
        assert abs(impact.impulse.x) <= mu * impact.impulse.y * (1 + ROUNDING) + slack
        assert impact.normal_impulse == max(impact.impulse.y, 0.0)
        before, after = impact.kinetic_energy_before, impact.kinetic_energy_after
        unit = before + abs(impact.energy_lost_restitution) + abs(impact.energy_lost_friction)
        slack = unit * (4 * impact.error_bound + ROUNDING)
        assert after <= before + slack
        lost = impact.energy_lost_restitution + impact.energy_lost_friction
        assert abs(before - after - lost) <= slack


@pytest.mark.parametrize("precision", PRECISIONS, ids=lambda precision: precision.name)
@pytest.mark.parametrize("law", ROUTH, ids=lambda law: law.name)
def test_routh_at_extreme_ratios(law, precision):
    for case in cases(SLIPS, frictions, 600):
        impact = resolve(*case.request(), ImpactModel(law, precision=precision))
        with mp.workdps(DIGITS):
            P = routh_in_plane(*case.numbers(), law is Law.ROUTH_STRONGE)
        assert error_of(impact, P) <= impact.error_bound, case
        assert_sound(impact, case.mu)


@pytest.mark.parametrize("law", ROUTH, ids=lambda law: law.name)
@pytest.mark.parametrize("slip", [1e-20, -1e-20, 2.0**-53, -(2.0**-53)])
@pytest.mark.parametrize("lever", [(2.0**30, 2.0**-20), (2.0**50, 1.0), (2.0**60, 5.0), (2.0**30, 1.0)])
def test_a_contact_that_slips_on_after_it_stopped_where_the_other_axis_is_far_stiffer(law, slip, lever):
    """The direction in which it slips on is a root with the scale of one axis, not of their sum."""
    for mu, e in product((1.0, 1.5, 2.0), (0.0, 0.5, 1.0)):
        case = Case(*lever, slip, e, mu)
        impact = resolve(*case.request(), ImpactModel(law))
        with mp.workdps(DIGITS):
            P = routh_in_plane(*case.numbers(), law is Law.ROUTH_STRONGE)
        assert error_of(impact, P) <= impact.error_bound < 1e-6, case
        assert impact.status is StatusCode.OK
        with mp.workdps(DIGITS):
            (tt, tn, _), (u_t, _), *_ = case.numbers()
            is_reversed = u_t * (u_t + tt * P[0] + tn * P[1]) < 0
        assert impact.regime is (Regime.REVERSED if is_reversed else Regime.SLIDING)


GREAT = (1e99, 1e100, math.nextafter(1e100, math.inf), 1e101, 1e120, 1e200, 1.7e308)


@pytest.mark.parametrize("law", [*ROUTH, Law.MOREAU, Law.COULOMB], ids=lambda law: law.name)
@pytest.mark.parametrize("precision", PRECISIONS, ids=lambda precision: precision.name)
def test_friction_above_any_limit(law, precision):
    """The laws compute with at most 1e100, and the bound includes the difference. It is infinite only with so
    much slip that more friction would change the answer."""
    every = cases((0.0, 1e-20, 1.0, -1e8, 1e20, 1e90, 1e100, -1e120), lambda x, y: GREAT, 400)
    for case in every:
        try:
            impact = resolve(*case.request(), ImpactModel(law, precision=precision))
        except ImpactError as refusal:
            assert (law, precision) == (Law.COULOMB, Precision.DOUBLE)
            assert refusal.code is StatusCode.OUT_OF_RANGE
            continue
        with mp.workdps(DIGITS):
            if law in ROUTH:
                P = routh_in_plane(*case.numbers(), law is Law.ROUTH_STRONGE)
            elif law is Law.COULOMB or Adjustment.LAW_FALLBACK in impact.adjustments:
                P = coulomb_in_plane(*case.numbers())
            else:
                P, gain = moreau_in_plane(*case.numbers())
                assert gain <= 2.0**-44
        assert error_of(impact, P) <= impact.error_bound, case
        if precision is Precision.AUTO and abs(case.slip) < 1e80:
            assert impact.error_bound < 1e-6, case


@pytest.mark.parametrize("precision", [*PRECISIONS, Precision.SINGLE], ids=lambda precision: precision.name)
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU], ids=lambda law: law.name)
def test_closed_forms_at_extreme_ratios(law, precision):
    for case in cases(SLIPS, frictions, 500):
        try:
            impact = resolve(*case.request(), ImpactModel(law, precision=precision))
        except ImpactError as refusal:
            assert refusal.code is StatusCode.OUT_OF_RANGE
            assert precision in (Precision.SINGLE, Precision.DOUBLE)
            continue
        with mp.workdps(DIGITS):
            if law is Law.COULOMB or Adjustment.LAW_FALLBACK in impact.adjustments:
                P = coulomb_in_plane(*case.numbers())
            else:
                P, gain = moreau_in_plane(*case.numbers())
                # A gain that may be rounding is none: docs/stability.md.
                assert impact.error_bound > 2.0**-44 or gain <= 2.0**-44, case
        assert error_of(impact, P) <= impact.error_bound, case
        assert_sound(impact, case.mu)


@pytest.mark.parametrize("slip", [0.1, 1.0, 10.0, 1e10])
@pytest.mark.parametrize("friction", [0.3, 3.0, 1e10, 1e18])
def test_moreau_in_single_precision_has_a_bound(slip, friction):
    """Its greatest friction, 1e100, is no number of float32."""
    case = Case(0.5, 0.25, slip, 0.5, friction)
    impact = resolve(*case.request(), ImpactModel(Law.MOREAU, precision=Precision.SINGLE))
    with mp.workdps(DIGITS):
        P, _ = moreau_in_plane(*case.numbers())
    assert error_of(impact, P) <= impact.error_bound < 1e-3


@pytest.mark.parametrize("slip", [0.0, 1.0, 1e10, 1e30])
@pytest.mark.parametrize("friction", [1e30, 3e38, 1e39, 1e100, 1e300])
def test_moreau_in_single_precision_refuses_by_name_what_it_cannot_hold(slip, friction):
    case = Case(0.5, 0.25, slip, 0.5, friction)
    try:
        impact = resolve(*case.request(), ImpactModel(Law.MOREAU, precision=Precision.SINGLE))
    except ImpactError as refusal:
        assert refusal.code is StatusCode.OUT_OF_RANGE
        assert "ask for AUTO or EXTENDED" in refusal.reason
    else:
        with mp.workdps(DIGITS):
            P, _ = moreau_in_plane(*case.numbers())
        assert error_of(impact, P) <= impact.error_bound
    assert resolve(*case.request(), ImpactModel(Law.MOREAU)).status is StatusCode.OK


@pytest.mark.parametrize("slip", [0.0, 1.0, -1e-20])
@pytest.mark.parametrize("lever", [(0.0, 0.0), (0.0, 2.0**20), (1.0, -1.0)])
def test_moreau_with_the_least_friction(slip, lever):
    case = Case(*lever, slip, 0.5, 5e-324)
    impact = resolve(*case.request(), ImpactModel(Law.MOREAU))
    with mp.workdps(DIGITS):
        P, _ = moreau_in_plane(*case.numbers())
    assert error_of(impact, P) <= impact.error_bound < 1e-12


def test_resolve_answers_what_a_batch_answers():
    """Levers whose squares nearly overflow, in space. Pairs of float64, which EXTENDED computes with, then
    overflow where float64 does not; the numbers of DOUBLE remain, without a bound."""
    draw, rows, unbounded = random.Random(1), body_rows(Geometry.SPATIAL), 0
    contact_row, unit = contact_rows(Geometry.SPATIAL), np.array([1.0, 0, 0, 1.0, 0, 1.0])

    def vector(size: float) -> tuple[float, ...]:
        return tuple(size * draw.choice([0.0, 1.0, -1.0, draw.uniform(-1, 1)]) for _ in range(3))

    for _ in range(600):
        bodies = np.zeros((rows.height, 2))
        for side in range(2):
            mass = draw.choice([1.0, 1e-10, 1e10, 1e-100])
            bodies[rows.mass, side] = mass
            bodies[rows.inertia, side] = mass * draw.choice([1.0, 1e100, 1e200]) * unit
            bodies[rows.position, side] = vector(draw.choice([1e152, 1e153, 1e154]))
            bodies[rows.velocity, side] = vector(draw.choice([1.0, 1e-10, 1e-100]))
            bodies[rows.angular_velocity, side] = vector(draw.choice([0.0, 1.0, 1e-154]))
        contact = Contact.of(vector(1.0), draw.choice([(1, 0, 0), (0, 1, 0), (1, 2, -3)]), 0.5, 2.0)
        columns = np.zeros((contact_row.height, 1))
        columns[contact_row.position, 0], columns[contact_row.normal, 0] = contact.position, contact.normal
        columns[contact_row.restitution], columns[contact_row.friction] = 0.5, 2.0
        model = ImpactModel(draw.choice([Law.COULOMB, Law.MOREAU, *ROUTH]))
        batch = resolve_batch(bodies, columns, model, pairs=[[0], [1]], report=True)
        if batch.status[0] not in (StatusCode.OK, StatusCode.SEPARATING):
            continue
        a, b = (
            Body.dynamic(
                bodies[rows.mass, side].item(),
                bodies[rows.inertia, side].tolist(),
                bodies[rows.position, side].tolist(),
                None,
                bodies[rows.velocity, side].tolist(),
                bodies[rows.angular_velocity, side].tolist(),
            )
            for side in range(2)
        )
        impact = resolve(a, b, contact, model)
        unbounded += impact.error_bound == math.inf
        if model.law is Law.COULOMB:
            assert true_error(impact, exact_answer(a, b, contact, model)) <= impact.error_bound
    assert unbounded


@pytest.mark.parametrize("friction", [4.0, 1e10, 1e300])
def test_moreau_in_extended_precision_sees_the_least_gain_of_energy(friction):
    """With e = 1, a contact that sticks against the least slip gains energy, far more than rounding there."""
    for (x, y), power in product(((1.0, 1.0), (1.0, 0.5), (1024.0, 512.0), (3.0, -1.0)), range(-53, -29)):
        for slip in (2.0**power, -(2.0**power)):
            case = Case(x, y, slip, 1.0, friction)
            with mp.workdps(DIGITS):
                _, gain = moreau_in_plane(*case.numbers())
                P = coulomb_in_plane(*case.numbers())
            if gain <= 0:
                continue
            impact = resolve(*case.request(), ImpactModel(Law.MOREAU, precision=Precision.EXTENDED))
            assert impact.adjustments is Adjustment.LAW_FALLBACK, case
            assert error_of(impact, P) <= impact.error_bound, case


@pytest.mark.parametrize("law", [Law.MOREAU, Law.COULOMB])
def test_numbers_at_both_ends_of_float64_are_answered_or_refused(law):
    """With MOREAU, some leave to fractions beyond float64 whether they separate."""
    draw = random.Random(3)
    numbers = [0.0, 1.0, -1.0, 0.3, 1e-5, 5e-324, 1e-300, 1e154, 1e308, -1e308]

    def vector():
        return tuple(draw.choice(numbers) for _ in range(3))

    inertia = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    for _ in range(100):
        body = Body.dynamic(abs(draw.choice(numbers)) or 1.0, inertia, vector(), None, vector(), vector())
        other = Body.dynamic(1.0, inertia, vector(), None, vector(), vector())
        contact = Contact.of(vector(), (draw.choice(numbers), 0.3, 1e308), 0.5, 1e308)
        try:
            impact = resolve(body, other, contact, ImpactModel(law))
        except ImpactError as error:
            assert error.code in (StatusCode.OUT_OF_RANGE, StatusCode.INVALID_MASS)
            continue
        assert impact.status in (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)
