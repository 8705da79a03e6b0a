"""Sends bytes that are no valid messages, with another DDS implementation: Cyclone DDS.

They reach a node with Fast DDS only if it does not propagate its types (``fastdds.type_propagation``).
"""

import os
import random
import struct
from functools import partial
from typing import Any

from .child_process import NAMESPACE, Parent
from .request_kinds import batch, full, scene

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
"""Wrong lengths to claim."""

HEADER = 4
"""Number of bytes that name the encoding; offsets count from their end."""

PORTION = 100
"""Messages sent between two pauses."""

HARMFUL = {"single": (416, 2**32 - 1), "batch": (24, 20_000_000), "scene": (24, 20_000_000)}
"""Offset of a length in a short message, and a claim that once did great harm: the length of the inverse
inertia of the second body, after which the reader reads on, or that of the names or bodies."""


def kept(what: str) -> list[bytes]:
    """Messages that did harm once; they are sent first."""
    if what not in HARMFUL:
        return []
    short, (offset, claim) = templates(what)[0], HARMFUL[what]
    at = HEADER + offset
    return [short[:at] + struct.pack("<I", claim) + short[at + 4 :]] * 5


def templates(what: str) -> list[bytes]:
    """Valid messages in serialized form: a short one and a complete one."""
    from rclpy.serialization import serialize_message

    if what == "states":
        whole = full().body_a
        whole.name = "raw"
    else:
        whole = {"single": full, "batch": partial(batch, 6), "scene": scene}[what]()
    return [serialize_message(type(whole)()), serialize_message(whole)]


class Draw(random.Random):
    """Draws messages to send."""

    def bytes_of(self, good: bytes) -> bytes:
        """A valid message, changed in one of ``WAYS``."""
        header, body = good[:HEADER], good[HEADER:]
        return self.choice(WAYS)(self, header, body)

    def truncated(self, header: bytes, body: bytes) -> bytes:
        return header + body[: self.randrange(len(body))]

    def oversized(self, header: bytes, body: bytes) -> bytes:
        return header + body + self.randbytes(self.choice((1, 4, 1000, 60_000)))

    def garbage(self, header: bytes, body: bytes) -> bytes:
        return header + self.randbytes(self.choice((0, 1, 3, 4, 8, 80, 1000, 10_000)))

    def claimed(self, header: bytes, body: bytes) -> bytes:
        """Replace a number anywhere by a large one; if it was a length, it is now wrong."""
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
    """Main function of the process: send the ordered number of messages at the ordered rate, then "done"."""
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
        """Serialized as the given bytes: Cyclone DDS only checks that its one field exists."""

        first: types.uint8 = 0

        def serialize(self, *_: Any, **__: Any) -> bytes:
            return self.given

    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    writer = DataWriter(participant, Topic(participant, topic, Raw), qos=qos)
    parent.wait_until(writer.get_matched_subscriptions)
    parent.send("ready")
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
            except DDSException:  # it refuses messages without any byte
                refused += 1
        parent.pause(PORTION / order["pace"])
    parent.pause(2.0)  # so that the last messages arrive
    parent.send("done", {"sent": sent - refused})
