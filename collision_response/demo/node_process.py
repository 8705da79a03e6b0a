"""The node in a process of its own, as a user starts it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sysconfig
import tempfile
from typing import Any

EXECUTABLE = "collision_response_node"
PATIENCE = 15.0
"""How long the node may take to end [s]; a recording has to be completed."""


class NodeFailed(Exception):
    """The node did not start, or did not end well; the message is what it said last."""


class NodeProcess:
    """Started on construction, ended by SIGINT when the context is left, whatever happens.

    Args:
        parameters: of the node, by name.
    """

    def __init__(self, parameters: dict[str, Any]) -> None:
        arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        self._said = tempfile.TemporaryFile("w+")  # noqa: SIM115, closed with the process
        # A session of its own: Ctrl-C is for the demo, which then ends the node in good order.
        self._process = subprocess.Popen(
            [find_executable(), "--ros-args", *arguments],
            stdin=subprocess.DEVNULL,
            stderr=self._said,
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
        with self._said:
            if kind is None and self._process.returncode:
                raise self._failed()

    def check(self) -> None:
        """Raises: NodeFailed: it has ended."""
        if self._process.poll() is not None:
            raise self._failed()

    def _failed(self) -> NodeFailed:
        self._said.seek(0)
        lines = self._said.read().strip().splitlines()[-5:]
        return NodeFailed("\n".join([f"the node ended with {self._process.returncode}", *lines]))


def find_executable() -> str:
    """The node's executable, where pip or where colcon installs it.

    Raises:
        NodeFailed: it is in neither place.
    """
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    places = [sysconfig.get_path("scripts"), *(f"{p}/lib/collision_response" for p in prefixes)]
    found = shutil.which(EXECUTABLE, path=os.pathsep.join(places))
    if found is None:
        raise NodeFailed(f"no executable {EXECUTABLE} in {', '.join(places)}")
    return found
