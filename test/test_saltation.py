"""The saltation matrix and covariances: against reference values, a simulated bounce and Monte Carlo."""

from __future__ import annotations

import json
import math
import pickle
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from collisions import random_collision
from extremes import extremes
from refusals import refused

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.batch import body_rows, contact_rows, resolve_batch
from collision_response.derivatives import (
    SurfaceMotion,
    corner_on_plane,
    differentiate,
    point_on_plane,
    propagate_covariance,
    saltation_matrix,
    sphere_on_plane,
    sphere_on_sphere,
)
from collision_response.physics.orientation import Quaternion
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

REFERENCE = json.loads((Path(__file__).parent / "data" / "saltation.json").read_text())
G = (0.0, 0.0, -9.81)
FLOOR = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.8, 0.1)
RADIUS, MASS = 0.1, 0.5
MOMENT = 0.4 * MASS * RADIUS**2


def ball(**changes) -> Body:
    state = {"velocity": (2.0, 0.5, -3.0), "angular_velocity": (1.0, -4.0, 7.0)} | changes
    return Body.dynamic(MASS, (MOMENT, 0, 0, MOMENT, 0, MOMENT), (0.0, 0.0, RADIUS), **state)


def test_a_point_on_an_incline():
    normal = (math.sin(math.pi / 6), 0.0, math.cos(math.pi / 6))
    point = Body.dynamic(2.0, velocity=(1.0, 0.5, -3.0))
    contact = Contact.of((0, 0, 0), normal, 0.7)
    found = saltation_matrix(point, Body.static(), contact, ImpactModel(Law.FRICTIONLESS), point_on_plane, G)
    np.testing.assert_allclose(found, REFERENCE["a"], atol=6e-10)  # its last digit


def test_a_ball_that_slides_on_a_plane():
    found = saltation_matrix(
        ball(), Body.static(), FLOOR, ImpactModel(Law.COULOMB), sphere_on_plane(RADIUS), G
    )
    np.testing.assert_allclose(found, REFERENCE["b ball mu=.1 sliding"], atol=6e-11 * 15)


@pytest.mark.parametrize(
    "surfaces", [point_on_plane, corner_on_plane, sphere_on_plane(RADIUS), sphere_on_sphere(RADIUS, 0.4)]
)
def test_surfaces_can_be_pickled(surfaces):
    request = ball(), Body.static(), FLOOR
    for one, again in zip(surfaces(*request), pickle.loads(pickle.dumps(surfaces))(*request), strict=True):
        np.testing.assert_array_equal(one, again)


# --- A simulated bounce


def flown(body: Body, time: float, gravity) -> Body:
    """The body after a short free flight, to second order in the time."""
    v, w = Vec3(*body.velocity), Vec3(*body.angular_velocity)
    if not body.is_movable():
        return turned(body._replace(position=Vec3(*body.position) + v * time), w * time)
    c, g = body.to_world(body.com), Vec3(*gravity)
    velocity = v + w.cross(c)
    position = Vec3(*body.position) + c + velocity * time + g * (time * time / 2)
    dw = free_angular_acceleration(body) * time
    later = turned(body, (w + dw * 0.5) * time)
    c, w = later.to_world(body.com), w + dw
    return later._replace(
        position=position - c, velocity=velocity + g * time - w.cross(c), angular_velocity=w
    )


def free_angular_acceleration(body: Body) -> Vec3:
    """Without a torque. The rotation about an axis without inertia stays as it is."""
    xx, xy, xz, yy, yz, zz = body.inertia
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    axes = np.array([body.to_world(Vec3(*axis)) for axis in np.eye(3)]).T
    w = axes.T @ np.array(body.angular_velocity)
    return Vec3(*(axes @ np.linalg.pinv(inertia) @ np.cross(inertia @ w, w)).tolist())


def turned(body: Body, by: Vec3) -> Body:
    angle = math.sqrt(by.dot(by))
    sine, cosine = (math.sin(angle / 2) / angle, math.cos(angle / 2)) if angle else (0.5, 1.0)
    q = body.orientation or Quaternion(0.0, 0.0, 0.0, 1.0)
    p, v = by * sine, Vec3(*q[:3])
    return body._replace(
        orientation=Quaternion(*(p * q.w + v * cosine + p.cross(v)), cosine * q.w - p.dot(v))
    )


def bounced(bodies, touch, model, gravity):
    """The bodies at time 0 after a bounce; ``touch(bodies)`` gives distance and contact."""
    time = 0.0
    for _ in range(8):  # each gains five digits or more
        now = [flown(body, time, gravity) for body in bodies]
        gap = touch(now)[0]
        speed = (touch([flown(body, time + 1e-6, gravity) for body in bodies])[0] - gap) / 1e-6
        time -= gap / speed
    now = [flown(body, time, gravity) for body in bodies]
    impact = resolve(*now, touch(now)[1], model)
    after = now[0].with_twist(impact.twist_a), now[1].with_twist(impact.twist_b)
    return [flown(body, -time, gravity) for body in after]


def changed(body: Body, change) -> Body:
    dx, theta, dv, dw = (Vec3(*part) for part in np.split(np.asarray(change, float), 4))
    moved = body._replace(
        position=Vec3(*body.position) + dx,
        velocity=Vec3(*body.velocity) + dv,
        angular_velocity=Vec3(*body.angular_velocity) + dw,
    )
    return turned(moved, theta) if any(theta) else moved


def difference(one: Body, other: Body) -> np.ndarray:
    """The small change from ``other`` to ``one``, in the order of a state."""
    p, q = (body.orientation or Quaternion(0.0, 0.0, 0.0, 1.0) for body in (one, other))
    v, w, other_length = Vec3(*p[:3]), Vec3(*q[:3]), q.squared_length()
    theta = (v * q.w - w * p.w - v.cross(w)) * (2.0 / other_length)  # p q^-1, near 1
    parts = (Vec3(*one.position) - other.position, theta, Vec3(*one.velocity) - other.velocity)
    return np.concatenate([*parts, Vec3(*one.angular_velocity) - other.angular_velocity])


def by_simulation(bodies, touch, model, gravity=G, step=1e-5) -> np.ndarray:
    movable = [side for side, body in enumerate(bodies) if body.is_movable()]
    columns = []
    for side in movable:
        for axis in range(12):
            ends = []
            for sign in (step, -step):
                some = list(bodies)
                some[side] = changed(some[side], np.eye(12)[axis] * sign)
                ends.append(bounced(some, touch, model, gravity))
            columns.append(np.concatenate([difference(ends[0][i], ends[1][i]) for i in movable]) / (2 * step))
    return np.array(columns).T


@pytest.mark.parametrize("friction", [0.05, 0.6])
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_ball_on_a_moving_plane_agrees_with_simulation(law, friction):
    plane = Body.kinematic((0.0, 0.0, 0.0), (0.1, 0.0, 0.7))

    def touch(bodies):
        a, b = bodies
        contact = Contact.of((a.position[0], a.position[1], a.position[2] - RADIUS), (0, 0, 1), 0.8, friction)
        return a.position[2] - RADIUS - b.position[2], contact

    bodies = ball(), plane
    expected = by_simulation(bodies, touch, ImpactModel(law))
    found = saltation_matrix(*bodies, touch(bodies)[1], ImpactModel(law), sphere_on_plane(RADIUS), G)
    # Differences over 1e-5: curvature 1e-10 and rounding 1e-16/1e-5, with rates up to 100.
    np.testing.assert_allclose(found, expected, atol=3e-7)


@pytest.mark.parametrize("off_centre", [False, True])
def test_a_rotating_corner_agrees_with_simulation(off_centre):
    com = (0.02, -0.01, 0.03) if off_centre else (0.0, 0.0, 0.0)
    corner = Vec3(0.1, -0.2, 0.3)  # in body axes
    body = Body.dynamic(2.0, (0.03, 0, 0, 0.03, 0, 0.03), (0.0, 0.0, 0.0), (0.3, 0.4, -0.2, 0.8), (0.4, 0.1, -2.0),  # noqa: E501
                        (1.0, 2.0, -1.5), com)  # fmt: skip
    body = body._replace(position=Vec3(0.0, 0.0, -body.to_world(corner).z))

    def touch(bodies):
        at = Vec3(*bodies[0].position) + bodies[0].to_world(corner)
        return at.z, Contact.of(at, (0, 0, 1), 0.6, 0.2)

    expected = by_simulation((body, Body.static()), touch, ImpactModel(Law.COULOMB))
    found = saltation_matrix(
        body, Body.static(), touch((body, None))[1], ImpactModel(Law.COULOMB), corner_on_plane, G
    )
    np.testing.assert_allclose(found, expected, atol=3e-7)


def test_two_spheres_agree_with_simulation():
    radius_b, moment = 0.2, 0.4 * 1.5 * 0.04
    n = Vec3(0.6, 0.48, 0.64)
    other = Body.dynamic(
        1.5, (moment, 0, 0, moment, 0, moment), (0.0, 0.0, 0.0), None, (0.3, 0.2, 0.5), (0.5, 1.0, -2.0)
    )
    one = ball(velocity=(-2.0, -1.0, -1.0))._replace(position=n * (RADIUS + radius_b))

    def touch(bodies):
        apart = Vec3(*bodies[0].position) - bodies[1].position
        distance = math.sqrt(apart.dot(apart))
        normal = apart / distance
        return distance - RADIUS - radius_b, Contact.of(
            Vec3(*bodies[1].position) + normal * radius_b, normal, 0.7, 0.3
        )

    model, forms = ImpactModel(Law.COULOMB), sphere_on_sphere(RADIUS, radius_b)
    found = saltation_matrix(one, other, touch((one, other))[1], model, forms, G)
    assert found.shape == (24, 24)
    np.testing.assert_allclose(found, by_simulation((one, other), touch, model), atol=2e-6)


TUMBLING = Body.dynamic(
    2.0, (0.05, 0.01, -0.005, 0.04, 0.008, 0.03), (0.1, -0.2, 0.3), (0.3, 0.4, -0.2, 0.8),
    (0.4, 0.1, -2.0), (1.0, 2.0, -1.5), (0.02, -0.01, 0.03),
)  # fmt: skip
SPINNING_ROD = TUMBLING._replace(inertia=Symmetric3(0.04, 0.0, 0.0, 0.04, 0.0, 0.0))
"""It has no inertia about its axis, and the contact is beside the axis."""
TURNING_PLANE = Body.kinematic((0.2, 0.1, -0.4), (0.1, -0.2, 0.7), (0.5, -0.7, 0.3))
LOOSE_PLANE = Body.dynamic(
    3.0, (0.3, 0.05, 0.02, 0.25, -0.04, 0.2), (0.2, 0.1, -0.4), (0.1, -0.5, 0.3, 1.2),
    (0.1, -0.2, 0.7), (0.5, -0.7, 0.3), (-0.05, 0.02, 0.04),
)  # fmt: skip


@pytest.mark.parametrize("is_swapped", [False, True], ids=["body on plane", "plane on body"])
@pytest.mark.parametrize(
    "plane", [Body.static(), TURNING_PLANE, LOOSE_PLANE], ids=["static", "turning", "loose"]
)
@pytest.mark.parametrize("body", [TUMBLING, SPINNING_ROD], ids=["tumbling", "rod"])
@pytest.mark.parametrize("radius", [0.0, 0.15])
def test_unsymmetric_bodies_agree_with_simulation(radius, body, plane, is_swapped):
    """A corner, or a ball that is a part of the body, meets a plane that is a part of the other body."""
    at, n = Vec3(0.2, 0.1, 0.1), Vec3(0.1, -0.2, 1.0) * (1 / math.sqrt(1.05))
    centre = body.to_body(at + n * radius - body.position)
    point, normal = plane.to_body(at - plane.position), plane.to_body(n)

    def touch(bodies):
        ball, flat = reversed(bodies) if is_swapped else bodies
        n = flat.to_world(normal)
        middle = Vec3(*ball.position) + ball.to_world(centre)
        gap = n.dot(middle - (Vec3(*flat.position) + flat.to_world(point))) - radius
        return gap, Contact.of(middle - n * radius, -n if is_swapped else n, 0.6, 0.2)

    bodies = (plane, body) if is_swapped else (body, plane)
    contact, motion = touch(bodies)[1], sphere_on_plane(radius)
    if is_swapped:
        motion = swapped(motion(body, plane, contact._replace(normal=n)))
    found = saltation_matrix(*bodies, contact, ImpactModel(), motion, G)
    expected = by_simulation(bodies, touch, ImpactModel())
    # Differences over 1e-5, as above.
    np.testing.assert_allclose(found, expected, atol=2e-8 * np.abs(found).max())


def swapped(motion: SurfaceMotion) -> SurfaceMotion:
    """The same motion with the two bodies exchanged, which reverses the normal."""
    position, normal = (np.roll(one, 6, axis=1) for one in motion[:2])
    return SurfaceMotion(position, -normal, -motion.position_by_normal)


def test_the_motion_of_the_contact_point_matters():
    """If the contact point stayed in place, the force of the plane would turn the ball about its centre."""
    held = SurfaceMotion(np.zeros((3, 12)), np.zeros((3, 12)), np.zeros((3, 3)))
    args = ball(), Body.static(), FLOOR._replace(friction=0.6), ImpactModel(Law.COULOMB)
    right, wrong = (saltation_matrix(*args, form, G) for form in (sphere_on_plane(RADIUS), held))
    assert np.linalg.norm(wrong - right) > 50 * np.linalg.norm(right)


# --- Covariances


SD = np.array([0.005] * 3 + [0.0] * 3 + [0.05] * 3 + [0.5] * 3)
TABLE = {  # x, z, v_x, v_z, w_x, w_y
    0.1: (0.00508, 0.00400, 0.07822, 0.07948, 0.50235, 1.42616),
    0.3: (0.00513, 0.00400, 0.04468, 0.07932, 0.40008, 0.40008),
}
SHOWN = [0, 2, 6, 8, 9, 10]
UNCERTAIN = {"restitution_sd": 0.02, "friction_sd": 0.01, "normal_sd": 0.005}


def propagated(friction: float, **given):
    args = ball(), Body.static(), FLOOR._replace(friction=friction), ImpactModel(), np.diag(SD**2)
    return propagate_covariance(*args, sphere_on_plane(RADIUS), **(UNCERTAIN | {"gravity": G} | given))


@pytest.mark.parametrize("friction", TABLE)
def test_covariances_of_the_reference(friction):
    after = propagated(friction)
    np.testing.assert_allclose(np.sqrt(np.diag(after.covariance))[SHOWN], TABLE[friction], atol=6e-6)
    assert after.is_reliable


def test_it_reports_where_both_stick_and_slip_are_likely():
    after = propagated(0.13089224)
    assert not after.is_reliable
    assert {Regime.STICKING, Regime.SLIDING} <= set(after.regimes)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_covariances_against_many_impacts(friction):
    count, random = 400_000, np.random.default_rng(1)
    state = random.normal(size=(12, count)) * SD[:, None]
    e, mu = 0.8 + 0.02 * random.normal(size=count), np.abs(friction + 0.01 * random.normal(size=count))
    tilt = 0.005 * random.normal(size=(2, count))
    normal = np.array([tilt[0], tilt[1], np.ones(count)])
    normal /= np.linalg.norm(normal, axis=0)
    g = np.array(G)[:, None]
    x = np.array([[0.0], [0.0], [RADIUS]]) + state[:3]
    v, w = np.array([[2.0], [0.5], [-3.0]]) + state[6:9], np.array([[1.0], [-4.0], [7.0]]) + state[9:]
    # The plane is tilted about the mean contact point: when is the centre a radius above it?
    a, b, c = (normal * g).sum(0) / 2, (normal * v).sum(0), (normal * x).sum(0) - RADIUS
    time = (-b - np.sqrt(b * b - 4 * a * c)) / (2 * a)
    x, v = x + v * time + g * time**2 / 2, v + g * time
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((body_row.height, 2, count)), np.zeros((contact_row.height, count))
    bodies[body_row.mass, 0], bodies[body_row.mass, 1] = MASS, np.inf
    bodies[body_row.inertia, 0] = np.array([MOMENT, 0, 0, MOMENT, 0, MOMENT])[:, None]
    bodies[body_row.position, 0], bodies[body_row.velocity, 0], bodies[body_row.angular_velocity, 0] = x, v, w
    contacts[contact_row.position], contacts[contact_row.normal] = x - RADIUS * normal, normal
    contacts[contact_row.restitution], contacts[contact_row.friction] = np.minimum(e, 1.0), mu
    result = resolve_batch(bodies, contacts)
    v, w = result.velocity[:, 0], result.angular_velocity[:, 0]
    x, v = x - v * time + g * time**2 / 2, v - g * time
    found = np.std(np.concatenate([x, v, w]), axis=1)
    expected = np.sqrt(np.diag(propagated(friction).covariance))[[0, 1, 2, *range(6, 12)]]
    # 1/sqrt(2 count) = .0011 of statistical error, and 1 % of second order where it slides.
    np.testing.assert_allclose(found, expected, rtol=0.012)


@pytest.mark.parametrize("speed", [1.0, 1e-140, 1e-150])
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
def test_the_error_handling_that_a_program_chose_for_numpy_does_not_matter(law, speed):
    velocity = Vec3(1.0, 0.5, -1.0) * speed
    place = 0.0, 0.0, RADIUS
    ball = Body.sphere(1.0, RADIUS, position=place, velocity=velocity, angular_velocity=velocity)
    request = ball, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3), ImpactModel(law)
    surfaces, covariance = sphere_on_plane(RADIUS), np.eye(12) * 1e-4
    expected = saltation_matrix(*request, surfaces), propagate_covariance(*request, covariance, surfaces)
    with np.errstate(all="raise"):
        found = saltation_matrix(*request, surfaces), propagate_covariance(*request, covariance, surfaces)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1].covariance, expected[1].covariance)


def test_two_bodies_have_a_joint_covariance():
    collision = random_collision(3)
    surfaces = sphere_on_sphere(0.3, 0.4)
    S = np.eye(24) * 1e-6
    after = propagate_covariance(*collision, ImpactModel(Law.COULOMB), S, surfaces, gravity=G)
    Xi = saltation_matrix(*collision, ImpactModel(Law.COULOMB), surfaces, G)
    np.testing.assert_allclose(after.covariance, Xi @ S @ Xi.T, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("uncertain", range(12))
def test_only_a_kink_along_an_uncertain_input_counts(uncertain):
    """A corner that lands without slip, and slips then: slip of its own, however small, turns meanwhile."""
    box = Body.box(1.0, (1.0, 0.5, 0.25), position=(-0.5, 0.25, 0.125), velocity=(0, 0, -1.0))
    contact, model = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.25), ImpactModel(Law.ROUTH_STRONGE)
    S = np.zeros((12, 12))
    S[uncertain, uncertain] = 1e-10
    after = propagate_covariance(box, Body.static(), contact, model, S, corner_on_plane)
    assert after.is_reliable == (uncertain not in (6, 7, 9, 10, 11))  # those that make slip
    tilted = propagate_covariance(
        box, Body.static(), contact, model, np.zeros((12, 12)), corner_on_plane, normal_sd=1e-5
    )
    assert not tilted.is_reliable


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
def test_on_a_floor_every_law_is_reliable(law):
    """The ball slides, far from sticking."""
    after = propagate_covariance(
        ball(), Body.static(), FLOOR._replace(friction=0.1), ImpactModel(law), np.diag(SD**2) * 1e-4,
        sphere_on_plane(RADIUS),
    )  # fmt: skip
    assert (after.regimes, after.is_reliable) == ((Regime.SLIDING,), True)


@pytest.mark.parametrize("speed", [0.0, 1e-9, 0.3])
def test_a_ball_whose_springs_hold_it_is_reliable_wherever_they_throw_it(speed):
    """COMPLIANT calls it STICKING, or REVERSED by the direction of the slip after the impact."""
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.75, 0.6)
    body = Body.sphere(0.5, RADIUS, position=(0, 0, RADIUS), velocity=(speed, 0, -1.0))
    after = propagate_covariance(
        body, Body.static(), contact, ImpactModel(Law.COMPLIANT), np.eye(12) * 1e-18, sphere_on_plane(RADIUS)
    )
    assert (Regime.REVERSED in after.regimes, after.is_reliable) == (True, True)


@pytest.mark.parametrize(
    ("slip", "sd", "is_reliable"), [(0.72, 0.1, False), (1.2, 0.1, True), (0.4, 0.1, True)]
)
def test_compliant_reports_that_both_slip_throughout_and_stick_are_likely(slip, sd, is_reliable):
    """The ball slips throughout if it slips by more than (7/2) mu (1 + e) |u_n| + ..., near 0.7 m/s."""
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    body = Body.sphere(0.5, RADIUS, position=(0, 0, RADIUS), velocity=(slip, 0, -1.0))
    S = np.zeros((12, 12))
    S[6, 6] = sd**2
    after = propagate_covariance(
        body,
        Body.static(),
        contact,
        ImpactModel(Law.COMPLIANT),
        S,
        sphere_on_plane(RADIUS),
        gravity=(0, 0, 0),
    )
    assert after.is_reliable == is_reliable


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.COMPLIANT])
@pytest.mark.parametrize("velocity", [(2.0, 0.5, -3.0), (0.0, 0.0, -3.0)], ids=["slips", "falls"])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("normal", [(0, 0, 1), (-0.3, 0.2, 0.9), (-2, 1.5, 2)], ids=str)
def test_without_friction_every_law_is_reliable(law, velocity, restitution, normal):
    """If friction is 0 for sure, neither its derivative matters nor whether the contact slips."""
    n = np.array(normal) / math.hypot(*normal)
    body = ball(velocity=velocity, angular_velocity=(0.0, 0.0, 0.0))._replace(position=Vec3(*(RADIUS * n)))
    request = body, Body.static(), Contact.of((0, 0, 0), n, restitution), ImpactModel(law), np.diag(SD**2)
    after = propagate_covariance(*request, sphere_on_plane(RADIUS), restitution_sd=0.02, normal_sd=0.005)
    assert after.is_reliable


@pytest.mark.parametrize("number", [Fraction, np.float32, np.float64, int])
def test_the_type_of_the_numbers_does_not_matter(number):
    """Each number of the request is exact in all of these types."""

    def propagate(number):
        def vector(*numbers):
            return tuple(map(number, numbers))

        inertia, position = vector(2, 0, 0, 3, 0, 1), vector(0, 0, 1)
        twist = {"velocity": vector(3, 1, -2), "angular_velocity": vector(1, 2, -1)}
        box = Body.dynamic(number(4), inertia, position, **twist)
        contact = Contact.of(vector(0, 0, 0), vector(0, 0, 1), number(1), number(1))
        return propagate_covariance(
            box, Body.static(), contact, covariance=np.diag(SD**2), surfaces=corner_on_plane
        )

    found, expected = propagate(number), propagate(float)
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    assert found[1:] == expected[1:]


@pytest.mark.parametrize("friction", [0.22, 0.28, 0.36])
def test_the_tangential_restitution_of_the_contact_counts_as_that_of_the_model(friction):
    """In these impacts it decides which regimes are near."""
    box = Body.dynamic(2.0, (0.3, 0, 0, 0.4, 0, 0.5), (0, 0, 0.1), None, (0.3, 0.2, -1.5), (0.4, -0.7, 0.9))
    contact = Contact.of((0.05, 0.1, 0), (0, 0, 1), 0.5, friction)

    def propagate(contact, model):
        return propagate_covariance(
            box, Body.static(), contact, model, 1e-4 * np.eye(12), corner_on_plane, friction_sd=0.01
        )

    in_contact = propagate(contact._replace(tangential_restitution=0.5), ImpactModel(Law.COULOMB))
    in_model = propagate(contact, ImpactModel(Law.COULOMB, tangential_restitution=0.5))
    assert in_contact[1:] == in_model[1:]


def test_uncertain_friction_counts_where_its_mean_is_0():
    """AUTO is COULOMB where there is friction."""
    request = propagated(0.0), propagated(0.0, friction_sd=0.0)
    with_friction, without = (np.diag(after.covariance) for after in request)
    slowed = 0.01 * 1.8 * 3.0  # sd of mu, times (1 + e) v_n; the slip has x and y components
    gained = (with_friction - without)[[6, 7]].sum()
    assert gained == pytest.approx(slowed**2, rel=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_it_reports_that_errors_of_several_numbers_together_separate_the_bodies(friction):
    """Each alone changes the approach of 1 m/s by 0.4; together their standard deviation is 0.69 m/s."""
    box = Body.box(1.0, (1.0, 1.0, 1.0), position=(-0.5, -0.5, 0.5), velocity=(0.0, 0.0, -1.0))
    sd = [0.0] * 8 + [0.4, 0.8, 0.8, 0.0]
    after = propagate_covariance(
        box, Body.static(), FLOOR._replace(friction=friction), ImpactModel(), np.diag(np.square(sd)),
        corner_on_plane,
    )  # fmt: skip
    assert Regime.SEPARATING in after.regimes
    assert not after.is_reliable


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0)])
@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("of_velocity", "of_spin"), [(0.9, 0.0), (0.0, 0.9), (0.9, 0.9)])
def test_a_ball_that_falls_without_slip_may_slide(law, normal, angle, of_velocity, of_spin):
    """It sticks if (2/7) |u_t| <= mu (1 + e) |u_n|, up to 1.89 m/s. Two deviations of the velocity or of the
    spin are 1.8 m/s, those of both together 2.5 m/s. The mean has no slip whose direction could be tried.
    """
    n = Vec3(*normal) / Vec3(*normal).norm()
    across = n.cross(Vec3(0.0, 1.0, 0.0))
    across = across / across.norm()
    along = across * math.cos(angle) + n.cross(across) * math.sin(angle)
    covariance = np.zeros((12, 12))
    covariance[6:9, 6:9] = np.outer(along, along) * of_velocity**2
    covariance[9:, 9:] = np.outer(n.cross(along), n.cross(along)) * (of_spin / RADIUS) ** 2
    body = ball(velocity=n * -3.0, angular_velocity=(0.0, 0.0, 0.0))._replace(position=n * RADIUS)
    contact = FLOOR._replace(normal=n)
    found = propagate_covariance(
        body, Body.static(), contact, ImpactModel(law), covariance, sphere_on_plane(RADIUS), gravity=G
    )
    both = of_velocity > 0 and of_spin > 0
    assert found.regimes == ((Regime.STICKING, Regime.SLIDING) if both else (Regime.STICKING,))
    assert found.is_reliable != both


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("sd", [0.07, 0.08, 0.3, 0.6, 0.8, 1.2, 2.0, 5.0])
def test_a_ball_that_may_slide_to_either_side_may_stick(law, sd):
    """It sticks below 7/2 mu (1 + e) |u_n| = 1.05 m/s, at a slip of 1.2 m/s 0.15 m/s away. With 1.2 m/s of
    uncertainty, two deviations to either side are slips of 3.6 and -1.2 m/s.
    """
    S = np.zeros((12, 12))
    S[6, 6] = sd**2
    body = ball(velocity=(1.2, 0.0, -1.0), angular_velocity=(0.0, 0.0, 0.0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    found = propagate_covariance(
        body, Body.static(), contact, ImpactModel(law), S, sphere_on_plane(RADIUS), gravity=G
    )
    assert found.is_reliable == (2 * sd < 0.15)


def propagated_at_a_plane(velocity, contact, S, mass=MASS, **given):
    """A ball without spin that touches a plane, by COULOMB."""
    body = Body.sphere(mass, RADIUS, position=(0, 0, RADIUS), velocity=velocity)
    args = body, Body.static(), contact, ImpactModel(Law.COULOMB), S, sphere_on_plane(RADIUS)
    return propagate_covariance(*args, gravity=G, **given)


@pytest.mark.parametrize(("deviations", "sticks"), [(0.5, True), (1.0, True), (2.0, True), (4.0, False)])
def test_it_reports_that_likely_slips_pass_by_where_the_ball_sticks(deviations, sticks):
    """It sticks below a slip of 1.05 m/s, as above: where v_x is 0, but not where it is 0.4 or -0.4 m/s.
    Nowhere friction is against that of the mean.
    """
    S = np.zeros((12, 12))
    S[6, 6] = (0.4 / deviations) ** 2
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    found = propagated_at_a_plane((0.4, 1.04, -1.0), contact, S)
    assert found.regimes == ((Regime.SLIDING, Regime.STICKING) if sticks else (Regime.SLIDING,))
    assert found.is_reliable != sticks


@pytest.mark.parametrize("mass", [MASS, 2.0**900, 2.0**-900])
@pytest.mark.parametrize(
    ("used", "regimes"),
    [(0.3857, (Regime.STICKING, Regime.SLIDING)), (0.1857, (Regime.SLIDING, Regime.STICKING))],
)
def test_slip_and_approach_together_reach_the_other_regime(mass, used, regimes):
    """To stick takes (2/7) |u_t| = 0.2857, and friction is at most mu (1 + e) |u_n|, ``used`` times |u_n|.
    Two deviations of slip or approach change the difference of 0.1 by 0.08, those of both together by 0.11.
    """
    sd = np.zeros(12)
    sd[[6, 8]] = 0.04 * 3.5, 0.04 / used
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, used / 1.5)
    found = propagated_at_a_plane((1.0, 0.0, -1.0), contact, np.diag(sd**2), mass)
    assert (found.regimes, found.is_reliable) == (regimes, False)


@pytest.mark.parametrize("mass", [MASS, 2.0**900, 2.0**-900])
def test_it_reports_that_the_ball_may_slide_to_either_side_whatever_its_mass(mass):
    """At none of the slips that are tried it sticks."""
    S = np.zeros((12, 12))
    S[6, 6] = 5.0**2
    found = propagated_at_a_plane((1.2, 0.0, -1.0), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2), S, mass)
    assert (found.regimes, found.is_reliable) == ((Regime.SLIDING,), False)


@pytest.mark.parametrize(("friction_sd", "sticks"), [(0.04, True), (0.02, False), (0.0, False)])
def test_a_contact_without_friction_may_stick_where_its_friction_is_uncertain(friction_sd, sticks):
    """A slip of 0.4 m/s ends from mu = (2/7) 0.4 / (1 + e) = 0.076 on."""
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5)
    found = propagated_at_a_plane((0.4, 0.0, -1.0), contact, np.zeros((12, 12)), friction_sd=friction_sd)
    assert found.regimes == ((Regime.SLIDING, Regime.STICKING) if sticks else (Regime.SLIDING,))
    assert found.is_reliable != sticks


@pytest.mark.parametrize(("sd", "sticks"), [(0.02, True), (0.015, False)])
def test_uncertain_restitution_may_let_a_ball_stick(sd, sticks):
    """It sticks where (2/7) 1.075 <= mu (1 + e), from e = 0.536 on."""
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    found = propagated_at_a_plane((1.075, 0.0, -1.0), contact, np.zeros((12, 12)), restitution_sd=sd)
    assert found.regimes == ((Regime.SLIDING, Regime.STICKING) if sticks else (Regime.SLIDING,))
    assert found.is_reliable != sticks


@pytest.mark.parametrize(("friction", "sticks"), [(0.3197, False), (0.3207, True)])
def test_an_uncertain_orientation_turns_the_inertia(friction, sticks):
    """About the normal, which moves nothing else. The friction is near that with which the body just sticks
    when it is turned by two deviations, -0.3 rad.
    """
    moments, orientation = (0.002, 0, 0, 0.01, 0, 0.011), Quaternion(0.3, 0.4, -0.2, 0.8)
    body = Body.dynamic(1.0, moments, (0, 0, RADIUS), orientation, (1.0, 0.0, -1.0))
    request = Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5, friction), ImpactModel(Law.COULOMB)
    assert (resolve(turned(body, Vec3(0, 0, -0.3)), *request).regime is Regime.STICKING) == sticks
    S = np.zeros((12, 12))
    S[5, 5] = 0.15**2
    found = propagate_covariance(body, *request, S, sphere_on_plane(RADIUS))
    assert found.regimes == ((Regime.SLIDING, Regime.STICKING) if sticks else (Regime.SLIDING,))


@pytest.mark.parametrize("normal_sd", [0.03, 0.02])
@pytest.mark.parametrize("is_round", [False, True], ids=["the normal is uncertain", "on a sphere"])
def test_a_turned_normal_separates_a_ball_that_moves_along_it_but_not_one_that_spins(normal_sd, is_round):
    """Two deviations of 0.03 rad turn 2 m/s of velocity away from the plane, with 0.12 m/s; the ball comes
    with 0.1 m/s. The surface of a ball that spins, also at 2 m/s, stays perpendicular to every normal.
    """
    contact, surfaces, S = Contact.of((0, 0, 0), (0, 0, 1), 0.5), sphere_on_plane(RADIUS), np.zeros((12, 12))
    sd = {"normal_sd": normal_sd}
    if is_round:  # the normal turns with the centre, by its displacement over the distance of the centres
        surfaces, S[0, 0], sd = sphere_on_sphere(RADIUS, 0.3), (normal_sd * 0.4) ** 2, {}
    for velocity, spin, separates in (
        ((2.0, 0.0, -0.1), (0.0, 0.0, 0.0), normal_sd == 0.03),
        ((0.0, 0.0, -0.1), (0.0, -20.0, 0.0), False),
    ):
        body = ball(velocity=velocity, angular_velocity=spin)
        found = propagate_covariance(body, Body.static(), contact, ImpactModel(), S, surfaces, **sd)
        assert (Regime.SEPARATING in found.regimes) == separates
        assert found.is_reliable != separates


@pytest.mark.parametrize(("sd", "separates"), [(0.26, True), (0.24, False)])
def test_velocities_and_spins_of_both_bodies_change_the_approach(sd, separates):
    """Each of the four has the standard deviation ``sd`` at the contact, so together they have twice that.
    Two deviations are four times ``sd``; the bodies approach at 1 m/s.
    """
    moments, S = (1, 0, 0, 1, 0, 1), np.zeros((24, 24))
    body_a = Body.dynamic(1.0, moments, (-0.5, 0, 0), velocity=(0, 0, -1))
    body_b = Body.dynamic(1.0, moments, (0.5, 0, 0))
    S[[8, 20], [8, 20]], S[[10, 22], [10, 22]] = sd**2, (sd / 0.5) ** 2
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5)
    found = propagate_covariance(body_a, body_b, contact, ImpactModel(), S, corner_on_plane)
    assert (Regime.SEPARATING in found.regimes) == separates
    assert found.is_reliable != separates


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
@pytest.mark.parametrize("deviations", [-2.1, -1.9, 0.1, 1.9, 2.1])
@pytest.mark.parametrize(("restitution", "restitution_sd"), [(0.8, 0.0), (0.0, 0.1), (0.0, 0.0)])
def test_it_reports_that_the_restitution_threshold_is_likely(law, deviations, restitution, restitution_sd):
    """Above the threshold the ball bounces, below it stays; without restitution both are the same."""
    sd = 0.01
    threshold = 1.0 - deviations * sd
    S = np.zeros((12, 12))
    S[8, 8] = sd**2
    found = propagate_covariance(
        ball(velocity=(0.0, 0.0, -1.0), angular_velocity=(0.0, 0.0, 0.0)), Body.static(),
        FLOOR._replace(restitution=restitution, friction=0.0),
        ImpactModel(law, restitution_threshold=threshold), S, sphere_on_plane(RADIUS),
        restitution_sd=restitution_sd,
    )  # fmt: skip
    bounces = restitution > 0 or restitution_sd > 0
    assert found.is_reliable == (abs(deviations) > 2 or not bounces)


@pytest.mark.parametrize("deviations", [-2.1, -1.9, 0.1, 1.9, 2.1])
def test_it_reports_that_a_fallback_of_moreau_is_likely(deviations):
    """A rod, steeper than 45 degrees, that slips fast enough for the least slip to create energy."""
    model = ImpactModel(Law.MOREAU)

    def rod(slip):
        moments = 1 / 12, 0, 0, 1 / 12, 0, 1 / 12
        return Body.dynamic(1.0, moments, (0.5 / 5**0.5, 0.0, 1 / 5**0.5), velocity=(slip, 0.0, -1.0))

    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.9, 0.3)

    def falls_back(slip):
        impact = resolve(rod(slip), Body.static(), contact, model)
        return Adjustment.LAW_FALLBACK in impact.adjustments

    slow, fast = 0.0, 0.5
    assert falls_back(fast) and not falls_back(slow)
    for _ in range(50):
        middle = (slow + fast) / 2
        slow, fast = (slow, middle) if falls_back(middle) else (middle, fast)
    sd = 1e-4
    S = np.zeros((12, 12))
    S[6, 6] = sd**2
    mean = rod(fast + deviations * sd)
    found = propagate_covariance(mean, Body.static(), contact, model, S, corner_on_plane)
    assert found.is_reliable == (abs(deviations) > 2), found.regimes


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("extreme", extremes(), ids=lambda extreme: extreme.name)
@pytest.mark.parametrize("sd", [1e-150, 1e-8, 1.0, 1e100])
def test_extremes_are_answered_or_refused_without_a_warning(extreme, sd):
    collision = extreme.collision
    size = 12 * sum(body.is_movable() for body in collision[:2])
    deviations = {"restitution_sd": 0.1, "friction_sd": 0.1, "normal_sd": 0.1}
    try:
        found = propagate_covariance(
            *collision, ImpactModel(), np.eye(size) * sd * sd, sphere_on_plane(0.1), **deviations
        )
    except ImpactError as error:
        assert error.code is StatusCode.OUT_OF_RANGE, error
    else:
        assert np.isfinite(found.covariance).all()


TRIPLES = [(3, 0, 4), (1, 0, 3), (8, 0, 15), (-7, 0, 24), (20, 0, -21), (0, 5, 12), (1, 2, 2), (-2, 3, 6)]
"""Normals of which no float along the unit normal is exact."""


def across(n) -> tuple[float, ...]:
    """A velocity that is exactly perpendicular to the normal."""
    x, y, z = n
    return (
        (float(-z), 0.25, float(x))
        if y == 0
        else (0.25, float(-z), float(y))
        if x == 0
        else (2.0 * y, -2.0 * x, 0)
    )


@pytest.mark.parametrize("power", [0, -300, 300])
@pytest.mark.parametrize("n", TRIPLES, ids=str)
def test_bodies_that_just_graze_are_refused(n, power):
    contact = Contact.of((0, 0, 0), [math.ldexp(x, power) for x in n], 0.5, 0.3)
    v = tuple(x if n[k] else 0.0 for k, x in enumerate(across(n)))
    for body, surfaces in (
        (Body.dynamic(1.0, velocity=v), point_on_plane),
        (ball(velocity=v, angular_velocity=(0.0, 0.0, 0.0)), sphere_on_plane(RADIUS)),
    ):
        assert resolve(body, Body.static(), contact).status is StatusCode.SEPARATING
        with refused(StatusCode.SEPARATING, "contact.normal"):
            saltation_matrix(body, Body.static(), contact, ImpactModel(), surfaces)
        with refused(StatusCode.SEPARATING, "contact.normal"):
            propagate_covariance(body, Body.static(), contact, ImpactModel(), np.eye(12), surfaces)


def test_surfaces_that_just_graze_by_a_spin_that_is_left_out_are_refused():
    body_a = Body.dynamic(1.0, (0.5, 0, 0, 0.5, 0, 0.5), velocity=(-0.5, 0.0, 1.5))
    body_b = Body.dynamic(
        1.0, position=(1.0, 0, 0), velocity=(1.75, -1.5, -0.5), angular_velocity=(-2.0, -1.25, 1.5)
    )
    contact = Contact.of((0, -0.5, 0), (-3, 0, -4), 1.0, 0.25)
    with refused(StatusCode.SEPARATING, "contact.normal"):
        saltation_matrix(body_a, body_b, contact, ImpactModel(), corner_on_plane)


@pytest.mark.parametrize("speed", [1.0, 1.1, 0.3, 7.0])
@pytest.mark.parametrize("n", [(2, 3, 6), (0, 5, 12), (1, 2, 2), (3, 0, 4), (2, 6, 9)], ids=str)
def test_the_restitution_is_that_of_the_impact_on_the_edge_of_the_threshold(n, speed):
    """The derivative of the velocity along the normal is minus the restitution that counts."""
    n, length = np.array(n, float), math.hypot(*n)
    body, contact = (
        Body.dynamic(1.0, velocity=tuple((-speed * n).tolist())),
        Contact.of((0, 0, 0), n, 0.5, 0.3),
    )
    for threshold in (
        speed * length,
        math.nextafter(speed * length, 0),
        math.nextafter(speed * length, math.inf),
    ):
        model = ImpactModel(Law.COULOMB, restitution_threshold=threshold)
        impact = resolve(body, Body.static(), contact, model)
        e = 0.0 if Adjustment.RESTITUTION_THRESHOLD in impact.adjustments else 0.5
        matrix = saltation_matrix(body, Body.static(), contact, model, point_on_plane, (0.0, 0.0, 0.0))
        assert -(n @ matrix[6:9, 6:9] @ n) / length**2 == pytest.approx(e, abs=1e-12)
        by_velocity = differentiate(body, Body.static(), contact, model).of(
            "twist_a.linear", "body_a.velocity"
        )
        assert -(n @ by_velocity @ n) / length**2 == pytest.approx(e, abs=1e-12)
        found = propagate_covariance(body, Body.static(), contact, model, np.eye(12), point_on_plane)
        assert not found.is_reliable  # the threshold is near


@pytest.mark.parametrize("speed", [1e-310, 5e-324])
def test_an_impact_that_hardly_approaches_is_refused(speed):
    slow = ball(velocity=(1.0, 0.0, -speed)), Body.static(), FLOOR, ImpactModel(Law.COULOMB)
    with refused(StatusCode.OUT_OF_RANGE, "matrix"):
        saltation_matrix(*slow, sphere_on_plane(RADIUS))
    nearly = ball(velocity=(1.0, 0.0, -1e-200)), *slow[1:]
    with refused(StatusCode.OUT_OF_RANGE, "covariance", match="too slowly"):
        propagate_covariance(*nearly, np.diag(SD**2), sphere_on_plane(RADIUS))


@pytest.mark.parametrize("field", ["restitution_sd", "normal_sd"])
def test_a_covariance_beyond_float64_is_refused(field):
    request = ball(), Body.static(), FLOOR, ImpactModel(), np.diag(SD**2), sphere_on_plane(RADIUS)
    with refused(StatusCode.OUT_OF_RANGE, "covariance", match="a standard deviation is too large"):
        propagate_covariance(*request, **{field: 1e200})


# --- Bad input


@pytest.mark.parametrize(
    ("change", "code", "field"),
    [
        ({"surfaces": None}, StatusCode.INVALID_NORMAL, "surfaces"),
        (
            {"surfaces": SurfaceMotion(np.zeros((3, 12)), None, np.zeros((3, 3)))},
            StatusCode.INVALID_NORMAL,
            "surfaces.normal",
        ),
        ({"body_a": ball(velocity=(0.0, 0.0, 1.0))}, StatusCode.SEPARATING, "contact.normal"),
        ({"covariance": np.eye(24)}, StatusCode.INVALID_TABLE, "covariance"),
        ({"covariance": None}, StatusCode.INVALID_TABLE, "covariance"),
        ({"covariance": -np.eye(12)}, StatusCode.INVALID_TABLE, "covariance"),
        ({"covariance": np.triu(np.ones((12, 12)))}, StatusCode.INVALID_TABLE, "covariance"),
        ({"friction_sd": -0.1}, StatusCode.INVALID_COEFFICIENT, "friction_sd"),
        ({"restitution_sd": math.nan}, StatusCode.INVALID_COEFFICIENT, "restitution_sd"),
        ({"contact": Contact.of((0, 0, 0), (0, 0, 0))}, StatusCode.INVALID_NORMAL, "contact.normal"),
        ({"contact": Contact.of((0, 0, 0), (0, math.nan, 1))}, StatusCode.NOT_FINITE, "contact.normal"),
        ({"gravity": (0, 0, math.nan)}, StatusCode.NOT_FINITE, "gravity"),
    ],
)
def test_bad_input_is_refused_by_name(change, code, field):
    request = {
        "body_a": ball(), "body_b": Body.static(), "contact": FLOOR, "covariance": np.diag(SD**2),
        "surfaces": sphere_on_plane(RADIUS),
    } | change  # fmt: skip
    with refused(code, field):
        propagate_covariance(**request)


NO_NUMBERS = ["x", None, (), {}, 1j, True, np.array([0.5]), np.zeros(0)]
BEYOND = [10**400, -(10**400), math.inf, -math.inf, math.nan]


@pytest.mark.parametrize("field", ["restitution_sd", "friction_sd", "normal_sd"])
def test_an_invalid_standard_deviation_is_refused_by_name(field):
    request = ball(), Body.static(), FLOOR, ImpactModel(), np.diag(SD**2), sphere_on_plane(RADIUS)
    for value in NO_NUMBERS:
        with pytest.raises(TypeError, match=f"^{field}: must be a real number, is "):
            propagate_covariance(*request, **{field: value})
    for value in BEYOND:
        with refused(StatusCode.INVALID_COEFFICIENT, field):
            propagate_covariance(*request, **{field: value})
    for value in (Fraction(1, 8), np.float64(0.125), np.array(0.125), np.float32(0.125)):
        found, expected = (propagate_covariance(*request, **{field: sd}) for sd in (value, 0.125))
        np.testing.assert_array_equal(found.covariance, expected.covariance)


def covariance_with(value) -> list:
    """A covariance with one number replaced."""
    rows = np.diag(SD**2).tolist()
    rows[3][3] = value
    return rows


@pytest.mark.parametrize(
    "covariance",
    [
        *("x", "1", 10**400, -(10**400), {}, (), [[1.0], [1, 2]], np.eye(12) * 1j, np.eye(12).astype(str)),
        *(np.ma.masked_array(np.eye(12), mask) for mask in (True, np.eye(12) > 0, np.eye(12) == 0)),
        *map(covariance_with, ("x", None, 1j, 10**400, math.nan, math.inf, [1.0, 2.0], -1.0)),
    ],
)
def test_an_invalid_covariance_is_refused_in_one_line(covariance):
    with refused(StatusCode.INVALID_TABLE, "covariance", match=r"\Acovariance: [^\n]+\Z"):
        propagate_covariance(ball(), Body.static(), FLOOR, ImpactModel(), covariance, sphere_on_plane(RADIUS))


@pytest.mark.parametrize(("part", "is_rounding"), [(1e-12, True), (1e-10, False)])
@pytest.mark.parametrize("wrong", ["unsymmetric", "negative"])
def test_a_covariance_is_checked_up_to_rounding_in_the_units_of_each_entry(part, is_rounding, wrong):
    """The faulty entries are the smallest. A correlation of ``1 + part`` has an eigenvalue below 0."""
    S = np.diag(np.array([1e-9, 1e-9] + [1.0] * 10) ** 2)
    S[0, 1], S[1, 0] = (part * 1e-18, 0.0) if wrong == "unsymmetric" else [(1 + part) * 1e-18] * 2
    request = ball(), Body.static(), FLOOR, ImpactModel(), S, sphere_on_plane(RADIUS)
    if is_rounding:
        assert np.isfinite(propagate_covariance(*request).covariance).all()
    else:
        with refused(StatusCode.INVALID_TABLE, "covariance", match="symmetric and positive semi-definite"):
            propagate_covariance(*request)


@pytest.mark.parametrize(
    "entries", [{(0, 1): 1e-12, (1, 0): 1e-12}, {(0, 1): 1e-30}, {(1, 0): 1e-30}], ids=str
)
@pytest.mark.parametrize("variances", [(0.0, 0.0), (1e-8, 0.0), (0.0, 1.0)], ids=str)
def test_what_has_no_variance_has_no_covariance(entries, variances):
    S = np.zeros((12, 12))
    S[0, 0], S[1, 1] = variances
    for place, covariance in entries.items():
        S[place] = covariance
    with refused(StatusCode.INVALID_TABLE, "covariance", match="symmetric and positive semi-definite"):
        propagate_covariance(ball(), Body.static(), FLOOR, ImpactModel(), S, sphere_on_plane(RADIUS))


@pytest.mark.parametrize(
    "as_given", [lambda x: x.astype(object), lambda x: x.astype(">f8"), lambda x: x.tolist()]
)
def test_a_surface_motion_may_be_tables_of_any_kind(as_given):
    motion = sphere_on_plane(RADIUS)(ball(), Body.static(), FLOOR)
    request = ball(), Body.static(), FLOOR, ImpactModel()
    for given in (SurfaceMotion(*map(as_given, motion)), lambda *_: SurfaceMotion(*map(as_given, motion))):
        np.testing.assert_array_equal(saltation_matrix(*request, given), saltation_matrix(*request, motion))
        found, expected = (propagate_covariance(*request, np.diag(SD**2), x) for x in (given, motion))
        np.testing.assert_array_equal(found.covariance, expected.covariance)


@pytest.mark.parametrize("given", [np.zeros((3, 12)), np.eye(3), 1.0, "x"], ids=str)
def test_what_is_no_surface_motion_is_refused_by_name(given):
    with refused(StatusCode.INVALID_NORMAL, "surfaces.position"):
        saltation_matrix(ball(), Body.static(), FLOOR, surfaces=given)


def test_a_covariance_may_hold_fractions():
    exact = [[Fraction(int(i == j), 4) for j in range(12)] for i in range(12)]
    request = ball(), Body.static(), FLOOR, ImpactModel()
    found, expected = (
        propagate_covariance(*request, S, sphere_on_plane(RADIUS)) for S in (exact, np.eye(12) / 4)
    )
    np.testing.assert_array_equal(found.covariance, expected.covariance)


@pytest.mark.parametrize("field", SurfaceMotion._fields)
@pytest.mark.parametrize("number", ["x", None, 1j, 10**400, math.nan, [1.0]])
def test_an_invalid_surface_motion_is_refused_by_name(field, number):
    motion = sphere_on_plane(RADIUS)(ball(), Body.static(), FLOOR)
    rows = getattr(motion, field).tolist()
    rows[1][2] = number
    with refused(StatusCode.INVALID_NORMAL, f"surfaces.{field}"):
        saltation_matrix(ball(), Body.static(), FLOOR, surfaces=motion._replace(**{field: rows}))


@pytest.mark.parametrize(
    ("form", "field"),
    [
        (sphere_on_plane, "radius"),
        (lambda radius: sphere_on_sphere(radius, 1.0), "radius_a"),
        (lambda radius: sphere_on_sphere(1.0, radius), "radius_b"),
    ],
)
def test_an_invalid_radius_is_refused_by_name(form, field):
    for value in NO_NUMBERS:
        with pytest.raises(TypeError, match=f"^{field}: must be a real number, is "):
            form(value)
    for value in BEYOND:
        with refused(StatusCode.NOT_FINITE, field):
            form(value)
    bodies = ball(), ball(velocity=(0.0, 0.0, 1.0)), FLOOR
    for one, other in zip(form(Fraction(1, 8))(*bodies), form(0.125)(*bodies), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("function", [sphere_on_plane, sphere_on_sphere])
def test_a_function_that_makes_surfaces_is_refused_by_name(function):
    with pytest.raises(TypeError, match=r"^surfaces: must be what sphere_on_plane\(radius\)"):
        saltation_matrix(ball(), Body.static(), FLOOR, ImpactModel(), function)


@pytest.mark.parametrize("radius", [0.0, 0.25, -0.25, Fraction(1, 3)])
def test_spheres_with_one_centre_are_refused(radius):
    with refused(StatusCode.INVALID_NORMAL, "radius_b"):
        sphere_on_sphere(radius, -radius)
