"""Create the virtual environments that the Makefile uses, or bring them up to date:

    python3 tools/setup_venv.py .venv test,lint   pip install '.[test,lint]'
    python3 tools/setup_venv.py .colcon-venv      what a colcon build needs, without this package

A third argument names a file of optional requirements, which are installed one by one. One that cannot be
installed is reported, skipped, and tried again the next time.
"""

# Only syntax of Python 3.6: a Python that is too old must be able to run this and print that it is too old.

import fcntl
import hashlib
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "collision_response"
SHARED = ["config", "launch", "security"]
BUILD_INPUTS = ["CMakeLists.txt", "cmake", "msg", "package.xml", "scripts", "setup.py", "srv"]
RUN_TIME = [ROOT / "tools" / "python.txt", ROOT / "tools" / "ros" / "kilted.txt"]
KERNELS = PACKAGE / "kernels"
COLCON = ["colcon-common-extensions", "ros-ament-cmake-pytest==2.7.*", "ros-domain-coordinator==0.12.*"]


def missing():
    """Return one line that says what this machine lacks, or ``None``."""
    version = "{}.{}".format(*sys.version_info)
    if sys.version_info < (3, 10):  # noqa: UP036
        return f"Python 3.10 or newer is needed, this is {version}. Name another one: make PYTHON=python3.X"
    if (
        (platform.system(), platform.machine(), platform.libc_ver()[0]) != ("Linux", "x86_64", "glibc")
        or platform.python_implementation() != "CPython"
        or sys.version_info >= (3, 15)
    ):
        return (
            "There are ROS wheels for CPython 3.10 to 3.14 on x86-64 Linux with glibc only: "
            "install ROS and build with colcon, see README.md."
        )
    parts = {}
    if not shutil.which(os.environ.get("CXX", "c++").split()[0]):
        parts["a C++ compiler"] = "g++"
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        parts["Python's headers"] = f"python{version}-dev"
    try:
        import ensurepip  # noqa: F401  a separate package on Debian
        import venv  # noqa: F401
    except ImportError:
        parts["Python's venv module"] = f"python{version}-venv"
    if parts:
        return f"Missing: {', '.join(parts)}. On Debian and Ubuntu: apt install {' '.join(parts.values())}"
    return None


def digest(*parts):
    """Hash strings, and the names and contents of files. A directory stands for all files in it."""
    sha = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            sha.update(part.encode() + b"\0")
            continue
        files = sorted(part.rglob("*")) if part.is_dir() else [part]
        for path in files:
            if path.is_file() and "__pycache__" not in path.parts:
                sha.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return sha.hexdigest()


class Environment:
    """A virtual environment in the root of the repository."""

    def __init__(self, name):
        self.path = ROOT / name
        self.python = self.path / "bin" / "python"
        # If a virtual environment runs this: the interpreter that it was made from.
        self.base_python = os.path.realpath(getattr(sys, "_base_executable", sys.executable))

    def is_current(self, name, value):
        """Whether the stamp file of this name holds this value."""
        stamp = self.path / name
        return stamp.exists() and stamp.read_text() == value

    def create(self):
        """Create the environment, in place of an older one."""
        if self.path.exists():
            shutil.rmtree(str(self.path))
        self.run(
            f"a virtual environment with Python {platform.python_version()} (5 s)",
            [self.base_python, "-m", "venv", str(self.path)],
        )

    def run(self, what, command):
        """Run a command and return its output. If it fails, print the output and exit."""
        result = self.attempt(what, command)
        if result.returncode:
            print(f"{result.stdout}\n==> {self.path.name}: {what} failed, output above.")
            sys.exit(1)
        return result.stdout

    def attempt(self, what, command):
        """Run a command, print one line of progress, and return the completed process."""
        print(f"==> {self.path.name}: {what} ...", end="", flush=True)
        start = time.monotonic()
        result = subprocess.run(
            command,
            cwd=str(ROOT),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        print(f" {'failed' if result.returncode else 'done'} in {time.monotonic() - start:.0f} s", flush=True)
        return result

    def pip_install(self, what, *arguments):
        """Install packages, without compiling them to bytecode, which would take as long again."""
        self.run(what, [str(self.python), "-m", "pip", "install", "--no-compile", *arguments])

    def install_build_requirements(self, what, *arguments):
        """Install the build requirements of pyproject.toml; pip would install them for each build."""
        requirements = self.run(
            "reading pyproject.toml",
            [
                str(self.python),
                "-c",
                "try: import tomllib\n"
                "except ImportError: from pip._vendor import tomli as tomllib\n"
                "project = tomllib.load(open('pyproject.toml', 'rb'))\n"
                "print(*project['build-system']['requires'], sep='\\n')",
            ],
        )
        self.pip_install(what, *requirements.split(), *arguments)


def dependencies_digest(environment):
    """Hash everything that decides which dependencies are installed."""
    requirements = (ROOT / "pyproject.toml").read_text().partition("\n[tool.")[0]
    files = [Path(__file__).resolve(), *RUN_TIME]
    return digest(requirements, sys.version, environment.base_python, str(ROOT), *files)


class Kernels:
    """The compiled kernels, built outside pip, so that an edited formula recompiles only what depends on it.

    Environments of the same Python share them.
    """

    def __init__(self, environment):
        self.environment = environment
        self.path = ROOT / ".kernels" / sys.implementation.cache_tag
        self.log = ROOT / ".kernels" / "build.log"

    def ninja(self):
        """Return the ninja that the build uses, of this or another environment.

        ``None`` if it is gone, or if the build is a copy, or of a tree that was moved: it would compile the
        sources of the other place.
        """
        cache = self.path / "CMakeCache.txt"
        settings = dict(re.findall(r"^(\w+):\w+=(.*)$", cache.read_text(), re.M)) if cache.exists() else {}
        ninja = settings.get("CMAKE_MAKE_PROGRAM", "")
        is_here = settings.get("CMAKE_CACHEFILE_DIR") == str(self.path)
        return ninja if is_here and Path(ninja).is_file() else None

    def start(self):
        """Start building what is not up to date, and return the process.

        Two builds at once would spoil ninja's records. One that was killed may still compile.
        """
        (ROOT / ".kernels").mkdir(exist_ok=True)
        with (ROOT / ".kernels" / "lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                name = self.environment.path.name
                print(f"==> {name}: waiting for another build of the kernels", flush=True)
                fcntl.flock(lock, fcntl.LOCK_EX)
            return self._start(lock)

    def _start(self, lock):
        tools, ninja = self.environment.path / "bin", self.ninja()
        if not ninja:
            shutil.rmtree(str(self.path), ignore_errors=True)
            self.path.mkdir(parents=True)
            ninja = tools / "ninja"
        script = '"$3" -C "$2"'
        if not (self.path / "build.ninja").exists():
            configure = (
                '"$0" -G Ninja -S "$1" -B "$2" -DFOR_THIS_MACHINE=ON '
                '-DCMAKE_MAKE_PROGRAM="$3" -DPython3_EXECUTABLE="$4"'
            )
            script = f"{configure} && {script}"
        arguments = [tools / "cmake", KERNELS, self.path, ninja, self.environment.python]
        return subprocess.Popen(
            ["sh", "-c", script, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=self.log.open("w"),
            stderr=subprocess.STDOUT,
            start_new_session=True,  # so that stop() ends compilers, too
            pass_fds=[lock.fileno()],  # locked as long as any of them runs
        )

    def stop(self, build):
        """End a build that still runs, because something else has failed: the next one would disturb it."""
        if build.poll() is None:
            os.killpg(build.pid, signal.SIGTERM)
            build.wait()

    def wait(self, build):
        """Wait for the build and return the compiled modules. If it fails, print its log and exit."""
        started = time.monotonic()
        try:
            build.wait(2)
        except subprocess.TimeoutExpired:
            print(f"==> {self.environment.path.name}: the kernels (2 min) ...", end="", flush=True)
            build.wait()
            print(f" done in {time.monotonic() - started:.0f} s more", flush=True)
        if build.returncode:
            print(f"{self.log.read_text()}\n==> building the kernels failed, output above.")
            sys.exit(1)
        return sorted(self.path.glob("_*.so"))


def install_package(name, extras):
    """Create or update an environment that holds the package, and return it."""
    environment = Environment(name)
    kernels = Kernels(environment)
    os.environ["COLLISION_RESPONSE_KERNELS"] = "OFF"  # not by pip: this script builds them
    dependencies = digest(dependencies_digest(environment), extras)
    inputs = digest(*(ROOT / name for name in BUILD_INPUTS))
    is_new = not environment.is_current("needs.stamp", dependencies)
    if is_new:
        environment.create()
        environment.pip_install("cmake and ninja", "cmake", "ninja")
    build = kernels.start()
    try:
        os.environ["PATH"] = f"{environment.path / 'bin'}{os.pathsep}{os.environ['PATH']}"
        if is_new:
            environment.install_build_requirements("build requirements")
            environment.pip_install(
                "the package and its dependencies (2 min)", "--no-build-isolation", f".[{extras}]"
            )
            (environment.path / "needs.stamp").write_text(dependencies)
            (environment.path / "build.stamp").write_text(inputs)
        elif not environment.is_current("build.stamp", inputs):
            # If interrupted, install again next time.
            (environment.path / "build.stamp").unlink(missing_ok=True)
            environment.pip_install(
                "the package again (1 min)", "--no-build-isolation", "--no-deps", "--force-reinstall", "."
            )
            (environment.path / "build.stamp").write_text(inputs)
        compiled = kernels.wait(build)
    finally:
        kernels.stop(build)
    link_python(next(environment.path.glob("lib/python*/site-packages/collision_response")), compiled)
    link_shared(environment.path / "share" / "collision_response")
    return environment


def install_optional(environment, requirements):
    """Install optional requirements one by one. One that cannot be installed does not affect the others."""
    stamp = environment.path / "optional.stamp"
    installed = set(stamp.read_text().splitlines()) if stamp.exists() else set()
    lines = (line.partition("#")[0].strip() for line in (ROOT / requirements).read_text().splitlines())
    for requirement in sorted({line for line in lines if line} - installed):
        command = [str(environment.python), "-m", "pip", "install", "--prefer-binary", requirement]
        if environment.attempt(requirement, command).returncode:
            print(f"==> {environment.path.name}: {requirement} is not available, continuing without it")
        else:
            installed.add(requirement)
            stamp.write_text("\n".join(sorted(installed)))


def link_shared(installed):
    """Replace the installed configuration and launch files by links to their sources."""
    sources = {path.relative_to(ROOT): path for folder in SHARED for path in (ROOT / folder).glob("*.*")}
    for path in (path for folder in SHARED for path in (installed / folder).glob("*.*")):
        if path.relative_to(installed) not in sources:
            path.unlink()
    link_all(installed, sources)


def link_python(installed, compiled):
    """Replace every installed module by a link to its source, as colcon --symlink-install does."""
    sources = {
        path.relative_to(PACKAGE): path
        for path in PACKAGE.rglob("*")
        if path.suffix in (".py", ".typed", ".yaml") and "__pycache__" not in path.parts
    }
    sources.update({Path("kernels", module.name): module for module in compiled})
    for path in sorted(installed.rglob("*"), reverse=True):
        relative = path.relative_to(installed)
        is_generated = relative.parts[0] in ("msg", "srv") or "collision_response_s" in path.name
        if is_generated or "__pycache__" in relative.parts:  # where a running node may write
            continue
        if path.is_dir() and not path.is_symlink():
            if not (PACKAGE / relative).is_dir():
                shutil.rmtree(str(path))
        elif relative not in sources:
            path.unlink()
    link_all(installed, sources)


def link_all(installed, sources):
    """Put links to the sources at their places below a folder."""
    for relative, source in sources.items():
        link = installed / relative
        if link.is_symlink() and os.readlink(str(link)) == str(source):
            continue
        link.parent.mkdir(parents=True, exist_ok=True)
        if link.exists() or link.is_symlink():
            link.unlink()
        link.symlink_to(source)


def install_colcon():
    """Create or update the environment for a colcon build."""
    environment = Environment(".colcon-venv")
    dependencies = dependencies_digest(environment)
    if environment.is_current("needs.stamp", dependencies):
        return
    environment.create()
    files = [argument for path in RUN_TIME for argument in ("-r", str(path))]
    environment.install_build_requirements("colcon, ROS and its build tools (1 min)", *COLCON, *files)
    (environment.path / "needs.stamp").write_text(dependencies)


def main(name, extras="", optional=""):
    problem = missing()
    if problem:
        sys.exit(problem)
    # A ROS wheel may have set these for the Python that runs this; they are wrong for any other Python.
    for variable in ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"):
        os.environ.pop(variable, None)
    if name == ".colcon-venv":
        install_colcon()
        return
    for number in (signal.SIGTERM, signal.SIGHUP):  # end the compilers, too
        signal.signal(number, lambda *_: sys.exit(1))
    environment = install_package(name, extras)
    if optional:
        install_optional(environment, optional)


if __name__ == "__main__":
    main(*sys.argv[1:])
