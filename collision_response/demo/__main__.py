"""``python3 -m collision_response.demo``: start a node, call it from this process, and check its answers."""

from __future__ import annotations

import argparse
import os
import random
import signal
import socket
import sys
import sysconfig
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..ros.take_all import RCLError
from . import chapters
from .client import Client, NoAnswer
from .node_process import NodeFailed, NodeProcess

DESCRIPTION = """Start a node and call it: eight systems with known answers, a break shot, a tumbling rod, and
several contacts at once. The exit code is 0 if all answers are correct to rounding. The node writes
recordings/demo.rrd for the rerun viewer."""

RECORDING = Path("recordings", "demo.rrd")

CAN_RECORD = find_spec("rerun") is not None
"""Whether rerun is installed; it may be missing if ROS was not installed by pip."""


def main(arguments: list[str] | None = None) -> int:
    """Run the demo. Return 0 if every difference is rounding and all energy is accounted for, else 1."""
    argparse.ArgumentParser(prog="collision_response demo", description=DESCRIPTION).parse_args(arguments)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    start = time.monotonic()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    domain = os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    print(f"This process starts a node and calls it over DDS, in domain {domain}.\n")
    problems: list[str] = []
    try:
        problems += demonstrate()  # and keep what was found before an error
    except (NodeFailed, NoAnswer, RCLError, OSError) as error:
        problems.append(str(error))
    except KeyboardInterrupt:
        print("\ninterrupted")
        return 130
    for problem in problems:
        print(f"FAILED: {problem}")
    if not problems:
        took = time.monotonic() - start
        print(f"All differences are rounding, and all energy is accounted for. {took:.1f} s.")
    return 1 if problems else 0


def demonstrate() -> Iterator[str]:
    """Play all parts of the demo; yield a message for each error."""
    with NodeProcess({}) as node, Client(node.check) as client:
        client.wait_for_node()
        yield from chapters.systems(client)

    with NodeProcess(recording_parameters()) as node, Client(node.check) as client:
        client.wait_for_node()
        begin = client.now()
        for chapter, duration in chapters.RECORDED:
            yield from chapter(client, begin)
            begin += round(1e9 * (duration + chapters.PAUSE))
        if not client.topics_agree():
            yield "a result topic differs from the answers"
        impacts = len(client.answers)
        print(f"All {impacts} answers were also published on the result topics.")

    if CAN_RECORD:
        yield from check_recording(impacts)
    else:
        print("Nothing recorded: rerun-sdk is not installed.")


def recording_parameters() -> dict[str, Any]:
    """Parameters of the node for a new recording, which replaces the previous one."""
    if not CAN_RECORD:
        return {}
    if not RECORDING.parent.exists():
        RECORDING.parent.mkdir()
    RECORDING.unlink(missing_ok=True)
    return {
        "recording.enabled": "true",
        "recording.directory": RECORDING.parent,
        "recording.file": RECORDING.name,
    }


def check_recording(impacts: int) -> Iterator[str]:
    """Yield a message if the recording cannot be read, or has another number of impacts and scenes."""
    from ..recording import scenes, table

    try:
        answers, _ = table.divide(table.read([RECORDING]))
        recorded = len(answers) + len(scenes.read([RECORDING]))
    except (RuntimeError, ValueError) as error:  # it is damaged or not complete
        yield str(error)
        return
    print(f"The node has recorded {recorded} impacts and scenes. To see them: {viewer()} {RECORDING}")
    if recorded != impacts:
        yield f"{RECORDING} has {recorded} impacts instead of {impacts}"


def viewer() -> str:
    """Command that starts the rerun viewer, relative to the current directory if possible."""
    path = Path(sysconfig.get_path("scripts"), "rerun")
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def free_domain() -> int:
    """A ROS domain that is unused on this machine: the discovery port of its first member is free."""
    for domain in random.sample(range(1, 100), 99):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7410 + 250 * domain))
            except OSError:
                continue
            return domain
    raise NodeFailed("every ROS domain from 1 to 99 is in use")


if __name__ == "__main__":
    sys.exit(main())
