"""The commands and examples in README.md and docs/ros.md work."""

from __future__ import annotations

import ast
import re
from operator import attrgetter
from pathlib import Path

import pytest
from programs import run_python

pytest.importorskip("rclpy")
pytest.importorskip("nav_msgs")

from types import SimpleNamespace

import yaml
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, Twist
from ros_graph import assign, state_of, wait_until

from collision_response import Body, StatusCode
from collision_response.cli import main
from collision_response.model import ENUMERATIONS
from collision_response.msg import BodyState
from collision_response.ros import markers, parameters, sources
from collision_response.ros.parameters import DECLARATIONS
from collision_response.srv import ResolveCollision

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.fixture
def node(graph):
    """A node under its usual name, which the README's client looks for."""
    graph.namespace = "/"
    graph.serve()
    return graph


@pytest.mark.parametrize("code", PYTHON, ids=["library", "client", "batch", "scene"])
def test_the_examples_of_the_readme_run(node, code):
    run = run_python("-c", code)
    (promised,) = re.findall(r"^print.*  # (.*)$", code, re.MULTILINE)
    assert (run.returncode, run.stdout.strip()) == (0, promised), run.stderr


def test_the_service_call_is_a_valid_request(shared_node):
    (text,) = re.findall(r'ResolveCollision "(.*?)"\n', README, re.DOTALL)
    request = ResolveCollision.Request()
    for path, value in _leaves(yaml.safe_load(text)):
        assign(request, path, value)
    assert shared_node.call(request).result.twist_a.linear.z == 1.5


def test_the_command_line_answers_as_shown(node, capsys):
    (typed,) = re.findall(r"collision_response call '(.*?)'\n", README, re.DOTALL)
    (shown,) = re.findall(r"```text\n(.*?)```", README, re.DOTALL)
    assert main(["call", typed]) == 0
    assert capsys.readouterr().out == shown


def test_every_parameter_is_listed_with_its_default():
    page = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| `([\w.]+)` \| `(.*?)` \|", page, re.MULTILINE))
    assert {name: ast.literal_eval(default) for name, default in listed.items()} == {
        declaration.name: declaration.default for declaration in DECLARATIONS
    }


@pytest.mark.parametrize("name", ENUMERATIONS)
def test_every_choice_of_a_model_is_listed(name):
    page = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| `{name}` \|.*$", page, re.MULTILINE)
    assert set(re.findall(r"`(\w+)`", row)) - {name} == set(parameters.CHOICES[name])


def _leaves(tree, path=""):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


ROS_PAGE = (ROOT / "docs" / "ros.md").read_text()


def xyz(*numbers: float) -> SimpleNamespace:
    return SimpleNamespace(**dict(zip("xyz", numbers, strict=True)))


def example_with(what: str) -> dict:
    """The names that the only Python example containing this text defines."""
    (code,) = [code for code in re.findall(r"```python\n(.*?)```", ROS_PAGE, re.DOTALL) if what in code]
    names = {}
    exec(code, names)
    return names


def test_gazebo_model_states_become_body_states(graph):
    """Shaped like gazebo_msgs/ModelStates: a crate falls on the ground, whose mass is unknown."""
    models = SimpleNamespace(name=["ground", "crate"], pose=[Pose(), Pose()], twist=[Twist(), Twist()])
    models.pose[1].position.z, models.twist[1].linear.z = 1.5, -2.0
    graph.serve()
    publisher = graph.user.create_publisher(BodyState, "body_states", 10)
    request = ResolveCollision.Request()
    request.contact.body_a, request.contact.header.frame_id = "crate", "world"
    request.body_b.header.frame_id, request.body_b.motion_type = "world", BodyState.STATIC
    request.contact.normal.z, request.contact.restitution = 1.0, 0.5
    (state,) = example_with("def states")["states"](models, Time(sec=7))

    def ask():
        publisher.publish(state)
        result = graph.call(request).result
        return result if result.status.code != StatusCode.UNKNOWN_BODY else None

    result = wait_until(ask)
    assert result.twist_a.linear.z == 1.0
    assert (result.impulse.z, state.inertia.com.z, state.header.stamp.sec) == (9.0, -0.5, 7)


def test_gazebo_contacts_become_a_request(graph):
    """Shaped like ros_gz_interfaces/Contacts: a cube, known by name, lands flat at e = 1."""
    names = example_with("def request_of")
    corners = [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    contact = SimpleNamespace(
        collision1=SimpleNamespace(name="crate::link::collision"),
        collision2=SimpleNamespace(name="ground_plane::link::collision"),
        positions=[xyz(*corner) for corner in corners],
        normals=[xyz(0.0, 0.0, 1.0)] * 4,
    )
    graph.serve(restitution=1.0)
    states = graph.user.create_publisher(BodyState, "body_states", 10)
    state = state_of(Body.box(1.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=(0.0, 0.0, -1.0)))
    state.name = "crate"

    def ask():
        states.publish(state)
        response = graph.call(names["request_of"](SimpleNamespace(contacts=[contact])))
        return response.result if response.success else None

    result = wait_until(ask)
    assert list(result.body_names) == ["ground_plane", "crate"]
    assert result.twists[1].linear.z == pytest.approx(1.0)
    assert sum(impulse.z for impulse in result.impulses) == pytest.approx(2.0)


def test_the_request_of_the_example_in_cpp_is_answered_as_it_says(shared_node):
    (code,) = re.findall(r"```cpp\n(.*?)```", ROS_PAGE, re.DOTALL)
    request = ResolveCollision.Request()
    for path, value in re.findall(r"request->([\w.]+) = (.*);", code):
        _, is_constant, name = value.partition("BodyState::")
        assign(request, path, getattr(BodyState, name) if is_constant else float(value))
    ((path, promised),) = re.findall(r"get\(\)->([\w.]+)\);  // (.*)", code)
    assert attrgetter(path)(shared_node.call(request)) == float(promised)


def test_the_service_call_of_the_ros_page_is_a_valid_request():
    (text,) = re.findall(r'ResolveCollision "(.*?)"\n', ROS_PAGE, re.DOTALL)
    request = ResolveCollision.Request()
    for owner, fields in yaml.safe_load(text).items():
        for field, value in fields.items():
            for name, number in value.items() if isinstance(value, dict) else [("", value)]:
                assign(request, f"{owner}.{field}.{name}".rstrip("."), number)
    assert (request.contact.body_a, request.body_b.motion_type) == ("base_footprint", BodyState.STATIC)


def test_the_parameters_that_the_ros_page_names_exist():
    known = {declared.name for room in (sources, markers, parameters) for declared in room.DECLARATIONS}
    assert set(re.findall(r"-p '?(\w+):=", ROS_PAGE)) <= known
    assert set(re.findall(r"param set /collision_response_markers (\w+)", ROS_PAGE)) <= known
