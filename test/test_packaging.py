"""ROS wheels are pinned to one release wherever they are named, and mixtures are refused."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import threading
from importlib import metadata
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

import collision_response

ROOT = Path(__file__).resolve().parent.parent
RELEASES = ROOT / "tools" / "ros"
DEADLINE = 20.0  # seconds
PIN = re.compile(r"(ros-[\w-]+)(\[\w+\])?==(\d+\.\d+)\.\*")


def pins(text: str) -> dict[str, str]:
    return {name: series for name, _, series in PIN.findall(text)}


def wheels(release: str) -> dict[str, str]:
    """Versions of all wheels of a release, as a user may have them."""
    return {name: f"{series}.9" for name, series in pins((RELEASES / f"{release}.txt").read_text()).items()}


@pytest.mark.parametrize(
    "file", ["pyproject.toml", "tools/setup_venv.py", *map(str, sorted(RELEASES.iterdir()))]
)
def test_every_ros_wheel_is_pinned_to_its_release(file):
    """``~=5.5`` is not a pin: it accepts any 5.x, and so the next release."""
    text = re.sub(r"#.*", "", (ROOT / file).read_text())
    named = set(re.findall(r"\bros-[\w-]+", text)) - {"ros-releases"}
    assert named == set(pins(text)) != set()


def test_pip_builds_with_kilted():
    kilted = wheels("kilted") | {"ros-domain-coordinator": "0.12.9"}
    named = pins((ROOT / "pyproject.toml").read_text())
    assert named == {name: kilted[name].removesuffix(".9") for name in named}


def test_an_sdist_holds_what_the_build_reads(monkeypatch):
    """Besides what pip adds by itself."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import setup_venv

    held = {"setup.py", *(ROOT / "MANIFEST.in").read_text().split()}
    assert held >= {*setup_venv.BUILD_INPUTS, *setup_venv.SHARED, setup_venv.PACKAGE.name, "tools"}


def test_no_version_belongs_to_two_releases():
    """Otherwise a mixture could pass for either."""
    kilted, jazzy = wheels("kilted"), wheels("jazzy")
    assert not {name for name in kilted if jazzy.get(name) == kilted[name]}


def test_ros_tools_read_the_package_and_its_changelog():
    """The release tools take the newest entry for the version of the package."""
    changelog = pytest.importorskip("catkin_pkg.changelog")
    from catkin_pkg.package import parse_package

    warnings: list[str] = []
    package = parse_package(str(ROOT), warnings=warnings)
    released = [version for version, _, _ in changelog.get_changelog_from_path(str(ROOT)).foreach_version()]
    assert (released[0], warnings) == (package.version, [])


def made_elsewhere(ninja, cache):
    cache.write_text(
        cache.read_text().replace("_CACHEFILE_DIR:INTERNAL=", "_CACHEFILE_DIR:INTERNAL=/elsewhere")
    )


def test_an_update_keeps_the_bytecode_of_modules_and_removes_modules_that_are_gone(tmp_path, monkeypatch):
    """A node that runs in another terminal may write its bytecode: the directory could not be removed."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import setup_venv

    kept = [tmp_path / "physics" / "__pycache__" / "body.pyc", tmp_path / "msg" / "_contact.py"]
    gone = [tmp_path / "physics" / "gone.py", tmp_path / "gone" / "__pycache__" / "gone.pyc"]
    for file in (*kept, *gone):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    setup_venv.link_python(tmp_path, [])
    assert [file.exists() for file in (*kept, *gone)] == [True, True, False, False]
    assert not (tmp_path / "gone").exists()
    assert (tmp_path / "physics" / "body.py").samefile(ROOT / "collision_response" / "physics" / "body.py")


@pytest.mark.parametrize("spoil", [lambda ninja, _: ninja.unlink(), made_elsewhere], ids=["gone", "copied"])
def test_environments_of_one_python_share_the_kernels(tmp_path, monkeypatch, spoil):
    """Otherwise each would recompile them and replace those of the others. A build that lost its ninja with
    its environment is made again, and so is one that was copied: it would compile the sources of its origin.
    """
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import setup_venv

    monkeypatch.setattr(setup_venv, "ROOT", tmp_path)
    kernels = setup_venv.Kernels(setup_venv.Environment(".second"))
    ninja, module = tmp_path / ".first" / "bin" / "ninja", kernels.path / "_compiled.so"
    for file in (ninja, module, kernels.path / "build.ninja"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    ninja.write_text("#!/bin/sh\n")
    ninja.chmod(0o755)
    cache = kernels.path / "CMakeCache.txt"
    cache.write_text(f"CMAKE_MAKE_PROGRAM:FILEPATH={ninja}\nCMAKE_CACHEFILE_DIR:INTERNAL={kernels.path}\n")
    assert kernels.wait(kernels.start()) == [module]
    spoil(ninja, cache)
    assert kernels.start().wait() != 0
    assert not module.exists()


def test_a_build_of_the_kernels_waits_for_another_one(tmp_path, monkeypatch):
    """Such as compilers that go on after a build was killed: both together would spoil ninja's records."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import setup_venv

    monkeypatch.setattr(setup_venv, "ROOT", tmp_path)
    kernels = setup_venv.Kernels(setup_venv.Environment(".venv"))
    ninja, log, gates = kernels.path / "ninja", tmp_path / "log", [tmp_path / "gate1", tmp_path / "gate2"]
    kernels.path.mkdir(parents=True)
    (kernels.path / "build.ninja").touch()
    (kernels.path / "CMakeCache.txt").write_text(
        f"CMAKE_MAKE_PROGRAM:FILEPATH={ninja}\nCMAKE_CACHEFILE_DIR:INTERNAL={kernels.path}\n"
    )
    ninja.write_text(
        f"#!/bin/sh\necho begin >> {log}\n"
        f"read line < {tmp_path}/gate$(grep -c begin {log})\necho end >> {log}\n"
    )
    ninja.chmod(0o755)
    for gate in gates:
        os.mkfifo(gate)
    waits = threading.Event()

    def told(text, **_):
        assert "waiting for another build of the kernels" in text
        waits.set()

    monkeypatch.setattr(setup_venv, "print", told, raising=False)
    builds = [kernels.start()]
    second = threading.Thread(target=lambda: builds.append(kernels.start()))
    second.start()
    assert waits.wait(DEADLINE)
    for gate in gates:
        gate.write_text("go on\n")
    second.join()
    assert [build.wait() for build in builds] == [0, 0]
    assert log.read_text().split() == ["begin", "end"] * 2


@pytest.mark.parametrize("file", ["config/fast_dds.xml", "config/fast_dds_2.xml", "security/policy.xml"])
def test_configuration_files_are_installed_where_ros_looks(file):
    prefixes = Path(collision_response.__file__).parents
    (share,) = (share for prefix in prefixes if (share := prefix / "share/collision_response").is_dir())
    assert (share / file).read_text() == (ROOT / file).read_text()


@pytest.fixture
def setup_options(monkeypatch):
    """What setup.py asks of setuptools with these wheels installed."""

    def run(installed):
        def version(name):
            try:
                return installed[name]
            except KeyError:
                raise metadata.PackageNotFoundError(name) from None

        asked = {}
        monkeypatch.setattr(metadata, "version", version)
        monkeypatch.setattr("setuptools.setup", lambda **options: asked.update(options))
        monkeypatch.setattr(sys, "path", list(sys.path))
        runpy.run_path(str(ROOT / "setup.py"))
        return asked

    pytest.importorskip("setuptools")
    return run


@pytest.mark.parametrize("release", ["kilted", "jazzy"])
def test_requirements_are_those_of_the_release_it_is_built_with(setup_options, release):
    needed = setup_options(wheels(release))["install_requires"]
    assert {"numpy>=1.22", "python-flint>=0.7"} < set(needed)
    of_ros = pins("\n".join(needed))
    assert of_ros.keys() == {
        "ros-diagnostic-msgs",
        "ros-geometry-msgs",
        "ros-nav-msgs",
        "ros-rcl-interfaces",
        "ros-rclpy",
        "ros-rosidl-default-runtime",
        "ros-std-msgs",
        "ros-visualization-msgs",
    }
    assert all(wheels(release)[name] == f"{series}.9" for name, series in of_ros.items())


def test_a_build_leaves_no_folder_behind(setup_options, monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    setup_options(wheels("kilted"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", sorted(wheels("kilted").keys() & wheels("jazzy").keys()))
def test_a_build_refuses_a_mixture_in_one_line(setup_options, name):
    mixed = wheels("kilted") | {name: wheels("jazzy")[name]}
    wrong = f"must be of one release .* Found: jazzy: {name} {wheels('jazzy')[name]}; kilted: ros-"
    with pytest.raises(SystemExit, match=wrong) as refusal:
        setup_options(mixed)
    assert "\n" not in str(refusal.value)


def test_a_build_refuses_a_release_that_is_not_listed(setup_options):
    with pytest.raises(SystemExit, match="Found: not in tools/ros: ros-ament-cmake 99"):
        setup_options({name: "99.0.0" for name in wheels("kilted")})
    with pytest.raises(SystemExit, match="No ROS wheels"):
        setup_options({})


@pytest.mark.usefixtures("need_ros")
class TestStart:
    """The check of the node before it imports ROS."""

    @pytest.fixture
    def check(self, monkeypatch):
        from collision_response.ros.wheels import check_release

        def check(installed, needed):
            monkeypatch.setattr(metadata, "requires", lambda _: needed)

            def version(name):
                if name not in installed:
                    raise metadata.PackageNotFoundError(name)
                return installed[name]

            monkeypatch.setattr(metadata, "version", version)
            check_release()

        return check

    def test_it_refuses_wheels_of_another_release(self, check):
        needed = ["numpy", "ros-rclpy[fastrtps]==9.1.*", "ros-std-msgs==5.5.*", 'ros-x==1.*; extra == "test"']
        check({"ros-rclpy": "9.1.2", "ros-std-msgs": "5.5.1"}, needed)
        with pytest.raises(ImportError) as refusal:
            check({"ros-rclpy": "9.10.2", "ros-std-msgs": "5.5.1"}, needed)
        assert str(refusal.value) == (
            "collision_response was built with other ROS wheels than ros-rclpy 9.10.2: "
            "pip install 'ros-rclpy[fastrtps]==9.1.*' 'ros-std-msgs==5.5.*'"
        )

    def test_it_says_what_to_install_without_ros(self, check):
        with pytest.raises(ImportError) as refusal:
            check({}, ["numpy", "ros-rclpy[fastrtps]==9.1.*"])
        assert str(refusal.value) == (
            "collision_response needs ROS for this: pip install 'ros-rclpy[fastrtps]==9.1.*'"
        )

    def test_the_installed_package_declares_its_requirements(self):
        try:
            installed = metadata.distribution("collision_response")
        except metadata.PackageNotFoundError:
            pytest.skip("built with colcon")
        if installed.read_text("INSTALLER") is None:
            pytest.skip("built with colcon, in an environment that has other metadata")
        assert pins("\n".join(installed.requires or [])).keys() >= {"ros-rclpy", "ros-geometry-msgs"}


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (None, "is not compiled. In a source tree"),
        ("_compiled.cpython-39-x86_64-linux-gnu.so", "is compiled for another Python: _compiled.cpython-39"),
        (f"_compiled{EXTENSION_SUFFIXES[0]}", "file too short"),
    ],
)
def test_a_package_whose_kernels_cannot_be_loaded_says_why(file, said, tmp_path):
    installed = Path(collision_response.__file__).parent
    copy = tmp_path / installed.name
    shutil.copytree(installed, copy, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    if file:
        (copy / "kernels" / file).touch()
    command = [sys.executable, "-c", "import collision_response"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert said in run.stderr.splitlines()[-1]


def test_an_editable_install_is_refused(setup_options):
    """It would install no file."""
    command = setup_options(wheels("kilted"))["cmdclass"]["editable_wheel"]
    with pytest.raises(SystemExit, match="make test"):
        command(pytest.importorskip("setuptools").Distribution()).run()


@pytest.mark.parametrize("file", ["README.md", "collision_response/recording/rerun_sdk.py"])
def test_the_versions_of_rerun_are_said_alike_everywhere(file):
    (pin,) = re.findall(r"^rerun-sdk\S+", (ROOT / "tools" / "python.txt").read_text(), re.MULTILINE)
    assert pin in (ROOT / file).read_text()
