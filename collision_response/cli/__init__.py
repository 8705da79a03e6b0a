"""``collision_response COMMAND``: the command line of the package.

A command is a module with ``main(arguments) -> int``, or a node. It is imported when it is called, so each
command needs only its own dependencies.
"""

from __future__ import annotations

import argparse
import errno
import io
import os
import signal
import sys
from importlib import import_module
from typing import NamedTuple

import collision_response

from . import nodes


class Command(NamedTuple):
    """The module of a command, and what the command does."""

    module: str
    purpose: str


COMMANDS = {
    "demo": Command(".demo.__main__", "run a demonstration: known answers, a break shot, a tumbling rod"),
    "node": Command(".ros.node", "run the ROS node that answers requests"),
    "call": Command(".cli.call", "send one request to the node, and print the answer"),
    "states": Command(".ros.sources", "publish the states of a robot, from odometry or TF and its URDF"),
    "markers": Command(".ros.markers", "show the answers in RViz or Foxglove"),
    "report": Command(".cli.report", "summarise a recording: in words, plots and a table"),
    "replay": Command(".cli.replay", "compute the answers of a recording again, and report differences"),
    "identify": Command(".identify.__main__", "find restitution and friction from measured impacts"),
}

EXAMPLE = """
first steps:
  collision_response demo
  collision_response node                              in one terminal, and in another:
  collision_response call 'body_a: {inertia: {m: 2.0}, twist: {linear: {z: -3.0}}}
  body_b: {motion_type: STATIC}
  contact: {normal: {z: 1.0}, restitution: 0.5}'

"collision_response COMMAND --help" describes each command.
"""

NO_SPACE = errno.ENOSPC, errno.EDQUOT, errno.EFBIG
"""Errors of a standard output without space. The commands handle errors of their own files themselves."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command, with the arguments of this process by default.

    Returns:
        The exit code of the command; that of a process ended by SIGINT or SIGPIPE; ``EX_IOERR`` if there is
        no space for its output; or ``EX_UNAVAILABLE`` if it needs something that is not installed.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names may have letters that the locale lacks
    try:
        try:
            return _run(sys.argv[1:] if arguments is None else arguments)
        finally:  # --help ends by SystemExit
            if sys.stdout is not None:
                sys.stdout.flush()
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except BrokenPipeError:  # the reader of the output has ended
        _drop_output()
        return 128 + signal.SIGPIPE
    except OSError as error:
        if error.errno not in NO_SPACE:
            raise
        _drop_output()
        print(f"collision_response: standard output: {error.strerror}", file=sys.stderr)
        return os.EX_IOERR


def _drop_output() -> None:
    """Discard further output, or Python would try to write the rest at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(words: list[str]) -> int:
    name, *rest = words or ["--help"]
    if name not in COMMANDS:
        _parser().parse_args([name])  # --help, --version, or no such command
    try:
        module = import_module(COMMANDS[name].module, collision_response.__name__)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("collision_response"):
            raise
        print(f"collision_response {name} needs {error.name}, which is not installed", file=sys.stderr)
        return os.EX_UNAVAILABLE
    except ImportError as error:
        if error.name:
            raise
        print(error, file=sys.stderr)  # it says what to install
        return os.EX_UNAVAILABLE
    return nodes.run(name, module, rest) if name in nodes.DESCRIPTIONS else module.main(rest)


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, COMMANDS))
    commands = "\n".join(f"  {name:{width}}  {command.purpose}" for name, command in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="collision_response",
        usage="collision_response COMMAND ...",
        description=f"Compute the twists of two bodies after an impact.\n\ncommands:\n{commands}",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS)
    parser.add_argument("--version", action="version", version=collision_response.__version__)
    return parser
