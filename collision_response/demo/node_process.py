"""The node as a separate process, started as a user starts it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sysconfig
import tempfile
from typing import Any

EXECUTABLE = "collision_response"
SHUTDOWN_TIME = 30.0
"""Longest time for the node to answer what has arrived and to complete its recording [s].

On a busy machine, rerun alone may take many seconds to load."""

PARAMETERS = {
    "shutdown_timeout": SHUTDOWN_TIME,
    "max_state_wait": 10.0,
    "qos_overrides./body_states.subscription.reliability": "reliable",
}
"""Published states arrive before the requests that give bodies by name, also on a busy machine."""

PATIENCE = SHUTDOWN_TIME + 10.0
"""Longest time for the node to end [s]."""


class NodeFailed(Exception):
    """The node did not start, or ended with an error; the message has its last lines of output."""


class NodeProcess:
    """A running node. It starts on construction and is always ended, by SIGINT, when the context is left."""

    def __init__(self, parameters: dict[str, Any]) -> None:
        parameters = {**PARAMETERS, **parameters}
        arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        self._output = tempfile.TemporaryFile("w+")  # noqa: SIM115, closed with the process
        # In its own session, so that Ctrl-C reaches only the demo, which then ends the node properly.
        self._process = subprocess.Popen(
            [find_executable(), "node", *arguments],
            stdin=subprocess.DEVNULL,
            stderr=self._output,
            start_new_session=True,
        )

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with self._output:
            if kind is None and self._process.returncode:
                raise self._failed()

    def check(self) -> None:
        """Raise NodeFailed if the process has ended."""
        if self._process.poll() is not None:
            raise self._failed()

    def _failed(self) -> NodeFailed:
        self._output.seek(0)
        lines = self._output.read().strip().splitlines()[-5:]
        return NodeFailed("\n".join([f"the node ended with {self._process.returncode}", *lines]))


def find_executable() -> str:
    """Path of the command line, as installed by pip or by colcon."""
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    places = [sysconfig.get_path("scripts"), *(f"{p}/bin" for p in prefixes)]
    found = shutil.which(EXECUTABLE, path=os.pathsep.join(places))
    if found is None:
        raise NodeFailed(f"no executable {EXECUTABLE} in {', '.join(places)}")
    return found
