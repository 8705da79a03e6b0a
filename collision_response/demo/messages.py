"""Bodies and contacts to messages: what a client of the service has to write."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, Vector3

from ..msg import BodyState, CollisionResult
from ..msg import Contact as ContactMessage
from ..physics.body import Body
from ..physics.body import Twist as BodyTwist
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.vector import Vec3
from .scene import Answer

FRAME = "world"


def time_of(nanoseconds: int) -> Time:
    """A stamp from one number [ns]."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def state_of(name: str, body: Body, stamp: Time) -> BodyState:
    """A body as the service wants to know it; one that does not give way stands still."""
    state = BodyState(name=name)
    state.header.frame_id, state.header.stamp = FRAME, stamp
    pose, inertia = state.pose, state.inertia
    pose.position.x, pose.position.y, pose.position.z = map(float, body.position)
    if body.orientation is not None:
        q = pose.orientation
        q.x, q.y, q.z, q.w = map(float, body.orientation)
    _write(state.twist.linear, body.velocity)
    _write(state.twist.angular, body.angular_velocity)
    if not body.is_movable():
        state.motion_type = BodyState.STATIC
        return state
    inertia.m = float(body.mass)
    _write(inertia.com, body.com)
    inertia.ixx, inertia.ixy, inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz = map(float, body.inertia)
    return state


def contact_of(contact: Contact, stamp: Time) -> ContactMessage:
    """A contact; the names of the bodies are left to the bodies."""
    message = ContactMessage()
    message.restitution, message.friction = map(float, contact[2:4])
    message.header.frame_id, message.header.stamp = FRAME, stamp
    message.position.x, message.position.y, message.position.z = map(float, contact.position)
    _write(message.normal, contact.normal)
    return message


def answer_of(result: CollisionResult) -> Answer:
    """What a scene needs to know of a result."""
    return Answer(
        twist_of(result.twist_a),
        twist_of(result.twist_b),
        _vector(result.impulse),
        result.energy_lost_restitution,
        result.energy_lost_friction,
        Regime(result.regime),
    )


def twist_of(message: Twist) -> BodyTwist:
    """A twist that was answered."""
    return BodyTwist(_vector(message.linear), _vector(message.angular))


def _write(message: Vector3, vector: Vec3) -> None:
    message.x, message.y, message.z = map(float, vector)


def _vector(message: Vector3) -> Vec3:
    return Vec3(message.x, message.y, message.z)
