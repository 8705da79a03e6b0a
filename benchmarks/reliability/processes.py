"""Starts the node and the processes that drive it, and ends each of them whatever happens."""

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
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import pages
import service

from .child import DEADLINE, NAMESPACE
from .client import Order, Report

ROOM = Path(__file__).resolve().parent
NODE = ROOM.parent.parent / "scripts" / "collision_response_node"


class Usage(NamedTuple):
    """What a process takes of the machine; memory in MiB."""

    memory: float
    peak: float
    threads: int
    descriptors: int
    processor_seconds: float


class Process:
    """One that this process has started.

    Attributes:
        pid: its number.
    """

    def __init__(self, command: list[str], environment: dict[str, str], **pipes: Any) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  it lives as long as this
        self._process = subprocess.Popen(command, env=environment, stderr=self._errors, text=True, **pipes)
        self._is_held = False
        self.pid = self._process.pid

    def is_alive(self) -> bool:
        return self._process.poll() is None

    def hold(self) -> None:
        """Stop it where it is, until :meth:`resume`."""
        self._process.send_signal(signal.SIGSTOP)
        self._is_held = True

    def resume(self) -> None:
        self._process.send_signal(signal.SIGCONT)
        self._is_held = False

    def kill(self) -> None:
        """At once: it cannot say goodbye."""
        self._process.kill()
        self._process.wait(DEADLINE)

    def terminate(self, seconds: float = DEADLINE) -> tuple[float, int | None]:
        """Ask it to end: after how many seconds it did, and with what exit code; ``None`` if it did not."""
        began = time.monotonic()
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            return seconds, None
        return time.monotonic() - began, self._process.returncode

    def log(self) -> str:
        """What it has written to standard error."""
        self._errors.seek(0)
        return self._errors.read()

    def usage(self) -> Usage | None:
        """``None`` if it is no more."""
        try:
            lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
            words = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            descriptors = len(os.listdir(f"/proc/{self.pid}/fd"))
        except OSError:
            return None
        found = dict(line.split(":", 1) for line in lines)
        if "VmRSS" not in found:  # it has ended, and nobody has waited for it yet
            return None
        memory, peak = (int(found[name].split()[0]) / 1024 for name in ("VmRSS", "VmHWM"))
        spent = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
        return Usage(memory, peak, int(found["Threads"]), descriptors, spent)

    def close(self) -> None:
        """End it."""
        if self._is_held and self.is_alive():
            self.resume()
        if self.is_alive():
            self.terminate(10.0)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):  # it has ended with words for it under way
                    pipe.close()
        self._errors.close()


class NodeProcess(Process):
    """The node under test, as installed."""

    def __init__(self, environment: dict[str, str], parameters: dict[str, Any]) -> None:
        words = [
            sys.executable,
            "-I",
            str(NODE),
            "--ros-args",
            "-r",
            f"__ns:={NAMESPACE}",
            "--log-level",
            "warn",
        ]
        for name, value in parameters.items():
            words += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        super().__init__(words, environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)


class Child(Process):
    """A process of this room: ``role`` is a word of ``__main__.py``."""

    def __init__(self, role: str, order: dict[str, Any], environment: dict[str, str]) -> None:
        command = [sys.executable, "-I", str(ROOM), role, json.dumps(order)]
        super().__init__(command, environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def until(self, word: str, seconds: float = DEADLINE) -> Any:
        """Wait for a word of it, and return what it says to that.

        Raises:
            TimeoutError: it does not say it.
            ChildProcessError: it has ended without it.
        """
        end = time.monotonic() + seconds
        while True:
            try:
                line = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise TimeoutError(f"no {word!r} from process {self.pid} within {seconds:.0f} s") from None
            if line is None:
                raise ChildProcessError(f"process {self.pid} ended without {word!r}:\n{self.log()[-2000:]}")
            said, _, what = line.partition(" ")
            if said == word:
                return json.loads(what)

    def tell(self, word: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()

    def report(self, seconds: float = 600.0) -> Report:
        """Of a client, what came of its requests."""
        return Report.from_json(self.until("done", seconds))


class Environment:
    """Variables for the processes of one run, in a ROS domain of its own that nothing leaves.

    Attributes:
        usual: with the profile for Fast DDS that the package recommends.
        large: for requests and answers of many megabytes.
    """

    def __enter__(self) -> Environment:
        self._domain = service.own_domain()
        profile = pages.ROOT / "config" / "fast_dds.xml"
        self.usual = {**self._domain.__enter__(), "FASTDDS_DEFAULT_PROFILES_FILE": str(profile)}
        self.large = {**self.usual, **service.LARGE_DATA}
        return self

    def __exit__(self, *_: object) -> None:
        self._domain.__exit__(None, None, None)  # what it cannot do is to end with an error


class Stage:
    """What a case starts. Left as a context it ends it all, the node last."""

    def __init__(self, environment: Environment, *, large: bool = False) -> None:
        self._variables = environment.large if large else environment.usual
        self._stack = ExitStack()

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _keep(self, process: Any) -> Any:
        self._stack.callback(process.close)
        return process

    def node(self, **parameters: Any) -> NodeProcess:
        """The node; a double underscore in the name of a parameter stands for a dot."""
        named = {name.replace("__", "."): value for name, value in parameters.items()}
        return self._keep(NodeProcess(self._variables, named))

    def child(self, role: str, **order: Any) -> Child:
        """A process of this room."""
        return self._keep(Child(role, order, self._variables))

    def client(self, **order: Any) -> Child:
        """A client, by the fields of :class:`~.client.Order`."""
        return self.child("client", **Order(**order).to_json())

    def start(self, *children: Child) -> None:
        """Let them begin, all when the last is ready."""
        for child in children:
            child.until("ready")
        for child in children:
            child.tell("go")
