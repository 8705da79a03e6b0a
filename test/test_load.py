"""Long requests, many requests, clients that leave and the end of the node: every request is answered."""

from __future__ import annotations

import multiprocessing
import pickle
import resource
import subprocess
import sys
import threading
import warnings
from array import array
from functools import partial
from operator import attrgetter
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service
from ros_graph import DEADLINE, assign, ball, balls_meet, falling, wait_until

from collision_response import Body, Contact, ImpactError, ImpactModel, StatusCode
from collision_response.msg import BodyState
from collision_response.ros import batches, clients, scenes, server
from collision_response.ros import diagnostics as diagnostics_module
from collision_response.ros.batch_client import unpack
from collision_response.ros.body_lookup import BODIES_PER_STEP, MAX_TEXT, TEXTS, StateFinder
from collision_response.ros.clients import ConnectedClients
from collision_response.ros.diagnostics import PERIOD, Counters, Diagnostics
from collision_response.ros.node import CollisionResponseNode
from collision_response.ros.scene_client import pack as pack_scene
from collision_response.ros.scenes import MAX_BODIES
from collision_response.ros.server import SERVICE_QOS
from collision_response.ros.states import LatestStates
from collision_response.ros.take_all import RCLError
from collision_response.srv import ResolveCollision, ResolveCollisionBatch, ResolveScene

# turns


@pytest.mark.parametrize(
    ("long", "status"),
    [
        (falling(20_000), StatusCode.OK),
        # Each of these takes a thousand times as long as one that the kernels answer alone.
        (falling(50, ImpactModel(tolerance=1e-30)), StatusCode.TOLERANCE_NOT_MET),
    ],
    ids=["many", "many digits"],
)
def test_a_short_request_overtakes_a_long_one(graph, monkeypatch, long, status):
    node = graph.serve()
    compute, answer, order = batches.compute, node.impact_service.answer, []
    short_is_there, long_has_begun = threading.Event(), threading.Event()

    def compute_once_both_are_there(*arguments):
        while not short_is_there.is_set():
            yield
        long_has_begun.set()
        yield from compute(*arguments)
        order.append("long")

    def answer_once_the_other_has_begun(request):
        short_is_there.set()
        while not long_has_begun.is_set():
            yield
        order.append("short")
        return (yield from answer(request))

    monkeypatch.setattr(batches, "compute", compute_once_both_are_there)
    monkeypatch.setattr(node.impact_service, "answer", answer_once_the_other_has_begun)
    futures = [graph.call_async(long), graph.call_async(balls_meet())]
    wait_until(lambda: all(future.done() for future in futures))
    assert order == ["short", "long"]
    assert set(futures[0].result().status) == {status}


def many_names(n):
    request = falling(1)
    request.names = "\n".join(map(str, range(n)))
    return request


def crowd(n):
    """A scene of one contact, between the first and the second of many bodies."""
    bodies = [Body.dynamic(1.0, velocity=(-float(i), 0.0, 0.0)) for i in range(n)]
    return pack_scene(bodies, [(1, 0)], [Contact.of((0, 0, 0), (1, 0, 0), 1.0)])


@pytest.mark.parametrize(
    ("request_", "module", "taking"),
    [(many_names(1000), StateFinder, "find"), (crowd(1000), scenes, "_body_in_table")],
    ids=["names of a batch", "bodies of a scene"],
)
def test_many_bodies_are_looked_up_in_parts(shared_node, monkeypatch, request_, module, taking):
    take, taken = getattr(module, taking), [0]

    def counted(*arguments, **options):
        taken[-1] += 1
        return take(*arguments, **options)

    monkeypatch.setattr(module, taking, counted)
    node, states = shared_node.node, LatestStates(10, lambda: 0, pytest.fail, lambda: None, str)
    if module is StateFinder:
        service = batches.BatchService(node.parameters, states)
    else:
        service = scenes.SceneService(node.parameters, states, SimpleNamespace(add=lambda *_: None))
    for _ in service.answer(request_):
        taken.append(0)
    assert sum(taken) == 1000
    assert max(taken) <= BODIES_PER_STEP


# budgets


def test_too_many_names_are_refused_by_name(graph):
    graph.serve(budget__contacts=10)
    assert graph.call(many_names(20)).success
    response = graph.call(many_names(21))
    assert response.code == StatusCode.BUDGET_EXCEEDED
    assert response.message == (
        "names: holds 21 names; budget.contacts is 10, and that many contacts have at most 20 bodies"
    )


class Unsplit(str):
    """Names that are not to be split into lines: tens of millions would hold up other clients for seconds."""

    def split(self, *_):
        raise AssertionError


@pytest.mark.parametrize("number", [10**6, 3 * 10**7])
@pytest.mark.parametrize("kind", [ResolveCollisionBatch, ResolveScene])
def test_far_too_many_names_are_only_counted(shared_node, kind, number):
    request = falling(1) if kind is ResolveCollisionBatch else crowd(2)
    request.names = Unsplit("\n" * (number - 1))
    node, states = shared_node.node, LatestStates(10, lambda: 0, pytest.fail, lambda: None, str)
    if kind is ResolveCollisionBatch:
        service = batches.BatchService(node.parameters, states)
    else:
        service = scenes.SceneService(node.parameters, states, SimpleNamespace(add=lambda *_: None))
    with pytest.raises(ImpactError, match=f"(holds|has) {number}[ ;]"):
        next(service.answer(request))


def texts_in(message, path=""):
    """The names of all fields of a message that hold text."""
    for name, kind in message.get_fields_and_field_types().items():
        if kind == "string":
            yield path + name
        elif hasattr(getattr(message, name), "get_fields_and_field_types"):
            yield from texts_in(getattr(message, name), f"{path}{name}.")


def test_every_text_of_a_request_is_limited():
    assert {*texts_in(ResolveCollision.Request())} == {*TEXTS}
    for kind in (ResolveCollisionBatch, ResolveScene):
        assert {*texts_in(kind.Request())} == {"header.frame_id", "names"}


@pytest.mark.parametrize("field", TEXTS)
def test_a_text_that_is_too_long_is_refused_by_name_and_not_repeated(shared_node, field):
    request = balls_meet()
    assign(request, field, "x" * (MAX_TEXT + 1))
    assert_too_long(shared_node.call(request).result, field)


@pytest.mark.parametrize("field", ["header.frame_id", "names"])
@pytest.mark.parametrize("kind", [ResolveCollisionBatch, ResolveScene])
def test_a_frame_or_name_of_many_that_is_too_long_is_refused_by_name(shared_node, kind, field):
    request = falling(1) if kind is ResolveCollisionBatch else crowd(2)
    assign(request, field, "\n".join(["a", "b", "x" * (MAX_TEXT + 1)][-3 if field == "names" else -1 :]))
    response = shared_node.call(request)
    assert_too_long(getattr(response, "result", response), field.replace("names", "names[2]"))


def assert_too_long(result, field):
    refusal = result if hasattr(result, "code") else result.status
    assert refusal.code == StatusCode.BUDGET_EXCEEDED
    assert refusal.message == f"{field}: has {MAX_TEXT + 1} characters; may have {MAX_TEXT}"
    assert all(len(attrgetter(text)(result)) <= MAX_TEXT for text in texts_in(result))


def test_a_scene_of_too_many_bodies_is_refused_by_name(shared_node):
    request = crowd(2)
    request.bodies = array("d", [0.0] * 23 * (MAX_BODIES + 1))
    status = shared_node.call(request).result.status
    assert status.code == StatusCode.BUDGET_EXCEEDED
    assert status.message == f"bodies: has {MAX_BODIES + 1}; a scene may have {MAX_BODIES}"


def test_a_scene_of_too_many_names_is_refused_by_name(shared_node):
    request = crowd(2)
    request.names = "\n" * MAX_BODIES
    status = shared_node.call(request).result.status
    assert status.code == StatusCode.BUDGET_EXCEEDED
    assert status.message == f"names: has {MAX_BODIES + 1}; a scene may have {MAX_BODIES}"


def test_a_batch_of_too_many_contacts_is_refused_by_name(graph):
    logged = graph.log()
    graph.serve(budget__contacts=10)
    assert graph.call(falling(10)).success
    response = graph.call(falling(11))
    assert response.code == StatusCode.BUDGET_EXCEEDED
    assert response.message == "pairs: has 11 contacts; budget.contacts is 10: send fewer at a time"
    wait_until(lambda: f"a request was refused: {response.message}" in logged)


def test_a_request_that_takes_too_long_is_refused_by_name(graph):
    node = graph.serve(budget__time=1e-9)
    response = graph.call(falling(100_000))
    assert response.code == StatusCode.BUDGET_EXCEEDED
    assert response.message.startswith("request: was stopped after ")
    assert "budget.time is 1e-09 s" in response.message
    assert not response.status
    assert graph.call(falling(1)).success  # one part is always done
    node.set_parameters([Parameter("budget.time", value=0.0)])
    answer = unpack(graph.call(falling(100_000)))
    assert (answer.velocity[2, 0] == 0.3 * 3.0).all()


def test_a_request_that_needs_too_much_memory_is_refused(shared_node, monkeypatch):
    def fail(*_, **__):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(batches, "result_in", fail)
        response = shared_node.call(falling(1))
    assert response.code == StatusCode.BUDGET_EXCEEDED
    assert response.message == "request: needs more memory than the parameter memory_limit allows"
    assert shared_node.call(falling(1)).success


LIMITED = """
import resource
import numpy as np
from collision_response.ros.process import limit_memory

limit_memory(0)
np.empty(1 << 27)
limit_memory(512)
try:
    np.empty(1 << 27)
except MemoryError:
    np.empty(1 << 20)
    print("refused")
limit_memory(1024)
print(resource.getrlimit(resource.RLIMIT_DATA)[0] >> 20)
"""


def test_limit_memory_limits_the_process(tmp_path):
    command = [sys.executable, "-c", LIMITED]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE)
    assert result.stdout.split() == ["refused", "1024"], result.stderr
    assert resource.getrlimit(resource.RLIMIT_DATA)[0] == resource.RLIM_INFINITY


STARVED = """
import ctypes
import numpy as np
from collision_response.ros.process import limit_memory

library, thread = ctypes.CDLL(None), ctypes.c_ulong()
start, work = library.pthread_create, ctypes.cast(library.abs, ctypes.c_void_p)
limit_memory(512)
taken = []
for size in (1 << 24, 1 << 20, 1 << 16):
    try:
        while True:
            taken.append(np.empty(size, np.uint8))
    except MemoryError:
        pass
error = start(ctypes.byref(thread), None, work, None)
del taken
print("started" if error == 0 else error)
"""


def test_a_thread_starts_where_no_memory_is_left(tmp_path):
    """Fast DDS starts one to say so, and would hang if it could not."""
    command = [sys.executable, "-c", STARVED]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE)
    assert result.stdout == "started\n", result.stderr


RECORDS = """
from collision_response.recording.rerun_sdk import rr
from collision_response.ros.process import private_memory

stream = rr.RecordingStream("memory")
stream.save("memory.rrd")
stream.log("one", rr.Scalars(1.0))
print(private_memory() >> 20)
"""


def test_recording_takes_little_of_what_memory_limit_allows(tmp_path):
    """rerun reserved 2 GiB, as much as the default allows, of which it used 70 MiB."""
    pytest.importorskip("rerun")
    command = [sys.executable, "-c", RECORDS]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE)
    assert int(result.stdout) < 1024, result.stderr


# clients that leave


def by_name(seconds):
    """A request that waits for a state with this stamp [s]."""
    request = balls_meet()
    request.body_b = BodyState(name="left")
    request.not_before.sec = seconds
    return request


def another_client(graph):
    """Another node and its client, whose service is ready."""
    other = graph.add(Node("other", context=graph.context, namespace=graph.namespace))
    client = other.create_client(ResolveCollision, graph.service, qos_profile=SERVICE_QOS)
    wait_until(client.service_is_ready)
    return other, client


def test_requests_of_a_client_that_leaves_are_dropped_and_counted(graph):
    graph.serve(max_state_wait=60.0)
    last = graph.diagnostics()
    other, client = another_client(graph)
    answered = client.call_async(balls_meet())
    wait_until(answered.done)
    for _ in range(5):
        client.call_async(by_name(10))
    wait_until(lambda: last() and last()[1]["requests waiting"] == "5")

    other.destroy_client(client)

    wait_until(lambda: last()[1]["requests of clients that left"] == "5")
    assert last()[1]["requests waiting"] == "0"
    assert graph.call(balls_meet()).success


@pytest.mark.parametrize("bursts", [1, 2])
def test_answers_to_a_client_that_leaves_are_at_risk_unless_it_has_asked_again(graph, bursts):
    """A request shows that the client has received the answers before it. The last answer of a client that
    calls one by one does not count, as nothing ever shows that for it."""
    graph.serve(max_state_wait=60.0)
    last, logged = graph.diagnostics(), graph.log()
    states = graph.publisher(BodyState, "body_states")
    once, single = another_client(graph)
    wait_until(single.call_async(balls_meet()).done)
    once.destroy_client(single)
    other, client = another_client(graph)
    for second in range(10, 10 + bursts):
        futures = [client.call_async(by_name(second)) for _ in range(2)]
        wait_until(lambda: last() and last()[1]["requests waiting"] == "2")
        left = ball(name="left")
        left.header.stamp.sec = second
        states.publish(left)
        wait_until(lambda futures=futures: all(future.done() for future in futures))

    other.destroy_client(client)

    field = "answers to clients that left, perhaps not received"
    wait_until(lambda: last()[1][field] != "0")
    assert last()[1][field] == "2"
    wait_until(lambda: any("it is not known whether it received 2 answers" in text for text in logged))


@pytest.fixture
def tried(graph, monkeypatch):
    """The headers of requests that were answered in vain: those of as many clients as ``graph.unseen`` says.

    The node does not see these clients, as if they had left before it could.
    """
    unseen, tried = set(), []
    is_connected, send = ConnectedClients.is_connected, server._try_to_send

    def is_seen(presence, client):
        return client not in unseen and is_connected(presence, client)

    def first_are_unseen(header):
        client = clients.client_id(header)
        if len(unseen) < graph.unseen:
            unseen.add(client)
        return client

    def send_to_others(service, response, header):
        if clients.client_id(header) not in unseen:
            return send(service, response, header)
        tried.append(header)
        return False

    monkeypatch.setattr(ConnectedClients, "is_connected", is_seen)
    monkeypatch.setattr(server, "client_id", first_are_unseen)
    monkeypatch.setattr(server, "_try_to_send", send_to_others)
    monkeypatch.setattr(server, "MAX_DISCOVERY_TIME", 1.0)  # all requests must arrive within this time
    return tried


def test_an_unseen_client_that_left_is_tried_once(graph, tried):
    """Fast DDS blocks for a tenth of a second per answer to such a client, and everybody else waits."""
    graph.unseen = 1
    graph.serve()
    last = graph.diagnostics()
    _, client = another_client(graph)
    for _ in range(50):
        client.call_async(balls_meet())
    wait_until(lambda: last() and last()[1]["requests of clients that left"] == "49")
    assert len(tried) == 1
    assert last()[1]["requests waiting"] == "0"
    assert graph.call(balls_meet()).success


def test_many_unseen_clients_that_left_are_not_tried_one_after_another(graph, tried, monkeypatch):
    """A tenth of a second for each would add up. The next try is due after the test."""
    monkeypatch.setattr(server, "TRY_INTERVAL", 2 * DEADLINE)
    monkeypatch.setattr(server, "MAX_TIME_TO_TRY", 0.1)
    graph.unseen = 5
    graph.serve()
    last = graph.diagnostics()
    left = [another_client(graph)[1] for _ in range(graph.unseen)]
    for client in left:
        client.call_async(balls_meet())
    wait_until(lambda: last() and last()[1]["requests of clients that left"] == "4")
    assert len(tried) == 1
    assert last()[1]["requests waiting"] == "0"
    assert graph.call(balls_meet()).success


def test_a_departure_is_noticed_even_if_other_clients_arrive():
    """A new client triggers an immediate look, which must not hide an earlier departure."""
    there = {b"a" * 16}

    class Endpoints:
        def get_subscriptions_info_by_topic(self, *_, **__):
            return [SimpleNamespace(endpoint_gid=[*client, *bytes(8)]) for client in there]

    presence = ConnectedClients(Endpoints(), "/service")
    assert presence.is_connected(b"a" * 16)
    there.clear()
    there.add(b"b" * 16)
    wait_until(lambda: presence.is_connected(b"b" * 16))
    assert presence.take_departed() == {b"a" * 16}
    assert presence.take_departed() == set()
    assert not presence.is_connected(b"a" * 16)


def test_unseen_clients_are_forgotten_eventually():
    nobody = SimpleNamespace(get_subscriptions_info_by_topic=lambda *_, **__: [])
    presence = ConnectedClients(nobody, "/service")
    guests = [number.to_bytes(16, "big") for number in range(2 * clients.MAX_REMEMBERED)]
    for guest in guests:
        presence.note_reached(guest)
    assert presence.is_connected(guests[-1])
    assert not presence.is_connected(guests[0])


def test_requests_of_a_client_that_stays_are_not_dropped(graph):
    graph.serve(max_state_wait=1.0)
    futures = [graph.call_async(by_name(10)) for _ in range(5)]
    wait_until(lambda: all(future.done() for future in futures))
    assert {future.result().result.status.code for future in futures} == {StatusCode.STALE_STATE}


def test_a_waiting_request_is_resumed_under_constant_load(graph, monkeypatch):
    # far longer than the pauses between requests
    monkeypatch.setattr(server, "WAIT_CHECK_INTERVAL", 0.5)
    graph.serve(max_state_wait=0.2)
    waiting = graph.call_async(by_name(10))
    wait_until(lambda: graph.call(balls_meet()).success and waiting.done())
    assert waiting.result().result.status.code == StatusCode.STALE_STATE


def test_an_answer_that_cannot_be_sent_is_counted_and_harmless(graph, monkeypatch):
    """If a client stops reading and its history fills up, rcl raises, or rclpy warns of a timeout."""
    graph.serve()
    last = graph.diagnostics()
    assert graph.call(balls_meet()).success

    def raise_error():
        raise RCLError("failed to send response")

    for fail in (raise_error, partial(warnings.warn, "timeout")):
        failed = threading.Event()

        def send(*_, fail=fail, failed=failed):
            failed.set()
            fail()

        with monkeypatch.context() as patch:
            patch.setattr(Service, "send_response", send)
            graph.call_async(balls_meet())
            assert failed.wait(DEADLINE)
        assert graph.call(balls_meet()).success
    wait_until(lambda: last() and last()[1]["answers that could not be sent"] == "2")
    assert last()[1]["answers"] == "3"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (MemoryError, StatusCode.BUDGET_EXCEEDED),
        (RuntimeError("unable to create double__Sequence ros_message"), StatusCode.BUDGET_EXCEEDED),
        (RuntimeError, StatusCode.INTERNAL_ERROR),
    ],
)
def test_an_answer_too_large_to_send_becomes_a_refusal(graph, monkeypatch, error, code):
    """Otherwise this request and all others of the client would be left without an answer."""
    graph.serve()
    send, failures = Service.send_response, [error]

    def fail_once(*arguments):
        if failures:
            raise failures.pop()
        send(*arguments)

    monkeypatch.setattr(Service, "send_response", fail_once)
    futures = [graph.call_async(balls_meet()) for _ in range(3)]
    wait_until(lambda: all(future.done() for future in futures))
    assert [future.result().result.status.code for future in futures] == [code, StatusCode.OK, StatusCode.OK]


# the end


def unspun(graph):
    """A node that takes requests only in ``drain``."""
    return CollisionResponseNode(context=graph.context, namespace=graph.namespace)


@pytest.mark.parametrize("is_read", [True, False])
def test_what_is_not_answered_before_the_end_is_refused(graph, monkeypatch, is_read):
    monkeypatch.setattr(server, "DELIVERY_TIME", 0.0)
    node = unspun(graph)
    futures = [graph.call_async(make()) for make in (balls_meet, partial(falling, 1), partial(crowd, 2)) * 50]
    if is_read:
        counters = node._server._counters
        wait_until(lambda: node._server._take_requests() == 0 and counters.requests == len(futures))

    def refuse():
        assert node._server.drain(DEADLINE, DEADLINE) == 0
        return all(future.done() for future in futures)

    wait_until(refuse)
    node.destroy_node()
    responses = [future.result() for future in futures]
    for response in responses:
        status = response.result.status if hasattr(response, "result") else response
        assert not response.success
        assert (status.code, status.message) == (StatusCode.SHUTTING_DOWN, str(server.AT_SHUTDOWN))
    assert len(set(map(str, responses))) == 3  # one for each service, which says nothing of the request


@pytest.mark.parametrize("is_read", [True, False])
def test_at_the_end_a_client_that_left_is_tried_once(graph, monkeypatch, is_read):
    """Each answer to such a client would take a tenth of a second of those that others wait for."""
    monkeypatch.setattr(server, "DELIVERY_TIME", 0.0)
    node, tried, rounds = unspun(graph), [], []
    counters = node._server._counters
    _, client = another_client(graph)
    for _ in range(50):
        client.call_async(balls_meet())

    def fail(*_):
        tried.append(None)
        return False

    def end():
        before = counters.requests
        node._server.drain(DEADLINE, DEADLINE)
        rounds.extend([None] * (counters.requests > before))  # usually, all requests have arrived in one
        return counters.requests == 50

    with monkeypatch.context() as patch:
        patch.setattr(server, "_try_to_send", fail)
        patch.setattr(ConnectedClients, "is_connected", lambda *_: False)
        if is_read:
            wait_until(lambda: node._server._take_requests() == 0 and counters.requests == 50)
            node._server.drain(DEADLINE, DEADLINE)
        else:
            wait_until(end)
    assert len(tried) == max(1, len(rounds))
    assert counters.dropped == 50 - len(tried)
    node.destroy_node()


def test_requests_left_without_an_answer_are_counted(graph):
    node = unspun(graph)
    for _ in range(50):
        graph.call_async(balls_meet())
    left = 0

    def count():
        nonlocal left
        left += node._server.drain(0.0, 0.0)
        return left == 50

    wait_until(count)
    node.destroy_node()


# diagnostics


def test_diagnostics_count_answers_and_failures(graph):
    graph.serve()
    last = graph.diagnostics()
    bad = balls_meet()
    bad.contact.normal.x = 0.0
    for request in (balls_meet(), balls_meet(), bad):
        graph.call(request)
    wait_until(lambda: last() and last()[1]["requests"] == "3")
    status, values = last()
    assert (values["answered OK"], values["answered INVALID_NORMAL"]) == ("2", "1")
    assert 0 < float(values["latency p50 [ms]"]) <= float(values["latency max [ms]"])
    assert status.level == DiagnosticStatus.OK
    states = graph.publisher(BodyState, "body_states")
    states.publish(BodyState(name="x" * 5000))
    wait_until(lambda: last()[1]["states that could not be read"] == "1")
    assert last()[1]["states"] == "1"


@pytest.mark.parametrize("late", [0.0, 3.0])
def test_rates_are_per_elapsed_time(graph, monkeypatch, late):
    """A long computation delays the timer."""
    now, told = [100.0], []
    monkeypatch.setattr(diagnostics_module, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    counters = Counters()
    node = Node("nobody_spins_it", context=graph.context)
    states = LatestStates(1, lambda: 0, print, lambda: None, str)
    of_node = Diagnostics(node, counters, states, lambda: 0, lambda: 0)
    monkeypatch.setattr(of_node, "_publisher", SimpleNamespace(publish=told.append))
    counters.requests += 600
    counters.latencies.extend([0.001, 0.002, 0.003])
    states.lost, states.outdated, states.received = 3, 5, 7
    now[0] += PERIOD + late
    of_node._publish()
    (status,) = told[-1].status
    values = {value.key: value.value for value in status.values}
    assert float(values["requests per second"]) == 600 / (1.0 + late)
    assert values["answers per second"] == "0.0"
    assert (values["latency p50 [ms]"], values["latency max [ms]"]) == ("2", "3")
    assert (values["states lost on the way"], values["states older than the one known"]) == ("3", "5")
    assert (values["states"], values["bodies known"]) == ("7", "0")
    node.destroy_node()


@pytest.mark.parametrize(("word", "publishers"), [("off", 0), ("metadata", 1), ("contents", 1)])
def test_calls_can_be_introspected(graph, word, publishers):
    graph.serve(service_introspection=word)
    assert graph.call(balls_meet()).success
    wait_until(lambda: graph.node.count_publishers(f"{graph.service}/_service_event") == publishers)


def test_an_error_survives_pickling():
    error = ImpactError(StatusCode.INVALID_MASS, "body_a.mass", "must be positive")
    again = pickle.loads(pickle.dumps(error))
    assert (again.code, again.field, again.reason, str(again)) == (
        error.code,
        error.field,
        error.reason,
        str(error),
    )
    with multiprocessing.get_context("spawn").Pool(1) as pool, pytest.raises(ImpactError):
        pool.apply(_refused)


def _refused():
    raise ImpactError(StatusCode.INVALID_MASS, "body_a.mass", "must be positive")
