"""Which part of the package may import which, and what an import loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import collision_response

PACKAGE = Path(collision_response.__file__).parent
FRONT = "collision_response"
LAYERS = (
    {"named_enum", "numbers", "optional"},
    {"status", "strict_yaml"},
    {"arguments"},
    {"physics"},
    {"body_numbers", "model"},
    {"description", "geometry", "impact", "materials", "validity"},
    {"answer"},
    {"kernels"},
    {"in_python"},
    {"resolve"},
    {"requirements", "resolve_contact", "scene"},
    {FRONT},
    {"batch"},
    {"derivatives"},
    {"recording"},
    {"identify"},
    {"msg", "srv"},
    {"ros"},
    {"demo"},
    {"cli"},
)
"""Packages and single modules, from the bottom up. Each may import the layers below it and itself."""

HEIGHT = {unit: height for height, layer in enumerate(LAYERS) for unit in layer}
ONLY = {"status": {"named_enum"}, "physics": {"arguments", "named_enum", "numbers", "status"}}
"""Units that may import less than all layers below."""
FORBIDDEN = {"recording": {"batch", "kernels"}, "ros": {"kernels"}, "demo": {"kernels"}, "cli": {"kernels"}}
THIRD_PARTY = {
    "numbers": {"numpy", "flint"},
    "physics": {"typing_extensions"},  # for type checkers only
    "batch": {"cupy", "dask", "numpy", "torch"},
    "description": {"numpy"},
    "strict_yaml": {"yaml"},
    "identify": {"numpy", "scipy", "matplotlib", "rerun"},
    "derivatives": {"numpy"},
    "recording": {"numpy", "rerun", "pyarrow"},
}
"""Third-party packages that units below ROS may import."""


def unit_of(module: list[str]) -> str:
    """The unit (a package or a single module) that a module name belongs to."""
    first = module[0] if module else ""
    is_module = (PACKAGE / first).is_dir() or (PACKAGE / f"{first}.py").is_file()
    return first if first and is_module and first != "__init__" else FRONT


def imports(file: Path) -> tuple[list[list[str]], set[str]]:
    """Every module of this package that a file imports, and the names of third-party packages."""
    package = list(file.relative_to(PACKAGE).parts[:-1])
    own, others = [], set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package[: len(package) - node.level + 1]
            name = node.module.split(".") if node.module else []
            own += [base + name + [alias.name] for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            name = node.module.split(".")
            if name[0] == FRONT:
                own += [[*name[1:], alias.name] for alias in node.names]
            else:
                others.add(name[0])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                name = alias.name.split(".")
                if name[0] == FRONT:
                    own.append(name[1:])
                else:
                    others.add(name[0])
    return own, others - set(sys.stdlib_module_names)


def names(file: Path) -> list[str]:
    parts = list(file.relative_to(PACKAGE).with_suffix("").parts)
    return parts if len(parts) > 1 else ([] if parts == ["__init__"] else parts)


FILES = [file for file in sorted(PACKAGE.rglob("*.py")) if unit_of(names(file)) not in ("msg", "srv")]
each_file = pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))


@pytest.mark.parametrize("room", ["batch", "physics", "physics/laws", "ros", "scene"])
def test_a_room_lists_its_files(room):
    listed = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text()))
    names = {file.name for file in (PACKAGE / room).glob("*.py")} - {"__init__.py", "__main__.py"}
    assert [name for name in sorted(names) if name not in listed] == []


@each_file
def test_imports_go_downwards(file):
    unit = unit_of(names(file))
    assert unit in HEIGHT, "a new unit: say in which layer it is"
    for module in imports(file)[0]:
        other = unit_of(module)
        if other == unit:
            continue
        assert HEIGHT[other] < HEIGHT[unit], ".".join(module)
        assert unit not in ONLY or other in ONLY[unit], ".".join(module)
        assert other not in FORBIDDEN.get(unit, ()), ".".join(module)


@each_file
def test_only_listed_units_import_third_party_packages(file):
    unit = unit_of(names(file))
    if HEIGHT[unit] < HEIGHT["ros"]:
        assert imports(file)[1] <= THIRD_PARTY.get(unit, set())


@each_file
def test_formulas_have_the_same_bits_in_every_version_of_python(file):
    """Since 3.12, ``sum`` rounds sums of floats differently. Some constants of the kernels are sums."""
    if unit_of(names(file)) in ("impact", "numbers", "physics"):
        calls = (node.func for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call))
        assert "sum" not in {function.id for function in calls if isinstance(function, ast.Name)}


def test_the_oracle_shares_no_code():
    for file in (Path(__file__).parent / "oracle").glob("*.py"):
        assert FRONT not in file.read_text()


def run(program: str, directory: Path) -> list[str]:
    """Run a program in a fresh interpreter; return the words that it prints."""
    command = [sys.executable, "-c", program]
    result = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


def loaded_with(modules: list[str], directory: Path) -> set[str]:
    """All modules that a fresh interpreter has loaded after importing ``modules``."""
    return set(run(f"import sys, {', '.join(modules)}; print(*sys.modules)", directory))


ROS = {"rclpy", "geometry_msgs", "std_msgs", "collision_response.msg", "collision_response.srv"}


def test_an_import_loads_only_what_one_impact_needs(tmp_path):
    """python-flint is loaded where it is installed, because balls are numbers."""
    loaded = loaded_with(["collision_response"], tmp_path)
    assert not loaded & (ROS | {"rerun", "scipy", "dask", "torch", "mpmath", "matplotlib"})
    rooms = {name.split(".")[1] for name in loaded if name.startswith("collision_response.")}
    assert not rooms & {"batch", "derivatives", "identify", "recording", "ros", "demo"}
    assert not loaded & {"collision_response.kernels.layout", "collision_response.kernels.tracer"}


def test_only_the_build_loads_the_tracer(tmp_path):
    loaded = loaded_with(
        [f"collision_response.{room}" for room in ("batch", "scene", "derivatives")], tmp_path
    )
    assert "collision_response.kernels.tracer" not in loaded


def test_batches_load_no_array_library_except_numpy(tmp_path):
    loaded = loaded_with(["collision_response.batch"], tmp_path)
    assert not loaded & (ROS | {"rerun", "scipy", "dask", "torch"})


def test_recording_loads_no_ros_and_an_idle_node_loads_no_rerun(tmp_path):
    assert not loaded_with(["collision_response.recording"], tmp_path) & (ROS | {"rerun"})
    assert not loaded_with(["collision_response.ros.node"], tmp_path) & {"rerun", "pyarrow"}


READ_RECORDING = "from collision_response.recording import table"
COMMAND = "from collision_response.cli import main; main({})"
TABLE = "m,vz,nz,vz_after\n1,-1,1,0.5\n1,-2,1,1\n1,-3,1,1.5\n"
NODE = """
import rclpy
from rclpy.parameter import Parameter
from collision_response.ros.node import CollisionResponseNode

rclpy.init()
CollisionResponseNode(parameter_overrides=[Parameter("recording.enabled", value=True)]).destroy_node()
"""


RERUN = "'rerun-sdk>=0.39,<0.42'"


@pytest.mark.parametrize(
    ("absent", "program", "name", "package"),
    [
        *(
            pytest.param(absent, program, "rerun 0.39 to 0.41", RERUN, id=f"{what}-{'-'.join(absent)}")
            for absent in (["rerun"], ["pyarrow"], ["rerun", "pyarrow"])
            for what, program in {
                "table": f"try: {READ_RECORDING}\nexcept ImportError as error: print(error)",
                "Recorder": "from collision_response.recording import Recorder; from pathlib import Path; "
                "Recorder(Path(), print).close()",
                "node": NODE,
                "report": COMMAND.format(["report", "a.rrd"]),
                "replay": COMMAND.format(["replay", "a.rrd"]),
                "identify": COMMAND.format(["identify", "a.rrd"]),
            }.items()
        ),
        (["scipy"], COMMAND.format(["identify", "a.csv"]), "SciPy", "scipy"),
        (
            ["matplotlib"],
            COMMAND.format(["identify", "a.csv", "--resamples", "2", "--plot", "a.png"]),
            "matplotlib",
            "matplotlib",
        ),
        (
            ["yaml"],
            "from collision_response.materials import *\n"
            "try: Materials.read(PUBLISHED)\nexcept ImportError as error: print(error)",
            "PyYAML",
            "pyyaml",
        ),
    ],
)
def test_one_line_says_which_package_to_install(absent, program, name, package, tmp_path):
    if program == NODE:
        pytest.importorskip("rclpy")
    (tmp_path / "a.csv").write_text(TABLE)
    absences = f"import sys; sys.modules.update(dict.fromkeys({absent}))\n"
    command = [sys.executable, "-c", absences + program]
    said = subprocess.run(
        command, cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True
    ).stdout
    (line,) = (line for line in said.splitlines() if "collision_response needs" in line)
    assert line.endswith(f"collision_response needs {name} for this: pip install {package}")
    assert "Traceback" not in said


WITHOUT = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in BLOCKED:
            raise ImportError(name)

sys.meta_path.insert(0, Blocked())

from collision_response import *

ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0.0, 0.1, 1.0), None, (0.1, 0.0, -2.0))
contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=0.5, friction=0.3)
for law in Law:
    for precision in (Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED):
        assert resolve(ball, Body.static(), contact, ImpactModel(law, precision=precision)).impulse.z > 2
exact = resolve(ball, Body.static(), contact, ImpactModel(precision=Precision.EXTENDED, tolerance=1e-15))
assert exact.status is StatusCode.OK
print(resolve(ball, Body.static(), contact, ImpactModel(tolerance=1e-17)).status.name)
"""


def test_one_impact_needs_no_other_package(tmp_path):
    blocked = {"flint", "numpy", "rclpy", "geometry_msgs", "rerun", "scipy", "mpmath", "dask", "torch"}
    assert run(f"BLOCKED = {blocked}\n{WITHOUT}", tmp_path) == ["TOLERANCE_NOT_MET"]


def test_batches_need_only_numpy(tmp_path):
    blocked = {"flint", "rclpy", "geometry_msgs", "rerun", "scipy", "mpmath", "dask", "torch"}
    batch = """
import numpy as np
from collision_response.batch import body_rows, contact_rows, resolve_batch

of, at = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
bodies, contacts = np.zeros((of.height, 2, 3)), np.zeros((at.height, 3))
bodies[of.mass], bodies[of.velocity, 0], contacts[at.normal] = 1.0, -1.0, 1.0
print(*resolve_batch(bodies, contacts, ImpactModel(Law.FRICTIONLESS, precision=Precision.EXTENDED)).status)
"""
    assert run(f"BLOCKED = {blocked}\n{WITHOUT}{batch}", tmp_path)[1:] == ["1", "1", "1"]
