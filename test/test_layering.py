"""Who may import whom: downwards only."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import collision_response

PACKAGE = Path(collision_response.__file__).parent
CORE = {"", "physics", "numerics"}
MAY_IMPORT = {
    "numerics": {"physics", "numerics", "status"},
    "physics": {"physics", "numerics", "status"},
    "": CORE,
    "recording": CORE | {"recording"},
    "ros": CORE | {"batch", "recording", "ros", "msg", "srv"},
}
"""For each room the rooms it may import; ``""`` are the modules on top, with ``status`` for one of them."""


def room_of(module: list[str]) -> str:
    """The room of a module given by the parts of its name after the package's."""
    return module[0] if module and (PACKAGE / module[0]).is_dir() else ""


def imports(file: Path) -> list[list[str]]:
    """Every module of this package that a file imports."""
    package = list(file.relative_to(PACKAGE).parts[:-1])
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = (node.module or "").split(".") if node.module else []
            if node.level:
                found += [base + name + [alias.name] for alias in node.names]
            elif name[:1] == ["collision_response"]:
                found += [[*name[1:], alias.name] for alias in node.names]
        elif isinstance(node, ast.Import):
            names = (alias.name.split(".") for alias in node.names)
            found += [name[1:] for name in names if name[0] == "collision_response"]
    return found


FILES = [
    file
    for file in sorted(PACKAGE.rglob("*.py"))
    if room_of(list(file.relative_to(PACKAGE).parts)) in MAY_IMPORT
]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_imports_go_downwards(file):
    allowed = MAY_IMPORT[room_of(list(file.relative_to(PACKAGE).parts))]
    for module in imports(file):
        room = room_of(module)
        assert room in allowed or module[0] in allowed, ".".join(module)


def strangers_among(modules: list[str], names: list[str], directory: Path) -> list[str]:
    """Those of ``names`` that a fresh interpreter has loaded after importing ``modules``."""
    program = f"import sys, {', '.join(modules)}; print(*[name for name in {names} if name in sys.modules])"
    command = [sys.executable, "-c", program]
    result = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=True)
    return result.stdout.split()


def test_the_core_and_the_recording_know_no_ros_and_load_no_rerun(tmp_path):
    rooms = [
        "collision_response",
        *(f"collision_response.{room}" for room in ("physics", "numerics", "recording")),
    ]
    assert (
        strangers_among(rooms, ["rclpy", "geometry_msgs", "collision_response.msg", "rerun"], tmp_path) == []
    )


def test_a_node_that_does_not_record_loads_no_rerun(tmp_path):
    pytest.importorskip("rclpy")
    assert strangers_among(["collision_response.ros.node"], ["rerun", "pyarrow"], tmp_path) == []
