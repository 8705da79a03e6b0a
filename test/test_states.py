"""Bodies given by name: look-up, age, frames."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")

from ros_graph import ball, balls_meet, until
from rosgraph_msgs.msg import Clock

from collision_response import StatusCode
from collision_response.msg import BodyState


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
    """Publishes states and waits until the node has them; best effort may lose one."""

    def __init__(self, graph, topic="body_states"):
        self._graph = graph
        self._publisher = graph.user.create_publisher(BodyState, topic, 10)

    def publish(self, state, *, until_answer=lambda answer: True):
        def answer():
            self._publisher.publish(state)
            answer = self._graph.call(by_name(state.name))
            known = answer.result.status.code != StatusCode.UNKNOWN_BODY
            return answer if known and until_answer(answer) else None

        return until(answer)


def test_a_body_given_by_name_is_looked_up(graph):
    graph.serve()
    in_full = graph.call(balls_meet()).result

    answer = Publisher(graph).publish(left_ball())

    assert answer.success
    assert (answer.result.twist_a, answer.result.twist_b) == (in_full.twist_a, in_full.twist_b)
    assert answer.result.contact.body_b == "left"


def test_the_latest_state_counts(graph):
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
    assert graph.call(request).result.status.code == StatusCode.INVALID_MASS


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


def test_age_is_by_the_clock_of_the_simulation(graph):
    node = graph.serve(use_sim_time=True, max_state_age=0.5)
    clock = graph.user.create_publisher(Clock, "/clock", 1)

    def set_clock(seconds):
        message = Clock()
        message.clock.sec, message.clock.nanosec = int(seconds), int(seconds % 1 * 1e9)

        def arrived():
            clock.publish(message)
            return node.get_clock().now().nanoseconds == seconds * 1e9

        until(arrived)

    set_clock(100.5)
    assert Publisher(graph).publish(left_ball(stamp=100.0)).success

    set_clock(102.25)
    answer = graph.call(by_name())
    assert not answer.success
    assert answer.result.status.code == StatusCode.STALE_STATE
    assert answer.result.status.message == (
        "body_b.header.stamp: the last state of 'left' is 2.25 s old; max_state_age is 0.5 s"
    )


def test_age_is_by_the_clock_of_the_machine(graph):
    graph.serve(max_state_age=3600.0)
    publisher = Publisher(graph)
    assert publisher.publish(left_ball(stamp=1.0)).result.status.code == StatusCode.STALE_STATE

    now = graph.user.get_clock().now().nanoseconds / 1e9
    assert publisher.publish(left_ball(stamp=now), until_answer=lambda answer: answer.success)


def test_states_never_grow_stale_unless_asked(graph):
    graph.serve()
    assert Publisher(graph).publish(left_ball(stamp=1.0)).success
