"""Bytes that are no messages, from another DDS implementation: Cyclone DDS.

It reaches a node of Fast DDS only if that does not propagate its types (``fastdds.type_propagation``).
"""

import os
import random
import struct
from functools import partial
from typing import Any

from .child import NAMESPACE, Parent
from .kinds import batch, full, scene

SERVICE = f"{NAMESPACE}/collision_response/resolve_collision"
TOPICS = {
    "single": (f"rq{SERVICE}Request", "collision_response.srv.dds_.ResolveCollision_Request_"),
    "batch": (f"rq{SERVICE}_batchRequest", "collision_response.srv.dds_.ResolveCollisionBatch_Request_"),
    "scene": (
        f"rq{NAMESPACE}/collision_response/resolve_sceneRequest",
        "collision_response.srv.dds_.ResolveScene_Request_",
    ),
    "states": (f"rt{NAMESPACE}/body_states", "collision_response.msg.dds_.BodyState_"),
}
CLAIMS = (2**32 - 1, 2**31 - 1, 2**31, 20_000_000, 1_000_000, 65536, 0)
"""Lengths that are not true."""

HEADER = 4
"""Bytes that name the encoding; offsets are counted from behind them."""

PORTION = 100


HARMFUL = {"single": (416, 2**32 - 1), "batch": (24, 20_000_000), "scene": (24, 20_000_000)}
"""Where in a short message a length stands, and what it claimed to great harm: of the second body's inverse
inertia, whose reader reads on behind it; of names, or bodies."""


def kept(what: str) -> list[bytes]:
    """What did harm once, sent first."""
    if what not in HARMFUL:
        return []
    short, (offset, claim) = templates(what)[0], HARMFUL[what]
    at = HEADER + offset
    return [short[:at] + struct.pack("<I", claim) + short[at + 4 :]] * 5


def templates(what: str) -> list[bytes]:
    """Good messages, as they travel: a short one and a full one."""
    from rclpy.serialization import serialize_message

    if what == "states":
        whole = full().body_a
        whole.name = "raw"
    else:
        whole = {"single": full, "batch": partial(batch, 6), "scene": scene}[what]()
    return [serialize_message(type(whole)()), serialize_message(whole)]


class Draw(random.Random):
    """What is sent."""

    def bytes_of(self, good: bytes) -> bytes:
        """Something made of a good message, by one of ``WAYS``."""
        header, body = good[:HEADER], good[HEADER:]
        return self.choice(WAYS)(self, header, body)

    def truncated(self, header: bytes, body: bytes) -> bytes:
        return header + body[: self.randrange(len(body))]

    def oversized(self, header: bytes, body: bytes) -> bytes:
        return header + body + self.randbytes(self.choice((1, 4, 1000, 60_000)))

    def garbage(self, header: bytes, body: bytes) -> bytes:
        return header + self.randbytes(self.choice((0, 1, 3, 4, 8, 80, 1000, 10_000)))

    def claimed(self, header: bytes, body: bytes) -> bytes:
        """A number anywhere becomes a great one; if it was a length, what it claims is not there."""
        at = 4 * self.randrange(len(body) // 4)
        return header + body[:at] + struct.pack("<I", self.choice(CLAIMS)) + body[at + 4 :]

    def flipped(self, header: bytes, body: bytes) -> bytes:
        found = bytearray(body)
        for _ in range(self.choice((1, 2, 8, 64))):
            found[self.randrange(len(found))] ^= 1 << self.randrange(8)
        return header + bytes(found)

    def of_another_encoding(self, header: bytes, body: bytes) -> bytes:
        return bytes((self.choice((0, 0, 255)), self.randrange(16))) + self.randbytes(2) + body


WAYS = (
    Draw.truncated,
    Draw.oversized,
    Draw.garbage,
    Draw.claimed,
    Draw.claimed,
    Draw.flipped,
    Draw.of_another_encoding,
)


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: send so many at such a pace, and say ``done``."""
    from dataclasses import dataclass

    from cyclonedds.core import DDSException, Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.idl import IdlStruct, types
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    topic, typename = TOPICS[order["what"]]

    @dataclass
    class Raw(IdlStruct, typename=typename):
        """Goes out as the bytes it is given: Cyclone DDS checks only that its one field is there."""

        first: types.uint8 = 0

        def serialize(self, *_: Any, **__: Any) -> bytes:
            return self.given

    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    writer = DataWriter(participant, Topic(participant, topic, Raw), qos=qos)
    parent.wait_until(writer.get_matched_subscriptions)
    parent.say("ready")
    parent.wait_for("go")
    draw, good, message = Draw(order["seed"]), templates(order["what"]), Raw()
    first = [good[1], *kept(order["what"])]
    sent = refused = 0
    while sent < order["number"] and not parent.is_gone():
        for _ in range(min(PORTION, order["number"] - sent)):
            message.given = first.pop(0) if first else draw.bytes_of(draw.choice(good))
            sent += 1
            try:
                writer.write(message)
            except DDSException:  # of no byte at all
                refused += 1
        parent.pause(PORTION / order["pace"])
    parent.pause(2.0)  # for what is under way
    parent.say("done", {"sent": sent - refused})
