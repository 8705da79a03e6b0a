"""A body at its centre of mass, and as a planar body, in plain floats."""

from __future__ import annotations

from .body import Body
from .tensor import Symmetric3
from .vector import ZERO, Vec3

LEAST_MOMENT = 2.0**-48
"""A moment of inertia in turned axes is rounding if it is at most this fraction of the trace."""


def with_com_as_reference(body: Body) -> Body:
    """Return the same body with its centre of mass as the reference point.

    With ``c`` from the reference point to the centre of mass, the centre of mass is at ``x + c`` and moves
    with ``v + w x c``.
    """
    if not any(body.com):
        return body
    c = com_in_world_axes(body)
    return body._replace(
        position=Vec3(*body.position) + c,
        velocity=Vec3(*body.velocity) + Vec3(*body.angular_velocity).cross(c),
        com=ZERO,
    )


def com_in_world_axes(body: Body) -> Vec3:
    """Vector from the reference point to the centre of mass, in world axes [m]."""
    return body.to_world(Vec3(*body.com))


def moment_about_z(body: Body) -> float:
    """Moment of inertia about the z axis of the world, through the centre of mass [kg m^2]."""
    inertia = Symmetric3(*body.inertia)
    if body.orientation is None:
        return inertia.zz
    axis = body.rotation().z
    moment = axis.dot(inertia @ axis)
    return moment if moment > LEAST_MOMENT * inertia.trace() else 0.0


def planar_spin(body: Body) -> float:
    """Angular velocity of the planar body that has the same angular momentum about the z axis [rad/s].

    That is not ``angular_velocity.z`` if the body also turns about x or y and its inertia couples these
    rotations to that about z.
    """
    x, y, z = body.angular_velocity
    moment = moment_about_z(body)
    if not moment or not body.is_movable():
        return z
    rotation = body.rotation()
    tumbling = rotation.to_body(Vec3(x, y, 0.0))
    return z + (Symmetric3(*body.inertia) @ rotation.z / moment).dot(tumbling)
