"""The node as a separate process."""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import rclpy
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.node import Node
from rclpy.task import Future
from ros_graph import DEADLINE, balls_meet, falling, wait_until

from collision_response import Body, Contact, ImpactModel, Law, StatusCode
from collision_response.ros.node import CollisionResponseNode
from collision_response.ros.process import spin
from collision_response.ros.scene_client import pack

JAZZY = os.environ.get("ROS_DISTRO") == "jazzy"
FAST_DDS = "FASTRTPS_DEFAULT_PROFILES_FILE" if JAZZY else "FASTDDS_DEFAULT_PROFILES_FILE"
NODE = Path(__file__).resolve().parent.parent / "scripts" / "collision_response_node"


@pytest.fixture
def start(graph):
    """Start the node in a process in the namespace of the graph; ``before`` is a command that runs it."""
    processes = []

    def start(*arguments, before=()):
        command = [*before, sys.executable, str(NODE), "--ros-args", "-r", f"__ns:={graph.namespace}"]
        command += arguments
        processes.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize(
    "number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name
)
def test_it_answers_another_process_and_ends_on_a_signal(graph, start, number):
    node = start(before=("env", "--default-signal"))  # `nohup make test` has SIGHUP ignored
    assert graph.call(balls_meet()).result.twist_a.linear.x == 2.0

    node.send_signal(number)

    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 0
    assert "Traceback" not in stderr
    scene = f"{graph.namespace}/collision_response/resolve_scene"
    assert f"serving {graph.service}, {graph.service}_batch, {scene}; " in stderr


def test_signals_ignored_at_the_start_stay_ignored(graph, start):
    """As under ``nohup``. SIGINT still ends a node that a shell starts in the background."""
    node = start(before=("sh", "-c", "trap '' HUP INT; exec \"$@\"", "sh"))
    assert graph.call(balls_meet()).success
    status = Path(f"/proc/{node.pid}/status").read_text()
    ignored = int(re.search(r"^SigIgn:\s*(\w+)$", status, re.MULTILINE)[1], 16)
    assert [bool(ignored >> number - 1 & 1) for number in (signal.SIGHUP, signal.SIGINT)] == [True, False]
    node.send_signal(signal.SIGINT)
    node.communicate(timeout=DEADLINE)
    assert node.returncode == 0


@pytest.mark.parametrize("closed", ["<&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_it_needs_no_standard_streams(graph, start, tmp_path, closed):
    """Otherwise its own pipe could get their file numbers, and log output would end the node."""
    pytest.importorskip("rerun")
    from collision_response.recording.table import read

    recording = ("-p", "recording.enabled:=true", "-p", f"recording.directory:={tmp_path}")
    busy = ("-p", "shutdown_timeout:=60.0")  # on a busy machine, importing rerun takes seconds
    node = start(*recording, *busy, before=("sh", "-c", f'exec "$@" {closed}', "sh"))
    assert graph.call(balls_meet()).success
    node.send_signal(signal.SIGTERM)
    node.communicate(timeout=DEADLINE)
    assert node.returncode == 0
    assert read(tmp_path.glob("*.rrd")).num_rows == 1


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (("-p", "restitution:=2.0"), "restitution"),
        (("-p", "restitution:=1"), "restitution: write it with a point, as in 1.0"),
        (("-p", "service_introspection:=off"), "service_introspection: must be text, but YAML reads False: "),
        (("-p", "body_state_topics:=[a b]"), "a b"),
        (("--params-file", "/nowhere/to/be/found.yaml"), "found.yaml"),
        (("-p", "=1"), "=1"),
        (("-p", "memory_limit:=1"), "memory_limit: is 1 MiB, but the node needs "),
        # Enough for the node itself, but not for rerun.
        (
            ("-p", "memory_limit:=450", "-p", "recording.enabled:=true"),
            "memory_limit: is 450 MiB, but the node",
        ),
        (
            ("-p", "body_state_topics:=[]"),
            "body_state_topics: an empty list has no type: write [''] for none",
        ),
        (
            ("-p", "body_state_topics:=[all_body_states]"),
            "/all_body_states is the topic of tables of states, BodyStates",
        ),
        (("bogus", "--bogus"), "unknown arguments: ['bogus', '--bogus']"),
        (("-p", b"world_frame:=\xff"), r"an argument is not text in UTF-8: 'world_frame:=\udcff'"),
        (
            ("-p", "recording.file:=../../x.rrd"),
            "must be a plain file name, without a directory; is '../../x.rrd'",
        ),
        (("-p", "recording.file:=demo"), "recording.file must end in .rrd; is 'demo'"),
    ],
)
def test_an_invalid_start_ends_with_one_line(start, arguments, shown):
    node = start(*arguments)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 1
    assert "Traceback" not in stderr
    assert shown in stderr.splitlines()[-1], stderr


def test_a_start_without_memory_neither_serves_nor_records(start, tmp_path):
    recording = ("-p", "recording.enabled:=true", "-p", f"recording.directory:={tmp_path / 'made'}")
    _, stderr = start("-p", "memory_limit:=10", *recording).communicate(timeout=DEADLINE)
    assert "serving" not in stderr and "memory_limit: is 10 MiB" in stderr
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("given", "meant"), [("restitutoin", "restitution"), ("recording.enable", "recording.enabled")]
)
def test_an_unknown_parameter_is_warned_about(graph, start, given, meant):
    node = start("-p", f"{given}:=0.5", "-p", "friction:=0.25")
    request = balls_meet()
    request.contact.friction = -1.0
    assert graph.call(request).result.contact.friction == 0.25
    node.send_signal(signal.SIGTERM)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert stderr.count("there is no parameter") == 1
    assert f"there is no parameter '{given}'; did you mean '{meant}'?" in stderr


def test_received_requests_are_answered_before_the_end(graph, start):
    node = start("-p", "shutdown_timeout:=600.0")
    assert graph.call(balls_meet()).success
    futures = [graph.call_async(balls_meet()) for _ in range(100)]
    wait_until(futures[0].done)
    node.send_signal(signal.SIGTERM)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 0, stderr
    wait_until(lambda: all(future.done() for future in futures))
    assert all(future.result().success for future in futures)


HANGS = """
import sys
import threading

from rclpy.node import Node

from collision_response.ros.node import main

Node.destroy_node = lambda _: threading.Event().wait()
sys.exit(main())
"""


def test_the_node_ends_in_time_even_if_the_middleware_hangs(graph, tmp_path):
    command = [sys.executable, "-c", HANGS, "--ros-args", "-r", f"__ns:={graph.namespace}"]
    command += ["-p", "shutdown_timeout:=0.5"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as node:
        assert graph.call(balls_meet()).success
        node.send_signal(signal.SIGTERM)
        _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 1
    assert "Timeout" in stderr and "in shut_down" in stderr


def test_an_error_in_a_callback_is_logged_once_and_ends_nothing(graph, capfd):
    node, stop, calls = Node("faulty", context=graph.context), Future(), []

    def fail():
        calls.append(None)
        if len(calls) == 10:
            stop.set_result(None)
        raise ValueError("77 is not a valid type")

    node.create_timer(0.0, fail)
    spin(node, stop)
    node.destroy_node()
    assert len(calls) == 10
    logged = capfd.readouterr().err
    assert logged.count("Traceback") == logged.count("ValueError: 77 is not a valid type") == 1


def test_a_parameter_of_an_unknown_type_is_harmless(graph):
    node, stop = CollisionResponseNode(context=graph.context, namespace=graph.namespace), Future()
    spinning = threading.Thread(target=spin, args=(node, stop))
    spinning.start()
    try:
        client = graph.user.create_client(SetParameters, f"{node.get_fully_qualified_name()}/set_parameters")
        wait_until(client.service_is_ready)
        odd = ParameterMessage(name="friction", value=ParameterValue(type=77))
        client.call_async(SetParameters.Request(parameters=[odd]))
        good = ParameterMessage(name="friction", value=ParameterValue(type=3, double_value=0.5))
        answer = client.call_async(SetParameters.Request(parameters=[good]))
        wait_until(answer.done)
        assert answer.result().results[0].successful
    finally:
        stop.set_result(None)
        spinning.join(DEADLINE)
        node.destroy_node()


def test_it_ends_when_the_context_is_shut_down(ros_domain):
    context = Context()
    rclpy.init(context=context)
    node = Node("ends", context=context)
    node.create_timer(0.0, context.try_shutdown)
    spin(node, Future())
    assert not context.ok()


SHARES = """
from pathlib import Path

import rclpy

rclpy.init()
node = rclpy.create_node("shares")
print("/dev/shm/fast" in Path("/proc/self/maps").read_text())
rclpy.shutdown()
"""
PROFILE = NODE.parent.parent / "config" / ("fast_dds_2.xml" if JAZZY else "fast_dds.xml")


@pytest.mark.parametrize(("profile", "shares"), [({}, "True"), ({FAST_DDS: str(PROFILE)}, "False")])
def test_the_profile_disables_shared_memory(ros_domain, tmp_path, profile, shares):
    """Discovery must not be restricted to this machine: then rmw_fastrtps chooses the transports itself."""
    environment = {name: value for name, value in os.environ.items() if name != FAST_DDS} | profile
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
    run = subprocess.run(
        [sys.executable, "-c", SHARES],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=DEADLINE,
        check=True,
    )
    assert (run.stdout.strip(), run.stderr) == (shares, "")


def test_a_scene_beyond_the_shutdown_timeout_is_abandoned(graph, start):
    """A tower of 300 balls with masses up to 1e6 apart takes several seconds."""
    node = start("-p", "shutdown_timeout:=1.0", "-p", "budget.scene_contacts:=4096")
    assert graph.call(balls_meet()).success
    draw, last = random.Random(3), graph.diagnostics()
    spheres = [
        Body.sphere(10 ** draw.uniform(-3, 3), 0.5, position=(0, 0, i + 0.5), velocity=(0, 0, -draw.random()))
        for i in range(300)
    ]
    contacts = [Contact.of((0, 0, i), (0, 0, 1), 0.5, 0.3) for i in range(len(spheres))]
    pairs = [(i + 1, i) for i in range(len(spheres))]
    long = graph.call_async(pack([Body.static(), *spheres], pairs, contacts, ImpactModel(Law.COULOMB)))
    wait_until(lambda: last() and last()[1]["requests waiting"] == "1")
    node.send_signal(signal.SIGTERM)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 0, stderr
    assert "most recent call first" not in stderr
    wait_until(long.done)
    assert long.result().result.status.code == StatusCode.SHUTTING_DOWN


def test_requests_beyond_the_shutdown_timeout_are_refused(graph, start):
    node = start("-p", "shutdown_timeout:=5.0")
    assert graph.call(balls_meet()).success
    last = graph.diagnostics()
    long = graph.call_async(falling(50_000, ImpactModel(tolerance=1e-30)))
    wait_until(lambda: last() and last()[1]["requests waiting"] == "1")
    node.send_signal(signal.SIGTERM)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 0, stderr
    wait_until(long.done)
    assert long.result().code == StatusCode.SHUTTING_DOWN
    assert long.result().message.startswith("node: is shutting down")
