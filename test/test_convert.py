"""Bodies in messages: the origin of the body frame, and what reaches the numeric core."""

from __future__ import annotations

import copy
import dataclasses
import itertools
import math

import pytest

pytest.importorskip("rclpy")

from hypothesis import given
from hypothesis import strategies as st
from refusals import refused
from ros_graph import ball

from collision_response import ImpactError, ImpactModel, Precision, StatusCode, resolve
from collision_response.materials import Materials
from collision_response.msg import BodyState, CollisionResult
from collision_response.physics.combine import CombineRule
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3
from collision_response.ros import convert
from collision_response.ros.parameters import Parameters
from collision_response.srv import ResolveCollision

PARAMETERS = Parameters(
    world_frame="",
    max_state_age=0.0,
    max_state_wait=0.5,
    budget_contacts=1000,
    budget_scene_contacts=100,
    budget_time=0.0,
    shutdown_timeout=5.0,
    restitution=1.0,
    friction=0.0,
    combine_restitution=CombineRule.AVERAGE,
    combine_friction=CombineRule.AVERAGE,
    model=ImpactModel(),
)


def test_a_rod_whose_frame_starts_at_one_end_is_struck_at_the_other(graph):
    """S8 of the sources, with the origin of the frame at the other end of the rod."""
    graph.serve()
    rod_mass, length, point_mass, speed, restitution = 3.0, 2.0, 1.0, 5.0, 0.5
    request = ResolveCollision.Request()
    rod, point, contact = request.body_a, request.body_b, request.contact
    rod.inertia.m, rod.inertia.com.z = rod_mass, length / 2
    rod.inertia.ixx = rod.inertia.iyy = rod_mass * length**2 / 12
    rod.pose.orientation.x = -(0.5**0.5)  # the rod's z axis along the world's y
    rod.pose.orientation.w = 0.5**0.5
    point.inertia.m, point.pose.position.y, point.twist.linear.x = point_mass, length, speed
    contact.position.y, contact.normal.x = length, 1.0
    contact.restitution, contact.friction = restitution, 0.0

    result = graph.call(request).result

    impulse = (1 + restitution) * speed * rod_mass * point_mass / (rod_mass + 4 * point_mass)
    assert result.impulse.x == pytest.approx(impulse, rel=1e-14)
    assert result.twist_a.linear.x == pytest.approx(-2 * impulse / rod_mass, rel=1e-14)
    assert result.twist_a.angular.z == pytest.approx(-6 * impulse / (rod_mass * length), rel=1e-14)
    assert result.twist_b.linear.x == pytest.approx(speed - impulse / point_mass, rel=1e-14)


def answer_to(request):
    result = CollisionResult()
    problem, coefficients = convert.problem_of(request, PARAMETERS)
    convert.write_answer(result, request, resolve(*problem), coefficients)
    return result


def make_impact(request):
    problem, _ = convert.problem_of(request, PARAMETERS)
    return resolve(*problem)


def set_vector(message, vector):
    message.x, message.y, message.z = vector


def vector_of(message):
    return Vec3(message.x, message.y, message.z)


def near(expected):
    return pytest.approx(expected, rel=1e-9, abs=1e-9)


numbers = st.floats(-2, 2)
vectors = st.builds(Vec3, numbers, numbers, numbers)
quaternions = st.builds(Quaternion, numbers, numbers, numbers, numbers)
orientations = quaternions.filter(lambda q: q.squared_length() > 0.1)


@st.composite
def requests(draw):
    """A body with any motion, its frame at its centre of mass, meets a ball."""
    request = ResolveCollision.Request(body_a=ball(), body_b=ball())
    a, q = request.body_a, draw(orientations)
    a.inertia.m, (sxx, syy, szz) = draw(st.floats(0.1, 10)), draw(st.tuples(*[st.floats(0.01, 1)] * 3))
    a.inertia.ixx, a.inertia.iyy, a.inertia.izz = syy + szz, szz + sxx, sxx + syy
    a.pose.orientation.x, a.pose.orientation.y, a.pose.orientation.z, a.pose.orientation.w = q
    for message in (a.pose.position, a.twist.linear, a.twist.angular, request.body_b.pose.position):
        set_vector(message, draw(vectors))
    request.contact.header.frame_id = "world"
    set_vector(request.contact.position, draw(vectors))
    set_vector(request.contact.normal, draw(vectors.filter(lambda v: v.norm() > 0.1)))
    request.contact.restitution, request.contact.friction = draw(st.floats(0, 1)), draw(st.floats(0, 1))
    return request


@given(request=requests(), com=vectors)
def test_the_origin_of_the_body_frame_does_not_matter(request, com):
    """With the origin moved by -com, the same body has the same angular velocity, and its origin moves at v -
    w x c.
    """
    a = request.body_a
    orientation = a.pose.orientation
    q = Quaternion(orientation.x, orientation.y, orientation.z, orientation.w)
    centre = q.rotation().to_world(com)
    moved = copy.deepcopy(request)
    set_vector(moved.body_a.inertia.com, com)
    set_vector(moved.body_a.pose.position, vector_of(a.pose.position) - centre)
    at_new_origin = vector_of(a.twist.linear) - vector_of(a.twist.angular).cross(centre)
    set_vector(moved.body_a.twist.linear, at_new_origin)

    expected, result = answer_to(request), answer_to(moved)

    w = vector_of(expected.twist_a.angular)
    assert vector_of(result.twist_a.angular) == near(w)
    assert vector_of(result.twist_a.linear) == near(vector_of(expected.twist_a.linear) - w.cross(centre))
    assert vector_of(result.twist_b.linear) == near(vector_of(expected.twist_b.linear))
    assert result.kinetic_energy_after == near(expected.kinetic_energy_after)


@given(request=requests(), com=vectors)
def test_bodies_that_separate_keep_their_twists_to_the_last_bit(request, com):
    set_vector(request.body_a.inertia.com, com)
    before = answer_to(request)
    if before.normal_velocity_before < 0:
        request.contact.normal.x *= -1
        request.contact.normal.y *= -1
        request.contact.normal.z *= -1
    result = answer_to(request)
    assert result.regime == CollisionResult.SEPARATING
    assert (result.twist_a, result.twist_b) == (request.body_a.twist, request.body_b.twist)


@given(request=requests(), com=vectors)
def test_the_twist_after_is_the_twist_in_the_message_plus_the_change(request, com):
    set_vector(request.body_a.inertia.com, com)
    impact, result = make_impact(request), answer_to(request)
    for state, after, change in (
        (request.body_a, result.twist_a, impact.change_a),
        (request.body_b, result.twist_b, impact.change_b),
    ):
        assert vector_of(after.linear) == vector_of(state.twist.linear) + change.linear
        assert vector_of(after.angular) == vector_of(state.twist.angular) + change.angular


@given(request=requests(), com=vectors, far=st.sampled_from([1e3, 1e8, 1e13]))
def test_a_distant_frame_origin_costs_digits_and_the_bound_counts_them(request, com, far):
    com = com * far
    a = request.body_a
    set_vector(a.inertia.com, com)
    set_vector(a.pose.position, vector_of(a.pose.position) - com)
    request.model.precision = int(Precision.EXTENDED)
    exact = answer_to(request)
    request.model.precision = int(Precision.DOUBLE)
    try:
        given = answer_to(request)
    except ImpactError as error:  # the inverse effective mass may be singular in DOUBLE
        assert (error.code, error.field) == (StatusCode.OUT_OF_RANGE, "model.precision")
        assert far > 1e3
        return
    size = vector_of(exact.impulse).norm()
    apart = (vector_of(given.impulse) - vector_of(exact.impulse)).norm()
    assert apart <= (given.error_bound + exact.error_bound) * size or given.error_bound == math.inf


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_the_length_of_a_quaternion_does_not_matter(length):
    request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
    request.contact.normal.x, request.contact.restitution, request.contact.friction = 1.0, 0.5, 0.0
    request.contact.position.y = 0.25
    request.body_a.inertia.com.y, request.body_a.pose.orientation.z = 0.5, 1.0
    expected = answer_to(request)
    request.body_a.pose.orientation.z = request.body_a.pose.orientation.w = length
    result = answer_to(request)
    assert result.adjustments == CollisionResult.NORMALISED_ORIENTATION
    assert vector_of(result.twist_a.linear) == near(vector_of(expected.twist_a.linear))


@pytest.mark.parametrize("w", [1.0, -1.0, 2.0])
def test_a_quaternion_that_does_not_rotate_is_none_to_the_core_unless_it_is_normalised(w):
    state = ball()
    state.pose.orientation.x, state.pose.orientation.w = -0.0, w
    assert convert.body_of("body_a", state).orientation == (None if abs(w) == 1 else (0.0, 0.0, 0.0, w))


@pytest.mark.parametrize("w", [0.0, math.nan, math.inf])
def test_a_quaternion_without_a_direction_is_refused(w):
    request = ResolveCollision.Request()
    request.body_a, request.body_b = ball(), BodyState(motion_type=BodyState.STATIC)
    request.body_a.pose.orientation.w, request.contact.normal.z = w, 1.0
    with refused(StatusCode.NOT_FINITE if w else StatusCode.INVALID_ORIENTATION, "body_a.orientation"):
        answer_to(request)


def test_a_twist_that_is_no_number_is_refused_as_such_also_if_it_is_static():
    request = ResolveCollision.Request()
    request.body_a, request.body_b = ball(), BodyState(motion_type=BodyState.STATIC)
    request.body_b.twist.linear.x, request.contact.normal.z = math.nan, 1.0
    with refused(StatusCode.NOT_FINITE, "body_b.velocity"):
        answer_to(request)


@pytest.mark.parametrize("motion_type", [BodyState.KINEMATIC, BodyState.STATIC])
def test_the_inertia_of_an_immovable_body_is_ignored(motion_type):
    request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
    request.contact.normal.x, request.contact.restitution = 1.0, 0.5
    floor = request.body_b
    floor.motion_type, floor.inertia.m, floor.inertia.com.y = motion_type, float("nan"), 7.0
    result = answer_to(request)
    assert (result.twist_a.linear.x, result.twist_b) == (0.5, floor.twist)


def test_an_answer_beyond_float64_is_refused():
    """The contact is 1e308 m from the centre of mass along y, and so is the origin, on the other side."""
    request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
    request.contact.normal.x, request.contact.restitution, request.contact.friction = 1.0, 0.5, 0.0
    a = request.body_a
    a.pose.position.y, a.inertia.com.y, a.twist.angular.z = -1e308, 1e308, 1.0
    with refused(StatusCode.OUT_OF_RANGE):
        answer_to(request)


@pytest.mark.parametrize("mass", [math.inf, -math.inf, math.nan])
def test_a_dynamic_body_without_finite_mass_is_refused_by_name(mass):
    """In the numeric core, an infinite mass means an immovable body."""
    request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
    request.body_a.inertia.m = mass
    with refused(StatusCode.NOT_FINITE) as raised:
        answer_to(request)
    assert convert.error_text(raised.value).startswith("body_a.inertia.m: must be finite")


@pytest.mark.parametrize(
    ("coefficient", "values", "must"),
    [
        ("restitution", (-0.5, 1.5, -2.0), "in [0, 1]"),
        ("restitution", (math.nan, math.inf), "finite"),
        ("friction", (-0.5, -2.0), "at least 0"),
        ("friction", (math.nan, -math.inf), "finite"),
    ],
)
def test_a_coefficient_out_of_range_has_one_message_for_contact_and_bodies(coefficient, values, must):
    for owner, value in itertools.product(("contact", "body_a", "body_b"), values):
        request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
        request.contact.normal.x = 1.0
        if owner != "contact":
            setattr(getattr(request, {"body_a": "body_b", "body_b": "body_a"}[owner]), coefficient, 0.5)
        setattr(getattr(request, owner), coefficient, value)
        with pytest.raises(ImpactError) as raised:
            answer_to(request)
        assert str(raised.value) == f"{owner}.{coefficient}: must be {must}; is {value}"


@pytest.mark.parametrize("coefficient", ["restitution", "friction"])
@pytest.mark.parametrize("of_other", [-1.0, 0.5])
@pytest.mark.parametrize("given", ["by the contact", "by the materials"])
def test_body_coefficients_are_checked_even_if_overridden(coefficient, of_other, given):
    steel = {"materials": {"steel": {"restitution": 0.5, "friction": 0.5}}}
    parameters = dataclasses.replace(PARAMETERS, materials=Materials.of(steel))
    for owner, value in itertools.product(("body_a", "body_b"), (-0.5, -2.0, math.nan, math.inf)):
        request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5))
        request.contact.normal.x = 1.0
        if given == "by the contact":
            setattr(request.contact, coefficient, 0.25)
        else:
            request.body_a.material = request.body_b.material = "steel"
        for body in ("body_a", "body_b"):
            setattr(getattr(request, body), coefficient, value if body == owner else of_other)
        with pytest.raises(ImpactError) as raised:
            convert.problem_of(request, parameters)
        assert raised.value.field == f"{owner}.{coefficient}"


def link(**fields) -> BodyState:
    """A door with its hinge along z at the origin of its frame: only the last matrix entry is not 0."""
    state = BodyState(inverse_inertia=[0.0] * 35 + [2.0], **fields)
    state.inertia.m = math.nan  # ignored
    state.twist.angular.z = -1.0
    return state


def test_a_link_given_by_its_inverse_inertia(graph):
    graph.serve()
    request = ResolveCollision.Request(body_a=link())
    request.body_b.motion_type = BodyState.STATIC
    request.contact.position.x, request.contact.normal.y, request.contact.restitution = 0.5, 1.0, 0.5
    result = graph.call(request).result
    assert result.status.code == StatusCode.OK
    assert result.adjustments == CollisionResult.ENERGY_CHANGE_ONLY
    assert "articulated" in result.status.message
    assert result.twist_a.angular.z == pytest.approx(0.5, abs=1e-15)
    assert result.kinetic_energy_before == 0
    assert result.kinetic_energy_after == pytest.approx(-(1 - 0.25) / 2 / 2, rel=1e-14)


def test_a_link_may_have_a_name(graph):
    graph.serve()
    link = BodyState(name="arm", inverse_inertia=[float(i == j) for i in range(6) for j in range(6)])
    link.header.frame_id = "world"
    link.twist.linear.z = -1.0
    request = ResolveCollision.Request(body_a=link, body_b=BodyState(motion_type=BodyState.KINEMATIC))
    request.body_b.header.frame_id = request.contact.header.frame_id = "world"
    request.contact.normal.z, request.contact.restitution, request.contact.friction = 1.0, 0.5, 0.0
    answer = graph.call(request)
    assert answer.success, answer.result.status.message
    assert answer.result.twist_a.linear.z == 0.5


@pytest.mark.parametrize("count", [1, 35])
def test_an_inverse_inertia_of_the_wrong_length(count):
    state = BodyState(inverse_inertia=[1.0] * count)
    with refused(StatusCode.INVALID_INERTIA, "body_a.inverse_inertia"):
        convert.body_of("body_a", state)


def test_an_immovable_body_needs_no_inverse_inertia():
    body = convert.body_of("body_b", link(motion_type=BodyState.KINEMATIC))
    assert body.inverse_inertia is None
