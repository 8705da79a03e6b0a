"""What ros2 launch, ros2 run and ros2 pkg find and start."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

pytest.importorskip("nav_msgs")

from ros_graph import DEADLINE, balls_meet, wait_until

import collision_response
from collision_response.ros import markers, parameters, sources
from collision_response.ros.node import CollisionResponseNode

ROOT = Path(__file__).resolve().parent.parent
NODES = {
    "collision_response": parameters.DECLARATIONS,
    "collision_response_states": sources.DECLARATIONS,
    "collision_response_markers": markers.DECLARATIONS,
}
CONFIG = ROOT / "config" / "collision_response.yaml"
LAUNCH = ROOT / "launch" / "collision_response.launch.py"


@pytest.fixture
def prefix(monkeypatch):
    """Where the package is installed; ament looks there, and the shell for its Python."""
    index = "share/ament_index/resource_index/packages/collision_response"
    prefix = next(up for up in Path(collision_response.__file__).parents if (up / index).is_file())
    for variable, path in (("AMENT_PREFIX_PATH", prefix), ("PATH", Path(sys.executable).parent)):
        monkeypatch.setenv(variable, str(path), prepend=os.pathsep)
    return prefix


def test_the_parameter_file_lists_every_parameter_with_its_default_and_description():
    text = CONFIG.read_text()
    assert yaml.safe_load(text) == {
        f"/**/{node}": {"ros__parameters": {d.name: d.default for d in declarations}}
        for node, declarations in NODES.items()
    }
    for node, declarations in NODES.items():
        section = text.partition(f"/**/{node}:\n")[2]
        for declared in declarations:
            assert f"    # {declared.full_description()}\n    {declared.name}: " in section


def test_the_node_starts_with_the_parameter_file(graph, tmp_path):
    """In any namespace, and with a changed value."""
    file = tmp_path / "mine.yaml"
    file.write_text(CONFIG.read_text().replace("restitution: 1.0", "restitution: 0.25"))
    arguments = ["--ros-args", "--params-file", str(file)]
    node = CollisionResponseNode(context=graph.context, namespace=graph.namespace, cli_args=arguments)
    graph.add(node)
    assert node.get_parameter("restitution").value == 0.25
    assert node.get_parameter("recording.max_size").value == 50.0
    request = balls_meet()
    request.contact.restitution = -1.0
    assert graph.call(request).result.contact.restitution == 0.25


def test_tools_find_the_package_and_its_executables(prefix):
    """The way ``ros2 pkg executables`` does: by the ament index, then by executable files."""
    index = pytest.importorskip("ament_index_python")
    assert index.get_package_prefix("collision_response") == str(prefix)
    executables = Path(prefix, "lib", "collision_response")
    found = {file.name for file in executables.iterdir() if os.access(file, os.X_OK)}
    assert found == {file.name for file in (ROOT / "scripts").iterdir()}
    share = Path(index.get_package_share_directory("collision_response"))
    for file in (CONFIG, LAUNCH):
        assert (share / file.relative_to(ROOT)).read_text() == file.read_text()


def test_the_executables_in_the_launch_file_exist():
    calls = [node for node in ast.walk(ast.parse(LAUNCH.read_text())) if isinstance(node, ast.Call)]
    started = {call.args[0].value for call in calls if getattr(call.func, "id", "") == "node"}
    assert started == {"collision_response_node", "collision_response_states", "collision_response_markers"}
    assert started <= {file.name for file in (ROOT / "scripts").iterdir()}


LAUNCHES = """
import sys

from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

file, *arguments = sys.argv[1:]
pairs = [argument.split(":=") for argument in arguments]
included = IncludeLaunchDescription(PythonLaunchDescriptionSource(file), launch_arguments=pairs)
service = LaunchService()
service.include_launch_description(LaunchDescription([included]))
sys.exit(service.run())
"""


if find_spec("launch_ros"):  # there is no wheel of it: it is there only where ROS is installed

    def test_the_launch_file_runs(graph, prefix):
        command = [sys.executable, "-c", LAUNCHES, str(LAUNCH), f"namespace:={graph.namespace}"]
        with subprocess.Popen(
            [*command, "states:=true", "markers:=true"], start_new_session=True
        ) as launched:
            assert graph.call(balls_meet()).result.twist_a.linear.x == 2.0
            there = {(name, graph.namespace) for name in NODES}
            wait_until(lambda: there <= set(graph.user.get_node_names_and_namespaces()))
            os.killpg(launched.pid, signal.SIGINT)  # Ctrl-C is for all of them
            assert launched.wait(DEADLINE) == 0
