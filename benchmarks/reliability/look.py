"""Looks at a node from outside: its diagnostics."""

from __future__ import annotations

import time
from typing import Any

from .child import Parent, ros_node

PATIENCE = 5.0
"""Seconds; diagnostics come every second."""


def run(_: dict[str, Any], parent: Parent) -> None:
    """As a process: say ``found``, what is on ``/diagnostics`` next; nothing if nobody publishes there."""
    from diagnostic_msgs.msg import DiagnosticArray

    heard: list[Any] = []
    with ros_node("look") as (node, executor):
        node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
        end = time.monotonic() + PATIENCE
        while not heard and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
    found = [pair for message in heard[-1:] for status in message.status for pair in status.values]
    parent.say("found", {pair.key: pair.value for pair in found})
