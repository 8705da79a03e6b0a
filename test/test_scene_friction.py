"""Friction in scenes: agreement with the laws of one contact, and its effect on boxes."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest
import rods
from refusals import refused
from scene_cases import (
    Scene,
    any_scene,
    box,
    change_norm,
    distance,
    distance_of_changes,
    random_scene,
    row_of_balls,
)

from collision_response import (
    Adjustment,
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    SceneImpact,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.kernels import protocol
from collision_response.physics.body import Twist
from collision_response.physics.column import Column
from collision_response.physics.vector import Vec3


def with_bystander(body_a: Body, body_b: Body, contact: Contact) -> Scene:
    """One contact in a cluster of two: a light body leaves body_a and takes no part."""
    fly = Body.dynamic(1e-3, position=body_a.position, velocity=(50.0, 60.0, 70.0))
    leaving = Contact.of(body_a.position, (1.0, 1.0, 1.0))
    return Scene([body_a, body_b, fly], [(0, 1), (2, 0)], [contact, leaving])


def rod(theta: float, velocity, mu: float, e: float) -> Scene:
    """A uniform rod that strikes a fixed plane with its end, as in the reference values of the laws."""
    r = Vec3(-math.cos(theta) / 2, -math.sin(theta) / 2, 0.0)
    body = Body.dynamic(1.0, (1 / 12, 0.0, 0.0, 1 / 12, 0.0, 1 / 12), -r, None, (*velocity, 0.0))
    return with_bystander(body, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), e, mu))


@pytest.mark.parametrize("case", rods.TABLE)
def test_in_the_plane_it_equals_the_law_of_one_contact(case):
    theta, velocity, e = rods.request(case)
    *impulse, _ = rods.answer(case, "COULOMB")
    answer = rod(theta, velocity, 0.3, e).resolve(Law.COULOMB)
    assert answer.clusters == ((0, 1),)
    assert answer.impulses[0] == pytest.approx((*impulse, 0), abs=1e-8)
    assert not any(answer.impulses[1])


def one_contact(seed, mu):
    """The first contact of a random scene in a cluster of two, and the answer for it alone."""
    scene = random_scene(seed, mu=mu)
    a, b = scene.pairs[0]
    touch = scene.bodies[a], scene.bodies[b], scene.contacts[0]
    return with_bystander(*touch), resolve(*touch, ImpactModel(Law.COULOMB))


STICKING = [seed for seed in range(40) if one_contact(seed, mu=1e4)[1].regime is Regime.STICKING]


@pytest.mark.parametrize("seed", STICKING)
def test_a_sticking_contact_equals_the_law_of_one_contact(seed):
    scene, one = one_contact(seed, mu=1e4)
    answer = scene.resolve(Law.COULOMB)
    assert answer.impulses[0] == pytest.approx(one.impulse, rel=1e-7, abs=1e-9)
    assert answer.regimes == (Regime.STICKING, Regime.SEPARATING)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("mu", [0.3, 1.0])
def test_in_space_it_takes_at_least_the_energy_of_the_law_of_one_contact(seed, mu):
    scene, one = one_contact(seed, mu)
    if one.status is StatusCode.SEPARATING:
        return
    answer = scene.resolve(Law.COULOMB)
    assert answer.normal_velocities_after[0] == pytest.approx(one.normal_velocity_after, abs=1e-9)
    total = one.energy_lost_friction + one.energy_lost_restitution
    assert answer.energy_lost_friction + answer.energy_lost_restitution >= total - 1e-9


def test_a_sphere_sticks_only_if_friction_suffices():
    """A solid sphere sticks if and only if (2/7) |u_t| <= mu (1 + e) |v_n|."""
    for mu, regime in ((0.13, Regime.SLIDING), (0.15, Regime.STICKING)):
        ball = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, 0.0, 1.0), None, (1.0, 0.0, -1.0))
        contact = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, mu)
        assert with_bystander(ball, Body.static(), contact).resolve().regimes[0] is regime


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


def on_slope(size, tilt: float, mu: float, speed: float = 0.0) -> Scene:
    """A box that gravity has accelerated for a moment, to 1 m/s, on a floor that is tilted about y; e = 0."""
    x, y, z = size
    velocity = (math.sin(tilt) + speed, 0.0, -math.cos(tilt))
    body = Body.box(1.0, size, position=(0.0, 0.0, z / 2), velocity=velocity)
    corners = [(a * x / 2, b * y / 2, 0.0) for a in (-1, 1) for b in (-1, 1)]
    contacts = [Contact.of(corner, (0.0, 0.0, 1.0), 0.0, mu) for corner in corners]
    return Scene([body, Body.static()], [(0, 1)] * 4, contacts)


@pytest.mark.parametrize("tilt", [0.0, 0.1, 0.19, 0.2, 0.4, 0.7])
@pytest.mark.parametrize("width", [0.2, 0.4])
def test_a_tall_box_topples_where_its_weight_passes_its_edge(width, tilt):
    """By statics: friction holds it, so it turns about its lower edge if tan(tilt) > width / height."""
    turn = max((math.sin(tilt) - width * math.cos(tilt)) / 2, 0) / ((1 + width**2) / 3)
    answer = on_slope((width, 0.5, 1.0), tilt, 3.0).resolve(Law.COULOMB)
    # The bound is relative to a change of about 1 m/s, for turns at the radius of gyration: 0.3 to 0.4 m.
    assert math.dist(answer.twists[0].angular, (0.0, turn, 0.0)) < answer.error_bound * 10
    assert [regime is Regime.SEPARATING for regime in answer.regimes[:2]] == [turn > 0] * 2
    assert answer.regimes[2:] == (Regime.STICKING,) * 2


@pytest.mark.parametrize("corners", [2, 4])
@pytest.mark.parametrize("width", [k / 20 for k in range(10, 30)])
def test_a_block_that_rocks_goes_on_over_its_other_edge(width, corners):
    """Housner 1963: of its turn, 1 - 1.5 width^2 / (width^2 + 1) is left about the other edge, or none."""
    block = Body.box(1.0, (2 * width, 2.0, 2.0), position=(0.0, 0.0, 1.0), velocity=(1, 0, -width))
    block = block._replace(angular_velocity=Vec3(0.0, 1.0, 0.0))
    ys = (-1.0, 1.0) if corners == 4 else (0.0,)
    contacts = [Contact.of((x, y, 0.0), (0, 0, 1), 0.0, 10.0) for x in (-width, width) for y in ys]
    answer = Scene([block, Body.static()], [(0, 1)] * corners, contacts).resolve(Law.COULOMB)
    turn = max(1 - 1.5 * width**2 / (width**2 + 1), 0)
    assert answer.twists[0].angular.y == pytest.approx(turn, abs=10 * answer.error_bound)


@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-13, 1e-11, 1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("seed", range(10))
def test_a_braked_box_topples_whatever_the_noise_of_its_normals(off, seed):
    """The front edge takes the load p and friction mu p, so p (1/m + x (x - mu z) / I) stops its fall."""
    rng, mu, (x, z) = random.Random(seed), 0.8, (0.2, 0.5)
    box = Body.box(1.0, (2 * x, 0.5, 2 * z), position=(0, 0, z), velocity=(2.0, 0, -0.5))
    contacts = [
        Contact.of((a, b, 0.0), (off * rng.uniform(-1, 1), off * rng.uniform(-1, 1), 1.0), 0.0, mu)
        for a in (-x, x)
        for b in (-0.25, 0.25)
    ]
    answer = Scene([box, Body.static()], [(0, 1)] * 4, contacts).resolve(Law.COULOMB)
    inertia = (4 * x**2 + 4 * z**2) / 12
    load = 0.5 / (1 + x * (x - mu * z) / inertia)
    turn = load * (mu * z - x) / inertia
    assert answer.twists[0].angular.y == pytest.approx(turn, abs=10 * answer.error_bound + 100 * off)


@pytest.mark.parametrize("floor", [0.0, 1e-300, 1e-12, 0.5], ids="floor at {}".format)
@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9])
@pytest.mark.parametrize("points", [2, 4, 6, 9])
@pytest.mark.parametrize(
    ("height", "velocity", "e", "mu", "after"),
    [
        (4, (0.5, -0.1), 1.0, 0.6, (0.340625, 0.165625, 0.13125)),
        (6, (0.5, -0.1), 0.0, 0.8, (0.384375, 0.04453125, 0.0890625)),
        (3, (3.0, -1.0), 0.5, 0.8, (1.6875, 1.0625, 1.125)),
        (3, (3.0, -0.1), 1.0, 1.5, (1.98, 0.76, 1.32)),
    ],
)
def test_a_braked_box_pitches_forward_for_every_observer(height, velocity, e, mu, after, points, off, floor):
    """The rear edge parts, and the front edge slides or sticks: in the plane, the only solution."""
    rng = random.Random(points)
    (v_x, v_z), z = velocity, height / 2
    box = Body.box(1.0, (1, 1, height), position=(0, 0, z), velocity=(v_x, floor, v_z))
    places = {2: [0], 4: [-0.5, 0.5], 6: [-0.5, 0, 0.5], 9: [-0.5, 0, 0.5]}[points]
    contacts = [
        Contact.of((x, y, 0), (off * rng.uniform(-1, 1), off * rng.uniform(-1, 1), 1), e, mu)
        for x in ((-0.5, 0.0, 0.5) if points == 9 else (-0.5, 0.5))
        for y in places
    ]
    scene = Scene([box, Body.kinematic((0, 0, 0), (0, floor, 0))], [(0, 1)] * points, contacts)
    answer = scene.resolve(Law.COULOMB)
    (twist, _) = answer.twists
    near = {"abs": 10 * answer.error_bound + 100 * off}
    assert (twist.linear.x, twist.linear.z, twist.angular.y) == pytest.approx(after, **near)


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("turns", [0, 1, 2], ids=["z up", "x up", "y up"])
@pytest.mark.parametrize("swaps", [False, True], ids=["", "every second contact with bodies swapped"])
def test_a_box_pitches_as_soon_as_friction_has_more_moment_than_the_load(e, off, turns, swaps):
    """A box of mass 1, half length x and half height z lands flat at 1 m/s. Then N = 1 + e, F = min(mu N, v),
    and both edges are loaded if F z <= N x. Else only the front edge is, which rebounds with e, and slides or
    sticks:

        turn = (F z - N x) / I,  N - x turn = 1 + e,  F = mu N or F + z turn = v
    """
    rng = random.Random(1)
    pitched = 0

    def turned(x: float, y: float, z: float) -> tuple[float, ...]:
        return (x, y, z)[3 - turns :] + (x, y, z)[: 3 - turns]

    for _ in range(60):
        x, z, mu = rng.uniform(0.1, 1.0), rng.uniform(0.1, 2.0), rng.choice((0.2, 0.5, 1.0, 2.0))
        v, inertia = rng.uniform(0.5, 5.0), (x * x + z * z) / 3
        load, turn = 1 + e, 0.0
        friction = min(mu * load, v)
        stiffness = 1 + x * (x - mu * z) / inertia  # the load by velocities of the edge: 0 where the box jams
        if abs(friction * z - load * x) < 0.1 or stiffness < 0.1:
            continue  # noise may decide whether it pitches
        if friction * z > load * x:
            pitched += 1
            load = (1 + e) / stiffness
            friction = mu * load
            turn = (friction * z - load * x) / inertia
            if v - friction - z * turn < 0:
                load, friction = np.linalg.solve(np.eye(2) + np.outer((x, -z), (x, -z)) / inertia, (1 + e, v))
                turn = (friction * z - load * x) / inertia
        box = Body.box(1.0, turned(2 * x, 0.5, 2 * z), position=turned(0, 0, z), velocity=turned(v, 0, -1))
        pairs, contacts = [], []
        for k, (a, b) in enumerate(itertools.product((-x, x), (-0.25, 0.25))):
            normal = Vec3(*turned(off * rng.uniform(-1, 1), off * rng.uniform(-1, 1), 1))
            is_swapped = swaps and k % 2 == 1
            pairs.append((1, 0) if is_swapped else (0, 1))
            contacts.append(Contact.of(turned(a, b, 0), -normal if is_swapped else normal, e, mu))
        answer = Scene([box, Body.static()], pairs, contacts).resolve(Law.COULOMB)
        (twist, _) = answer.twists
        # The bound is relative to changes of up to 10 m/s. A tilt acts on slips of up to 5 m/s and turns
        # of up to 10 rad/s, and the stiffness of 0.1 makes of it ten times as much.
        near = {"abs": 10 * answer.error_bound + 1000 * off}
        expected = *turned(v - friction, 0, load - 1), *turned(0, turn, 0)
        assert (*twist.linear, *twist.angular) == pytest.approx(expected, **near)
    assert pitched > 10


def test_a_box_that_turns_and_pitches_on_a_step():
    """Heights that differ by a tenth are no noise: each edge rebounds by itself, as with MOREAU."""
    rng = random.Random(1)
    compared = 0
    for _ in range(200):
        x, z, mu, step = (
            rng.uniform(0.2, 1.0),
            rng.uniform(0.3, 2.0),
            rng.choice((0.5, 1.0)),
            rng.uniform(0.01, 0.1),
        )
        spin = rng.uniform(-0.2, 0.2)
        box = Body.box(1.0, (2 * x, 0.5, 2 * z), position=(0, 0, z), velocity=(rng.uniform(0.5, 5.0), 0, -1))
        box = box._replace(angular_velocity=Vec3(0.0, spin, 0.0))
        contacts = [
            Contact.of((a, b, step * (a > 0)), (0, 0, 1), 0.5, mu) for a in (-x, x) for b in (-0.25, 0.25)
        ]
        scene = Scene([box, Body.static()], [(0, 1)] * 4, contacts)
        answer, moreau = scene.resolve(Law.COULOMB), scene.resolve(Law.MOREAU)
        pitches = answer.normal_velocities_after[0] > -0.5 * answer.normal_velocities_before[0] + 0.01
        if pitches and not moreau.adjustments and moreau.error_bound < 1e-6:
            compared += 1
            assert distance(scene, answer, moreau) <= answer.error_bound + moreau.error_bound
    assert compared > 10


@pytest.mark.parametrize("drift", [0.0, -1e-12, 1e-12, -1e-9, -1e-6])
@pytest.mark.parametrize("mu", [0.2, 0.5, 1.0])
def test_a_ball_that_turns_on_the_floor_rubs_on_the_wall_beside_it(mu, drift):
    """Friction mu n presses it to the wall, whose friction carries mu^2 n; so (1 + mu^2) n stops its fall."""
    ball = Body.sphere(1.0, 0.5, position=(0, 0, 0.5), velocity=(drift, 0, -1.0))
    ball = ball._replace(angular_velocity=Vec3(0.0, -8.0, 0.0))
    contacts = [Contact.of((0, 0, 0), (0, 0, 1), 0.0, mu), Contact.of((-0.5, 0, 0.5), (1, 0, 0), 0.0, mu)]
    answer = Scene([ball, Body.static()], [(0, 1)] * 2, contacts).resolve(Law.COULOMB)
    load = 1 / (1 + mu**2)
    near = {"abs": answer.error_bound + 2 * abs(drift)}
    assert answer.impulses[0] == pytest.approx((-mu * load, 0, load), **near)
    assert answer.impulses[1] == pytest.approx((mu * load, 0, mu * mu * load), **near)
    assert answer.regimes == (Regime.SLIDING,) * 2


@pytest.mark.parametrize("seed", range(120))
def test_slides_sticks_and_topples_as_by_moreau(seed):
    """Boxes that move in a plane, with e = 0. MOREAU finds the velocities and friction by another method."""
    rng = random.Random(seed)
    size = [rng.uniform(0.1, 1.0) for _ in range(3)]
    scene = on_slope(size, rng.uniform(0.0, math.pi / 4), rng.uniform(0.0, 1.2), rng.choice((0.0, 0.0, 3.0)))
    answer, moreau = scene.resolve(Law.COULOMB), scene.resolve(Law.MOREAU)
    assert distance(scene, answer, moreau) <= answer.error_bound + min(moreau.error_bound, 1e-9)


def test_a_stack_that_slides_fast_does_not_jump():
    """Contacts part only where friction opposes the slip; else 25 times the load braked it, on one corner."""
    sizes = [(1.0, 0.36, 0.9), (0.27, 0.9, 0.44), (0.9, 0.8, 1.0), (0.5, 0.9, 1.2)]
    centres, masses = (0.0, -0.06, -0.06, 0.09), (0.1, 1.0, 2.0, 1.0)
    bodies, pairs, contacts, height = [], [], [], 0.0
    for k, ((x, y, z), centre) in enumerate(zip(sizes, centres, strict=True)):
        at, below = (centre, 0.0, height + z / 2), max(k - 1, 0)
        bodies.append(Body.box(masses[k], (x, y, z), position=at, velocity=(2.0, 0.5, -0.01)))
        low = max(centre - x / 2, centres[below] - sizes[below][0] / 2)
        high = min(centre + x / 2, centres[below] + sizes[below][0] / 2)
        wide = min(y, sizes[below][1]) / 2
        for corner in itertools.product((low, high), (-wide, wide)):
            pairs.append((k, k - 1 if k else 4))
            contacts.append(Contact.of((*corner, height), (0, 0, 1), 0.0, 0.5))
        height += z
    answer = resolve_scene([*bodies, Body.static()], pairs, contacts)
    floor = sum(impulse.z for impulse, pair in zip(answer.impulses, pairs, strict=True) if 4 in pair)
    assert floor < 2 * 0.01 * sum(masses)


@pytest.mark.parametrize("turns", [60.0, -60.0])
def test_a_driven_wheel_climbs_a_wall(turns):
    """Friction at the wall lifts it off the floor, or presses it down. One contact, or two that slide."""
    wheel = Body.sphere(
        1.0, 0.1, position=(0, 0, 0.1), velocity=(-1.0, 0.0, -0.02), angular_velocity=(0, turns, 0)
    )
    floor = Contact.of((0, 0, 0), (0, 0, 1), 0.0, 1.0)
    wall = Contact.of((-0.1, 0, 0.1), (1, 0, 0), 0.0, 1.0)
    twist = resolve_scene([wheel, Body.static()], [(0, 1)] * 2, [floor, wall]).twists[0]
    if turns < 0:
        assert twist.linear.z == pytest.approx(1.0 - 0.02, rel=1e-6)
        alone = resolve(wheel, Body.static(), wall).twist_a
        assert math.dist(twist.angular, alone.angular) < 1e-5
    else:  # P_floor + P_wall = 1 and P_floor - P_wall = 0.02, and both brake the turn
        assert math.dist(twist.linear, (0, 0, 0)) < 1e-6
        assert twist.angular.y == pytest.approx(60.0 - 0.1 * (0.51 + 0.49) / wheel.inertia.yy, rel=1e-6)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_a_plate_on_four_legs_is_braked_evenly_in_any_order(law):
    """The least number of contacts that can carry the plate is three: which three, no order decides."""
    places = [(2, 2), (-2, 2), (2, -2), (-2, -2)]
    plate = Body.box(1.0, (4, 4, 1), position=(0, 0, 1.5), velocity=(1.0, 0.0, -1.0))
    legs = [Body.box(1.0, (1, 1, 1), position=(x, y, 0.5)) for x, y in places]
    for order in itertools.permutations(range(4)):
        pairs = [pair for k in order for pair in ((0, k + 1), (k + 1, 5))]
        points = [(*places[k], height) for k in order for height in (1, 0)]
        contacts = [Contact.of(point, (0, 0, 1), 0.0, 0.5) for point in points]
        answer = resolve_scene([plate, *legs, Body.static()], pairs, contacts, ImpactModel(law))
        speed = 1.0 if law is Law.FRICTIONLESS else 0.5
        assert math.dist(answer.twists[0].linear, (speed, 0, 0)) < 1e-6
        assert answer.twists[0].angular.norm() < 1e-6


def test_friction_does_not_depend_on_the_frame():
    """A moving floor with a box that moves along, as at rest."""
    still = box((1.0, 0.5, -1.0), (0.3, -0.2, 0.5), e=0.5, mu=0.3)
    moving = Scene(
        [
            still.bodies[0]._replace(velocity=Vec3(1.0 + 5, 0.5 - 3, -1.0 + 2)),
            Body.kinematic(velocity=(5.0, -3.0, 2.0)),
        ],
        *still[1:],
    )
    assert distance(still, still.resolve(), moving.resolve()) < 1e-9


def test_friction_that_pushes_into_another_contact():
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


def test_moreau_is_replaced_where_it_would_create_energy():
    """With unequal restitution, the fast contact may give back more than the slow one absorbs."""
    gained = 0
    for e in (0.0, 0.2, 0.5):
        scene = row_of_balls((3.0, 0.0, -1.0), masses=(1, 50, 1), number=float)
        scene = Scene(
            scene.bodies, scene.pairs, [scene.contacts[0]._replace(restitution=e), scene.contacts[1]]
        )
        answer = scene.resolve(Law.MOREAU)
        assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + 1e-12)
        gained += bool(answer.adjustments & Adjustment.LAW_FALLBACK)
    for seed in range(200):
        answer = random_scene(seed, mu=3.0).resolve(Law.MOREAU)
        lost = answer.energy_lost_restitution + answer.energy_lost_friction
        assert lost >= -1e-9 * (1 + answer.kinetic_energy_before)
        if answer.adjustments & Adjustment.LAW_FALLBACK:
            gained += 1
            assert answer.model.law is Law.COULOMB
    assert gained > 0


def test_moreau_is_replaced_where_it_would_create_little_more_energy_than_rounding():
    """Two balls on a floor, the upper one slower by a little."""
    bodies = [Body.static(), *(Body.sphere(1.0, 0.5, position=(0, 0, z)) for z in (0.5, 1.5))]
    contacts = [Contact.of((0, 0, z), (0, 0, 1), 1.0) for z in (0, 1)]
    replaced = set()
    for power in range(-130, -88):
        speeds_before = (0, 0, -1.0), (0, 0, -1.0 + 10 ** (power / 10))
        moving = [b._replace(velocity=Vec3(*v)) for b, v in zip(bodies[1:], speeds_before, strict=True)]
        answer = resolve_scene([bodies[0], *moving], [(1, 0), (2, 1)], contacts, ImpactModel(Law.MOREAU))
        assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + 1e-11)
        replaced.add(bool(answer.adjustments & Adjustment.LAW_FALLBACK))
    assert replaced == {False, True}


@pytest.mark.parametrize("boost", [0.25, 4.0, -64.0])
@pytest.mark.parametrize("masses", [(1.0, 0.5, 2.0), (1.0, 1.0, 1.0), (2.0, 0.5, 0.25)])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU])
def test_an_observer_does_not_choose_the_law(law, masses, boost):
    """A contact separates by so little that MOREAU gains about as much as rounding may."""
    replaced = set()
    for power in range(30, 46):
        resting = row_of_balls((1.0, -(2.0**-power), 0.0), masses=masses, number=float)
        one, other = (
            resting._replace(
                bodies=[b._replace(velocity=b.velocity + Vec3(v, 0.0, 0.0)) for b in resting.bodies]
            )
            for v in (0.0, boost)
        )
        answer, seen, exact = (scene.resolve(law) for scene in (one, other, one.in_fractions()))
        assert seen.adjustments == answer.adjustments == exact.adjustments
        changes = [twist.linear.x for twist in seen.changes]
        assert changes == pytest.approx([twist.linear.x for twist in answer.changes], abs=1e-12)
        replaced.add(bool(answer.adjustments & Adjustment.LAW_FALLBACK))
    assert replaced == ({False, True} if law is Law.MOREAU else {False})


@pytest.mark.parametrize("steep", [0.1, math.pi / 4])
def test_more_friction_than_any_changes_no_path(steep):
    ball = Body.sphere(1.0, 1.0, velocity=(0.3, 0.4, -1.0), angular_velocity=(1, 2, 3))
    s, c = math.sin(steep), math.cos(steep)

    def in_groove(mu: float) -> Scene:
        contacts = [Contact.of((-x, 0, -c), (x, 0, c), 0.5, mu) for x in (s, -s)]
        return Scene([ball, Body.static()], [(0, 1)] * 2, contacts)

    first, *others = (in_groove(mu).resolve(Law.ROUTH_STRONGE) for mu in (1e12, 1e15, 1e30, 1e300))
    for other in others:
        assert distance(in_groove(1.0), other, first) <= first.error_bound + other.error_bound


def test_moreau_friction_may_do_positive_work():
    """It opposes the slip after the impact, not before."""
    along = 0
    for seed in (91, 92, 130, 171):
        answer = random_scene(seed, mu=0.3).resolve(Law.MOREAU)
        assert answer.model.law is Law.MOREAU
        along += answer.energy_lost_friction < 0
        assert answer.energy_lost_friction + answer.energy_lost_restitution >= 0
    assert along > 0


def test_coulomb_friction_may_do_positive_work_where_it_adds_to_the_normal_impulses():
    """A turning box is wedged between a wall and a floor. Both losses add up to that of kinetic energy."""
    moving = Body.box(
        1.0, (1.0, 1.0, 1.0), position=(0, 0, 0.5), velocity=(-2, 0, 0), angular_velocity=(0, 0, -2)
    )
    contacts = [
        Contact.of(position, normal, 0.0, 0.9)
        for position, normal in (
            ((-0.5, 0.0, 0.25), (1, 0, 0)),
            ((-0.5, -0.5, 0.0), (0, 0, 1)),
            ((0.0, 0.5, 0.0), (0, 0, 1)),
        )
    ]
    answer = resolve_scene([moving, Body.static()], [(0, 1)] * 3, contacts)
    assert answer.energy_lost_friction < 0 < answer.energy_lost_restitution
    lost = answer.kinetic_energy_before - answer.kinetic_energy_after
    assert answer.energy_lost_restitution + answer.energy_lost_friction == pytest.approx(lost, rel=1e-9)
    assert lost > 0


def test_stronge_gives_the_planar_law_of_one_contact():
    """Along Routh's path, where friction stays at its limit or reverses."""
    for case in rods.TABLE:
        theta, velocity, e = rods.request(case)
        *impulse, _ = rods.answer(case, "ROUTH_STRONGE")
        answer = rod(theta, velocity, 0.3, e).resolve(Law.ROUTH_STRONGE)
        assert answer.impulses[0] == pytest.approx((*impulse, 0), abs=2 * answer.error_bound + 1e-6)
        assert answer.error_bound < 1e-2


TWICE = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 2.0))


def assert_equals_one_contact(body: Body, e: float, mu: float) -> None:
    """Check that a point of contact that is given twice, with normals of two lengths, acts as given once."""
    contacts = [contact._replace(restitution=e, friction=mu) for contact in TWICE]
    scene = Scene([body, Body.static()], [(0, 1)] * 2, contacts)
    answer, one = (
        scene.resolve(Law.ROUTH_STRONGE),
        resolve(*scene.bodies, contacts[0], ImpactModel(Law.ROUTH_STRONGE)),
    )
    assert answer.error_bound < 1e-4
    assert distance_of_changes(scene, answer.changes, [one.change_a, one.change_b]) <= answer.error_bound


@pytest.mark.parametrize("angle", [0.3, math.pi / 4, 1.2])
@pytest.mark.parametrize("mu", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("e", [0.3, 0.8, 1.0])
def test_slips_that_reverse_within_a_step_are_in_the_bound(angle, mu, e):
    """Friction has the wrong direction for a part of the step, in the whole step and in its halves alike."""
    c, s = math.cos(angle), math.sin(angle)
    for slip in range(1, 31):
        rod = Body.dynamic(1.0, (s * s / 3, 0.0, -c * s / 3, 1 / 3, 0.0, c * c / 3), (c, 0.0, s))
        assert_equals_one_contact(rod._replace(velocity=Vec3(0.025 * slip, 0.0, -1.0)), e, mu)


@pytest.mark.parametrize(
    "inertia",
    [
        (0.05746361173281893, 0.0, -0.12590659462829074, 1 / 3, 0.0, 0.2758697216005147),
        (0.16770971097145698, 0.0, -0.16666340281044298, 1 / 3, 0.0, 0.16562362236187664),
    ],
)
def test_whether_there_is_inertia_about_a_rod_is_decided_in_all_digits(inertia):
    """Doubles alone would decide otherwise: the moments are within 1 % of the limit."""
    angle = math.atan2(math.sqrt(inertia[0]), math.sqrt(inertia[5]))
    velocity = {"velocity": (0.5, -0.2, -1.0), "angular_velocity": (-0.5, 0.3, 0.0)}
    assert_equals_one_contact(
        Body.dynamic(1.0, inertia, (math.cos(angle), 0.0, math.sin(angle)), **velocity), 0.5, 0.1
    )


def test_stronge_reports_the_frictional_work_along_the_path():
    """As the law of one contact does, not the work at the mean of the slip before and after."""
    for theta, velocity, mu, e in (
        (math.pi / 4, (1.0, -1.0), 0.3, 0.5),
        (math.atan(2), (0.5, -1.0), 0.3, 0.9),
        (math.atan(2), (0.5, -1.0), 0.3, 1.0),
    ):
        scene = rod(theta, velocity, mu, e)
        answer = scene.resolve(Law.ROUTH_STRONGE)
        one = resolve(scene.bodies[0], scene.bodies[1], scene.contacts[0], ImpactModel(Law.ROUTH_STRONGE))
        for field in ("energy_lost_restitution", "energy_lost_friction"):
            assert getattr(answer, field) == pytest.approx(getattr(one, field), abs=2 * answer.error_bound)


@pytest.mark.parametrize("seed", range(60, 76))
def test_elastic_stronge_contacts_lose_energy_to_friction_only(seed):
    """A contact loses 1 - e^2 of its work of compression."""
    scene = any_scene(seed).with_contacts(restitution=1.0, friction=0.3)
    answer = scene.resolve(Law.ROUTH_STRONGE)
    size = answer.kinetic_energy_before + change_norm(scene, answer) ** 2
    assert abs(answer.energy_lost_restitution) <= answer.error_bound * size
    assert answer.energy_lost_friction > 0


@pytest.mark.parametrize("power", [3, 6, 9, 12, 15, 17, 20, 25, 30])
@pytest.mark.parametrize("e", [0.05, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.5, 3.0])
@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_light_ball_rebounds_by_stronge(power, e, exponent, mu):
    """Whatever else the heavy ball touches: next to it, the light one counts for nothing."""
    light = 10.0**-power
    scene = row_of_balls((1.0, 0.0, 0.0), e, (light, 1.0, 1.0), float).with_contacts(friction=mu)
    answer = scene.resolve(Law.ROUTH_STRONGE, options={"exponent": exponent})
    # The first is the rebound of a heavy wall, which moves by less than 2 light.
    assert answer.twists[0].linear.x == pytest.approx(-e, abs=2 * answer.error_bound + 2 * light)
    lost = (1 - e * e) * light / 2
    assert answer.energy_lost_restitution == pytest.approx(
        lost, abs=(4 * answer.error_bound + 3 * light) * light
    )
    assert 0 <= answer.error_bound < 2e-5


WEAKLY_PRESSED = [
    (
        (-0.9993844285732415, 0, 0.16000190889991117),
        (0.6954028614451392, -0.8931183306250434, -0.9932656405273075),
        0.09232629905801827,
        0.5031035591056386,
        1e-3,
        3.7596e-5,
    ),
    ((-1, 0, 0.16), (0.5, -0.9, -0.99), 0.0923, 0.5, 1e-3, None),
    ((-1.014, 0, 0.0046), (0.575, -0.4964, -1.1885), 0.1, 0.4735, 1.026e-3, None),
]
"""Balls in a corner of a soft wall and a stiff one, which only the friction of the soft one presses.

Velocity, spin, friction, restitution, stiffness of the soft wall, and the velocity along y afterwards, where
it is known by an implicit integrator (Radau) with regularised friction, whose width was made ever smaller.
"""


@pytest.mark.parametrize(("velocity", "spin", "mu", "e", "softer", "known"), WEAKLY_PRESSED)
def test_a_finer_path_takes_other_steps(velocity, spin, mu, e, softer, known):
    """Where motion is slow, all paths might take the longest steps, and agree on the same error."""
    ball = Body.sphere(1.0, 0.5, position=(0.5, 0.5, 0), velocity=velocity, angular_velocity=spin)
    contacts = [Contact.of((0, 0.5, 0), (1, 0, 0), e, mu), Contact.of((0.5, 0, 0), (0, 1, 0), e, mu)]
    scene = Scene([ball, Body.static()], [(0, 1)] * 2, contacts)
    options = {"stiffness": [softer, 1.0], "exponent": 1.0}
    answer = scene.resolve(Law.ROUTH_STRONGE, options=options)
    finer = scene.resolve(Law.ROUTH_STRONGE, options=options, tolerance=1e-8)
    assert finer.error_bound <= 1e-8
    assert distance(scene, answer, finer) <= answer.error_bound + finer.error_bound
    if known is not None:
        off = abs(answer.twists[0].linear.y - known)
        assert off <= answer.error_bound * change_norm(scene, answer) + 1e-8  # the known one has five digits


@pytest.mark.parametrize("seed", [62, 64, 66, 67, 70, 72, 73, 74, 76])
def test_stronge_errors_are_within_the_bound(seed):
    scene = any_scene(seed).with_contacts(restitution=0.5, friction=0.3)
    one, other = scene.resolve(Law.ROUTH_STRONGE), scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-7)
    assert one.error_bound <= 1e-5
    assert other.status is StatusCode.OK
    assert distance(scene, one, other) <= one.error_bound + other.error_bound


def test_errors_are_in_the_bound_where_a_slip_starts_as_others_stop():
    """A rod in a groove: its load moves from two contacts to another one. The order does not matter."""
    moment = 25 / 12
    rod = Body.dynamic(1.0, (0.0, 0.0, 0.0, moment, 0.0, moment), velocity=(0.0, 0.0, -5.0))
    places = (-0.625, 0.0, -3.125), (-3.125, 0.0, -1.875), (2.5, -2.5, -1.875), (2.5, 2.5, -1.875)
    normals = [(3.0, 0.0, 4.0)] * 2 + [(-4.0, 0.0, 3.0)] * 2
    contacts = [Contact.of(*given, 1.0, 1.0) for given in zip(places, normals, strict=True)]
    scene = Scene([rod, Body.static()], [(0, 1)] * 4, contacts)
    fine = scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-7)
    assert fine.status is StatusCode.OK
    for order in itertools.permutations(contacts):
        answer = scene._replace(contacts=list(order)).resolve(Law.ROUTH_STRONGE)
        assert answer.error_bound <= 1e-5
        assert distance(scene, answer, fine) <= answer.error_bound + fine.error_bound


@pytest.mark.parametrize("e", [0.05, 0.25])
@pytest.mark.parametrize(("mu", "copies"), [(0.5, 1), (2.0, 3)])
def test_rounding_does_not_add_up_over_the_steps_of_a_path(e, mu, copies):
    """A point between two walls, on a third one, comes to rest. The path takes some 40,000 steps."""
    given = [
        (Contact.of((0.0, 0.0, 0.0), (3.0, 0.0, 4.0), e, mu), 1),
        (Contact.of((0.0, 0.0, 0.0), (-3.0, 0.0, 4.0), e, 3.0), copies),
        (Contact.of((0.0, 0.0, 0.0), (3.0, 0.0, -4.0), e, mu), 1),
    ]
    contacts = [contact for contact, times in given for _ in range(times)]
    point = Body.dynamic(1.0, velocity=(0.0, 0.0, -2.5))
    scene = Scene([point, Body.static()], [(0, 1)] * len(contacts), contacts)
    answer = scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-12)
    assert answer.status is StatusCode.OK
    assert answer.twists[0].linear.norm() <= 2.5 * answer.error_bound


@pytest.mark.parametrize("mu", [0.0, 0.1, 3.0])
def test_stronge_keeps_the_symmetry_of_a_rack(mu):
    """Thirty contacts of fifteen balls, struck head-on."""
    places = [(row * math.sqrt(0.75), k - row / 2) for row in range(5) for k in range(row + 1)]
    balls = [(-1.0, 0.0), *places]
    moment = 0.1
    bodies = [
        Body.dynamic(1.0, (moment, 0, 0, moment, 0, moment), (x, y, 0.0), None, (float(x < 0), 0.0, 0.0))
        for x, y in balls
    ]
    pairs = [
        (i, k)
        for i in range(len(balls))
        for k in range(i + 1, len(balls))
        if math.dist(balls[i], balls[k]) < 1.01
    ]
    contacts = [
        Contact.of(
            (*((p + q) / 2 for p, q in zip(balls[i], balls[k], strict=True)), 0.0),
            (*(p - q for p, q in zip(balls[i], balls[k], strict=True)), 0.0),
            0.95,
            mu,
        )
        for i, k in pairs
    ]
    scene = Scene(bodies, pairs, contacts)
    answer = scene.resolve(Law.ROUTH_STRONGE)
    assert answer.error_bound < 1e-4
    room = answer.error_bound * change_norm(scene, answer)
    for (x, y), twist in zip(balls, answer.twists, strict=True):
        mirrored = answer.twists[balls.index((x, -y))]
        assert mirrored.linear == pytest.approx((twist.linear.x, -twist.linear.y, twist.linear.z), abs=room)
        assert mirrored.angular.z == pytest.approx(-twist.angular.z, abs=room / math.sqrt(moment))


def corner(walls: int, part: float, e: float) -> Scene:
    """A point that falls evenly into a corner of walls. Friction adds ``part`` of each normal force."""
    velocity = [-1.0] * walls + [0.0] * (3 - walls)
    normals = [[float(i == k) for i in range(3)] for k in range(walls)]
    contacts = [Contact.of((0.0, 0.0, 0.0), n, e, part / math.sqrt(walls - 1)) for n in normals]
    return Scene([Body.dynamic(2.0, velocity=velocity), Body.static()], [(0, 1)] * walls, contacts)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("e", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("walls", [2, 3])
@pytest.mark.parametrize("part", [0.14, 0.3, 0.5, 0.71, 0.9, 0.99])
def test_stronge_gives_the_closed_form_of_a_corner(walls, part, e, exponent, monkeypatch):
    """It slips evenly at each wall.

    With n walls, friction adds c = mu sqrt(n - 1) to the force of a spring, against the motion: m u^2 / 2 is
    (1 + c) times the work of compression, and (1 - c) times the work given back. The springs turn round
    together, which needs no long search: the budget is a hundredth of the usual one.
    """
    monkeypatch.setattr(protocol, "SPRING_WORK", protocol.SPRING_WORK // 100)
    answer = corner(walls, part, e).resolve(Law.ROUTH_STRONGE, options={"exponent": exponent})
    speed = e * math.sqrt((1 - part) / (1 + part))
    assert answer.error_bound <= 1e-5  # what it follows the path for
    change = (1 + speed) * math.sqrt(walls)
    for axis in answer.twists[0].linear[:walls]:
        assert axis == pytest.approx(speed, abs=answer.error_bound * change)


@pytest.mark.parametrize("e", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("walls", [2, 3])
@pytest.mark.parametrize("part", [1.01, 1.5, 20.0])
def test_contacts_that_friction_keeps_compressed_are_refused(walls, part, e):
    """As above with c > 1: friction holds more than a spring gives back."""
    with refused(StatusCode.PATH_TOO_LONG, match="friction wedges the bodies"):
        corner(walls, part, e).resolve(Law.ROUTH_STRONGE)


@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-15, 1e-12, 1e-9])
@pytest.mark.parametrize("opening", [40, 60, 90, 120])
@pytest.mark.parametrize("inertia", [0.0, 0.4])
def test_a_ball_wedged_in_a_groove_is_refused_quickly(inertia, opening, off, monkeypatch):
    """Friction holds it from the tangent of the slope on, however the walls are rounded.

    The budget is a hundredth of the usual one.
    """
    monkeypatch.setattr(protocol, "SPRING_WORK", protocol.SPRING_WORK // 100)
    slope = math.radians(90 - opening / 2)
    normals = [(math.sin(slope) + off, -off, math.cos(slope)), (-math.sin(slope), off, math.cos(slope))]
    ball = Body.dynamic(1.0, (inertia, 0, 0, inertia, 0, inertia), velocity=(off, 0.0, -1.0))
    for part in (0.9, 1.1, 2.0):
        mu = part / math.tan(slope)
        contacts = [Contact.of(tuple(-x for x in n), n, 0.5, mu) for n in normals]
        scene = Scene([ball, Body.static()], [(0, 1)] * 2, contacts)
        if part < 1:
            assert scene.resolve(Law.ROUTH_STRONGE).status is StatusCode.OK
        else:
            with pytest.raises(ImpactError, match="friction wedges the bodies"):
                scene.resolve(Law.ROUTH_STRONGE)


def held_rod(seed: int, count: int, mu: float) -> Scene:
    """A rod that strikes walls in some of its points."""
    rng = random.Random(seed)
    rod = Body.dynamic(
        1.0, (0.0, 0.0, 0.0, 1 / 12, 0.0, 1 / 12), velocity=(0.0, 0.0, -1.0), angular_velocity=(0.0, 0.5, 0.5)
    )
    contacts = [
        Contact.of((rng.uniform(-0.5, 0.5), 0.0, 0.0), (rng.uniform(-1, 1), rng.uniform(-1, 1), 1.0), 0.5, mu)
        for _ in range(count)
    ]
    return Scene([rod, Body.static()], [(0, 1)] * count, contacts)


@pytest.mark.parametrize(
    ("mu", "seed", "count"), [(30.0, 11, 2), (300.0, 11, 2), (30.0, 3, 3), (300.0, 3, 3), (300.0, 20, 3)]
)
def test_friction_that_holds_a_body_in_several_ways_is_found_quickly(mu, seed, count, monkeypatch):
    """Contact by contact, it takes up to a million turns. The budget is a twentieth of the usual one."""
    monkeypatch.setattr(protocol, "SPRING_WORK", protocol.SPRING_WORK // 20)
    scene = held_rod(seed, count, mu)
    if seed == 3:
        with refused(StatusCode.PATH_TOO_LONG, match="friction wedges the bodies"):
            scene.resolve(Law.ROUTH_STRONGE)
    else:
        assert scene.resolve(Law.ROUTH_STRONGE).error_bound <= 1e-5


@pytest.mark.parametrize("mu", [100.0, 300.0, 400.0])
def test_wedged_bodies_do_not_creep_out(mu):
    """Friction that is nearly found would let them."""
    with refused(StatusCode.PATH_TOO_LONG, match="friction wedges the bodies"):
        held_rod(11, 3, mu).resolve(Law.ROUTH_STRONGE)


def test_a_body_that_only_a_coarse_path_stops_is_not_wedged():
    assert held_rod(20, 2, 3.0).resolve(Law.ROUTH_STRONGE).error_bound <= 1e-5


def between_walls(e: float, mu: float, recedes: float = 0.0) -> Scene:
    """A ball that moves from one wall to an opposite one, along them too."""
    ball = Body.sphere(1.0, 0.5, velocity=(1.0, 0.2, 0.0))
    walls = [Body.static(), Body.kinematic((0.0, 0.0, 0.0), (-recedes, 0.0, 0.0))]
    contacts = [Contact.of((x, 0.0, 0.0), (-2 * x, 0.0, 0.0), e, mu) for x in (0.5, -0.5)]
    return Scene([ball, *walls], [(0, 1), (0, 2)], contacts)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_elastic_contacts_that_press_on_each_other_are_refused_quickly(mu, monkeypatch):
    """Their springs never relax, all of them. The budget is a hundredth of the usual one."""
    monkeypatch.setattr(protocol, "SPRING_WORK", protocol.SPRING_WORK // 100)
    with refused(StatusCode.PATH_TOO_LONG, match="rattle for ever"):
        between_walls(1.0, mu).resolve(Law.ROUTH_STRONGE)
    for scene in (between_walls(0.9, mu), between_walls(1.0, mu, recedes=3.0)):
        assert scene.resolve(Law.ROUTH_STRONGE).error_bound <= 1e-4


def test_an_exhausted_budget_has_a_status(monkeypatch):
    """Or gives the answer found within it, if its error is known."""
    scene = box((1, 0.3, -1), (0.2, 0.3, 1), e=0.5, mu=0.3)
    exact = scene.resolve(Law.ROUTH_STRONGE)
    monkeypatch.setattr(protocol, "SPRING_WORK", 30_000)
    with refused(StatusCode.PATH_TOO_LONG):
        scene.resolve(Law.ROUTH_STRONGE)
    monkeypatch.setattr(protocol, "SPRING_WORK", 1_500_000)
    answer = scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-9)
    assert answer.status is StatusCode.TOLERANCE_NOT_MET
    assert 1e-9 < answer.error_bound < 1e-2
    assert distance(scene, answer, exact) <= answer.error_bound + exact.error_bound


@pytest.mark.parametrize("inertia", [0.0, 0.4])
@pytest.mark.parametrize("velocity", [(0.0, -1.0, 0.0), (0.3, -1.0, 0.0), (0.0, -1.0, 0.5)])
@pytest.mark.parametrize("tilt", [0.3, 1e-2, 1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("mu", [0.3, 1.0])
def test_a_wedge_holds_what_falls_into_it(inertia, velocity, tilt, mu):
    """It comes to rest. The more parallel the walls, the more other velocities nearly obey the law."""
    contacts = [
        Contact.of((-x, -math.sin(tilt), 0.0), (x, math.sin(tilt), 0.0), 0.0, mu)
        for x in (math.cos(tilt), -math.cos(tilt))
    ]
    body = Body.dynamic(1.0, (inertia, 0, 0, inertia, 0, inertia), velocity=velocity)
    answer = Scene([body, Body.static()], [(0, 1)] * 2, contacts).resolve(Law.MOREAU)
    assert answer.model.law is Law.MOREAU
    size = math.hypot(*velocity)
    assert math.hypot(*answer.twists[0].linear[:2]) <= answer.error_bound * size + 1e-15
    if tilt >= 1e-5:
        assert answer.error_bound < 1e-12 / tilt


@pytest.mark.parametrize("tilt", [1e-2, 1e-3])
def test_at_the_limit_of_sliding_the_bound_is_a_root(tilt):
    """Friction just holds, so the bound is the root of what rounding may be."""
    n = math.cos(tilt), math.sin(tilt)
    contacts = [Contact.of((-x, -n[1], 0.0), (x, n[1], 0.0), 0.0, tilt / 2) for x in (n[0], -n[0])]
    body = Body.dynamic(1.0, velocity=(0.0, -1.0, 0.5))
    answer = Scene([body, Body.static()], [(0, 1)] * 2, contacts).resolve(Law.MOREAU)
    assert math.hypot(*answer.twists[0].linear) <= answer.error_bound
    assert 1e-6 < answer.error_bound < 1e-2


@pytest.mark.parametrize("theta", [math.atan(2), math.pi / 4, math.atan(0.5), 1.2])
@pytest.mark.parametrize("factor", [0.5, 1 - 1e-6, 1, 1 + 1e-9, 2])
def test_moreau_errors_are_within_the_bound_near_its_edges(theta, factor):
    """Where a rod just sticks, and where it just locks."""
    s, c = math.sin(theta), math.cos(theta)
    for mu in (3 * s * c / (1 + 3 * s * s), (1 + 3 * c * c) / (3 * s * c)):
        for slip in (-5.0, -0.3, 0.0, 0.3, 1.0, 5.0):
            scene = rod(theta, (slip, -1.0), mu * factor, 0.5)
            answer = scene.resolve(Law.MOREAU)
            one = resolve(scene.bodies[0], scene.bodies[1], scene.contacts[0], ImpactModel(Law.MOREAU))
            if answer.model.law is one.model.law:
                known = [one.change_a, *answer.changes[1:]]
                assert (
                    distance_of_changes(scene, answer.changes, known) <= answer.error_bound + one.error_bound
                )


@pytest.mark.parametrize("power", range(0, 81, 10))
@pytest.mark.parametrize("contacts", [(0, 1, 2), (0, 2), (1, 2)])
def test_moreau_where_a_light_ball_strikes_a_heavy_body_that_leaves_walls(power, contacts):
    """The impulse is small next to the motion of the heavy body. The ball comes at 0.5 m/s, with e = 1/4."""
    light = 2.0**-power
    heavy = Body.dynamic(
        2.0**20, (0.0, 0.0, 0.0, 2.0**20, 0.0, 2.0**20), (-1.0, 1.0, 1.0), None, (0.0, 1.0, 0.5),
        (0.0, 0.0, 1.0), (-0.5, 0.0, 0.5),
    )  # fmt: skip
    ball = Body.dynamic(
        light, [light / 8 * x for x in (1, 0, 0, 1, 0, 1)], (-1.0, 2.0, 2.0), None, (1.0, 0.5, -2.0)
    )
    walls = [Body.static(), Body.kinematic(velocity=(-1.0, 0.0, 1.0))]
    all_contacts = [
        ((1, 2), Contact.of((0.5, 1.0, 0.0), (0, 1, 0), 0.25, 0.1)),
        ((0, 3), Contact.of((0.5, 0.0, 0.0), (1, 0, 0), 0.25, 0.1)),
        ((0, 1), Contact.of((1.0, 0.5, 0.5), (1, 0, 0), 0.25, 0.3)),
    ]
    pairs, touches = zip(*(all_contacts[i] for i in contacts), strict=True)
    answer = resolve_scene([heavy, ball, *walls], pairs, touches, ImpactModel(Law.MOREAU))
    off = abs(answer.normal_velocities_after[-1] - 0.125)
    assert off <= 0.625 * 3 * answer.error_bound  # 3: the spin of the ball adds to this velocity


def obeys_moreau(answer: SceneImpact) -> bool:
    """Whether contacts of two bodies rebound by Newton's law, and friction opposes each slip."""
    v = answer.twists[0].linear - answer.twists[1].linear
    for contact, P, before, after in zip(
        answer.contacts,
        answer.impulses,
        answer.normal_velocities_before,
        answer.normal_velocities_after,
        strict=True,
    ):
        n = contact.normal * (1 / contact.normal.norm())
        slip, friction = v - n * n.dot(v), P - n * n.dot(P)
        limit = contact.friction * n.dot(P)
        if not limit > 0 or abs(after + contact.restitution * before) > 1e-13:
            return False
        if (slip * limit + friction * slip.norm()).norm() > 1e-13 * limit:
            return False
    return True


@pytest.mark.parametrize("d", [10.0**-k for k in range(3, 13)])
@pytest.mark.parametrize("tilts", [((0, 0), (1, -1)), ((2, 1), (2, 0)), ((0, 1), (0, -1))])
@pytest.mark.parametrize("other", [Body.static(), Body.dynamic(1.0)], ids=["wall", "body"])
def test_moreau_errors_are_within_the_bound_where_normals_are_nearly_parallel(d, tilts, other):
    """One of two contacts takes the load, as if alone, if the other then separates fast enough."""
    for mu, e, slip in itertools.product(
        (0.3, 2.0, 1e3, 1e6), (0.5, 1.0), ((1e-3, 0.0), (0.0, 1e-3), (-1.0, 0.0), (0.5, 1.0))
    ):
        body, model = Body.dynamic(1.0, velocity=(*slip, -1.0)), ImpactModel(Law.MOREAU)
        contacts = [Contact.of((0, 0, 0), (x * d, y * d, 1.0), e, mu) for x, y in tilts]
        answer = resolve_scene([body, other], [(0, 1)] * 2, contacts, model)
        errors = []
        for taking, idle in (contacts, contacts[::-1]):
            alone = resolve(body, other, taking, model)
            after, before = alone.twist_a.linear - alone.twist_b.linear, Vec3(*body.velocity)
            if idle.normal.dot(after) >= -e * idle.normal.dot(before):
                errors.append(
                    (answer.changes[0].linear - alone.change_a.linear).norm() / alone.change_a.linear.norm()
                )
        if errors and obeys_moreau(answer):  # a third solution, in which both take a load
            errors.append(0.0)
        if errors and answer.model.law is Law.MOREAU:
            assert min(errors) <= answer.error_bound + 1e-15, (mu, e, slip)
            if d > 1e-5 and mu < 1e3:
                assert answer.error_bound < 1e-4, (mu, e, slip)


def test_a_load_with_several_distributions_has_no_bound():
    """A box slides and turns: it may rest on two different triples of its corners, with different spins."""
    scene = box((1, 0.3, -1), (0, 0, 0.3), e=0.5, mu=0.3)
    answer = scene.resolve(Law.MOREAU)
    assert answer.error_bound == math.inf
    spins = set()
    for left_out in range(4):
        three = [i for i in range(4) if i != left_out]
        other = Scene(scene.bodies, [(0, 1)] * 3, [scene.contacts[i] for i in three]).resolve(Law.MOREAU)
        after = other.twists[0]
        at = Vec3(*scene.contacts[left_out].position) - Vec3(*scene.bodies[0].position)
        if (after.linear + after.angular.cross(at)).z >= 0.5 - 1e-9:  # the fourth needs no impulse
            spins.add(round(after.angular.z, 6))
    assert len(spins) == 2


UNITS = pytest.mark.parametrize(
    ("mass", "length", "time"), [(1.0, 1.0, 1.0), (1e-3, 100.0, 1e3), (1e-30, 1e20, 1e5), (1e6, 1e-9, 3.0)]
)
"""How many of other units a kilogram, a metre and a second are."""


@UNITS
def test_impulses_that_change_no_twist_are_shared_evenly(mass, length, time):
    """In a wedge friction moves nothing, so the works with and without it differ by rounding."""
    speed, unit = length / time, mass * length / time
    ball = Body.sphere(mass, 0.5 * length, velocity=(0, 0, -speed))
    contacts = [
        Contact.of((-x * 0.3 * length, 0, -0.4 * length), (x * 0.6, 0, 0.8), 0.5, 0.125) for x in (1, -1)
    ]
    answer = resolve_scene([ball, Body.static()], [(0, 1)] * 2, contacts)
    for x, impulse in zip((1, -1), answer.impulses, strict=True):  # along n + mu t
        assert impulse.x == pytest.approx(x * 0.75 * 0.5 / 0.875 * unit, rel=1e-5)
        assert impulse.z == pytest.approx(0.75 * unit, rel=1e-5)
    assert answer.regimes == (Regime.REVERSED,) * 2


@UNITS
def test_a_slip_that_cancels_is_not_reversed(mass, length, time):
    """(0.5, 0) + (0, 1, 0) x (+-0.5, 0, -0.5): the contacts do not slip before the impact, up to rounding."""
    inertia = mass * length * length / 6
    cube = Body.dynamic(
        mass,
        (inertia, 0, 0, inertia, 0, inertia),
        (0, 0, 0.5 * length),
        velocity=(0.5 * length / time, 0, -0.5 * length / time),
        angular_velocity=(0, 1 / time, 0),
    )
    contacts = [Contact.of((x * length, 0, 0), (0, 0, 1), 0.0, 0.3) for x in (-0.5, 0.5)]
    answer = resolve_scene([cube, Body.static()], [(0, 1)] * 2, contacts)
    assert answer.regimes == (Regime.SLIDING,) * 2


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [1e-6, 0.3, 3.0])
def test_a_box_that_falls_flat_without_slip_sticks_with_all_corners(e, mu):
    """Friction does nothing, in whatever order the corners are."""
    scene = box((0, 0, -1), e=e, mu=mu)
    for order in itertools.permutations(range(4)):
        answer = scene._replace(contacts=[scene.contacts[i] for i in order]).resolve(Law.COULOMB)
        assert answer.regimes == (Regime.STICKING,) * 4
        for impulse in answer.impulses:
            assert impulse == pytest.approx((0, 0, (1 + e) / 4), abs=1e-9)


@pytest.mark.parametrize("mu", [0.05, 0.1, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("speed", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("radius", [0.0, 0.5])
def test_a_body_that_slides_along_the_floor_rebounds_from_a_wall(radius, speed, e, mu):
    """MOREAU has this solution for any friction; with more, it finds that the contacts lock."""
    body = Body.sphere(1.0, radius, velocity=(speed, 0, 0))
    contacts = [Contact.of((0, 0, -radius), (0, 0, 1), e, mu), Contact.of((radius, 0, 0), (-1, 0, 0), e, mu)]
    answer = Scene([body, Body.static()], [(0, 1)] * 2, contacts).resolve(Law.MOREAU)
    assert Adjustment.LAW_FALLBACK not in answer.adjustments
    off = math.dist(answer.twists[0].linear, (-e * speed, 0, 0)) / ((1 + e) * speed)
    assert off <= min(answer.error_bound, 1e-5)  # the bound is infinite if contacts nearly lock


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_units_change_no_answer_beyond_its_bound(law):
    """Twice the mass, whose root is rounded, and another unit of speed, of which springs take a root."""
    for seed in (62, 64, 66, 67, 70, 72, 73, 74, 76):
        scene = any_scene(seed).with_contacts(restitution=0.5, friction=0.3)
        bodies = [
            body._replace(mass=2 * body.mass, inertia=body.inertia * 2.0, velocity=Vec3(*body.velocity) * 8.0,
                          angular_velocity=Vec3(*body.angular_velocity) * 8.0)
            for body in scene.bodies
        ]  # fmt: skip
        one, other = scene.resolve(law), scene._replace(bodies=bodies).resolve(law)
        back = [Twist(t.linear * 0.125, t.angular * 0.125) for t in other.changes]
        assert distance_of_changes(scene, one.changes, back) <= one.error_bound + other.error_bound


@pytest.mark.parametrize("seed", [61, 64, 65, 66, 67, 70, 74, 79])
def test_properties_of_stronge_with_any_friction(seed):
    """Order and frame do not matter, and every impulse is in its friction cone."""
    scene, rng = any_scene(seed), random.Random(seed)
    scene = scene._replace(
        contacts=[
            c._replace(restitution=rng.choice([0.1, 0.5, 1.0]), friction=rng.choice([0.0, 0.3, 3.0, 1e5]))
            for c in scene.contacts
        ]
    )
    answer = scene.resolve(Law.ROUTH_STRONGE)
    off, size = answer.error_bound, change_norm(scene, answer)
    order = rng.sample(range(len(scene.pairs)), len(scene.pairs))
    other = Scene(scene.bodies, [scene.pairs[i] for i in order], [scene.contacts[i] for i in order])
    v = Vec3(0.7, -3.0, 1.1)
    boosted = scene._replace(bodies=[b._replace(velocity=Vec3(*b.velocity) + v) for b in scene.bodies])
    for same in (other.resolve(Law.ROUTH_STRONGE), boosted.resolve(Law.ROUTH_STRONGE)):
        assert distance(scene, answer, same) <= off + same.error_bound
    assert min(answer.energy_lost_restitution, answer.energy_lost_friction) >= -off * size * size
    for contact, P in zip(scene.contacts, answer.impulses, strict=True):
        n = Vec3(*contact.normal)
        along = P.dot(n) / n.norm()
        across = (P - n * (along / n.norm())).norm()
        assert across <= contact.friction * along + 1e-9 * P.norm()


@pytest.mark.parametrize("height", [0.05, 0.2])
@pytest.mark.parametrize("e", [0.1, 0.5, 1.0])
def test_friction_of_contacts_that_stick_at_last_is_in_its_cone(e, height):
    """Slip ends just before the impact does, and two contacts can share the friction in several ways."""
    mu, spin = 0.3, (0.0, 0.01 if e < 0.5 else 0.4, 0.0)
    for k in range(90, 102):
        velocity = (-mu * (1 + e) * k / 100, 0.0, -1.0)
        body = Body.dynamic(1.0, (0.1, 0.0, 0.0, 0.1, 0.0, 0.1), (0.0, 0.0, height), None, velocity, spin)
        contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0), e, mu) for x in (-0.5, 0.5)]
        scene = Scene([body, Body.static()], [(0, 1)] * 2, contacts)
        fine = scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-7)
        for tolerance in (0.0, 1e-3):
            answer = scene.resolve(Law.ROUTH_STRONGE, tolerance=tolerance)
            assert answer.status is StatusCode.OK
            assert distance(scene, answer, fine) <= answer.error_bound + fine.error_bound
            for P in answer.impulses:
                assert math.hypot(P.x, P.y) <= mu * P.z + 1e-9


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("unit", [5e-324, 2.0**-1000, 2.0**1000])
def test_only_the_ratios_of_the_stiffnesses_matter(unit, mu):
    scene, ratios = box(spin=(0.1, 0.2, 0.0), e=0.5, mu=mu), (1.0, 2.0, 4.0, 1.0)
    one, other = (
        scene.resolve(Law.ROUTH_STRONGE, options={"stiffness": [k * by for k in ratios]}) for by in (1, unit)
    )
    assert one == other


@pytest.mark.parametrize("speed", [10.0**k for k in range(0, 13, 3)])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_stronge_sees_an_approach_next_to_bodies_that_part_far_faster(speed, mu, e):
    """A ball lands while another one leaves it."""
    moment = (0.1, 0, 0, 0.1, 0, 0.1)
    balls = [
        Body.dynamic(1.0, moment, (0.0, 0.0, z), velocity=(0.0, 0.0, v))
        for z, v in ((0.5, -1.0), (1.5, speed))
    ]
    contacts = [Contact.of((0.0, 0.0, z), (0.0, 0.0, 1.0), e, mu) for z in (0.0, 1.0)]
    scene = Scene([*balls, Body.static()], [(0, 2), (1, 0)], contacts)
    answer = scene.resolve(Law.ROUTH_STRONGE)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-4
    assert abs(answer.changes[0].linear.z - (1 + e)) <= (1 + e) * answer.error_bound
    assert answer.changes[1].linear.norm() <= (1 + e) * answer.error_bound


@pytest.mark.parametrize("speed", [2.0**-400, 1.0, 2.0**200])
@pytest.mark.parametrize("mu", [1.0, 1000.0])
def test_friction_of_an_impulse_that_is_less_than_its_error_is_no_fault(speed, mu):
    """A rod whirls against a body a million times faster than their other contact approaches."""
    body_a = Body.dynamic(
        1.0,
        (1.0, 0.0, 0.0, 1.0, 0.0, 2.0),
        (1.0, -0.5, 0.0),
        velocity=Vec3(0.25, 0.1, -1.0) * speed,
        angular_velocity=Vec3(0.1, 2.0, -2.0) * speed,
    )
    rod = Body.dynamic(
        1.0,
        (0.0, 0.0, 0.0, 1.0, 0.0, 1.0),
        (0.5, 1.0, -0.5),
        velocity=Vec3(3.0, 0.0, 1.0) * speed,
        angular_velocity=Vec3(-3e6, 7e5, 0.0) * speed,
    )
    contacts = [
        Contact.of((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), 0.25, 1.0),
        Contact.of((3.0, 0.1, 0.7), (0.0, 0.6, 0.8), 0.25, mu),
    ]
    answer = Scene([body_a, rod], [(0, 1), (1, 0)], contacts).resolve(Law.ROUTH_STRONGE)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-4


def assert_the_last_contact_takes_no_part(scene: Scene, **model):
    answer = scene.resolve(Law.COULOMB, **model)
    rest = Scene(scene.bodies, scene.pairs[:-1], scene.contacts[:-1]).resolve(Law.COULOMB, **model)
    assert not any(answer.impulses[-1])
    assert answer.regimes[-1] is Regime.SEPARATING
    assert distance(scene, answer, rest) <= answer.error_bound + rest.error_bound


@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3, 1e4, 1e6, 1e12, math.inf])
def test_a_body_that_flies_away_does_not_share_a_load(mass):
    heavy = {"position": (2, 0, 0), "velocity": (3, 0, 4)}
    flies = Body.kinematic(**heavy) if mass == math.inf else Body.dynamic(mass, **heavy)
    ball = Body.dynamic(1.0, velocity=(1, 0, 0))
    contacts = [
        Contact.of((0, 0, -1), (-12, 0, 5), 0.0, 0.5),
        Contact.of((0, 0, -1), (3, 0, 4), 0.0, 0.5),
        Contact.of((1, 0, 0), (-1, 0, 0), 0.0, 0.5),
    ]
    scene = Scene([ball, flies, Body.static()], [(0, 2), (0, 2), (0, 1)], contacts)
    assert_the_last_contact_takes_no_part(scene)


@pytest.mark.parametrize("mass", [1.0, 1e3, 1e5, 1e6, 1e7, 1e9, 1e12, 1e15])
@pytest.mark.parametrize("drift", [0.0, -4.0, 64.0])
def test_a_heavy_body_that_flies_away_and_strikes_another_does_not_share_the_load_of_the_first(mass, drift):
    """For every observer."""
    ball = Body.dynamic(1.0, velocity=(1, 0, drift))
    heavy = Body.dynamic(mass, position=(2, 0, 0), velocity=(3, 0, 4 + drift))
    struck, wall = Body.dynamic(1.0, velocity=(0, 0, drift)), Body.kinematic((0, 0, 0), (0, 0, drift))
    contacts = [
        Contact.of((0, 0, -1), (-12, 0, 5), 0.0, 0.5),
        Contact.of((3, 0, 0), (1, 0, 0), 0.0, 0.5),
        Contact.of((0, 0, -1), (3, 0, 4), 0.0, 0.5),
        Contact.of((1, 0, 0), (-1, 0, 0), 0.0, 0.5),
    ]
    scene = Scene([ball, heavy, wall, struck], [(0, 2), (3, 1), (0, 2), (0, 1)], contacts)
    assert_the_last_contact_takes_no_part(scene)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-5, 1e-3, 1 / 64])
def test_a_neighbour_that_parts_does_not_share_a_load_of_nearly_parallel_contacts(tilt):
    ball, wall = Body.sphere(2.0, 1.0, velocity=(1, 0, -1)), Body.static()
    neighbour = Body.dynamic(4.0, position=(2, 0, 0), velocity=(3, 0, -1))
    contacts = [
        Contact.of((-0.5, 0, -1), (-1, 0, 0), 0.0, 1.0),
        Contact.of((0.5, 0, -1), (-1, 0, tilt), 0.0, 1.0),
        Contact.of((1, 0, 0), (-1, 0, 1), 0.0, 1.0),
    ]
    scene = Scene([ball, wall, neighbour], [(0, 1), (0, 1), (0, 2)], contacts)
    assert_the_last_contact_takes_no_part(scene)


def test_friction_reaches_no_body_that_parts():
    bodies = [
        Body.dynamic(4.0, velocity=(-1, 0, 4)),
        Body.dynamic(2.0, position=(2, 0, 0), velocity=(-2, 0, 0)),
        Body.static(),
    ]
    contacts = [Contact.of((1.5, 0, 0), (1, 0, 0)), Contact.of((1, 0, 0), (-1, 0, 0), 0.0, 1.0)]
    scene = Scene(bodies, [(1, 2), (0, 1)], contacts)
    assert_the_last_contact_takes_no_part(scene, tolerance=1e-12)


@pytest.mark.parametrize("mu", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("tilt", [0.0, 1e-5, 1e-3, 3.5e-3, 1e-2])
def test_contacts_that_are_nearly_dependent_answer_alike_for_every_observer(tilt, mu):
    """The observer turns by 90 degrees, without rounding."""
    normals = [(1, 0, 1), (-1, tilt, 1), (0, -tilt, 1), (3, tilt, 1)]

    def changes(turn):
        ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), velocity=turn(-0.245, 0.4475, -0.1))
        contacts = [Contact.of(turn(*(-x for x in n)), turn(*n), 0.5, mu) for n in normals]
        scene = Scene([ball, Body.static()], [(0, 1)] * 4, contacts)
        return scene, scene.resolve(Law.COULOMB, tolerance=1e-9)

    scene, straight = changes(lambda x, y, z: (x, y, z))
    _, turned = changes(lambda x, y, z: (-y, x, z))
    back = [Twist(Vec3(v.y, -v.x, v.z), Vec3(w.y, -w.x, w.z)) for v, w in turned.changes]
    off = distance(scene, straight, turned._replace(changes=back))
    assert off <= straight.error_bound + turned.error_bound


@pytest.mark.parametrize("noise", [0.0, 3e-15, 1e-14, 5e-14, 1e-13, 1e-9])
@pytest.mark.parametrize("table", [1.0, 1e3, 1e9])
def test_a_table_that_leaves_takes_no_part_in_any_order_of_contacts(noise, table):
    """Rounding gives it loads, where eight contacts depend on each other to 27 digits."""
    rng = random.Random(0)

    def off(x, y, z):
        return tuple(one + noise * rng.uniform(-1, 1) for one in (x, y, z))

    corners = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    bodies = [
        Body.box(1.0, (1, 1, 1), position=(0, 0, 0.5)),
        Body.box(
            1.0, (1, 1, 1), position=(0, 0, 1.5), velocity=(1, 0.5, -1), angular_velocity=(0.1, 0.2, 0.3)
        ),
        Body.box(table, (4, 4, 1), position=(0, 0, -0.5), velocity=(0, 0, -2)),
    ]
    above = [Contact.of(off(*corner, 1), off(0, 0, 1), 0.0, 0.3) for corner in corners]
    below = [Contact.of(off(*corner, 0), off(0, 0, 1), 0.0, 0.3) for corner in corners]
    alone = Scene(bodies, [(1, 0)] * 4, above).resolve(Law.COULOMB)
    pairs, contacts = [(1, 0)] * 4 + [(0, 2)] * 4, above + below
    for seed in range(8):
        order = random.Random(seed).sample(range(8), 8)
        scene = Scene(bodies, [pairs[i] for i in order], [contacts[i] for i in order])
        answer = scene.resolve(Law.COULOMB)
        assert distance(scene, answer, alone) <= answer.error_bound + alone.error_bound
        regimes = {answer.regimes[order.index(i)] for i in range(4, 8)}
        assert regimes == {Regime.SEPARATING}


@pytest.mark.parametrize("noise", [1e-6, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("seed", range(5))
def test_the_point_by_which_the_motion_of_a_turntable_is_given_does_not_matter(noise, seed):
    rng = random.Random(seed)
    box = Body.box(1.0, (1, 1, 1), position=(2, 0, 0.5), velocity=(0.5, 1.5, -1))
    contacts = [
        Contact.of(
            (2 + x, y, noise * rng.uniform(-1, 1)),
            (noise * rng.uniform(-1, 1), noise * rng.uniform(-1, 1), 1),
            0.0,
            0.3,
        )
        for x in (-0.5, 0.5)
        for y in (-0.5, 0.5)
    ]
    answers = []
    for x in (0.0, 1.0, 8.0, 64.0):  # turning once in 2 pi seconds about the z axis
        table = Body.kinematic((x, 0, 0), (0, x, 0), (0, 0, 1))
        scene = Scene([box, table], [(0, 1)] * 4, contacts)
        answers.append(scene.resolve(Law.COULOMB))
    for answer in answers[1:]:
        assert distance(scene, answer, answers[0]) <= answer.error_bound + answers[0].error_bound


def normal_velocity(scene: Scene, answer, i: int) -> float:
    """The normal velocity of a contact of the scene for the twists of an answer."""
    contact = scene.contacts[i]
    columns = (
        Column.of(
            scene.bodies[body]._replace(
                velocity=answer.twists[body].linear, angular_velocity=answer.twists[body].angular
            ),
            contact.position,
            contact.normal,
        )
        for body in scene.pairs[i]
    )
    u_a, u_b = (column.velocity for column in columns)
    return (u_a - u_b) / contact.normal.norm()


@pytest.mark.parametrize("first", range(0, 300, 10))
def test_a_contact_that_parts_before_and_after_changes_nothing(first):
    """A cluster of one contact is left out: it has another law."""
    compared = 0
    for seed in range(first, first + 10):
        scene = any_scene(seed).with_contacts(restitution=0.0)
        before = scene.resolve(Law.FRICTIONLESS).normal_velocities_before
        limit = -0.1 * min(before)
        for i, u in enumerate(before):
            if not u > limit > 0:
                continue
            rest = Scene(*(list(part) for part in scene))
            del rest.pairs[i], rest.contacts[i]
            touches = list(zip(rest.pairs, rest.contacts, strict=True))
            without = rest.resolve(Law.COULOMB)
            if any(len({touches[k] for k in cluster}) == 1 for cluster in without.clusters):
                continue
            answers = rest.resolve(Law.FRICTIONLESS), without
            if all(normal_velocity(scene, answer, i) > limit for answer in answers):
                answer = scene.resolve(Law.COULOMB)
                assert distance(scene, answer, without) <= answer.error_bound + without.error_bound
                compared += 1
    assert compared
