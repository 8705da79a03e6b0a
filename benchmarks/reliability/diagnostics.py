"""Reads the diagnostics of the node."""

from __future__ import annotations

import time
from typing import Any

from .child_process import Parent, ros_node

PATIENCE = 5.0
"""Longest wait [s]; diagnostics come every second."""


def run(_: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: send "found" with the next values on ``/diagnostics``, or none."""
    from diagnostic_msgs.msg import DiagnosticArray

    received: list[Any] = []
    with ros_node("diagnostics_reader") as (node, executor):
        node.create_subscription(DiagnosticArray, "/diagnostics", received.append, 10)
        end = time.monotonic() + PATIENCE
        while not received and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
    found = [pair for message in received[-1:] for status in message.status for pair in status.values]
    parent.send("found", {pair.key: pair.value for pair in found})
