"""Conversion of bodies and contacts to messages and back, as a client of the service needs it."""

from __future__ import annotations

import rclpy.time
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist

from ..body_conversions import body_to_numbers
from ..msg import BodyState
from ..msg import Contact as ContactMessage
from ..physics.body import Body
from ..physics.body import Twist as BodyTwist
from ..physics.contact import Contact
from ..ros.convert import vector_of
from ..ros.serialized import state_from

FRAME = "world"


def time_of(nanoseconds: int) -> Time:
    """Stamp of a time [ns]."""
    return rclpy.time.Time(nanoseconds=nanoseconds).to_msg()


def state_of(name: str, body: Body, stamp: Time) -> BodyState:
    """Message with the state of a body; an immovable body is static."""
    state = BodyState(name=name)
    state.header.frame_id, state.header.stamp = FRAME, stamp
    if not body.is_movable():
        state.motion_type = BodyState.STATIC
        body = body._replace(mass=0.0)
    return state_from(map(float, body_to_numbers(body)), state)


def contact_of(contact: Contact, stamp: Time) -> ContactMessage:
    """Message of a contact, without the names of the bodies."""
    message = ContactMessage()
    message.restitution, message.friction = map(float, contact[2:4])
    message.header.frame_id, message.header.stamp = FRAME, stamp
    for part, vector in ((message.position, contact.position), (message.normal, contact.normal)):
        part.x, part.y, part.z = map(float, vector)
    return message


def twist_of(message: Twist) -> BodyTwist:
    """Twist of a message."""
    return BodyTwist(vector_of(message.linear), vector_of(message.angular))
