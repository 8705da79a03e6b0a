"""Requests for one impact, made from bodies and a contact of the Python library."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

pytest.importorskip("rclpy")

from collisions import random_collision
from refusals import refused
from ros_graph import publish_until_received

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    Vec3,
    resolve,
)
from collision_response.model import DEFAULT
from collision_response.ros import batch_client, convert, scene_client
from collision_response.ros.impact_client import pack, unpack

BALL = Body.sphere(2.0, 0.1, position=(0, 0, 0.1), velocity=(0.5, 0, -3))
TOUCH = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)
LINK = Body.articulated(np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) + 0.25, velocity=(0, 0, -1))


@pytest.mark.parametrize(
    ("body_a", "body_b", "contact", "model"),
    [
        *((*random_collision(seed), ImpactModel(law)) for seed, law in enumerate((Law.COULOMB, Law.MOREAU))),
        (BALL, Body.kinematic((0, 0, -1), (1, 0, 0), (0, 2, 0)), TOUCH, ImpactModel(tolerance=1e-9)),
        (LINK, Body.static(), Contact.of((0.1, 0.2, 0), (0, 0, 1), 0.5, 0.3), ImpactModel()),
        (BALL, Body.static(), TOUCH, ImpactModel(Law.COULOMB, tangential_restitution=0.25)),
    ],
)
def test_the_service_answers_as_the_library(shared_node, body_a, body_b, contact, model):
    expected = resolve(body_a, body_b, contact, model)
    answer = unpack(shared_node.call(pack(body_a, body_b, contact, model)))
    assert answer == (expected.twist_a, expected.twist_b)


def test_a_body_may_be_a_name(shared_node):
    floor = convert.state_message(
        "client floor", Body.kinematic(velocity=(0, 0, 1)), pack(BALL, "", TOUCH).body_a.header
    )
    publish_until_received(shared_node, floor)
    expected = resolve(BALL, Body.kinematic(velocity=(0, 0, 1)), TOUCH)
    assert unpack(shared_node.call(pack(BALL, "client floor", TOUCH))) == (expected.twist_a, expected.twist_b)


def test_a_refusal_is_raised(shared_node):
    response = shared_node.call(pack(BALL._replace(mass=-1.0), Body.static(), TOUCH))
    with refused(StatusCode.INVALID_MASS, "body_a.inertia.m"):
        unpack(response)


def test_a_response_without_a_reason_is_an_error_that_says_so():
    error = convert.error_from(StatusCode.SHUTTING_DOWN, "")
    assert str(error) == "response: has SHUTTING_DOWN"
    assert str(convert.error_from(StatusCode.SHUTTING_DOWN, "no reason")) == "response: no reason"
    assert str(convert.error_from(StatusCode.INVALID_MASS, "body_a.mass: is: -1")) == "body_a.mass: is: -1"


@pytest.mark.parametrize(
    ("request_of", "message"),
    [
        (lambda: pack(1, "floor", TOUCH), r"^body_a: must be a Body or a name, is 1"),
        (lambda: pack(BALL, None, TOUCH), r"^body_b: must be a Body or a name, is None"),
        (lambda: pack(BALL, "floor", BALL), r"^contact: must be a Contact, is "),
        (lambda: pack(BALL, "floor", TOUCH, frame_id=1), r"^frame_id: must be text, is 1"),
        (lambda: pack(Body.dynamic(None), "floor", TOUCH), r"^body_a\.mass: must be a real number, is None"),
        (lambda: pack(BALL, "floor", TOUCH._replace(friction="a")), r"^contact\.friction: must be a real "),
        (lambda: pack(BALL, "floor", TOUCH._replace(normal=None)), r"^contact\.normal: must be 3 numbers"),
    ],
)
def test_wrong_types_are_refused_by_name(request_of, message):
    with pytest.raises(TypeError, match=message):
        request_of()


@pytest.mark.parametrize(
    ("request_of", "message"),
    [
        (lambda: pack(BALL, "a\nb", TOUCH), r"^body_b: must be one line without a NUL character, is 'a\\nb'"),
        (lambda: pack("a\0b", "floor", TOUCH), r"^body_a: must be one line without a NUL character"),
        (lambda: pack(BALL, "\ud800", TOUCH), r"^body_b: must be text in UTF-8"),
        (lambda: pack(BALL, "floor", TOUCH, frame_id="a\0b"), r"^frame_id: must be one line without a NUL"),
        (
            lambda: pack(BALL, "floor", TOUCH._replace(restitution=lambda speed: 0.5)),
            r"^contact\.restitution: must be a number: requests hold no functions",
        ),
        (
            lambda: pack(BALL, "floor", TOUCH._replace(tangential_restitution=0.0)),
            r"^contact\.tangential_restitution: set that of the model",
        ),
    ],
)
def test_what_a_request_cannot_hold_is_refused(request_of, message):
    with pytest.raises(ValueError, match=message):
        request_of()


@pytest.mark.parametrize(
    "change",
    [
        {"velocity": (1.0, 2.0)},
        {"orientation": 0.1},
        {"inertia": [1.0]},
        {"inverse_inertia": [1.0] * 36},
        {"com": Vec3("1", 0, 0)},
    ],
)
def test_bodies_are_refused_as_by_resolve(change):
    body = BALL._replace(**change)
    with pytest.raises((ImpactError, TypeError)) as expected:
        resolve(body, Body.static(), TOUCH)
    with pytest.raises((ImpactError, TypeError)) as found:
        pack(body, "floor", TOUCH)
    assert str(found.value) == str(expected.value)


@pytest.mark.parametrize("number", [10**400, Fraction(10**400), math.nan])
@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("body_a.inertia.m", lambda x: (BALL._replace(mass=x), TOUCH)),
        ("body_a.twist.linear", lambda x: (BALL._replace(velocity=Vec3(x, 0, 0)), TOUCH)),
        ("contact.friction", lambda x: (BALL, TOUCH._replace(friction=x))),
    ],
)
def test_numbers_that_float64_does_not_hold_are_refused_by_the_node(shared_node, number, field, change):
    body, contact = change(number)
    with refused(StatusCode.NOT_FINITE, field):
        unpack(shared_node.call(pack(body, Body.static(), contact)))


def test_a_link_of_a_mechanism_keeps_its_inverse_inertia():
    state = pack(LINK, "floor", TOUCH).body_a
    assert convert.body_of("body_a", state) == LINK
    assert state.inertia.m == 0 and not math.isinf(sum(state.inverse_inertia))
    assert Vec3(*state.inverse_inertia[:3]) == Vec3(1.25, 0.25, 0.25)


def test_a_request_without_a_model_leaves_all_to_the_node(graph):
    """Every field of a model counts that is not 0, such as the stiffness ratio of the default model."""
    parameters = ImpactModel(Law.COMPLIANT, Geometry.SPATIAL, Precision.DOUBLE, 1e-3, 0.0, 0.01, 0.5)
    graph.serve(
        law="compliant",
        geometry="spatial",
        precision="double",
        tolerance=parameters.tolerance,
        restitution_threshold=parameters.restitution_threshold,
        stiffness_ratio=parameters.stiffness_ratio,
    )
    expected = resolve(BALL, Body.static(), TOUCH, parameters)
    response = graph.call(pack(BALL, Body.static(), TOUCH))
    assert unpack(response) == (expected.twist_a, expected.twist_b)
    assert convert.model_of(response.result.model, DEFAULT) == expected.model
    no_contacts = batch_client.pack(np.empty((7, 0)), np.empty((2, 0), int), np.empty((5, 0)))
    assert graph.call(no_contacts).model.stiffness_ratio == parameters.stiffness_ratio
    scene = graph.call(scene_client.pack([BALL, Body.static()], [(0, 1)], [TOUCH])).result
    assert (scene.status.code, scene.model.stiffness_ratio) == (StatusCode.OK, parameters.stiffness_ratio)
