"""The commands and examples in the README work."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import yaml
from ros_graph import assign

from collision_response.cli import main
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
def test_the_examples_run(node, code):
    run = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=60)
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


def _leaves(tree, path=""):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value
