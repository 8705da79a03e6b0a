"""ROS nodes of a test, spun in this process and connected over DDS."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from collision_response import Body, Contact, Geometry, ImpactModel, Precision
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.msg import BodyState
from collision_response.ros.batch_client import pack
from collision_response.ros.node import CollisionResponseNode
from collision_response.ros.server import SERVICE_QOS
from collision_response.srv import ResolveCollision, ResolveCollisionBatch, ResolveScene

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For subscriptions that also get earlier messages."""

DEADLINE = 20.0
"""Seconds after which a test gives up waiting: far more than anything takes."""

_numbers = itertools.count()


class Graph:
    """A context, a thread that spins its nodes, and a client of each service."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.namespace = f"/test_{next(_numbers)}"
        self.service = f"{self.namespace}/collision_response/resolve_collision"
        self._executor = SingleThreadedExecutor(context=self.context)
        self._nodes: list[Node] = []
        self._stop = Future()  # executor.shutdown() from another thread is a race
        self._thread = threading.Thread(target=self._executor.spin_until_future_complete, args=[self._stop])
        self._thread.start()
        self.user = self.add(Node("user", context=self.context, namespace=self.namespace))
        services = (
            (ResolveCollision, self.service),
            (ResolveCollisionBatch, f"{self.service}_batch"),
            (ResolveScene, f"{self.namespace}/collision_response/resolve_scene"),
        )
        self._clients = {
            kind.Request: self.user.create_client(kind, name, qos_profile=SERVICE_QOS)
            for kind, name in services
        }

    def add(self, node: Node) -> Any:
        """Spin a node until the test ends."""
        self._nodes.append(node)
        self._executor.add_node(node)
        return node

    def forget(self, node: Node) -> None:
        """Stop spinning a node."""
        self._executor.remove_node(node)
        self._nodes.remove(node)

    def remove(self, node: Node) -> None:
        """Stop spinning a node, and destroy it."""
        self.forget(node)
        node.destroy_node()

    def serve(self, cli_args: Any = None, **parameters: Any) -> CollisionResponseNode:
        """Start the node under test; a double underscore in a parameter's name stands for a dot."""
        overrides = [Parameter(name.replace("__", "."), value=value) for name, value in parameters.items()]
        self.node = CollisionResponseNode(
            context=self.context, namespace=self.namespace, parameter_overrides=overrides, cli_args=cli_args
        )
        return self.add(self.node)

    def listen(self, kind: type, topic: str, qos: Any = 10) -> list[Any]:
        """Subscribe to a topic; return the list to which its messages are added."""
        received: list[Any] = []
        self.user.create_subscription(kind, topic, received.append, qos)
        return received

    def publisher(self, kind: type, topic: str, qos: Any = 10) -> Any:
        """A publisher on a topic, once a node under test has subscribed to it."""
        publisher = self.user.create_publisher(kind, topic, qos)
        wait_until(publisher.get_subscription_count)
        return publisher

    def log(self) -> list[str]:
        """The texts that nodes log, past ones included, as a list to which new ones are added."""
        texts: list[str] = []
        self.user.create_subscription(Log, "/rosout", lambda log: texts.append(log.msg), LATCHED)
        return texts

    def diagnostics(self) -> Callable[[], Any]:
        """Subscribe to the diagnostics; return a function that gives the last status and its values."""
        received = self.listen(DiagnosticArray, "/diagnostics")

        def last():
            for message in reversed(received):
                (status,) = message.status
                if status.name.startswith(self.namespace):
                    return status, {value.key: value.value for value in status.values}
            return None

        return last

    def call_async(self, request: Any) -> Any:
        """Send a request to its service, once the service is available."""
        client = self._clients[type(request)]
        wait_until(client.service_is_ready)
        return client.call_async(request)

    def call(self, request: Any) -> Any:
        """Send a request and return the answer."""
        answered = threading.Event()
        future = self.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        assert answered.wait(DEADLINE), "no answer"
        return future.result()

    def close(self) -> None:
        """Stop spinning, then destroy everything in an order that Fast DDS survives. Idempotent."""
        if self._stop.done():
            return
        self._stop.set_result(None)
        self._thread.join(DEADLINE)
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()
        rclpy.shutdown(context=self.context)


def wait_until(condition: Callable[[], Any]) -> Any:
    """Wait for a true value of ``condition`` and return it; not every ROS release reports discovery."""
    deadline = time.monotonic() + DEADLINE
    while not (value := condition()):
        assert time.monotonic() < deadline, "this did not happen"
        threading.Event().wait(0.002)
    return value


def ball(position: float = 0.0, velocity: float = 0.0, *, name: str = "", frame: str = "world") -> BodyState:
    """A solid ball of 2 kg and 0.5 m radius on the x axis."""
    state = BodyState(name=name)
    state.header.frame_id = frame
    state.pose.position.x = position
    state.twist.linear.x = velocity
    state.inertia.m = 2.0
    state.inertia.ixx = state.inertia.iyy = state.inertia.izz = 0.2
    return state


def balls_meet() -> ResolveCollision.Request:
    """Two equal balls meet head-on at the origin at 4 m/s, e = 0.5; ``a`` is on the right."""
    request = ResolveCollision.Request(body_a=ball(0.5, -1.0), body_b=ball(-0.5, 3.0))
    request.contact.header.frame_id = "world"
    request.contact.normal.x = 1.0
    request.contact.restitution, request.contact.friction = 0.5, 0.0
    return request


def assign(message: Any, path: str, value: Any) -> None:
    """Set a field given by its dotted name."""
    *owners, field = path.split(".")
    for owner in owners:
        message = getattr(message, owner)
    setattr(message, field, value)


def request_of(body_a: Body, body_b: Body, contact: Contact, **model: Any) -> ResolveCollision.Request:
    """The request for an impact, with both bodies in full."""
    request = ResolveCollision.Request(body_a=state_of(body_a), body_b=state_of(body_b))
    request.contact.header.frame_id = "world"
    request.contact.restitution = float(contact.restitution)
    request.contact.friction = float(contact.friction)
    _fill(request.contact.position, contact.position)
    _fill(request.contact.normal, contact.normal)
    for field, value in model.items():
        setattr(request.model, field, value)
    return request


def state_of(body: Body) -> BodyState:
    """The state of a body."""
    state = BodyState(motion_type=BodyState.DYNAMIC if body.is_movable() else BodyState.KINEMATIC)
    state.header.frame_id = "world"
    if body.is_movable():
        state.inertia.m = float(body.mass)
        for field, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), body.inertia, strict=True):
            setattr(state.inertia, field, float(value))
        _fill(state.inertia.com, body.com)
    if body.orientation is not None:
        _fill(state.pose.orientation, body.orientation)
    _fill(state.pose.position, body.position)
    _fill(state.twist.linear, body.velocity)
    _fill(state.twist.angular, body.angular_velocity)
    return state


def _fill(message: Any, components: Any) -> None:
    for axis, value in zip("xyzw", components, strict=False):
        setattr(message, axis, float(value))


EXTENDED = ImpactModel(precision=Precision.EXTENDED)


def falling(n, model=EXTENDED):
    """A batch in which one mass strikes the ground ``n`` times."""
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((body_row.height, 2)), np.zeros((contact_row.height, n))
    bodies[body_row.mass] = [[2.0, np.inf]]
    bodies[body_row.velocity][2] = [-3.0, 0.0]
    contacts[contact_row.normal][2], contacts[contact_row.restitution] = 1.0, 0.3
    return pack(bodies, [np.zeros(n), np.ones(n)], contacts, model)


def publish_until_received(graph: Graph, *states: BodyState) -> None:
    """Publish states until the node has them; best effort may lose some."""
    publisher = graph.user.create_publisher(BodyState, "body_states", 10)
    kind = ResolveCollisionBatch.Request
    request = kind(layout=kind.SPATIAL_ORIENTED, names="\n".join(state.name for state in states))

    def heard() -> bool:
        for state in states:
            publisher.publish(state)
        return "has been received" not in graph.call(request).message

    wait_until(heard)
