"""Friction in scenes: where it must agree with one contact, and what it does to boxes."""

from __future__ import annotations

import math

import pytest
from scene_cases import Case, apart, box, random_case, row

from collision_response import (
    Adjustment,
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.physics.vector import Vec3


def beside(body_a: Body, body_b: Body, contact: Contact) -> Case:
    """One contact in a cluster of two: a light body leaves body_a, and takes no part."""
    fly = Body.dynamic(1e-3, position=body_a.position, velocity=(50.0, 60.0, 70.0))
    leaving = Contact.of(body_a.position, (1.0, 1.0, 1.0))
    return Case([body_a, body_b, fly], [(0, 1), (2, 0)], [contact, leaving])


def rod(theta: float, velocity, mu: float, e: float) -> Case:
    """A uniform rod that strikes a fixed plane with its end: see the reference values of impact laws."""
    r = Vec3(-math.cos(theta) / 2, -math.sin(theta) / 2, 0.0)
    body = Body.dynamic(1.0, (1 / 12, 0.0, 0.0, 1 / 12, 0.0, 1 / 12), -r, None, (*velocity, 0.0))
    return beside(body, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), e, mu))


@pytest.mark.parametrize(
    ("theta", "velocity", "mu", "e", "impulse"),
    [
        pytest.param(math.pi / 4, (0.0, -1.0), 0.3, 0.5, (9 / 41, 30 / 41), id="T1"),
        pytest.param(math.pi / 4, (1.0, -1.0), 0.3, 0.5, (-0.15254237, 0.50847458), id="T2"),
        pytest.param(math.atan(2), (0.5, -1.0), 0.3, 0.9, (0.1, 1.2625), id="T3"),
        pytest.param(math.atan(2), (0.5, -1.0), 0.3, 1.0, (0.1, 1.325), id="T3 elastic"),
    ],
)
def test_in_the_plane_it_is_the_law_of_one_contact(theta, velocity, mu, e, impulse):
    answer = rod(theta, velocity, mu, e).resolve(Law.COULOMB)
    assert answer.clusters == ((0, 1),)
    assert answer.impulses[0] == pytest.approx((*impulse, 0), abs=1e-8)
    assert not any(answer.impulses[1])


def one_contact(seed):
    """A random scene, and the answer for its first contact alone."""
    case = random_case(seed, mu=1e4)
    a, b = case.pairs[0]
    return case, resolve(case.bodies[a], case.bodies[b], case.contacts[0], ImpactModel(Law.COULOMB))


STICKING = [seed for seed in range(40) if one_contact(seed)[1].regime is Regime.STICKING]


@pytest.mark.parametrize("seed", STICKING)
def test_where_a_contact_sticks_it_is_the_law_of_one_contact(seed):
    case, one = one_contact(seed)
    (a, b), contact = case.pairs[0], case.contacts[0]
    fly = Body.dynamic(1e-3, position=case.bodies[a].position, velocity=(50.0, 60.0, 70.0))
    leaving = Contact.of(case.bodies[a].position, (1.0, 1.0, 1.0))
    answer = resolve_scene([case.bodies[a], case.bodies[b], fly], [(0, 1), (2, 0)], [contact, leaving])
    assert answer.impulses[0] == pytest.approx(one.impulse, rel=1e-7, abs=1e-9)
    assert answer.regimes == (Regime.STICKING, Regime.SEPARATING)


@pytest.mark.parametrize("seed", range(40))
def test_in_space_it_differs_from_the_law_of_one_contact_by_less_than_a_quarter(seed):
    case = random_case(seed, mu=0.3)
    (a, b), contact = case.pairs[0], case.contacts[0]
    one = resolve(case.bodies[a], case.bodies[b], contact, ImpactModel(Law.COULOMB))
    if one.status is StatusCode.SEPARATING:
        return
    fly = Body.dynamic(1e-3, position=case.bodies[a].position, velocity=(50.0, 60.0, 70.0))
    leaving = Contact.of(case.bodies[a].position, (1.0, 1.0, 1.0))
    answer = resolve_scene([case.bodies[a], case.bodies[b], fly], [(0, 1), (2, 0)], [contact, leaving])
    P = answer.impulses[0]
    assert (P - one.impulse).norm() <= 0.25 * one.impulse.norm()
    assert answer.normal_velocities_after[0] == pytest.approx(one.normal_velocity_after, abs=1e-9)
    # It takes the most energy that friction can, which that of one contact does not.
    total = one.energy_lost_friction + one.energy_lost_restitution
    assert answer.energy_lost_friction + answer.energy_lost_restitution >= total - 1e-9


def test_the_size_of_a_sphere_does_not_let_it_stick_early():
    """A solid sphere sticks if and only if (2/7) |u_t| <= mu (1 + e) |v_n|."""
    for mu, regime in ((0.13, Regime.SLIDING), (0.15, Regime.STICKING)):
        ball = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, 0.0, 1.0), None, (1.0, 0.0, -1.0))
        contact = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, mu)
        assert beside(ball, Body.static(), contact).resolve().regimes[0] is regime


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_a_box_that_slides_is_braked_and_does_not_spin(mu):
    answer = box((1.0, 0.5, -1.0), e=0.5, mu=mu).resolve()
    linear, angular = answer.twists[0]
    brake = mu * 1.5 / math.hypot(1, 0.5)
    assert linear == pytest.approx((1 - brake, 0.5 * (1 - brake), 0.5), abs=1e-12)
    assert angular == pytest.approx((0, 0, 0), abs=1e-12)
    assert answer.regimes == (Regime.SLIDING,) * 4


def test_a_box_that_sticks_comes_to_rest():
    answer = box((0.1, 0.0, -1.0), (0.0, 0.0, 0.02), e=0.0, mu=3.0).resolve()
    assert answer.twists[0].linear == pytest.approx((0, 0, 0), abs=1e-12)
    assert answer.twists[0].angular == pytest.approx((0, 0, 0), abs=1e-12)
    assert answer.regimes == (Regime.STICKING,) * 4


def test_friction_does_not_depend_on_what_the_floor_does():
    """A moving floor and a box that moves along: as at rest."""
    still = box((1.0, 0.5, -1.0), (0.3, -0.2, 0.5), e=0.5, mu=0.3)
    moving = Case(
        [
            still.bodies[0]._replace(velocity=Vec3(1.0 + 5, 0.5 - 3, -1.0 + 2)),
            Body.kinematic(velocity=(5.0, -3.0, 2.0)),
        ],
        *still[1:],
    )
    assert apart(still, still.resolve(), moving.resolve()) < 1e-9


def test_friction_that_pushes_into_another_contact_meets_it():
    """A box slides along the floor into a wall, whose friction presses it down."""
    body = Body.dynamic(
        1.0, (0.2, 0.0, 0.0, 0.2, 0.0, 0.2), (0.0, 0.0, 0.5), None, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
    )
    contacts = [Contact.of((-0.5, y, 0.0), (0.0, 0.0, 1.0), 0.0, 0.5) for y in (-0.5, 0.5)]
    contacts += [Contact.of((0.5, y, 0.9), (-1.0, 0.0, 0.0), 0.0, 0.5) for y in (-0.5, 0.5)]
    answer = resolve_scene([body, Body.static()], [(0, 1)] * 4, contacts)
    assert min(answer.normal_velocities_after) >= -1e-9
    assert answer.kinetic_energy_after <= answer.kinetic_energy_before
    assert answer.energy_lost_friction >= 0


def test_tangential_restitution_is_for_one_contact():
    with pytest.raises(ImpactError) as refused:
        box(mu=0.3).resolve(Law.COULOMB, tangential_restitution=0.5)
    assert (refused.value.code, refused.value.field) == (
        StatusCode.INVALID_MODEL,
        "model.tangential_restitution",
    )


def test_newton_for_all_at_once_may_create_energy_and_is_replaced():
    """Unequal restitution in a row: what the fast contact gives back, the slow one does not take."""
    gained = 0
    for e in (0.0, 0.2, 0.5):
        case = row((3.0, 0.0, -1.0), masses=(1, 50, 1), number=float)
        case = Case(case.bodies, case.pairs, [case.contacts[0]._replace(restitution=e), case.contacts[1]])
        answer = case.resolve(Law.MOREAU)
        assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + 1e-12)
        gained += bool(answer.adjustments & Adjustment.LAW_FALLBACK)
    for seed in range(200):
        answer = random_case(seed, mu=3.0).resolve(Law.MOREAU)
        lost = answer.energy_lost_restitution + answer.energy_lost_friction
        assert lost >= -1e-9 * (1 + answer.kinetic_energy_before)
        if answer.adjustments & Adjustment.LAW_FALLBACK:
            gained += 1
            assert answer.model.law is Law.COULOMB
    assert gained > 0


@pytest.mark.parametrize("law", [Law.MOREAU, Law.ROUTH_STRONGE])
def test_other_laws_brake_a_box_likewise(law):
    answer = box((1.0, 0.5, -1.0), e=0.5, mu=0.1).resolve(law)
    lost = answer.energy_lost_friction
    assert 0.1 < lost < 0.25
    assert answer.twists[0].linear.x == pytest.approx(0.866, abs=0.02)


def test_springs_with_friction_give_the_planar_law_of_one_contact():
    """Stronge's law along Routh's path, for a contact whose friction stays at its limit or reverses."""
    for theta, velocity, mu, e, impulse in (
        (math.pi / 4, (0.0, -1.0), 0.3, 0.5, (9 / 41, 30 / 41)),
        (math.pi / 4, (1.0, -1.0), 0.3, 0.5, (-0.11288499, 0.51260558)),
        (math.atan(2), (0.5, -1.0), 0.3, 0.9, (0.25579294, 1.30309359)),
    ):
        answer = rod(theta, velocity, mu, e).resolve(Law.ROUTH_STRONGE)
        assert answer.impulses[0] == pytest.approx((*impulse, 0), abs=2 * answer.error_bound + 1e-6)
        assert answer.error_bound < 1e-2


def test_springs_with_friction_lose_energy():
    for seed in range(10):
        case = random_case(seed, e=0.5, mu=0.3, contacts=4)
        answer = case.resolve(Law.ROUTH_STRONGE)
        assert answer.energy_lost_friction >= -1e-4
        assert answer.kinetic_energy_before >= 0
        assert answer.energy_lost_restitution + answer.energy_lost_friction >= -1e-6
