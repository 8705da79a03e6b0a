"""The service for single impacts, over DDS."""

from __future__ import annotations

import math
import threading
from itertools import product
from typing import Any, NamedTuple

import pytest

pytest.importorskip("rclpy")

from attacks import rod_in_plane
from exact_adapter import as_request
from rclpy.publisher import Publisher
from rclpy.service import Service
from ros_graph import DEADLINE, LATCHED, assign, balls_meet, request_of, wait_until

from collision_response import Body, Contact, Impact, Law, StatusCode, resolve
from collision_response import ImpactModel as Model
from collision_response.kernels import library
from collision_response.msg import BodyState, CollisionResult, ImpactModel
from collision_response.physics.mass_properties import box
from collision_response.ros import impacts
from collision_response.ros.answer_log import ResultPublisher
from collision_response.ros.convert import NUMBERS
from collision_response.srv import ResolveCollision

nan, inf = math.nan, math.inf
LAWS = [law for law in Law if law]


def test_an_impact_is_answered(graph):
    graph.serve()
    request = balls_meet()
    request.body_a.name, request.body_b.name = "right", "left"
    request.contact.header.stamp.sec, request.contact.header.stamp.nanosec = 12, 34

    answer = graph.call(request)

    assert answer.success
    result = answer.result
    assert result.header == request.contact.header
    assert (result.sequence, result.status.code, result.status.message) == (1, StatusCode.OK, "")
    # Centre of mass at 1 m/s, approach at 4, so separation at 2; reduced mass 1 kg.
    assert (result.twist_a.linear.x, result.twist_b.linear.x) == (2.0, 0.0)
    assert (result.impulse.x, result.normal_impulse, result.tangential_impulse) == (6.0, 6.0, 0.0)
    assert (result.normal_velocity_before, result.normal_velocity_after) == (-4.0, 2.0)
    assert result.effective_mass == 1.0
    assert (result.kinetic_energy_before, result.kinetic_energy_after) == (10.0, 4.0)
    assert (result.energy_lost_restitution, result.energy_lost_friction) == (6.0, 0.0)
    assert (result.regime, result.adjustments) == (CollisionResult.SLIDING, 0)
    assert 0 < result.error_bound < 1e-14
    assert (result.contact.body_a, result.contact.body_b) == ("right", "left")
    assert result.contact.normal == request.contact.normal
    assert (result.contact.restitution, result.contact.friction) == (0.5, 0.0)
    assert (result.model.law, result.model.geometry, result.model.precision) == (
        ImpactModel.FRICTIONLESS,
        ImpactModel.POINT,
        ImpactModel.DOUBLE,
    )


def test_separating_bodies_are_a_valid_answer(shared_node):
    request = balls_meet()
    request.body_a.twist.linear.x = 3.5
    answer = shared_node.call(request)
    assert answer.success
    assert answer.result.status.code == StatusCode.SEPARATING
    assert answer.result.regime == CollisionResult.SEPARATING
    assert (answer.result.normal_impulse, answer.result.twist_a) == (0.0, request.body_a.twist)


def test_a_quaternion_of_another_length_is_normalised_and_reported(shared_node):
    request = balls_meet()
    request.body_a.pose.orientation.w = 2.0
    answer = shared_node.call(request)
    assert answer.success
    assert answer.result.adjustments == CollisionResult.NORMALISED_ORIENTATION
    assert "pose.orientation" in answer.result.status.message


def test_a_tolerance_that_is_not_met_is_reported(shared_node):
    request = balls_meet()
    request.model.precision, request.model.tolerance = ImpactModel.DOUBLE, 1e-30
    answer = shared_node.call(request)
    assert answer.success
    assert answer.result.status.code == StatusCode.TOLERANCE_NOT_MET
    assert answer.result.normal_impulse == 6.0
    assert f"{answer.result.error_bound:.3g}" in answer.result.status.message
    assert "1e-30" in answer.result.status.message


class Refused(NamedTuple):
    """One change to a good request, and the refusal it must meet."""

    code: StatusCode
    changes: dict[str, Any]
    field: str
    shown: str


def refused(code: StatusCode, field: str, value: Any) -> Refused:
    return Refused(code, {field: value}, field, repr(value))


REFUSALS = [
    refused(StatusCode.INVALID_MASS, "body_a.inertia.m", 0.0),
    refused(StatusCode.INVALID_MASS, "body_b.inertia.m", -1.5),
    refused(StatusCode.INVALID_MASS, "body_a.inertia.m", 1e-310),
    *(
        refused(StatusCode.NOT_FINITE, field, value)
        for field, value in (
            ("body_a.inertia.m", nan),
            ("body_a.inertia.m", inf),
            ("contact.restitution", nan),
            ("contact.restitution", -inf),
            ("contact.friction", inf),
            ("model.tolerance", nan),
            ("model.tangential_restitution", nan),
            ("model.restitution_threshold", inf),
        )
    ),
    *(
        Refused(StatusCode.NOT_FINITE, {field: value}, named, repr(value))
        for field, value, named in (
            ("body_a.inertia.ixz", inf, "body_a.inertia"),
            ("body_b.inertia.com.y", nan, "body_b.inertia.com"),
            ("body_a.pose.position.z", -inf, "body_a.pose.position"),
            ("body_b.pose.orientation.x", nan, "body_b.pose.orientation"),
            ("body_a.twist.linear.y", inf, "body_a.twist.linear"),
            ("body_b.twist.angular.z", nan, "body_b.twist.angular"),
            ("contact.position.x", nan, "contact.position"),
            ("contact.normal.y", inf, "contact.normal"),
        )
    ),
    Refused(
        StatusCode.NOT_FINITE,
        {"body_a.motion_type": BodyState.KINEMATIC, "body_a.twist.linear.x": nan},
        "body_a.twist.linear",
        "nan",
    ),
    Refused(StatusCode.INVALID_INERTIA, {"body_a.inertia.ixx": -3.25}, "body_a.inertia", "-3.25"),
    Refused(StatusCode.INVALID_INERTIA, {"body_b.inertia.izz": 0.75}, "body_b.inertia", "0.75"),
    Refused(StatusCode.INVALID_NORMAL, {"contact.normal.x": 0.0}, "contact.normal", "(0.0, 0.0, 0.0)"),
    refused(StatusCode.INVALID_COEFFICIENT, "contact.restitution", 1.25),
    refused(StatusCode.INVALID_COEFFICIENT, "model.tangential_restitution", -1.25),
    Refused(
        StatusCode.INVALID_COEFFICIENT,
        {"contact.restitution": -1.0, "body_a.restitution": 0.5, "body_b.restitution": 1.25},
        "body_b.restitution",
        "1.25",
    ),
    Refused(
        StatusCode.NOT_FINITE,
        {"contact.friction": -1.0, "body_a.friction": inf, "body_b.friction": 0.5},
        "body_a.friction",
        "inf",
    ),
    refused(StatusCode.FRAME_MISMATCH, "body_a.header.frame_id", "map"),
    refused(StatusCode.FRAME_MISMATCH, "body_b.header.frame_id", ""),
    Refused(StatusCode.FRAME_MISMATCH, {"contact.header.frame_id": "odom"}, "body_a.header.frame_id", "odom"),
    Refused(StatusCode.UNKNOWN_BODY, {"body_b": BodyState(name="ghost")}, "body_b.name", "'ghost'"),
    Refused(
        StatusCode.UNKNOWN_BODY,
        {"body_a": BodyState(), "contact.body_a": "ghost"},
        "contact.body_a",
        "'ghost'",
    ),
    Refused(
        StatusCode.UNKNOWN_BODY, {"body_a.name": "cup", "contact.body_a": "dish"}, "contact.body_a", "'dish'"
    ),
    Refused(
        StatusCode.UNKNOWN_BODY, {"body_b.name": "dish", "contact.body_b": "cup"}, "contact.body_b", "'cup'"
    ),
    Refused(StatusCode.SAME_BODY, {"body_a.name": "x", "contact.body_b": "x"}, "contact.body_b", "'x'"),
    Refused(StatusCode.SAME_BODY, {"contact.body_a": "x", "contact.body_b": "x"}, "contact.body_b", "'x'"),
    Refused(StatusCode.SAME_BODY, {"body_a.name": "cup", "body_b.name": "cup"}, "body_b.name", "'cup'"),
    refused(StatusCode.INVALID_MODEL, "model.law", 77),
    refused(StatusCode.INVALID_MODEL, "model.geometry", 88),
    refused(StatusCode.INVALID_MODEL, "model.precision", 99),
    refused(StatusCode.INVALID_MODEL, "model.tolerance", -0.125),
    Refused(
        StatusCode.NO_DYNAMIC_BODY,
        {"body_a.motion_type": BodyState.KINEMATIC, "body_b.motion_type": BodyState.KINEMATIC},
        "body_a",
        "immovable",
    ),
    Refused(
        StatusCode.INVALID_ORIENTATION,
        {"body_a.pose.orientation.w": 0.0},
        "body_a.pose.orientation",
        "(0.0, 0.0, 0.0, 0.0)",
    ),
    Refused(
        StatusCode.INVALID_ORIENTATION,
        {"body_b.motion_type": BodyState.KINEMATIC, "body_b.pose.orientation.w": 0.0},
        "body_b.pose.orientation",
        "(0.0, 0.0, 0.0, 0.0)",
    ),
    Refused(
        StatusCode.OUT_OF_RANGE,
        {"body_a.inertia.m": 1e300, "body_a.twist.linear.x": -1e300},
        "result",
        "float64",
    ),
    Refused(
        StatusCode.UNKNOWN_MATERIAL,
        {"body_a.material": "cheese"},
        "body_a.material",
        "is 'cheese', but the parameter materials_file names no file",
    ),
    refused(StatusCode.INVALID_MOTION_TYPE, "body_b.motion_type", 9),
    Refused(
        StatusCode.INVALID_MOTION_TYPE, {"body_b.motion_type": BodyState.STATIC}, "body_b.motion_type", "3.0"
    ),
]


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case.code.name}-{case.field}")
def test_a_refusal_names_the_field_and_its_value(shared_node, case):
    request = balls_meet()
    for field, value in case.changes.items():
        assign(request, field, value)

    answer = shared_node.call(request)

    status = answer.result.status
    assert StatusCode(status.code) is case.code, status.message
    assert status.message.startswith(f"{case.field}: ")
    assert case.shown in status.message
    assert not answer.success
    assert answer.result.twist_a == CollisionResult().twist_a


def test_every_refusal_code_is_tested():
    answers = {code for code in StatusCode if code.is_answer}
    by_tests_of_their_own = {
        StatusCode.STALE_STATE,
        StatusCode.PATH_TOO_LONG,
        StatusCode.BUDGET_EXCEEDED,
        StatusCode.SHUTTING_DOWN,
        StatusCode.INTERNAL_ERROR,
    }
    of_batches_and_scenes = {StatusCode.INVALID_TABLE, StatusCode.CONTRADICTORY_CONTACTS}
    others = answers | by_tests_of_their_own | of_batches_and_scenes | {StatusCode.UNSET}
    assert {case.code for case in REFUSALS} == set(StatusCode) - others


def test_a_path_that_does_not_end_is_refused(shared_node, monkeypatch):
    def give_up(*_):
        raise library.refusal(StatusCode.PATH_TOO_LONG)

    with monkeypatch.context() as patch:
        patch.setattr(impacts, "resolve", give_up)
        answer = shared_node.call(balls_meet())
    assert not answer.success
    assert answer.result.status.code == StatusCode.PATH_TOO_LONG
    assert answer.result.status.message.startswith("contact: ")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "changes",
    [
        {"pose.orientation.x": 0.1, "pose.orientation.z": 1e308},
        {"pose.position.y": -1e308, "inertia.com.y": 1e308},
        {"pose.position.y": -1e308, "inertia.com.y": 1e308, "twist.angular.z": 1.0},
        {"pose.position.y": 1e308, "inertia.com.y": 1e308},
    ],
    ids=str,
)
def test_numbers_at_the_end_of_float64_are_answered_or_refused(shared_node, law, changes):
    request = request_of(*boxes_in_space(), law=law)
    for field, value in changes.items():
        assign(request.body_a, field, value)
    result = shared_node.call(request).result
    status = StatusCode(result.status.code)
    assert status.is_answer or status is StatusCode.OUT_OF_RANGE
    vectors = result.twist_a.linear, result.twist_a.angular, result.twist_b.linear, result.impulse
    assert all(math.isfinite(getattr(vector, axis)) for vector in vectors for axis in "xyz")


def test_a_default_constructed_request_is_refused(shared_node):
    answer = shared_node.call(ResolveCollision.Request())
    assert not answer.success
    assert answer.result.status.code == StatusCode.INVALID_MASS


def test_a_second_node_of_the_same_name_is_warned_about(graph):
    logged = graph.log()
    graph.serve()
    assert graph.call(balls_meet()).success
    names = graph.service, f"{graph.service}_batch", graph.service.removesuffix("collision") + "scene"
    warnings = [f"another node serves {name}, too, or was killed a moment ago: " for name in names]
    assert not any("another node" in text for text in logged)
    graph.serve()
    wait_until(lambda: all(sum(text.startswith(one) for text in logged) == 2 for one in warnings))
    assert sum("another node" in text for text in logged) == 2 * len(names), "each node warns once"


def test_an_internal_error_is_answered(shared_node, monkeypatch):
    def fail(*_):
        raise RuntimeError("a bolt is loose")

    with monkeypatch.context() as patch:
        patch.setattr(impacts, "resolve", fail)
        answer = shared_node.call(balls_meet())
    assert not answer.success
    assert answer.result.status.code == StatusCode.INTERNAL_ERROR
    assert answer.result.status.message == "RuntimeError: a bolt is loose"
    assert shared_node.call(balls_meet()).success


def test_a_thousand_requests_at_once_get_a_thousand_answers(graph):
    graph.serve()
    total, answers, done = 1000, [], threading.Event()

    def count(future):
        answers.append(future.result())
        if len(answers) == total:
            done.set()

    for _ in range(total):
        graph.call_async(balls_meet()).add_done_callback(count)

    assert done.wait(DEADLINE), f"{len(answers)} answers"
    assert all(answer.success for answer in answers)
    assert {answer.result.sequence for answer in answers} == set(range(1, total + 1))


def subscribe(graph):
    """Subscribe to the results, earlier ones included; return the subscription and the list of received
    results.
    """
    received = []
    subscription = graph.user.create_subscription(
        CollisionResult, "collision_response/result", received.append, LATCHED
    )
    return subscription, received


def test_results_reach_late_subscribers(graph):
    graph.serve()
    bad = balls_meet()
    bad.contact.normal.x = 0.0
    answers = [graph.call(balls_meet()).result, graph.call(bad).result]

    _, received = subscribe(graph)

    wait_until(lambda: len(received) == 2)
    assert received == answers


def test_results_from_before_and_after_a_subscription_arrive_in_order_once(graph):
    graph.serve()
    before = [graph.call(balls_meet()).result for _ in range(3)]
    _, first = subscribe(graph)
    after = [graph.call(balls_meet()).result for _ in range(3)]
    _, second = subscribe(graph)
    wait_until(lambda: len(second) >= 6)
    last = graph.call(balls_meet()).result
    wait_until(lambda: last in first and last in second)
    assert first == second == [*before, *after, last]


def test_results_are_kept_again_when_the_last_subscriber_has_left(graph):
    node = graph.serve()
    subscription, received = subscribe(graph)
    heard = graph.call(balls_meet()).result
    wait_until(lambda: received == [heard])
    graph.user.destroy_subscription(subscription)
    wait_until(lambda: node.count_subscribers("collision_response/result") == 0)
    unheard = graph.call(balls_meet()).result

    _, received = subscribe(graph)

    wait_until(lambda: len(received) == 2)
    assert received == [heard, unheard]


def test_the_last_hundred_results_are_kept(graph):
    graph.serve()
    answers = [graph.call(balls_meet()).result for _ in range(103)]
    _, received = subscribe(graph)
    wait_until(lambda: answers[-1] in received)
    assert received == answers[3:]


def test_results_without_a_subscriber_are_not_published(graph, monkeypatch):
    published, publish = [], Publisher.publish

    def note(publisher, message):
        if isinstance(message, CollisionResult):
            published.append(message.sequence)
        publish(publisher, message)

    monkeypatch.setattr(Publisher, "publish", note)
    graph.serve()
    graph.call(balls_meet())
    assert published == []
    _, received = subscribe(graph)
    wait_until(lambda: received)
    graph.call(balls_meet())
    wait_until(lambda: len(received) == 2)
    assert published == [1, 2]


def test_a_result_is_published_after_its_response_is_sent(graph, monkeypatch):
    graph.serve()
    events = []

    def note(kind, method):
        call = getattr(kind, method)

        def noted(*arguments):
            events.append(method)
            return call(*arguments)

        monkeypatch.setattr(kind, method, noted)

    note(Service, "send_response")
    note(ResultPublisher, "publish")
    graph.call(balls_meet())
    graph.call(ResolveCollision.Request())
    assert wait_until(lambda: len(events) == 4 and events) == ["send_response", "publish"] * 2


def test_an_answer_arrives_even_if_its_result_cannot_be_published(graph, monkeypatch):
    graph.serve()
    logged = graph.log()
    with monkeypatch.context() as patch:
        patch.setattr(ResultPublisher, "publish", lambda *_: 1 / 0)
        assert graph.call(balls_meet()).success
        wait_until(lambda: any("ZeroDivisionError" in text for text in logged))
    assert graph.call(balls_meet()).success


def rod_on_plane(slope: float, restitution: float, slip: float) -> tuple[Body, Body, Contact]:
    """A rod of 1 kg and 1 m strikes a fixed plane with its end."""
    angle = math.atan(slope)
    return as_request(rod_in_plane(math.cos(angle), math.sin(angle), slip, -1.0, restitution, 0.3))


def boxes_in_space() -> tuple[Body, Body, Contact]:
    """Two rotating boxes; the frame of one starts at a corner."""
    inertia, com = box(2.0, (1, 2, 3)).inertia, (0.5, 1, 1.5)
    a = Body.dynamic(2.0, inertia, (0.2, 0.1, 0.5), (1, 2, 3, 4), (0.3, 0, -1), (1, 2, 3), com)
    inertia = box(3.0, (3, 1, 1)).inertia
    b = Body.dynamic(3.0, inertia, (0, 0.3, -0.5), (2, -1, 0, 1), (0, 0.5, 1), (0, -1, 1))
    return a, b, Contact.of((0, 0, 0), (0.1, 0.2, 1), 0.5, friction=0.4)


FALLS_BACK = rod_on_plane(slope=2.0, restitution=0.9, slip=0.5)
COLLISIONS = {
    "stopped": rod_on_plane(slope=1.0, restitution=0.5, slip=0.0),
    "sliding": rod_on_plane(slope=1.0, restitution=0.5, slip=1.0),
    "reversed": FALLS_BACK,
    "in space": boxes_in_space(),
}


def assert_same(result: CollisionResult, impact: Impact) -> None:
    """Check that a result has every number of an impact."""
    for field in NUMBERS:
        assert getattr(result, field) == getattr(impact, field), field
    for field in ("regime", "adjustments"):
        assert getattr(result, field) == getattr(impact, field), field
    assert result.status.code == impact.status
    assert tuple(getattr(result.model, field) for field in Model._fields) == impact.model
    assert (result.contact.restitution, result.contact.friction) == impact.contact[2:4]
    for message, vector in (
        (result.impulse, impact.impulse),
        (result.twist_a.linear, impact.twist_a.linear),
        (result.twist_a.angular, impact.twist_a.angular),
        (result.twist_b.linear, impact.twist_b.linear),
        (result.twist_b.angular, impact.twist_b.angular),
    ):
        assert (message.x, message.y, message.z) == vector


@pytest.mark.parametrize(("collision", "law"), list(product(COLLISIONS, LAWS)))
def test_answers_over_dds_equal_the_library(shared_node, collision, law):
    result = shared_node.call(request_of(*COLLISIONS[collision], law=law)).result
    assert_same(result, resolve(*COLLISIONS[collision], Model(law)))


def test_a_fallback_is_reported(shared_node):
    result = shared_node.call(request_of(*FALLS_BACK, law=Law.MOREAU)).result
    assert result.model.law == ImpactModel.COULOMB
    assert result.adjustments == CollisionResult.LAW_FALLBACK
    assert "model.law was used" in result.status.message


def test_massless_spin_is_reported(shared_node):
    request = balls_meet()
    for field in ("ixx", "iyy", "izz"):
        setattr(request.body_a.inertia, field, 0.0)
    request.body_a.twist.angular.z = 3.0
    result = shared_node.call(request).result
    assert result.adjustments == CollisionResult.MASSLESS_SPIN
    assert result.twist_a.angular.z == 3.0
    assert "axis without inertia" in result.status.message


def test_the_node_logs_what_the_scene_requires(graph):
    logged = graph.log()
    graph.serve(scene_tolerance=1e-6)
    graph.call(request_of(*COLLISIONS["sliding"]))
    required = "the scene requires PLANAR: body_a - body_b turns"
    wait_until(lambda: any(text.startswith(required) for text in logged))


def test_tangential_restitution(shared_node):
    """Garwin's ball, as in test_laws.py."""
    ball = Body.sphere(2.0, 0.1, position=(0, 0.1, 0), velocity=(1, -1, 0), angular_velocity=(0, 0, -30))
    superball = ball, Body.static(), Contact.of((0, 0, 0), (0, 1, 0), 1.0, friction=10.0)
    result = shared_node.call(request_of(*superball, tangential_restitution=1.0)).result
    assert_same(result, resolve(*superball, Model(tangential_restitution=1.0)))


@pytest.mark.parametrize(
    ("tolerance", "precision"), [(1e-9, ImpactModel.DOUBLE), (3e-16, ImpactModel.EXTENDED)]
)
def test_a_tolerance_decides_the_precision(shared_node, tolerance, precision):
    result = shared_node.call(request_of(*boxes_in_space(), tolerance=tolerance)).result
    assert result.error_bound <= tolerance
    assert result.model.precision == precision
