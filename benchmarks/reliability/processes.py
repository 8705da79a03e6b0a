"""Starts the node and the processes that drive it, and always ends them."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import pages

from .child_process import DEADLINE, NAMESPACE
from .client import Order, Report

DIRECTORY = Path(__file__).resolve().parent
NODE = DIRECTORY.parent.parent / "scripts" / "collision_response_node"

LARGE_DATA = {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"}
"""With its other transports Fast DDS loses parts of requests and answers of many megabytes."""


class Usage(NamedTuple):
    """Resources used by a process; memory in MiB."""

    memory: float
    peak: float
    threads: int
    descriptors: int
    processor_seconds: float


class Process:
    """A process started by this one.

    Attributes:
        pid: its process id.
    """

    def __init__(self, command: list[str], environment: dict[str, str], **pipes: Any) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  closed in close()
        self._process = subprocess.Popen(command, env=environment, stderr=self._errors, text=True, **pipes)
        self._is_held = False
        self.pid = self._process.pid

    def is_alive(self) -> bool:
        return self._process.poll() is None

    def hold(self) -> None:
        """Suspend the process until :meth:`resume`."""
        self._process.send_signal(signal.SIGSTOP)
        self._is_held = True

    def resume(self) -> None:
        self._process.send_signal(signal.SIGCONT)
        self._is_held = False

    def kill(self) -> None:
        """Kill the process, without a chance to clean up."""
        self._process.kill()
        self._process.wait(DEADLINE)

    def terminate(self, seconds: float = DEADLINE) -> tuple[float, int | None]:
        """Send SIGTERM; return the time until the process ended [s] and its exit code, or ``None``."""
        began = time.monotonic()
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            return seconds, None
        return time.monotonic() - began, self._process.returncode

    def log(self) -> str:
        """Its output on standard error."""
        self._errors.seek(0)
        return self._errors.read()

    def usage(self) -> Usage | None:
        """Current usage of resources; ``None`` if the process has ended."""
        try:
            lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
            words = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            descriptors = len(os.listdir(f"/proc/{self.pid}/fd"))
        except OSError:
            return None
        found = dict(line.split(":", 1) for line in lines)
        if "VmRSS" not in found:  # a zombie: it has ended but was not waited for
            return None
        memory, peak = (int(found[name].split()[0]) / 1024 for name in ("VmRSS", "VmHWM"))
        spent = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
        return Usage(memory, peak, int(found["Threads"]), descriptors, spent)

    def close(self) -> None:
        """End the process."""
        if self._is_held and self.is_alive():
            self.resume()
        if self.is_alive():
            self.terminate(10.0)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):  # it has ended without reading everything
                    pipe.close()
        self._errors.close()


class NodeProcess(Process):
    """The installed node, under test."""

    def __init__(self, environment: dict[str, str], parameters: dict[str, Any]) -> None:
        words = [sys.executable, "-I", str(NODE), "--ros-args", "-r", f"__ns:={NAMESPACE}"]
        words += ["--log-level", "warn"]
        for name, value in parameters.items():
            words += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        super().__init__(words, environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)


class Child(Process):
    """A process of this package; ``role`` is the module whose ``run`` it calls."""

    def __init__(self, role: str, order: dict[str, Any], environment: dict[str, str]) -> None:
        command = [sys.executable, "-I", str(DIRECTORY), role, json.dumps(order)]
        super().__init__(command, environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def until(self, word: str, seconds: float = DEADLINE) -> Any:
        """Wait until the process sends a word, and return the data that comes with it.

        Raises:
            TimeoutError: if the word does not come in time.
            ChildProcessError: if the process ends without sending it.
        """
        end = time.monotonic() + seconds
        while True:
            try:
                line = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise TimeoutError(f"no {word!r} from process {self.pid} within {seconds:.0f} s") from None
            if line is None:
                raise ChildProcessError(f"process {self.pid} ended without {word!r}:\n{self.log()[-2000:]}")
            sent, _, data = line.partition(" ")
            if sent == word:
                return json.loads(data)

    def tell(self, word: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()

    def report(self, seconds: float = 600.0) -> Report:
        """Wait for the report of a client."""
        return Report.from_json(self.until("done", seconds))


@contextmanager
def own_domain() -> Iterator[dict[str, str]]:
    """Environment variables for processes in a ROS domain that nobody else uses, limited to this machine."""
    import domain_coordinator

    with domain_coordinator.domain_id() as domain:
        yield {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@contextmanager
def with_profile() -> Iterator[dict[str, str]]:
    """The same with the Fast DDS profile that the package recommends."""
    with own_domain() as variables:
        yield {**variables, "FASTDDS_DEFAULT_PROFILES_FILE": str(pages.ROOT / "config" / "fast_dds.xml")}


class Stage:
    """The processes of one case. When the context is left, it ends all of them, the node last.

    Args:
        variables: environment variables of the processes.
        large: whether requests and answers have many megabytes.
    """

    def __init__(self, variables: dict[str, str], *, large: bool = False) -> None:
        self._variables = {**variables, **LARGE_DATA} if large else variables
        self._stack = ExitStack()

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _keep(self, process: Any) -> Any:
        self._stack.callback(process.close)
        return process

    def node(self, **parameters: Any) -> NodeProcess:
        """Start the node; a double underscore in the name of a parameter stands for a dot."""
        named = {name.replace("__", "."): value for name, value in parameters.items()}
        return self._keep(NodeProcess(self._variables, named))

    def child(self, role: str, **order: Any) -> Child:
        """Start a child process."""
        return self._keep(Child(role, order, self._variables))

    def client(self, **order: Any) -> Child:
        """Start a client, with the fields of :class:`~.client.Order`."""
        return self.child("client", **asdict(Order(**order)))

    def start(self, *children: Child) -> None:
        """Let child processes begin, once all of them are ready."""
        for child in children:
            child.until("ready")
        for child in children:
            child.tell("go")
