"""Bodies by their centres of mass, for those who show or tabulate them."""

from __future__ import annotations

from .physics.body import Body
from .physics.orientation import Quaternion
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
    if body.orientation is None:
        return body.com
    longest = max(map(abs, body.orientation))  # so that no square overflows, or is 0
    return Quaternion(*(q / longest for q in body.orientation)).rotation().to_world(body.com)
