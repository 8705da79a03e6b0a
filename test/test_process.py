"""The node as a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from ros_graph import DEADLINE, balls_meet

NODE = Path(__file__).resolve().parent.parent / "scripts" / "collision_response_node"


@pytest.fixture
def start(graph):
    """Start the node's executable with ROS arguments, in the namespace of the graph."""
    processes = []

    def start(*arguments):
        command = [sys.executable, str(NODE), "--ros-args", "-r", f"__ns:={graph.namespace}", *arguments]
        processes.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_it_answers_another_process_and_ends_on_a_signal(graph, start, number):
    node = start()
    assert graph.call(balls_meet()).result.twist_a.linear.x == 2.0

    node.send_signal(number)

    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 0
    assert "Traceback" not in stderr
    assert f"serving {graph.service}" in stderr


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (("-p", "restitution:=2.0"), "restitution"),
        (("-p", "body_state_topics:=[a b]"), "a b"),
        (
            ("-p", "recording.file:=../../x.rrd"),
            "must be a plain file name, without a directory; is '../../x.rrd'",
        ),
    ],
)
def test_a_start_that_is_not_allowed_is_one_line(start, arguments, shown):
    node = start(*arguments)
    _, stderr = node.communicate(timeout=DEADLINE)
    assert node.returncode == 1
    assert "Traceback" not in stderr
    assert shown in stderr.splitlines()[-1], stderr
