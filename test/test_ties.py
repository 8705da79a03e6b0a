"""Contacts that just do not approach, or just at the restitution threshold: no number of digits tells."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from batch_cases import batch_of
from scene_cases import Scene, assert_within_bound

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.batch import one_by_one, resolve_batch
from collision_response.batch.result import REPORT
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.scene.resolve_scene import resolve_without_python

MODULE = sys.modules["collision_response.resolve"]

LAWS = [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE]


class Tie(NamedTuple):
    """A body that meets body_b at a contact, and a restitution threshold [m/s]."""

    body: Body
    contact: Contact
    threshold: float = 0.0
    body_b: Body = Body.static()

    def normal_velocity(self) -> Fraction:
        """Velocity of body_a relative to body_b along the normal, times the length of the normal."""
        n = [Fraction(x) for x in self.contact.normal]
        signs = (1, self.body), (-1, self.body_b)
        return sum((sign * _dot(n, _velocity(body, self.contact)) for sign, body in signs), Fraction(0))

    def approaches(self) -> bool:
        return self.normal_velocity() < 0

    def is_below(self) -> bool:
        n = [Fraction(x) for x in self.contact.normal]
        limit = Fraction(self.threshold) ** 2 * _dot(n, n)
        return self.approaches() and self.normal_velocity() ** 2 < limit

    def resolve(self, law: Law, **model: object) -> Impact:
        given = ImpactModel(law, restitution_threshold=self.threshold)._replace(**model)
        return resolve(self.body, self.body_b, self.contact, given)


def _dot(x: Sequence[Fraction], y: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(x, y, strict=True)), Fraction(0))


def _velocity(body: Body, contact: Contact) -> list[Fraction]:
    d = [Fraction(p) - Fraction(x) for p, x in zip(contact.position, body.position, strict=True)]
    x, y, z = (Fraction(w) for w in body.angular_velocity)
    turned = y * d[2] - z * d[1], z * d[0] - x * d[2], x * d[1] - y * d[0]
    return [Fraction(v) + t for v, t in zip(body.velocity, turned, strict=True)]


def body_at(velocity, spin=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), turned=False) -> Body:
    inertia = (0.5, 0.0, 0.0, 0.75, 0.0, 1.0)
    return Body.dynamic(1.5, inertia, position, (0.5, 0.5, 0.5, 0.5) if turned else None, velocity, spin)


def contact_along(normal, point=(0.0, 0.0, 0.0)) -> Contact:
    return Contact.of(point, normal, 0.5, 0.25)


def scaled(tie: Tie, speed: float, length: float) -> Tie:
    """The tie in other units: powers of two, so nothing is rounded."""

    def in_units(body: Body) -> Body:
        return body._replace(
            inertia=Symmetric3(*(x * length**2 for x in body.inertia)),
            position=Vec3(*body.position) * length,
            velocity=Vec3(*body.velocity) * speed,
            angular_velocity=Vec3(*body.angular_velocity) * (speed / length),
        )

    contact = tie.contact._replace(position=Vec3(*tie.contact.position) * length)
    return Tie(in_units(tie.body), contact, tie.threshold * speed, in_units(tie.body_b))


GRAZING = {
    "slope": Tie(body_at((2.0, 0.0, -1.0)), contact_along((1.0, 0.0, 2.0))),
    "decimals": Tie(body_at((0.3, 0.0, -0.1), turned=True), contact_along((0.1, 0.0, 0.3))),
    "three axes": Tie(body_at((2.0, 3.0, -8.0)), contact_along((1.0, 2.0, 1.0))),
    "rolling": Tie(
        body_at((2.0, 0.0, -1.0), (0.0, 3.0, 0.0), (1.0, 0.0, 2.0)), contact_along((1.0, 0.0, 2.0))
    ),
    "turning": Tie(
        body_at((4.0, -2.0, 1.0), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0), turned=True),
        contact_along((3.0, 1.0, 2.0), (2.0, 4.0, 3.0)),
    ),
    "both move": Tie(
        body_at((0.1, 0.7, 0.2)), contact_along((3.0, 7.0, 5.0)), body_b=body_at((0.1, 0.7, 0.2))
    ),
    "with a moving floor": Tie(
        body_at((0.25, 0.0, -0.5)),
        contact_along((1.0, 0.0, 3.0)),
        body_b=Body.kinematic(velocity=(1.0, 0.0, -0.75)),
    ),
}
AT_THRESHOLD = {
    "after a time step": Tie(body_at((1.0, 0.0, -9.81e-3)), contact_along((0.0, 0.0, 1.0)), 9.81e-3),
    "a long normal": Tie(body_at((0.5, 0.0, -1 / 3)), contact_along((0.0, 0.0, 3.0)), 1 / 3),
    "3, 4, 5": Tie(body_at((-3.0, -4.0, 1.0)), contact_along((3.0, 4.0, 0.0)), 5.0),
    "2, 3, 6": Tie(body_at((-1.0, -1.5, -3.0), turned=True), contact_along((2.0, 3.0, 6.0)), 3.5),
    "turning": Tie(
        body_at((0.0, 0.0, 1.0), (0.0, 2.0, 0.0)), contact_along((0.0, 0.0, 1.0), (1.0, 0.0, -0.5)), 1.0
    ),
    "both move": Tie(
        body_at((0.1, 0.0, -0.75)), contact_along((0.0, 0.0, 0.3)), 0.5, body_b=body_at((0.0, 0.0, -0.25))
    ),
}
TILTED = Body.dynamic(
    1.0,
    (0.06, -0.08 / 3, -0.08 / 3, 0.06, -0.08 / 3, 0.06),
    (1.0, 0.0, 2.0),
    None,
    (2.0, 0.0, -1.0),
    (0, 3.0, 0),
)
"""A long box along (1, 1, 1): its products of inertia are nearly as large as its moments."""
GRAZING["tilted"] = Tie(TILTED, contact_along((1.0, 0.0, 2.0)))
LONGEST = 1.75 * 2.0**1021
UNITS = [(1.0, 1.0), (2.0**30, 1.0), (2.0**-150, 2.0**40), (2.0**150, 2.0**-40)]


def next_to(tie: Tie) -> list[Tie]:
    """The tie, and with each number of the velocity, and the threshold, one place less or more."""
    ties = [tie]
    for i, to in product(range(3), (-math.inf, math.inf)):
        velocity = [*tie.body.velocity]
        velocity[i] = math.nextafter(velocity[i], to)
        ties.append(tie._replace(body=tie.body._replace(velocity=Vec3(*velocity))))
    if tie.threshold:
        ties += [tie._replace(threshold=math.nextafter(tie.threshold, to)) for to in (0.0, math.inf)]
    return ties


@pytest.fixture
def only_kernels(monkeypatch):
    """Where Python has to answer, an impact takes a thousand times as long."""

    def refuse(*request):
        pytest.fail("the kernels left the decision to Python")

    monkeypatch.setattr(MODULE, "_resolve_in_python", refuse)


def assert_unchanged(tie: Tie, impact: Impact) -> None:
    assert (impact.status, impact.regime) == (StatusCode.SEPARATING, Regime.SEPARATING)
    assert (impact.error_bound, impact.adjustments) == (0.0, Adjustment.NONE)
    assert impact.impulse == (0.0, 0.0, 0.0)
    assert impact.twist_a == (tie.body.velocity, tie.body.angular_velocity)
    assert impact.twist_b == (tie.body_b.velocity, tie.body_b.angular_velocity)
    assert impact.change_a == impact.change_b == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    length = math.hypot(*tie.contact.normal)
    expected = float(tie.normal_velocity()) / length
    assert impact.normal_velocity_before == pytest.approx(expected, rel=1e-14, abs=0.0)
    assert impact.energy_lost_restitution == impact.energy_lost_friction == 0.0
    assert impact.kinetic_energy_before == impact.kinetic_energy_after
    assert impact.contact == tie.contact._replace(friction=impact.contact.friction)


@pytest.mark.parametrize("units", UNITS, ids=str)
@pytest.mark.parametrize("name", GRAZING)
@pytest.mark.parametrize("law", LAWS)
def test_bodies_that_just_do_not_approach_are_left_alone(only_kernels, law, name, units):
    tie = scaled(GRAZING[name], *units)
    assert tie.normal_velocity() == 0
    assert_unchanged(tie, tie.resolve(law))
    assert_unchanged(tie, tie.resolve(law, tolerance=1e-9))


@pytest.mark.parametrize("name", GRAZING)
@pytest.mark.parametrize("law", LAWS)
def test_next_to_a_tie_the_side_is_right(law, name):
    for tie in next_to(GRAZING[name]):
        impact = tie.resolve(law, precision=Precision.EXTENDED)
        assert (impact.status is not StatusCode.SEPARATING) == tie.approaches()
        if not tie.approaches():
            assert impact.impulse == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("units", UNITS, ids=str)
@pytest.mark.parametrize("name", AT_THRESHOLD)
@pytest.mark.parametrize("law", LAWS)
def test_an_approach_just_at_the_threshold_rebounds(only_kernels, law, name, units):
    tie = scaled(AT_THRESHOLD[name], *units)
    assert tie.approaches() and not tie.is_below()
    impact, free = tie.resolve(law), tie._replace(threshold=0.0).resolve(law)
    assert impact == free._replace(model=impact.model)
    assert impact.model.restitution_threshold == tie.threshold


@pytest.mark.parametrize("name", AT_THRESHOLD)
@pytest.mark.parametrize("law", LAWS)
def test_next_to_the_threshold_the_restitution_is_right(only_kernels, law, name):
    found = set()
    for tie in next_to(AT_THRESHOLD[name]):
        impact = tie.resolve(law)
        below = Adjustment.RESTITUTION_THRESHOLD in impact.adjustments
        assert below == tie.is_below()
        contact = tie.contact._replace(restitution=0.0) if below else tie.contact
        free = tie._replace(threshold=0.0, contact=contact).resolve(law)
        bound = (impact.error_bound + free.error_bound) * math.hypot(*free.impulse)
        assert math.dist(impact.impulse, free.impulse) <= bound
        found.add(below)
    assert found == {True, False}


@pytest.mark.parametrize("law", LAWS)
def test_a_normal_near_the_end_of_the_range_changes_no_decision(law):
    tie = Tie(body_at((-0.375, -0.5, 0.0)), contact_along((3 * LONGEST, 4 * LONGEST, 0.0)), 0.625)
    assert tie.approaches() and not tie.is_below()
    for one in next_to(tie):
        impact = one.resolve(law)
        assert (Adjustment.RESTITUTION_THRESHOLD in impact.adjustments) == one.is_below()


def test_a_tie_of_bodies_of_very_different_inertia_has_no_massless_spin(only_kernels):
    small, large = (1e-300, 0, 0, 1e-300, 0, 1e-300), (1e150, 0, 0, 1e150, 0, 1e150)
    body = Body.dynamic(2.0, small, (0.0, 2.0, 0.0), None, (3.0, -15.0, -3.0), (1.0, -2.0, 1.0))
    body_b = Body.dynamic(1.0, large, (1.0, -3.0, -1.0), None, (-3.0, -3.0, -3.0), (2.0, -2.0, 1.0))
    tie = Tie(body, contact_along((0.0, 2.0, -3.0), (1.0, -2.0, 3.0)), body_b=body_b)
    assert tie.normal_velocity() == 0
    assert_unchanged(tie, tie.resolve(Law.FRICTIONLESS))


@pytest.mark.parametrize("law", LAWS)
def test_a_tie_whose_squares_underflow_is_decided_too(law):
    """Doubles cannot hold the squares of these speeds, so fractions compare them."""
    tie = scaled(AT_THRESHOLD["3, 4, 5"], 2.0**-600, 1.0)
    for one in next_to(tie):
        impact = one.resolve(law)
        assert (Adjustment.RESTITUTION_THRESHOLD in impact.adjustments) == one.is_below()


INERTIA = {"rod": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0), "point mass": (0.0,) * 6}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kind", INERTIA)
@pytest.mark.parametrize("law", LAWS)
def test_a_tie_of_a_body_that_turns_about_an_axis_without_inertia(request, law, kind, turned):
    """Only its other spin counts, so the bodies do not approach, though the material at the contact does."""
    if not (turned and kind == "rod"):  # whose axes are rounded
        request.getfixturevalue("only_kernels")
    turn = (0.0, 0.0, 1.0, 1.0) if turned else None
    body = Body.dynamic(1.0, INERTIA[kind], (0.1, 0.0, 0.0), turn, (2.0, 0.0, -1.0), (0.0, 0.0, 7.0))
    tie = Tie(body, contact_along((1.0, 1.0, 2.0)))
    assert tie.approaches()
    impact = tie.resolve(law)
    assert impact.status is StatusCode.SEPARATING
    assert Adjustment.MASSLESS_SPIN in impact.adjustments
    assert impact.twist_a == (body.velocity, body.angular_velocity)


SLOW = Tie(body_at((0.0, 2.0**-560, -(2.0**-560))), contact_along((0.0, 0.0, 1.0)))
"""No tie, but a row that batches cannot compute in the units of its numbers."""


@pytest.mark.parametrize("tolerance", [0.0, 1e-9])
@pytest.mark.parametrize("law", LAWS)
def test_rows_of_a_batch_that_tie_are_as_alone(monkeypatch, law, tolerance):
    threshold = AT_THRESHOLD["after a time step"].threshold
    ties = [SLOW, *GRAZING.values(), *AT_THRESHOLD.values()]
    if tolerance:  # without, rounding decides next to a tie
        near = [one for tie in ties for one in next_to(tie._replace(threshold=threshold))]
        ties += [one for one in near if one.threshold == threshold]
    ties = [tie for tie in ties if tie.body.orientation is None]
    model = ImpactModel(law, Geometry.SPATIAL, tolerance=tolerance, restitution_threshold=threshold)
    expected = [resolve(tie.body, tie.body_b, tie.contact, model) for tie in ties]
    monkeypatch.setattr(one_by_one, "resolve", lambda *_: pytest.fail("a row was left to Python"))
    arrays = batch_of([(tie.body, tie.body_b, tie.contact) for tie in ties], oriented=False)
    result = resolve_batch(*arrays, model, report=True)
    for k, alone in enumerate(expected):
        twists = np.array([alone.twist_a, alone.twist_b])
        assert result.status[k] == alone.status
        if result.error_bound is None:
            assert result.impulse[:, k].tolist() == pytest.approx(alone.impulse, rel=1e-12, abs=0.0)
            continue
        np.testing.assert_array_equal(result.velocity[..., k].T, twists[:, 0])
        np.testing.assert_array_equal(result.angular_velocity[..., k].T, twists[:, 1])
        assert result.impulse[:, k].tolist() == [*alone.impulse]
        assert (result.error_bound[k], result.precision[k]) == (alone.error_bound, alone.model.precision)
        for field in REPORT:
            assert getattr(result, field)[k] == getattr(alone, field)
        assert result.adjustments[k] == alone.adjustments


def on_corners(velocity, normal, corners) -> Scene:
    body = body_at(velocity, position=normal)
    contacts = [contact_along(normal, corner) for corner in corners]
    return Scene([body, Body.static()], [(0, 1)] * len(contacts), contacts)


FLAT = on_corners(
    (0.0, 0.0, -9.81e-3), (0.0, 0.0, 1.0), [(x, y, 0.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
)
SLOPE = on_corners((2.0, 0.0, -1.0), (1.0, 0.0, 2.0), [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-2.0, 0.0, 1.0)])


@pytest.mark.parametrize("threshold", [9.81e-3, math.nextafter(9.81e-3, 0), math.nextafter(9.81e-3, 1)])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_kernels_decide_whether_a_scene_is_at_the_threshold(law, threshold):
    answer = resolve_without_python(*FLAT, ImpactModel(law, restitution_threshold=threshold))
    assert answer is not None
    assert (Adjustment.RESTITUTION_THRESHOLD in answer.adjustments) == (threshold > 9.81e-3)
    restitution = 0.0 if threshold > 9.81e-3 else 0.5
    free = FLAT.with_contacts(restitution=restitution).resolve(law)
    assert answer.twists == free.twists
    assert answer.impulses == free.impulses


@pytest.mark.parametrize("excess", [-1, 0, 1])
@pytest.mark.parametrize("kind", [Fraction, lambda x: Decimal(x.numerator) / Decimal(x.denominator)])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_a_threshold_that_is_no_float_is_not_rounded(law, kind, excess):
    """It is less than the rounding of floats away from the speed, in one of two clusters."""
    speed = Fraction(9.81e-3)
    with localcontext() as context:
        context.prec = 80
        threshold = kind(speed * (1 + Fraction(excess, 10**20)))
    scene = FLAT._replace(
        bodies=[*FLAT.bodies, body_at((0.0, 0.0, -9.81e-3))],
        pairs=[*FLAT.pairs, (2, 1)],
        contacts=[*FLAT.contacts, contact_along((0.0, 0.0, 1.0))],
    )
    e = 0.0 if excess > 0 else 0.5
    for case in (FLAT, scene):
        answer = case.resolve(law, restitution_threshold=threshold)
        assert (Adjustment.RESTITUTION_THRESHOLD in answer.adjustments) == (excess > 0)
        assert {contact.restitution for contact in answer.contacts} == {e}


@pytest.mark.parametrize("scene", [SLOPE, on_corners((2.0, 0.0, -1.0), (1.0, 0.0, 2.0), [(0.0, 0.0, 0.0)])])
@pytest.mark.parametrize("law", [*LAWS[:3], Law.ROUTH_STRONGE])
def test_kernels_leave_a_scene_alone_that_just_slides(law, scene):
    answer = resolve_without_python(*scene, ImpactModel(law))
    assert answer is not None
    assert (answer.status, answer.error_bound) == (StatusCode.SEPARATING, 0.0)
    assert answer.twists[0] == (scene.bodies[0].velocity, scene.bodies[0].angular_velocity)
    assert answer.normal_velocities_before == (0.0,) * len(scene.contacts)


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
def test_next_to_a_contact_that_just_slides_another_is_hit(law, place):
    """The block slides along one slope and meets another one."""
    slope = contact_along((1.0, 0.0, 2.0))
    wall = contact_along((-1.0, 0.0, 1.0), (1.0, 0.0, 0.5))
    contacts = [slope, wall] if place else [wall, slope]
    scene = Scene([SLOPE.bodies[0], Body.static()], [(0, 1)] * 2, contacts)
    answer = scene.resolve(law)
    assert answer.status is StatusCode.OK
    assert answer.normal_velocities_before[1 - place] == 0.0
    if law is Law.FRICTIONLESS:
        assert_within_bound(scene, answer, scene.in_fractions().resolve(law))
