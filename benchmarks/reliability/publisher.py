"""Publishes body states at a given rate, as prepared bytes, because making messages would be too slow."""

from __future__ import annotations

import struct
import time
from typing import Any

from .child_process import Parent, ros_node
from .request_kinds import NAMES, full

TICK = 0.002
"""Time between two ticks [s]; the states of one tick are published together."""

TABLE = 1000
"""Number of bodies in one ``BodyStates`` message."""


def name_of(number: int) -> str:
    """Name of a body. All names have the same length, so that one can replace another in the bytes."""
    return f"body_{number:07}"


class Template:
    """The bytes of a message with body states, in which names and stamp are replaced.

    Attributes:
        bodies: number of bodies in one message.
        kind: type of the message.
    """

    def __init__(self, name: str) -> None:
        from cases import ALIGNED
        from rclpy.serialization import serialize_message

        from collision_response import msg
        from collision_response.body_numbers import body_to_numbers

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

    def filled(self, first: int) -> bytes:
        """The bytes for the bodies from number ``first`` on, with the current time."""
        for number, at in enumerate(self._places, first):
            name = name_of(number).encode()
            self._bytes[at : at + len(name)] = name
        now = time.time_ns()
        struct.pack_into("<iI", self._bytes, 4, now // 1_000_000_000, now % 1_000_000_000)
        return bytes(self._bytes)


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: publish at ``rate`` until ``number`` states are sent or "stop" comes.

    It ends by sending "sent". The states belong to ``bodies`` bodies, from number ``first`` on.
    """
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    qos = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    template = Template(order["type"])
    named_states = [full().body_a, full().body_b] if order["type"] == "BodyState" else []
    for state, name in zip(named_states, NAMES, strict=False):
        state.name = name
    with ros_node("publisher") as (node, _):
        publisher = node.create_publisher(template.kind, order["topic"], qos)
        parent.wait_until(publisher.get_subscription_count)
        parent.send("ready")
        parent.wait_for("go")
        began, sent, announced, step = time.monotonic(), 0, 0.0, template.bodies
        while sent < order["number"] and not parent.has_sent("stop") and not parent.is_gone():
            elapsed = time.monotonic() - began
            if elapsed >= announced:  # the bodies that clients give by name, ten times a second
                announced = elapsed + 0.1
                for state in named_states:
                    state.header.stamp = node.get_clock().now().to_msg()
                    publisher.publish(state)
            due = min(order["number"], int(elapsed * order["rate"]) + step, sent + 1000 * step)
            while sent + step <= due:
                publisher.publish(template.filled(order["first"] + sent % order["bodies"]))
                sent += step
            parent.pause(TICK)
        parent.send("sent", {"states": sent, "seconds": time.monotonic() - began})
