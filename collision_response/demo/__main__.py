"""``python3 -m collision_response.demo``: the node at work, called from this process."""

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
from pathlib import Path
from typing import Any

from ..ros.take_all import RCLError
from . import chapters
from .client import Client, NoAnswer
from .node_process import NodeFailed, NodeProcess
from .recording import RECORDING, can_record, impacts_in

DESCRIPTION = """Starts a node of its own and calls it: eight systems with known answers, a break shot and a
tumbling rod. Ends with 0 if every difference is rounding. Writes recordings/demo.rrd for the rerun viewer."""


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; the exit code is 0 if every difference is rounding and all energy is accounted for."""
    argparse.ArgumentParser(prog="collision_response demo", description=DESCRIPTION).parse_args(arguments)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    start = time.monotonic()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    domain = os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    print(f"A node is started and called from another process over DDS, in domain {domain}.\n")
    try:
        problems = list(demonstrate())
    except (NodeFailed, NoAnswer, RCLError) as error:
        problems = [str(error)]
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
    """All parts of the demo; gives what is wrong."""
    with NodeProcess({}) as node, Client(node.check) as client:
        client.wait_for_node()
        yield from chapters.systems(client)
        yield from check_topic(client)
        yield from chapters.burst(client)

    with NodeProcess(recording_parameters()) as node, Client(node.check) as client:
        client.wait_for_node()
        begin = client.now()
        for chapter, lasts in chapters.RECORDED:
            yield from chapter(client, begin)
            begin += round(1e9 * (lasts + chapters.PAUSE))
        yield from check_topic(client)
        answers = client.answers()
        impacts = sum(answer.status.code == answer.status.OK for answer in answers)
        print(f"The result topics have brought all {len(answers)} answers.")

    if not can_record():
        print("Nothing recorded: rerun-sdk is not installed.")
        return
    held = impacts_in(RECORDING)
    print(f"The node has recorded {held} impacts. To see them: {viewer()} {RECORDING}")
    if held != impacts:
        yield f"{RECORDING} holds {held} impacts, not {impacts}"


def recording_parameters() -> dict[str, Any]:
    """The node's parameters for a new recording in place of the last one."""
    if not can_record():
        return {}
    RECORDING.unlink(missing_ok=True)
    return {
        "recording.enabled": "true",
        "recording.directory": RECORDING.parent,
        "recording.file": RECORDING.name,
    }


def check_topic(client: Client) -> Iterator[str]:
    """Whether the result topics tell the same as the answers."""
    if not client.topics_agree():
        yield "a result topic differs from the answers"


def viewer() -> str:
    """How to call rerun from here."""
    here = Path(sysconfig.get_path("scripts"), "rerun")
    return str(here.relative_to(Path.cwd()) if here.is_relative_to(Path.cwd()) else here)


def free_domain() -> int:
    """A ROS domain that nobody on this machine uses: the discovery port of its first member is free."""
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
