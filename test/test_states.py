"""Bodies given by name: lookup, age and frames."""

from __future__ import annotations

import math
import os

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from ros_graph import DEADLINE, assign, ball, balls_meet, wait_until
from rosgraph_msgs.msg import Clock

from collision_response import Body, Contact, StatusCode
from collision_response.msg import BodyState, BodyStates
from collision_response.ros import batch_client, scene_client
from collision_response.ros.take_all import TakeAllWaitable
from collision_response.ros.throttled_warnings import ThrottledWarnings


def by_name(name="left"):
    """The usual request, with the ball on the left given by name only."""
    request = balls_meet()
    request.body_b = BodyState(name=name)
    return request


def left_ball(velocity=3.0, stamp=0.0):
    state = ball(-0.5, velocity, name="left")
    state.header.stamp.sec, state.header.stamp.nanosec = int(stamp), int(stamp % 1 * 1e9)
    return state


class Publisher:
    """Publish states until the node has them; best effort may lose some."""

    def __init__(self, graph, topic="body_states"):
        self._graph = graph
        self._publisher = graph.user.create_publisher(BodyState, topic, 10)

    def send(self, state):
        self._publisher.publish(state)

    def publish(self, state, *, until_answer=lambda answer: True):
        def answer():
            self._publisher.publish(state)
            answer = self._graph.call(by_name(state.name))
            known = answer.result.status.code != StatusCode.UNKNOWN_BODY
            return answer if known and until_answer(answer) else None

        return wait_until(answer)


def test_a_body_given_by_name_is_looked_up(graph):
    graph.serve()
    in_full = graph.call(balls_meet()).result

    answer = Publisher(graph).publish(left_ball())

    assert answer.success
    assert (answer.result.twist_a, answer.result.twist_b) == (in_full.twist_a, in_full.twist_b)
    assert answer.result.contact.body_b == "left"


def test_the_latest_state_is_used(graph):
    graph.serve()
    publisher = Publisher(graph)
    publisher.publish(left_ball(3.0))

    answer = publisher.publish(left_ball(1.0), until_answer=lambda answer: answer.result.twist_b.linear.x < 0)

    assert answer.result.normal_velocity_before == -2.0


def test_states_come_from_every_topic_of_the_parameter(graph):
    graph.serve(body_state_topics=["robots", "objects", "robots", ""])
    assert Publisher(graph, "objects").publish(left_ball()).success
    assert Publisher(graph, "robots").publish(ball(-0.5, 3.0, name="arm")).success
    assert graph.user.count_subscribers("body_states") == 0
    assert graph.user.count_subscribers("robots") == 1


@pytest.mark.parametrize("again", ["robots", "{}/robots", "remapped"])
def test_a_topic_that_is_given_twice_has_one_subscription(graph, again):
    graph.serve(
        cli_args=["--ros-args", "-r", "remapped:=robots"],
        body_state_topics=["robots", again.format(graph.namespace)],
    )
    wait_until(lambda: graph.user.count_subscribers("robots"))
    assert graph.user.count_subscribers("robots") == 1


def test_a_publisher_that_a_reliable_subscription_cannot_hear_is_warned_about(graph):
    logged, topic = graph.log(), f"{graph.namespace}/all_body_states"
    graph.serve(**{f"qos_overrides.{topic}.subscription.reliability": "reliable"})
    graph.user.create_publisher(BodyStates, topic, qos_profile_sensor_data)
    warning = f"New publisher discovered on topic '{topic}', offering incompatible QoS. "
    wait_until(lambda: any(text.startswith(warning) for text in logged))


@pytest.mark.skipif(os.environ.get("ROS_DISTRO") == "jazzy", reason="its rclpy names no publishers")
def test_a_warning_about_stamps_names_the_publishers(graph):
    logged, space = graph.log(), graph.namespace
    graph.serve()
    other = graph.add(Node("other", context=graph.context, namespace=space))
    late, publisher = other.create_publisher(BodyState, "body_states", 10), Publisher(graph)
    publisher.publish(left_ball(stamp=500.0))
    warning = (
        "a state of 'left' is 400 s older than the known one and is ignored; "
        f"the publishers are {space}/user on {space}/body_states and {space}/other on {space}/body_states: "
        "do their clocks agree?"
    )

    def warned():
        publisher.send(left_ball(stamp=500.0))
        late.publish(left_ball(stamp=100.0))
        return warning in logged

    wait_until(warned)


def test_an_unknown_body_is_refused_with_the_names_that_are_known(graph):
    graph.serve()
    Publisher(graph).publish(left_ball())
    status = graph.call(by_name("lift")).result.status
    assert status.code == StatusCode.UNKNOWN_BODY
    assert "'lift'" in status.message
    assert "left" in status.message


def test_a_body_with_more_than_a_name_is_not_looked_up(graph):
    graph.serve()
    Publisher(graph).publish(left_ball())
    request = by_name()
    request.body_b.header.frame_id = "world"
    status = graph.call(request).result.status
    assert status.code == StatusCode.INVALID_MASS
    assert status.message == (
        "body_b.inertia.m: is 0: to use the last state of 'left', set no field but its name"
    )


def test_a_stamp_before_1970_is_as_good_as_any_if_no_other_is_asked_for(graph):
    graph.serve(max_state_wait=60.0)
    assert Publisher(graph).publish(left_ball(stamp=-5.0)).success


def test_a_looked_up_body_must_be_in_the_frame_of_the_contact(graph):
    graph.serve()
    state = left_ball()
    state.header.frame_id = "map"
    status = Publisher(graph).publish(state).result.status
    assert status.code == StatusCode.FRAME_MISMATCH
    assert status.message.startswith("body_b.header.frame_id: is 'map'")


def test_world_frame_is_the_only_frame_accepted(graph):
    graph.serve(world_frame="map")
    status = graph.call(balls_meet()).result.status
    assert status.code == StatusCode.FRAME_MISMATCH
    assert status.message == "contact.header.frame_id: is 'world', but the parameter world_frame is 'map'"


def requests_by_name(name, frame):
    """A request to each service in which ``name`` strikes a body given in full, and how it was answered."""
    single = by_name(name)
    single.contact.header.frame_id = single.body_a.header.frame_id = frame
    wall = Contact.of((0, 0, 0), (-1, 0, 0), 0.5, 0.0)
    scene = scene_client.pack([Body.static()], [(1, 0)], [wall], names=["wall", name], frame_id=frame)
    bodies, contacts = [[math.inf], [0.0], [0.0], [0.0]], [[-1.0], [0.0], [0.0], [0.5]]
    batch = batch_client.pack(bodies, [[1], [0]], contacts, names=[name], frame_id=frame)
    return (
        (single, lambda response: response.result.status.code),
        (scene, lambda response: response.result.status.code),
        (batch, lambda response: response.status[0] if response.success else response.code),
    )


def test_all_services_check_frames_and_ages_in_the_same_order(graph):
    """The frame of the request; then of each state whether it is known, its age, and its frame."""
    graph.serve(max_state_age=3600.0, world_frame="world")
    now = graph.user.get_clock().now().nanoseconds / 1e9
    publisher = Publisher(graph)
    for name, frame, stamp in (
        ("good", "world", now),
        ("elsewhere", "map", now),
        ("old", "world", 1.0),
        ("old and elsewhere", "map", 1.0),
    ):
        state = left_ball(stamp=stamp)
        state.name, state.header.frame_id = name, frame
        publisher.publish(state)
    for name, code in {
        "good": StatusCode.OK,
        "elsewhere": StatusCode.FRAME_MISMATCH,
        "old": StatusCode.STALE_STATE,
        "old and elsewhere": StatusCode.STALE_STATE,
        "unknown": StatusCode.UNKNOWN_BODY,
    }.items():
        for frame, expected in (("world", code), ("map", StatusCode.FRAME_MISMATCH)):
            for request, code_of in requests_by_name(name, frame):
                assert code_of(graph.call(request)) == expected, (type(request), name, frame)


def test_all_services_check_the_frame_of_the_request_first(graph):
    graph.serve(world_frame="world")
    for frame, expected in (
        ("world", (StatusCode.SAME_BODY, StatusCode.INVALID_TABLE, StatusCode.INVALID_TABLE)),
        ("map", (StatusCode.FRAME_MISMATCH,) * 3),
    ):
        requests = requests_by_name("left", frame)
        (single, _), (scene, _), (batch, _) = requests
        single.contact.body_a = single.body_b.name
        scene.pairs, batch.pairs = [0], [0]
        for (request, code_of), code in zip(requests, expected, strict=True):
            assert code_of(graph.call(request)) == code, (type(request), frame)


def simulated_clock(graph, **parameters):
    """Start a node with simulated time; return a function that sets the time."""
    node = graph.serve(use_sim_time=True, **parameters)
    clock = graph.user.create_publisher(Clock, "/clock", 1)

    def set_clock(seconds):
        message = Clock()
        message.clock.sec, message.clock.nanosec = int(seconds), int(seconds % 1 * 1e9)

        def arrived():
            clock.publish(message)
            return node.get_clock().now().nanoseconds == seconds * 1e9

        wait_until(arrived)

    return set_clock


def test_age_is_by_simulated_time(graph):
    set_clock = simulated_clock(graph, max_state_age=0.5)
    set_clock(100.5)
    assert Publisher(graph).publish(left_ball(stamp=100.0)).success

    set_clock(102.25)
    answer = graph.call(by_name())
    assert not answer.success
    assert answer.result.status.code == StatusCode.STALE_STATE
    assert answer.result.status.message == (
        "body_b.header.stamp: the last state of 'left' is 2.25 s old; max_state_age is 0.5 s"
    )


@pytest.mark.parametrize("has_clock", [True, False])
def test_no_request_waits_for_ever_while_simulated_time_stands_still(graph, has_clock):
    if has_clock:
        simulated_clock(graph, max_state_wait=0.05)(100.0)
    else:
        graph.serve(use_sim_time=True, max_state_wait=0.05)
    request = by_name()
    request.not_before.sec = 200
    status = graph.call(request).result.status
    assert status.code == StatusCode.STALE_STATE
    assert status.message.endswith("; waited 0.05 s (max_state_wait)")


def test_diagnostics_are_published_while_simulated_time_stands_still(graph):
    node = graph.serve(use_sim_time=True)
    received = graph.listen(DiagnosticArray, "/diagnostics")
    name = node.get_fully_qualified_name()
    wait_until(lambda: any(status.name == name for array in received for status in array.status))


def test_age_is_by_system_time(graph):
    graph.serve(max_state_age=3600.0)
    publisher = Publisher(graph)
    assert publisher.publish(left_ball(stamp=1.0)).result.status.code == StatusCode.STALE_STATE

    now = graph.user.get_clock().now().nanoseconds / 1e9
    assert publisher.publish(left_ball(stamp=now), until_answer=lambda answer: answer.success)


def test_states_are_never_stale_by_default(graph):
    graph.serve()
    assert Publisher(graph).publish(left_ball(stamp=1.0)).success


def test_a_request_overtakes_no_state_published_before_it(graph):
    """Each state follows many others; taken one at a time, an older one would answer the request."""
    graph.serve()
    states = graph.publisher(BodyState, "body_states", 1000)
    for speed in range(1, 20):
        for other in range(30):
            states.publish(ball(name=f"other {other}"))
        state = left_ball(float(speed), stamp=float(speed))
        states.publish(state)
        request = by_name()
        request.not_before = state.header.stamp
        result = graph.call(request).result
        assert result.status.code == StatusCode.OK, result.status.message
        assert result.normal_velocity_before == -1.0 - speed


def test_a_request_that_waits_goes_on_when_another_one_takes_its_state(graph, monkeypatch):
    """Each look-up takes the states that have arrived. Here nothing else does."""
    is_ready = TakeAllWaitable.is_ready
    monkeypatch.setattr(
        TakeAllWaitable, "is_ready", lambda self, ready: self._is_service and is_ready(self, ready)
    )
    node = graph.serve(max_state_wait=2 * DEADLINE)
    publisher = Publisher(graph)
    publisher.publish(left_ball(3.0, stamp=10.0))
    request = by_name()
    request.not_before.sec = 20
    future = graph.call_async(request)
    wait_until(lambda: node._server._jobs.is_waiting)
    publisher.publish(left_ball(5.0, stamp=20.5), until_answer=lambda answer: future.done())
    assert future.result().result.normal_velocity_before == -6.0


def test_a_request_waits_for_a_state_with_its_stamp(graph):
    graph.serve(max_state_wait=DEADLINE)
    publisher = Publisher(graph)
    publisher.publish(left_ball(3.0, stamp=10.0))
    request = by_name()
    request.not_before.sec = 20
    future = graph.call_async(request)
    assert graph.call(by_name()).result.normal_velocity_before == -4.0  # other requests do not wait for it
    assert not future.done()

    def answered():
        publisher.send(left_ball(5.0, stamp=20.5))
        return future.done()

    wait_until(answered)
    result = future.result().result
    assert (result.normal_velocity_before, result.state_stamp_b.sec) == (-6.0, 20)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("left", "body_b.header.stamp: the last state of 'left' is 10 s older than not_before"),
        (
            "ghost",
            "body_b.name: is 'ghost', but no state with this name has been received; known bodies: left",
        ),
    ],
)
def test_waiting_ends_after_max_state_wait(graph, name, reason):
    graph.serve(max_state_wait=0.05)
    Publisher(graph).publish(left_ball(3.0, stamp=10.0))
    request = by_name(name)
    request.not_before.sec = 20
    status = graph.call(request).result.status
    assert status.code == StatusCode.STALE_STATE
    assert status.message == f"{reason}; waited 0.05 s (max_state_wait)"


def test_an_answer_says_which_states_were_used(graph):
    graph.serve()
    Publisher(graph).publish(left_ball(stamp=10.25))
    request = by_name()
    request.contact.header.stamp.sec = 12
    result = graph.call(request).result
    assert (result.state_stamp_b.sec, result.state_stamp_b.nanosec) == (10, 250_000_000)
    assert (result.state_age_a, result.state_age_b) == (0.0, 1.75)
    assert (result.state_stamp_a.sec, result.state_stamp_a.nanosec) == (0, 0)


def test_a_state_without_a_stamp_has_no_age(graph):
    graph.serve()
    Publisher(graph).publish(left_ball())
    assert math.isnan(graph.call(by_name()).result.state_age_b)


@pytest.mark.parametrize(
    ("stamp", "reason"),
    [
        (8.0, "is 2 s old; max_state_age is 1 s"),
        (102.0, "is 92 s ahead of the contact; max_state_age is 1 s: do the clocks agree?"),
        (0.0, "has no stamp, or there is no time yet; max_state_age is 1 s"),
    ],
)
def test_age_is_relative_to_the_contact_and_limited_in_both_directions(graph, stamp, reason):
    graph.serve(max_state_age=1.0)
    publisher = Publisher(graph)
    request = by_name()
    request.contact.header.stamp.sec = 10
    publisher.publish(left_ball(stamp=stamp))
    status = graph.call(request).result.status
    assert status.code == StatusCode.STALE_STATE
    assert status.message == f"body_b.header.stamp: the last state of 'left' {reason}"
    request.contact.header.stamp.sec = int(stamp) or 10
    assert graph.call(request).success == bool(stamp)


@pytest.mark.parametrize("not_before", [100, -100])
def test_a_state_without_a_stamp_is_not_reported_as_old(graph, not_before):
    graph.serve(max_state_wait=0.0)
    Publisher(graph).publish(left_ball())
    request = by_name()
    request.not_before.sec = not_before
    status = graph.call(request).result.status
    assert status.code == StatusCode.STALE_STATE
    assert "the last state of 'left' has no stamp, which not_before requires; waited" in status.message


def test_before_the_first_clock_a_state_has_no_age(graph):
    node = graph.serve(use_sim_time=True)
    Publisher(graph).publish(left_ball(stamp=100.0))
    assert math.isnan(graph.call(by_name()).result.state_age_b)
    node.set_parameters([Parameter("max_state_age", value=1.0)])
    status = graph.call(by_name()).result.status
    assert status.code == StatusCode.STALE_STATE
    assert "has no stamp, or there is no time yet; max_state_age is 1 s" in status.message


def test_bodies_may_be_named_by_the_contact_only(graph):
    graph.serve()
    publisher = Publisher(graph)
    publisher.publish(left_ball())
    publisher.publish(ball(0.5, -1.0, name="right"))
    request = balls_meet()
    request.body_a, request.body_b = BodyState(), BodyState()
    request.contact.body_a, request.contact.body_b = "right", "left"
    answer = graph.call(request)
    assert answer.success
    assert answer.result.normal_velocity_before == -4.0
    request.contact.body_b = "ghost"
    status = graph.call(request).result.status
    assert (status.code, status.message.split(":")[0]) == (StatusCode.UNKNOWN_BODY, "contact.body_b")


def test_states_of_many_bodies_come_in_a_table(graph):
    graph.serve()
    message = BodyStates(names=["right", "left"])
    message.header.frame_id, message.header.stamp.sec = "world", 7
    columns = {0: (2.0, 2.0), 10: (0.5, -0.5), 16: (1.0, 1.0), 17: (-1.0, 3.0)}
    message.numbers = [number for row in range(23) for number in columns.get(row, (0.0, 0.0))]
    tables = graph.user.create_publisher(BodyStates, "all_body_states", 10)

    def answer():
        tables.publish(message)
        return next(filter(lambda answer: answer.success, [graph.call(by_name())]), None)

    answer = wait_until(answer)
    assert answer.result.normal_velocity_before == -4.0
    assert answer.result.state_stamp_b.sec == 7


def test_a_clock_that_is_set_back_all_the_time_is_warned_about_once(graph):
    """As with two publishers of /clock."""
    said = []
    set_clock = simulated_clock(graph)
    graph.node._warn = ThrottledWarnings(said.append, lambda: 0.0)
    for seconds in (10, 9, 8, 7, 6, 5):
        set_clock(seconds)
    assert said == ["the clock was changed or set back: the states of all bodies are forgotten"]


def test_when_the_clock_is_set_back_states_are_forgotten(graph):
    set_clock = simulated_clock(graph)
    set_clock(100)
    publisher = Publisher(graph)
    publisher.publish(left_ball(1.0, stamp=100.0))
    set_clock(5)
    assert graph.call(by_name()).result.status.code == StatusCode.UNKNOWN_BODY
    assert publisher.publish(left_ball(2.0, stamp=5.0)).result.normal_velocity_before == -3.0


@pytest.mark.parametrize("value", [-0.5, -2.0])
@pytest.mark.parametrize("field", ["contact.restitution", "body_a.restitution", "body_b.friction"])
def test_only_minus_one_leaves_a_coefficient_open(graph, field, value):
    graph.serve()
    request = balls_meet()
    request.contact.restitution = request.contact.friction = -1.0
    request.body_a.restitution = request.body_b.restitution = 0.5
    assign(request, field, value)
    status = graph.call(request).result.status
    assert status.code == StatusCode.INVALID_COEFFICIENT
    assert status.message.startswith(f"{field}: ") and str(value) in status.message


def test_an_answer_says_where_its_coefficients_came_from(graph):
    logged = graph.log()
    graph.serve()
    request = balls_meet()
    result = graph.call(request).result
    assert (result.restitution_from, result.friction_from) == (result.FROM_CONTACT, result.FROM_CONTACT)
    request.contact.restitution = request.contact.friction = -1.0
    request.body_a.restitution, request.body_b.restitution = 0.5, 0.25
    request.body_a.friction = 0.5
    result = graph.call(request).result
    assert (result.restitution_from, result.friction_from) == (result.FROM_BODIES, result.FROM_PARAMETER)
    request.body_a.restitution = 0.0  # is a coefficient, too
    assert graph.call(request).result.restitution_from == result.FROM_BODIES
    request.body_a.restitution = 0.5
    one_sided = "only one of two bodies has a coefficient of friction"
    wait_until(lambda: any(text.startswith(one_sided) for text in logged))
    graph.call(request)
    request.body_a.restitution = -1.0
    graph.call(request)
    wait_until(lambda: any("coefficient of restitution" in text for text in logged))
    assert sum("coefficient of friction" in text for text in logged) == 1


def test_a_coefficient_that_no_body_has_is_no_reason_to_warn(graph):
    logged = graph.log()
    graph.serve()
    request = balls_meet()
    request.contact.restitution = request.contact.friction = -1.0
    result = graph.call(request).result
    assert (result.restitution_from, result.friction_from) == (result.FROM_PARAMETER, result.FROM_PARAMETER)
    request.body_a.friction = 0.5
    graph.call(request)
    wait_until(lambda: any("coefficient of friction" in text for text in logged))
    assert not any("coefficient of restitution" in text for text in logged)
