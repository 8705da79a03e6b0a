"""Properties of every law on every impact, by Hypothesis."""

from __future__ import annotations

from importlib import import_module

import pytest
from collisions import (
    LAWS_WITH_FRICTION,
    LAWS_WITH_ORACLE,
    Collision,
    collisions,
    planar_collisions,
    quaternions,
)
from hypothesis import given, settings
from scene_cases import rotate

from collision_response import Body, Contact, Geometry, Impact, Law, StatusCode
from collision_response.impact import impact
from collision_response.physics.vector import Vec3

TOLERANCE = 1e-9
"""Relative to the size of what is compared. Routh's path is followed to 1e-12 and the scenes'
condition numbers stay below 1e3, so rounding is below 1e-12."""

FASTEST = 20.0
"""No two bodies of a scene meet faster [m/s]."""

every_law = pytest.mark.parametrize("law", LAWS_WITH_ORACLE, ids=lambda law: law.name)


def examples_for(law: Law):
    """Fewer examples for path laws, which take a hundred times as long."""
    return settings(max_examples=10 if law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE) else 30, deadline=None)


def check(law: Law, strategy, holds) -> None:
    examples_for(law)(given(strategy)(lambda collision: holds(collision)))()


def scale(collision: Collision, impact: Impact) -> float:
    """The largest energy involved [J]."""
    u = abs(impact.normal_velocity_before)
    return impact.kinetic_energy_before + impact.impulse.norm() * (1 + u) + 1e-3


@every_law
def test_energy_never_grows_and_all_of_it_is_accounted_for(law):
    def holds(collision: Collision) -> None:
        impact = collision.resolve(law)
        room = TOLERANCE * scale(collision, impact)
        lost = impact.energy_lost_restitution + impact.energy_lost_friction
        assert lost >= -room
        if collision.body_b.is_movable():  # a kinematic body does work that no answer counts
            assert impact.kinetic_energy_before - impact.kinetic_energy_after == pytest.approx(lost, abs=room)

    check(law, collisions(), holds)


@every_law
def test_the_impulse_lies_in_the_friction_cone_and_does_not_pull(law):
    def holds(collision: Collision) -> None:
        impact = collision.resolve(law)
        assert impact.normal_impulse >= 0
        room = TOLERANCE * impact.normal_impulse
        assert impact.tangential_impulse <= impact.contact.friction * impact.normal_impulse + room

    check(law, collisions(), holds)


@every_law
def test_the_bodies_separate(law):
    def holds(collision: Collision) -> None:
        impact = collision.resolve(law)
        u_n, after = impact.normal_velocity_before, impact.normal_velocity_after
        room = TOLERANCE * FASTEST
        if impact.status is StatusCode.SEPARATING:
            assert u_n >= 0
            assert after == pytest.approx(u_n, abs=room)
        elif law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE):
            assert after >= -room
        else:
            assert after == pytest.approx(-impact.contact.restitution * u_n, abs=room)

    check(law, collisions(), holds)


@every_law
def test_momentum_and_angular_momentum_are_conserved(law):
    def holds(collision: Collision) -> None:
        impact = collision.resolve(law)
        C, P = collision.contact.position, impact.impulse
        for body, change, impulse in (
            (collision.body_a, impact.change_a, P),
            (collision.body_b, impact.change_b, -P),
        ):
            if body.is_movable():
                room = TOLERANCE * (P.norm() + 1e-6)
                com = body.to_world(body.com)
                velocity_change = change.linear + change.angular.cross(com)
                assert (velocity_change * body.mass - impulse).norm() <= 10 * room
                gained = body.to_world(body.inertia @ body.to_body(change.angular))
                assert (gained - (C - body.position - com).cross(impulse)).norm() <= 10 * room

    check(law, collisions(), holds)


@every_law
def test_exchanging_the_bodies_reverses_the_impulse(law):
    def holds(collision: Collision) -> None:
        impact, swapped = collision.resolve(law), collision.swapped().resolve(law)
        close(swapped.impulse, -impact.impulse)
        close(swapped.twist_b.angular, impact.twist_a.angular)

    check(law, collisions(), holds)


@every_law
def test_rotating_the_frame_rotates_the_answer(law):
    @examples_for(law)
    @given(collisions(), quaternions)
    def holds(collision: Collision, q) -> None:
        impact = collision.resolve(law)
        if abs(impact.normal_velocity_before) < 1e-6:
            return  # whether it is an impact at all is then a matter of rounding
        turned = collision.rotated(q).resolve(law)
        close(turned.impulse, rotate(q, impact.impulse))
        close(turned.twist_a.linear, rotate(q, impact.twist_a.linear))

    holds()


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION, ids=lambda law: law.name)
def test_without_friction_every_law_is_the_frictionless_one(law):
    def holds(collision: Collision) -> None:
        smooth = collision._replace(contact=collision.contact._replace(friction=0.0))
        close(smooth.resolve(law).impulse, smooth.resolve(Law.FRICTIONLESS).impulse)

    check(law, collisions(), holds)


@every_law
def test_planar_scenes_have_the_planar_answer_in_space(law):
    def holds(collision: Collision) -> None:
        planar, spatial = (collision.resolve(law, geometry=g) for g in (Geometry.PLANAR, Geometry.SPATIAL))
        close(planar.impulse, spatial.impulse)
        close(planar.twist_a.angular, spatial.twist_a.angular)

    check(law, planar_collisions(), holds)


def test_poisson_and_stronge_agree_where_the_slip_never_stops():
    def holds(collision: Collision) -> None:
        slippery = collision._replace(contact=collision.contact._replace(friction=0.01))
        poisson, stronge = (slippery.resolve(law) for law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE))
        if poisson.regime.name == stronge.regime.name == "SLIDING":
            close(poisson.impulse, stronge.impulse)

    check(Law.ROUTH_STRONGE, planar_collisions(), holds)


def close(value: Vec3, expected: Vec3) -> None:
    assert (value - expected).norm() <= TOLERANCE * (expected.norm() + 1e-3)


@pytest.mark.parametrize(
    "law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT], ids=lambda law: law.name
)
def test_bodies_that_separate_have_no_path_to_follow(law, monkeypatch):
    """A path takes a hundred times as long as to see that there is none."""

    def refuse(state, going, step, budget, **kwargs):
        assert not going(state)
        return state

    ball, wall = Body.sphere(1.0, 0.1, velocity=(0.3, 0.1, 0.5), angular_velocity=(1, 2, 3)), Body.static()
    contact = Contact.of((0.05, 0.0, -0.1), (0, 0, 1), 0.5, 0.3)
    approaching = ball._replace(velocity=-ball.velocity)
    for name in ("compliant", "routh_path"):
        monkeypatch.setattr(import_module(f"collision_response.physics.laws.{name}"), "iterate", refuse)
    assert impact(ball, wall, contact, law).flags.separating
    with pytest.raises(AssertionError):
        impact(approaching, wall, contact, law)
