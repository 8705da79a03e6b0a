"""Publishes body states at a rate, as bytes made beforehand: Python would be too slow to make them on the way."""

from __future__ import annotations

import struct
import time
from typing import Any

from .child import Parent
from .kinds import NAMES, full

NAME = "body_0000000"
TICK = 0.002
"""Seconds; the states of one tick go out together."""


class States:
    """The bytes of a state, with a name and the present time filled in."""

    def __init__(self) -> None:
        from rclpy.serialization import serialize_message

        state = full().body_a
        state.name = NAME
        self._bytes = bytearray(serialize_message(state))
        self._name = self._bytes.index(NAME.encode())

    def of(self, number: int) -> bytes:
        """Of the body of that number."""
        name = f"body_{number:07}".encode()
        self._bytes[self._name : self._name + len(name)] = name
        now = time.time_ns()
        struct.pack_into("<iI", self._bytes, 4, now // 1_000_000_000, now % 1_000_000_000)
        return bytes(self._bytes)


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: publish at ``rate``, round about ``bodies``, until ``number`` or told to stop; say ``sent``."""
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    from collision_response.msg import BodyState

    qos = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    rclpy.init()
    node, states = Node("publisher"), States()
    publisher = node.create_publisher(BodyState, order["topic"], qos)
    asked_for = [full().body_a, full().body_b]
    for state, name in zip(asked_for, NAMES, strict=True):
        state.name = name
    try:
        parent.wait_until(publisher.get_subscription_count)
        parent.say("ready")
        parent.wait_for("go")
        began, sent, announced = time.monotonic(), 0, 0.0
        while sent < order["number"] and not parent.has_said("stop") and not parent.is_gone():
            elapsed = time.monotonic() - began
            if elapsed >= announced:  # those that clients ask for by name, ten times a second
                announced = elapsed + 0.1
                for state in asked_for:
                    state.header.stamp = node.get_clock().now().to_msg()
                    publisher.publish(state)
            due = min(order["number"], int(elapsed * order["rate"]) + 1)
            for number in range(sent, min(due, sent + 1000)):
                publisher.publish(states.of(number % order["bodies"]))
            sent = min(due, sent + 1000)
            parent.pause(TICK)
        parent.say("sent", {"states": sent, "seconds": time.monotonic() - began})
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
