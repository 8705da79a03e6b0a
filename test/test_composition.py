"""The node in a process of somebody else: in any executor, next to others, destroyed and made again."""

from __future__ import annotations

import faulthandler
import gc
import os
import threading
import weakref
from contextlib import suppress
from operator import attrgetter

import pytest

pytest.importorskip("rclpy")

from rclpy.context import Context
from rclpy.exceptions import InvalidTopicNameException, ParameterException
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_graph import ball, balls_meet, wait_until
from rosgraph_msgs.msg import Clock

from collision_response.msg import BodyState
from collision_response.ros.answer_log import ResultPublisher
from collision_response.ros.impacts import ImpactService
from collision_response.ros.markers import ContactMarkers
from collision_response.ros.node import CollisionResponseNode
from collision_response.ros.sources import BodyStatePublisher
from collision_response.ros.take_all import RCLError

EXECUTORS = pytest.mark.parametrize("kind", [SingleThreadedExecutor, MultiThreadedExecutor])


class Host:
    """A context and an executor with a node that has a timer, and the node under test."""

    def __init__(self, kind, namespace, **parameters):
        self.context = Context()
        self.context.init()
        self.executor = kind(context=self.context)
        self.own = Node("host", context=self.context)
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.tested = CollisionResponseNode(
            context=self.context, namespace=namespace, parameter_overrides=overrides
        )
        self.calls, self.on_call = 0, []
        self.own.create_timer(0.001, self._call)
        self.executor.add_node(self.own)
        self.executor.add_node(self.tested)

    def _call(self):
        self.calls += 1
        while self.on_call:
            self.on_call.pop()()

    def spin_until(self, condition):
        wait_until(lambda: self.executor.spin_once(timeout_sec=1.0) or condition())

    def close(self):
        self.executor.shutdown()
        self.own.destroy_node()
        self.tested.destroy_node()
        self.context.try_shutdown()


@pytest.mark.parametrize("requests", [0, 50])
@pytest.mark.parametrize(
    ("kind", "where"),
    [
        (SingleThreadedExecutor, "between two spins"),
        (SingleThreadedExecutor, "in a callback"),
        (MultiThreadedExecutor, "between two spins"),
    ],
)
def test_an_executor_outlives_the_node(graph, kind, where, requests):
    """Whoever destroys a node rarely removes it from its executor first."""
    host = Host(kind, graph.namespace)
    states = graph.publisher(BodyState, "body_states", 100)
    future = graph.call_async(balls_meet())
    host.spin_until(future.done)
    for _ in range(requests):
        states.publish(ball(name="left"))
        graph.call_async(balls_meet())
    if where == "in a callback":
        host.on_call.append(host.tested.destroy_node)
    else:
        host.tested.destroy_node()
    before = host.calls
    host.spin_until(lambda: host.calls > before + 5)
    host.close()


@pytest.mark.parametrize("end", ["tested.destroy_node", "context.shutdown"])
def test_a_node_that_ends_after_an_answer_logs_no_error(graph, monkeypatch, capfd, end):
    """As when another thread destroys it, or a signal handler shuts the context down."""
    host, publish = Host(SingleThreadedExecutor, graph.namespace), ResultPublisher.publish

    def end_before(publisher, result):
        attrgetter(end)(host)()
        publish(publisher, result)

    monkeypatch.setattr(ResultPublisher, "publish", end_before)
    future = graph.call_async(balls_meet())
    with suppress(ExternalShutdownException, RCLError):  # of the executor
        host.spin_until(future.done)
    wait_until(future.done)
    host.close()
    assert "Traceback" not in capfd.readouterr().err


def test_ctrl_c_while_a_request_is_read_is_no_system_error(graph, monkeypatch, capfd):
    """rclpy does not notice errors in the constructor of a message, and then Python raises SystemError."""
    host = Host(SingleThreadedExecutor, graph.namespace)
    errors = [MemoryError, KeyboardInterrupt]

    def interrupted(state, **fields):
        if threading.current_thread() is threading.main_thread():
            raise errors.pop(0)
        return make(state, **fields)

    make = BodyState.__init__
    requests = [balls_meet() for _ in range(2)]
    with monkeypatch.context() as patch:
        patch.setattr(BodyState, "__init__", interrupted)
        for request in requests:
            graph.call_async(request)
        with pytest.raises(KeyboardInterrupt):
            host.spin_until(lambda: False)
    future = graph.call_async(balls_meet())
    host.spin_until(future.done)
    assert errors == []
    assert "a request could not be read: MemoryError()" in capfd.readouterr().err
    host.close()


def test_ctrl_c_leaves_nobody_else_waiting(graph, monkeypatch):
    """In a program that catches it and goes on."""
    host, answer = Host(SingleThreadedExecutor, graph.namespace), ImpactService.answer
    interrupts = [KeyboardInterrupt]

    def interrupted(service, request):
        if interrupts:
            raise interrupts.pop()
        return answer(service, request)

    monkeypatch.setattr(ImpactService, "answer", interrupted)
    futures = [graph.call_async(balls_meet()) for _ in range(20)]
    with pytest.raises(KeyboardInterrupt):
        host.spin_until(lambda: False)
    host.spin_until(lambda: sum(future.done() for future in futures) == 19)
    host.close()


def test_a_node_that_shuts_down_too_late_says_what_is_left(graph, capfd):
    """As in a program that leaves Ctrl-C to rclpy, which shuts the context down."""
    host = Host(SingleThreadedExecutor, graph.namespace, max_state_wait=60.0, shutdown_timeout=0.5)
    request = balls_meet()
    request.body_b, request.not_before.sec = BodyState(name="left"), 10
    graph.call_async(request)
    host.spin_until(host.tested._server.waiting)
    host.tested.destroy_node()
    host.tested.shut_down()
    host.close()
    assert "at least 1 requests have no answer; shutdown_timeout is 0.5 s" in capfd.readouterr().err


def test_a_shutdown_that_fails_does_not_end_the_program_later(graph, monkeypatch):
    node, calls = CollisionResponseNode(context=graph.context, namespace=graph.namespace), []
    monkeypatch.setattr(faulthandler, "dump_traceback_later", lambda *_, **__: calls.append("start"))
    monkeypatch.setattr(faulthandler, "cancel_dump_traceback_later", lambda: calls.append("cancel"))
    monkeypatch.setattr(node._server, "drain", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        node.shut_down()
    assert calls == ["start", "cancel"]
    node.destroy_node()


@EXECUTORS
def test_the_clock_may_be_set_back_in_the_middle_of_look_ups(graph, kind):
    host = Host(kind, graph.namespace, use_sim_time=True)
    clock, states = graph.publisher(Clock, "/clock"), graph.publisher(BodyState, "body_states", 100)
    futures = []
    for i in range(100):
        message = Clock()
        message.clock.sec = 100 - i % 2
        clock.publish(message)
        for name in "abcdefgh":
            states.publish(ball(-0.5, 3.0, name=name))
        request = balls_meet()
        request.body_b = BodyState(name="e")
        futures.append(graph.call_async(request))
    host.spin_until(lambda: all(future.done() for future in futures))
    host.close()


def test_two_nodes_of_one_name_answer(graph):
    """ROS permits this, with a warning. Each request gets two answers, of which a client takes the first."""
    graph.serve()
    graph.serve()
    assert all(graph.call(balls_meet()).success for _ in range(20))


def number_of(what):
    """Number of open files ("fd") or threads ("task") of this process."""
    return len(os.listdir(f"/proc/self/{what}"))


@pytest.mark.parametrize("kind", [CollisionResponseNode, BodyStatePublisher, ContactMarkers])
def test_nodes_that_come_and_go_leave_nothing_behind(graph, kind):
    def make():
        node = kind(context=graph.context, namespace=graph.namespace)
        node.destroy_node()
        return weakref.ref(node)

    for _ in range(3):  # DDS makes some of its threads and sockets late
        make()
    before = number_of("fd"), number_of("task")
    nodes = [make() for _ in range(10)]
    gc.collect()
    assert [node() for node in nodes] == [None] * 10
    assert number_of("fd") <= before[0] and number_of("task") <= before[1]


def test_nodes_that_record_leave_no_file_open_and_are_collected(graph, tmp_path, monkeypatch):
    """Except the first one, which the garbage collector leaves alone together with rerun."""
    pytest.importorskip("rerun")
    monkeypatch.setenv("HOME", str(tmp_path))
    overrides = [
        Parameter("recording.enabled", value=True),
        Parameter("recording.directory", value="~/recordings"),
    ]

    def make():
        node = CollisionResponseNode(
            context=graph.context, namespace=graph.namespace, parameter_overrides=overrides
        )
        node.destroy_node()
        return weakref.ref(node)

    for _ in range(3):
        make()
    before = number_of("fd")
    nodes = [make() for _ in range(5)]
    gc.collect()
    assert [node() for node in nodes] == [None] * 5
    assert number_of("fd") <= before
    assert len([*tmp_path.glob("recordings/*.rrd")]) == 8


@pytest.mark.parametrize(
    ("parameters", "error"),
    [
        ({"body_state_topics": ["a b"]}, InvalidTopicNameException),
        ({"qos_overrides./diagnostics.publisher.depth": -1}, ParameterException),
        ({"friction": -1.0}, ParameterException),
    ],
    ids=["topics", "diagnostics", "parameters"],
)
def test_a_start_that_fails_leaves_no_recording_and_shows_no_service(
    graph, tmp_path, parameters, error, monkeypatch
):
    would_wait = "a client would wait for answers"
    monkeypatch.setattr("collision_response.ros.node.Server", lambda *_: pytest.fail(would_wait))
    recording = {"recording__enabled": True, "recording__directory": str(tmp_path)}
    with pytest.raises(error):
        graph.serve(**recording, **parameters)
    assert "recording" not in {thread.name for thread in threading.enumerate()}
    assert list(tmp_path.iterdir()) == []


def test_a_new_node_reads_the_materials_anew(graph, tmp_path):
    file = tmp_path / "materials.yaml"
    request = balls_meet()
    request.contact.restitution = -1.0
    request.body_a.material = request.body_b.material = "steel"
    for restitution in (0.25, 0.75):
        file.write_text(f"materials: {{steel: {{restitution: {restitution}}}}}")
        node = graph.serve(materials_file=str(file))
        assert graph.call(request).result.contact.restitution == restitution
        graph.remove(node)
