"""Bodies by their centres of mass, for those who show or tabulate them."""

from __future__ import annotations

from .body_numbers import PARALLEL
from .physics.body import Body
from .physics.orientation import Quaternion, Rotation
from .physics.vector import ZERO, Vec3


def at_centre(body: Body) -> Body:
    """The same body, of plain numbers, with its centre of mass for reference point.

    With ``c`` from the reference point to the centre of mass, that is at ``x + c`` and moves with
    ``v + w x c``.
    """
    if not any(body.com):
        return body
    c = com_in_world_axes(body)
    return body._replace(
        position=body.position + c, velocity=body.velocity + body.angular_velocity.cross(c), com=ZERO
    )


def com_in_world_axes(body: Body) -> Vec3:
    """From the reference point to the centre of mass, for a quaternion of any length."""
    return body.com if body.orientation is None else rotation_of(body).to_world(body.com)


def rotation_of(body: Body) -> Rotation:
    """From body axes to world axes, for a quaternion of any length."""
    turn = body.orientation or PARALLEL
    longest = max(map(abs, turn))  # so that no square overflows, or is 0
    return Quaternion(*(q / longest for q in turn)).rotation()
