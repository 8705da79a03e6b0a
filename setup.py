"""Builds the wheel for pip. What the package consists of is said in CMakeLists.txt alone: it is
built and installed into a staging prefix here, and the wheel ships what then lies there."""

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

SOURCE = Path(__file__).resolve().parent
RELEASES = SOURCE / "tools" / "ros"
WORK = tempfile.TemporaryDirectory()  # leaves the checkout, and colcon's build/ in it, as they are
STAGE = Path(WORK.name, "stage")
NO_WHEELS = "No ROS wheels found. Where ROS is installed, build with colcon: see README.md."


def ros_prefix() -> Path:
    """Where the ROS wheels lie: in an isolated build that is not sys.prefix."""
    for entry in map(Path, sys.path):
        for parent in entry.parents:
            if (parent / "share" / "ament_index").is_dir():
                return parent
    raise SystemExit(NO_WHEELS)


def lines(path: Path) -> list[str]:
    """The requirements in a file."""
    return [line for line in (line.partition("#")[0].strip() for line in path.open()) if line]


def release_of(name: str, version: str) -> str:
    """The ROS release of a wheel."""
    for file in sorted(RELEASES.glob("*.txt")):
        pins = (line.split("==") for line in lines(file))
        if any(pin.partition("[")[0] == name and version.startswith(of[:-1]) for pin, of in pins):
            return file.stem
    return "no release in tools/ros"


def run_time_requirements() -> list[str]:
    """What the package needs to run: of ROS, the release it is built with and no other."""
    names = {line.split("==")[0].partition("[")[0] for file in RELEASES.glob("*.txt") for line in lines(file)}
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
        found = "; ".join(f"of {release}: {', '.join(some)}" for release, some in sorted(wheels.items()))
        raise SystemExit(f"ROS wheels that are not of one release: {found}")
    of_ros = file.read_text().split("\n\n")[1]
    return [*lines(SOURCE / "tools" / "python.txt"), *of_ros.split()]


def build_and_stage() -> None:
    prefix, binaries = ros_prefix(), Path(WORK.name, "cmake")
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(prefix), "CMAKE_PREFIX_PATH": str(prefix)}

    def cmake(*arguments: object) -> None:
        subprocess.run(["cmake", *map(str, arguments)], env=environment, check=True)

    cmake(
        *("-S", SOURCE, "-B", binaries, "-G", "Ninja"),
        "-DBUILD_TESTING=OFF",
        "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_INSTALL_PREFIX={STAGE}",
        f"-DCMAKE_PROJECT_INCLUDE={SOURCE / 'cmake' / 'ros_wheels.cmake'}",
        f"-DPython3_EXECUTABLE={sys.executable}",
        "-DPYTHON_INSTALL_DIR=python",
        f"-DWITH_KERNELS={os.environ.get('COLLISION_RESPONSE_KERNELS', 'ON')}",
    )
    cmake("--build", binaries)
    cmake("--install", binaries)


def version() -> str:
    """It is set in package.xml alone, where ROS's release tools change it."""
    return (SOURCE / "package.xml").read_text().partition("<version>")[2].partition("</version>")[0]


class Build(build):
    """Puts the staged Python where setuptools expects it, and lists the rest as data files."""

    def run(self) -> None:
        build_and_stage()
        shutil.copytree(
            STAGE / "python", self.build_lib, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
        )
        data: dict[str, list[str]] = {}
        for part in ("include", "lib", "share"):
            for path in sorted((STAGE / part).rglob("*")):
                if path.is_file():
                    data.setdefault(str(path.parent.relative_to(STAGE)), []).append(str(path))
        self.distribution.data_files = list(data.items())


class BinaryDistribution(Distribution):
    def has_ext_modules(self) -> bool:
        return True


setup(
    version=version(),
    distclass=BinaryDistribution,
    cmdclass={"build": Build},
    packages=[],
    install_requires=run_time_requirements(),
    options={
        "bdist_wheel": {"bdist_dir": WORK.name + "/wheel"},
        "build": {"build_base": WORK.name + "/build"},
        "egg_info": {"egg_base": WORK.name},
    },
)
