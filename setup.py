"""Build the wheel for pip.

CMakeLists.txt alone says what belongs to the package. This script builds and installs it into a staging
prefix; the wheel contains what is installed there.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build import build
from setuptools.command.editable_wheel import editable_wheel

SOURCE = Path(__file__).resolve().parent
RELEASES = SOURCE / "tools" / "ros"
NO_WHEELS = "No ROS wheels found. If ROS is installed, build with colcon: see README.md."


def ros_prefix() -> Path:
    """Return the prefix of the ROS wheels, which is not ``sys.prefix`` in an isolated build."""
    for entry in map(Path, sys.path):
        for parent in entry.parents:
            if (parent / "share" / "ament_index").is_dir():
                return parent
    raise SystemExit(NO_WHEELS)


def read_requirements(path: Path) -> list[str]:
    """Return the requirements in a file, without comments."""
    return [line for line in (line.partition("#")[0].strip() for line in path.open()) if line]


def release_of(name: str, version: str) -> str:
    """Return the ROS release that a wheel belongs to."""
    for file in sorted(RELEASES.glob("*.txt")):
        pins = (line.split("==") for line in read_requirements(file))
        if any(pin.partition("[")[0] == name and version.startswith(series[:-1]) for pin, series in pins):
            return file.stem
    return "not in tools/ros"


def run_time_requirements() -> list[str]:
    """Return what the package needs to run, with ROS pinned to the release that it is built with."""
    pins = (pin for file in RELEASES.glob("*.txt") for pin in read_requirements(file))
    names = {pin.split("==")[0].partition("[")[0] for pin in pins}
    wheels: dict[str, list[str]] = {}
    for name in sorted(names):
        with suppress(metadata.PackageNotFoundError):
            version = metadata.version(name)
            wheels.setdefault(release_of(name, version), []).append(f"{name} {version}")
    if not wheels:
        raise SystemExit(NO_WHEELS)
    (release, *others) = wheels
    file = RELEASES / f"{release}.txt"
    if others or not file.exists():
        found = "; ".join(f"{release}: {', '.join(names)}" for release, names in sorted(wheels.items()))
        raise SystemExit(f"The ROS wheels must be of one release listed in tools/ros. Found: {found}")
    ros_run_time = file.read_text().split("\n\n")[1]
    return [*read_requirements(SOURCE / "tools" / "python.txt"), *ros_run_time.split()]


def build_and_stage(folder: Path) -> Path:
    """Build the package with CMake in a folder. Returns the prefix there that it is installed into."""
    prefix, binaries, stage = ros_prefix(), folder / "cmake", folder / "stage"
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(prefix), "CMAKE_PREFIX_PATH": str(prefix)}
    environment.pop("DESTDIR", None)  # is for what the wheel is installed into

    def cmake(*arguments: object) -> None:
        subprocess.run(["cmake", *map(str, arguments)], env=environment, check=True)

    cmake(
        *("-S", SOURCE, "-B", binaries, "-G", "Ninja"),
        "-DBUILD_TESTING=OFF",
        "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_INSTALL_PREFIX={stage}",
        f"-DCMAKE_PROJECT_INCLUDE={SOURCE / 'cmake' / 'ros_wheels.cmake'}",
        f"-DPython3_EXECUTABLE={sys.executable}",
        "-DPYTHON_INSTALL_DIR=python",
        f"-DWITH_KERNELS={os.environ.get('COLLISION_RESPONSE_KERNELS', 'ON')}",
    )
    cmake("--build", binaries)
    cmake("--install", binaries)
    return stage


def version() -> str:
    """Return the version from package.xml, where the release tools of ROS change it."""
    return (SOURCE / "package.xml").read_text().partition("<version>")[2].partition("</version>")[0]


class Build(build):
    """Copies the staged Python files to where setuptools expects them and lists the others as data files."""

    def run(self) -> None:
        stage = build_and_stage(Path(self.build_base))
        shutil.copytree(
            stage / "python",
            self.build_lib,
            ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "*.c"),
        )
        data: dict[str, list[str]] = {}
        for part in ("include", "lib", "share"):
            for path in sorted((stage / part).rglob("*")):
                if path.is_file() and path.suffix not in (".c", ".cpp"):  # sources of the messages
                    data.setdefault(str(path.parent.relative_to(stage)), []).append(str(path))
        self.distribution.data_files = list(data.items())


class RefuseEditable(editable_wheel):
    """Takes the place of the command that would install a package without any file."""

    def run(self) -> None:
        raise SystemExit("An editable install would lack what is compiled: use make test instead")


class BinaryDistribution(Distribution):
    def has_ext_modules(self) -> bool:
        return True


with tempfile.TemporaryDirectory() as work:  # outside the checkout, which may hold colcon's build/
    if any(map(str.isspace, work)):
        raise SystemExit(f"ROS cannot build messages in a folder with a space, such as {work}: set TMPDIR")
    setup(
        version=version(),
        distclass=BinaryDistribution,
        cmdclass={"build": Build, "editable_wheel": RefuseEditable},
        packages=[],
        install_requires=run_time_requirements(),
        options={
            "bdist_wheel": {"bdist_dir": work + "/wheel"},
            "build": {"build_base": work + "/build"},
            "egg_info": {"egg_base": work},
        },
    )
