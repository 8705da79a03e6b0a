"""Scenes whose numbers nearly cancel: fast observers, rolling, and light bodies between heavy ones."""

from __future__ import annotations

import math

import pytest
from refusals import refused
from scene_cases import Scene, box, distance, distance_of_changes, rotate, rotated_body, row_of_balls

from collision_response import Body, Contact, Law, SceneImpact, StatusCode
from collision_response.physics.body import Twist
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

ZERO = Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
WITH_FRICTION = [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE]


def losses(answer: SceneImpact) -> tuple[float, float]:
    return answer.energy_lost_restitution, answer.energy_lost_friction


def tilted(velocity: tuple[float, ...], spin: tuple[float, ...], mu: float) -> Scene:
    """A box on a slope, whose velocity is a multiple of 2^-10, so that a fast observer can see it exactly."""
    flat, turn = box(velocity, spin, e=0.5, mu=mu), Quaternion(0.25, -0.25, 0.5, 0.75)
    body = rotated_body(flat.bodies[0], turn)
    body = body._replace(velocity=Vec3(*(math.ldexp(round(math.ldexp(x, 10)), -10) for x in body.velocity)))
    contacts = [
        contact._replace(position=rotate(turn, contact.position), normal=rotate(turn, contact.normal))
        for contact in flat.contacts
    ]
    return Scene([body, Body.kinematic()], flat.pairs, contacts)


@pytest.mark.parametrize("law", WITH_FRICTION)
@pytest.mark.parametrize("power", [10, 25, 30, 35, 40])
@pytest.mark.parametrize(
    ("velocity", "spin", "mu"),
    [
        ((1, 0.5, -1), (0, 0, 0), 0.3),
        ((0, 0, -1), (0, 0, 0), 0.3),
        ((0.1, 0.05, -1), (0, 0, 0), 0.3),
        ((1, 0.5, -1), (0, 0, 0), 1.0),
        ((1, 0.5, -1), (0.25, -0.25, 0.5), 0.3),
    ],
)
def test_a_fast_observer_sees_the_same_slip(law, power, velocity, spin, mu):
    """The slip is the difference of velocities that are up to 2^40 times as large."""
    scene, fast = tilted(velocity, spin, mu), Vec3(1.0, 1.0, -1.0) * 2.0**power
    seen = scene._replace(bodies=[body._replace(velocity=body.velocity + fast) for body in scene.bodies])
    one, other = scene.resolve(law), seen.resolve(law)
    assert distance(scene, one, other) <= min(one.error_bound, other.error_bound) + 1e-15
    assert losses(other) == pytest.approx(losses(one), abs=4 * min(one.error_bound, 1e-5))


@pytest.mark.parametrize("law", WITH_FRICTION)
@pytest.mark.parametrize("power", [10, 25, 30, 35, 40])
def test_rolling_adds_nothing_to_the_slip(law, power):
    """A ball rolls, in addition to its other motion; a light body that leaves it moves along."""
    normal, fast = Vec3(0.0, 1.0, 1.0), Vec3(1.0, 1.0, -1.0) * 2.0**power
    arm = normal * -0.5
    ball = Body.dynamic(1.0, (0.1, 0, 0, 0.1, 0, 0.1), velocity=(0.5, 0.25, -1.0))
    fly = Body.dynamic(1e-3, velocity=(50.0, 60.0, 70.0))
    contacts = [Contact.of(arm, normal, 0.5, 0.3), Contact.of(ball.position, (1.0, 1.0, 1.0), 0.5)]
    bodies = [ball, Body.static(), fly]
    rolls = [
        ball._replace(velocity=ball.velocity + fast, angular_velocity=fast.cross(arm) * 2.0),
        Body.static(),
        fly._replace(velocity=fly.velocity + fast),
    ]
    one, other = (Scene(of, [(0, 1), (2, 0)], contacts).resolve(law) for of in (bodies, rolls))
    bound = min(one.error_bound, other.error_bound) + 1e-15
    assert distance_of_changes(Scene(bodies, [], []), one.changes, other.changes) <= bound
    assert losses(other) == pytest.approx(losses(one), abs=4 * min(bound, 1e-5))


@pytest.mark.parametrize("law", WITH_FRICTION)
@pytest.mark.parametrize("power", [10, 25, 35])
def test_a_reference_point_far_away_changes_no_impulse(law, power):
    """The arm of a contact is the difference of distances that are up to 2^35 times as large."""
    scene = tilted((1, 0.5, -1), (0, 0, 0), 0.3)
    body, wall = scene.bodies
    near = body._replace(orientation=None, position=Vec3(0.0, 0.0, 0.0))
    com = Vec3(1.0, -1.0, 1.0) * 2.0**power
    one, other = (
        scene._replace(bodies=[of, wall]).resolve(law)
        for of in (near, near._replace(position=near.position - com, com=com))
    )
    change, far_change = one.changes[0], other.changes[0]
    room = one.error_bound * math.hypot(*change.linear) + 1e-15
    assert math.dist(change.angular, far_change.angular) <= room * math.sqrt(6)
    for P, Q in zip(one.impulses, other.impulses, strict=True):
        # Impulses are shared to about 1e-6, and by arms that are rounded.
        assert pytest.approx(P, abs=1e-6 + 2.0 ** (power - 53)) == Q


@pytest.mark.parametrize("e", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("mass", [1e3, 1e6, 1e9])
def test_a_light_ball_between_two_heavy_ones_stays_in_the_middle(mass, mu, e):
    """Both springs act alike, and each heavy ball returns with e times its speed."""
    scene = row_of_balls((1.0, 0.0, -1.0), e, (mass, 1.0, mass), float).with_contacts(friction=mu)
    answer = scene.resolve(Law.ROUTH_STRONGE)
    known = [Twist(Vec3(by * (1 + e), 0.0, 0.0), ZERO.angular) for by in (-1, 0, 1)]
    assert answer.error_bound < 2e-5
    assert distance_of_changes(scene, answer.changes, known) <= answer.error_bound


def plate_on_balls(mass: float, slip: float, e: float) -> Scene:
    """A heavy plate lands on two light balls on the floor."""
    plate = Body.box(mass, (2, 1, 0.2), position=(0, 0, 1.1), velocity=(slip, 0, -1))
    balls = [Body.sphere(1.0, 0.5, position=(x, 0, 0.5)) for x in (-0.5, 0.5)]
    contacts = [Contact.of((x, 0, z), (0, 0, 1), e, 0.3) for z in (1, 0) for x in (-0.5, 0.5)]
    return Scene([plate, *balls, Body.static()], [(0, 1), (0, 2), (1, 3), (2, 3)], contacts)


@pytest.mark.parametrize("slip", [0.0, 0.5])
def test_springs_that_a_heavy_body_compresses_for_long_are_not_wedged(slip):
    """They hold it for a moment, in which nothing moves."""
    answer = plate_on_balls(1e6, slip, 1.0).resolve(Law.ROUTH_STRONGE)
    assert answer.error_bound < 1e-4
    # The balls rattle with speeds of the order of the plate's, so with an energy of that order.
    assert answer.twists[0].linear.z == pytest.approx(1.0, abs=1e-5 + 2 * answer.error_bound)
    with refused(StatusCode.PATH_TOO_LONG, match="did not settle"):
        plate_on_balls(1e8, slip, 1.0).resolve(Law.ROUTH_STRONGE)


@pytest.mark.parametrize("slip", [0.0, 0.5])
def test_light_bodies_that_rattle_on_and_on_are_not_damped_by_rounding(slip):
    """The balls rattle between the springs, which relax whenever they do, until the plate has come to rest.

    So it is with a plate of 1000 kg. With 1e7 kg it takes millions of turns, too many to follow.
    """
    answer = plate_on_balls(1e3, slip, 0.5).resolve(Law.ROUTH_STRONGE)
    assert answer.twists[0].linear.z == pytest.approx(0.0, abs=2 * answer.error_bound)
    with refused(StatusCode.PATH_TOO_LONG, match="did not settle"):
        plate_on_balls(1e7, slip, 0.5).resolve(Law.ROUTH_STRONGE)
