"""The round trip of the services, compared with an echo server of the same types.

Each server is a separate process; the clients share one. Servers and clients are this directory, run with one
of the words in ``CHILDREN``.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

from reliability.child_process import ros_node, service_client
from reliability.processes import LARGE_DATA, Process, own_domain
from timing import Samples, ratio, spread

HERE = Path(__file__).resolve().parent
DEADLINE = 30.0
"""Longest time to wait for anything [s]."""

ROUNDS = 80
CALLS = 24
"""Calls in a round: one after the other, or of all concurrent clients together."""

CONCURRENT = 8
"""Number of concurrent clients."""

BATCH = "batch"
CONTACTS, BODIES, BATCH_CALLS = 10_000, 4_000, 3
"""Contacts and bodies of a batch, in which each body touches five others; batches in a round."""

CALLBACK = "the callback alone"


# Servers --------------------------------------------------------------------------------------


def echo() -> None:
    """Serve prepared answers under the names of the node's services."""
    from rclpy.node import Node

    from collision_response import srv
    from collision_response.ros.process import run
    from collision_response.ros.server import SERVICE_QOS

    one = srv.ResolveCollision.Response(success=True)
    one.result.header.frame_id = one.result.contact.header.frame_id = "world"
    one.result.contact.body_a, one.result.contact.body_b = "a", "b"
    many = batch_response()

    def make() -> Node:
        node = Node("collision_response")
        for kind, name, response in (
            (srv.ResolveCollision, "~/resolve_collision", one),
            (srv.ResolveCollisionBatch, "~/resolve_collision_batch", many),
        ):
            node.create_service(kind, name, lambda *_, response=response: response, qos_profile=SERVICE_QOS)
        return node

    run(make, sys.argv)


def batch_response() -> Any:
    """A response with as many bytes as the node's answer to :func:`batch`."""
    from collision_response import Geometry
    from collision_response.batch import body_rows
    from collision_response.batch.result import result_fields
    from collision_response.ros.tables import Response, result_in, zeros_in

    response = Response(success=True)
    response.header.frame_id = "world"
    fields = result_fields(body_rows(Geometry.SPATIAL), CONTACTS, bounded=False, report=False)
    result_in(response, fields, zeros_in)
    return response


def server(command: list[str], namespace: str, *parameters: str) -> closing[Process]:
    """A server in a namespace, which ends when the context is left."""
    options = [word for parameter in parameters for word in ("-p", parameter)]
    words = [*command, "--ros-args", "-r", f"__ns:=/{namespace}", *options, "--log-level", "warn"]
    return closing(Process(words, dict(os.environ), stdin=subprocess.DEVNULL))


# Clients --------------------------------------------------------------------------------------


def impact() -> Any:
    """A request with two bodies in space and friction."""
    from collision_response.srv import ResolveCollision

    request = ResolveCollision.Request()
    for body, name, side in ((request.body_a, "a", 1.0), (request.body_b, "b", -1.0)):
        body.name, body.header.frame_id = name, "world"
        body.inertia.m, body.inertia.ixx, body.inertia.iyy, body.inertia.izz = 2.0, 0.3, 0.4, 0.5
        body.pose.position.x, body.pose.position.y, body.pose.position.z = 0.1, 0.2, 0.6 * side
        body.twist.linear.x, body.twist.linear.y, body.twist.linear.z = 0.3 * side, -0.2, -1.5 * side
        body.twist.angular.x, body.twist.angular.y, body.twist.angular.z = 0.4, -0.7 * side, 0.9
    request.contact.header.frame_id = "world"
    request.contact.position.x, request.contact.position.y, request.contact.position.z = 0.05, 0.1, 0.02
    request.contact.normal.z = 1.0
    request.contact.restitution, request.contact.friction = 0.5, 0.3
    return request


def batch() -> Any:
    """A request with many contacts in space between fewer bodies, without friction."""
    import numpy as np
    from cases import tables

    from collision_response import Geometry, ImpactModel, Law
    from collision_response.ros.batch_client import pack

    bodies, contacts = tables(Geometry.SPATIAL, CONTACTS)
    body_a, step = np.random.default_rng(0).integers((BODIES, BODIES - 1), size=(CONTACTS, 2)).T
    pairs = body_a, (body_a + 1 + step) % BODIES
    return pack(bodies[:, 0, :BODIES], pairs, contacts[:-1], ImpactModel(Law.FRICTIONLESS), frame_id="world")


class Clients:
    """Clients of one service of every server, in one node."""

    def __init__(self, node: Any, executor: Any, servers: Iterable[str], service: str, number: int) -> None:
        self._executor = executor
        self._clients = {
            name: [service_client(node, service, f"/{name}") for _ in range(number)] for name in servers
        }

    def wait(self) -> None:
        """Wait until every server is available.

        Raises:
            TimeoutError: if a server is not available in time.
        """
        for name, clients in self._clients.items():
            for client in clients:
                if not client.wait_for_service(DEADLINE):
                    raise TimeoutError(f"the server {name} is not available")

    def call(self, name: str, request: Any) -> Any:
        """Call a server and return its answer.

        Raises:
            TimeoutError: if there is no answer in time.
        """
        future = self._clients[name][0].call_async(request)
        return self._result(future)

    def call_in_sequence(self, name: str, request: Any, calls: int = CALLS) -> float:
        """Mean time of a call [s]."""
        start = time.perf_counter()
        for _ in range(calls):
            self.call(name, request)
        return (time.perf_counter() - start) / calls

    def call_concurrently(self, name: str, request: Any) -> float:
        """Mean time between answers [s], if each client calls again as soon as it has its answer."""
        from rclpy.task import Future

        done, left, answers = Future(), CALLS, 0

        def ask(client: Any) -> None:
            nonlocal left
            left -= 1
            client.call_async(request).add_done_callback(lambda _: answered(client))

        def answered(client: Any) -> None:
            nonlocal answers
            answers += 1
            if left > 0:
                ask(client)
            elif answers == CALLS:
                done.set_result(True)

        start = time.perf_counter()
        for client in self._clients[name]:
            ask(client)
        self._result(done)
        return (time.perf_counter() - start) / CALLS

    def _result(self, future: Any) -> Any:
        self._executor.spin_until_future_complete(future, DEADLINE)
        if not future.done():
            raise TimeoutError("no answer")
        return future.result()


# Measuring ------------------------------------------------------------------------------------


def round_trips(service: str, request: Any, *names: str) -> Samples:
    """Round-trip times [s] of a batch, or of one impact with one client and with several, by server."""
    with ExitStack() as stack:
        directory = stack.enter_context(tempfile.TemporaryDirectory())
        record = ("recording.enabled:=true", f"recording.directory:={directory}")
        for name in names:
            command = (
                _self("echo")
                if name == "echo"
                else [str(Path(sys.executable).with_name("collision_response")), "node"]
            )
            stack.enter_context(server(command, name, *(record if name == "recording" else ())))
        is_batch = service.endswith("batch")
        node, executor = stack.enter_context(ros_node("clients"))
        clients = Clients(node, executor, names, service, 1 if is_batch else CONCURRENT)
        clients.wait()
        calls: dict[str, Callable[[], float]] = {}
        for name in names:
            assert clients.call(name, request).success, name
            if is_batch:
                calls[f"{name}, {BATCH}"] = partial(clients.call_in_sequence, name, request, BATCH_CALLS)
                continue
            clients.call_concurrently(name, request)
            calls[f"{name}, 1 client"] = partial(clients.call_in_sequence, name, request)
            calls[f"{name}, {CONCURRENT} clients"] = partial(clients.call_concurrently, name, request)
        return _rounds(calls)


def _rounds(calls: dict[str, Callable[[], float]]) -> Samples:
    order, draw = list(calls), random.Random(0)
    samples: Samples = {name: [] for name in order}
    for _ in range(ROUNDS):
        draw.shuffle(order)
        for name in order:
            samples[name].append(calls[name]())
    return samples


def callback_time() -> dict[str, float]:
    """Time of the node's own work for a request [s]."""
    import rclpy
    from timing import interleaved

    from collision_response.ros.node import CollisionResponseNode

    rclpy.init(args=["--ros-args", "--log-level", "warn"])
    node = CollisionResponseNode()
    try:
        request = impact()

        def call() -> None:
            for _ in node.impact_service.answer(request):
                pass

        return spread(interleaved({CALLBACK: call}, rounds=11, seconds=0.02)[CALLBACK])
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def measure_requests() -> None:
    """Measure the service for one impact and print the results."""
    samples = round_trips("resolve_collision", impact(), "echo", "plain", "recording")
    ratios = {
        f"{name}, {kind}": ratio(samples, f"{name}, {kind}", f"echo, {kind}")
        for name in ("plain", "recording")
        for kind in ("1 client", "8 clients")
    }
    _print_results(samples, ratios, callback=callback_time())


def measure_batch() -> None:
    """Measure the service for a batch and print the results."""
    samples = round_trips("resolve_collision_batch", batch(), "echo", "plain")
    _print_results(samples, {BATCH: ratio(samples, f"plain, {BATCH}", f"echo, {BATCH}")})


def _print_results(samples: Samples, ratios: dict[str, Any], **others: Any) -> None:
    seconds = {name: spread(values) for name, values in samples.items()}
    print(json.dumps({"s": seconds, "ratios": ratios, **others}))


CHILDREN = {"echo": echo, "measure-requests": measure_requests, "measure-batch": measure_batch}
"""Functions that this directory runs when it is called with one of these words."""


def measure(skipped: dict[str, str], _: object) -> dict[str, Any] | None:
    """All there is to say, measured out of the way of whatever else this process has imported."""
    try:
        import rclpy  # noqa: F401
    except ImportError as missing:
        skipped["service"] = str(missing)
        return None
    with own_domain() as environment:
        found = _by(_self("measure-requests"), environment)
        of_batch = _by(_self("measure-batch"), {**environment, **LARGE_DATA})
    merged = {**found, **{key: {**found[key], **more} for key, more in of_batch.items()}}
    targets = [
        {"what": f"service, {what}, against the echo", "most": most, "measured": merged["ratios"][name]}
        for what, most, name in (
            ("one request after the other", 1.1, "plain, 1 client"),
            ("one request after the other, recording", 1.35, "recording, 1 client"),
            ("a batch of 1e4 contacts", 1.6, BATCH),
        )
    ]
    return {**merged, "targets": targets}


def _by(command: list[str], environment: dict[str, str]) -> dict[str, Any]:
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, text=True, timeout=600, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def _self(command: str) -> list[str]:
    return [sys.executable, "-I", str(HERE), command]
