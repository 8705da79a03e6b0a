"""Publishes body states at a rate, as bytes made beforehand: making messages on the way is too slow."""

from __future__ import annotations

import struct
import time
from typing import Any

from .child import Parent, ros_node
from .kinds import NAMES, full

TICK = 0.002
"""Seconds; the states of one tick go out together."""

TABLE = 1000
"""Bodies of one message of ``BodyStates``."""


def name_of(number: int) -> str:
    """Of a body. All are of one length, so that one can take the place of another."""
    return f"body_{number:07}"


class Template:
    """The bytes of a message about bodies, with their names and the present time filled in.

    Attributes:
        bodies: of one message.
        kind: of message.
    """

    def __init__(self, name: str) -> None:
        from cases import ALIGNED
        from rclpy.serialization import serialize_message

        from collision_response import msg
        from collision_response.body_conversions import body_to_numbers

        self.kind = getattr(msg, name)
        self.bodies = 1 if name == "BodyState" else TABLE
        if name == "BodyState":
            message = full().body_a
            message.name = name_of(0)
        else:
            message = self.kind(names=list(map(name_of, range(TABLE))))
            message.header.frame_id = "world"
            message.numbers.extend(
                float(number) for number in body_to_numbers(ALIGNED.body_a) for _ in range(TABLE)
            )
        self._bytes = bytearray(serialize_message(message))
        first = self._bytes.index(name_of(0).encode())
        second = self._bytes.find(name_of(1).encode())
        self._places = [first + number * (second - first) for number in range(self.bodies)]

    def of(self, first: int) -> bytes:
        """Of the bodies from that number on."""
        for number, at in enumerate(self._places, first):
            name = name_of(number).encode()
            self._bytes[at : at + len(name)] = name
        now = time.time_ns()
        struct.pack_into("<iI", self._bytes, 4, now // 1_000_000_000, now % 1_000_000_000)
        return bytes(self._bytes)


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: publish at ``rate`` until ``number`` are out or it is told to stop; say ``sent``.

    The bodies are so many, from ``first`` on.
    """
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    qos = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    template = Template(order["type"])
    asked_for = [full().body_a, full().body_b] if order["type"] == "BodyState" else []
    for state, name in zip(asked_for, NAMES, strict=False):
        state.name = name
    with ros_node("publisher") as (node, _):
        publisher = node.create_publisher(template.kind, order["topic"], qos)
        parent.wait_until(publisher.get_subscription_count)
        parent.say("ready")
        parent.wait_for("go")
        began, sent, announced, step = time.monotonic(), 0, 0.0, template.bodies
        while sent < order["number"] and not parent.has_said("stop") and not parent.is_gone():
            elapsed = time.monotonic() - began
            if elapsed >= announced:  # those that clients ask for by name, ten times a second
                announced = elapsed + 0.1
                for state in asked_for:
                    state.header.stamp = node.get_clock().now().to_msg()
                    publisher.publish(state)
            due = min(order["number"], int(elapsed * order["rate"]) + step, sent + 1000 * step)
            while sent + step <= due:
                publisher.publish(template.of(order["first"] + sent % order["bodies"]))
                sent += step
            parent.pause(TICK)
        parent.say("sent", {"states": sent, "seconds": time.monotonic() - began})
