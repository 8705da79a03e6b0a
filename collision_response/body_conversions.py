"""Convert bodies of plain floats: to and from the rows of ``BodyStates.msg``, and to the centre of mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice
from typing import Any

from .physics.body import Body
from .physics.inverse_inertia import InverseInertia
from .physics.orientation import Quaternion
from .physics.tensor import Symmetric3
from .physics.vector import ZERO, Vec3

ROWS = 23
"""How many numbers a rigid body has in ``BodyStates.msg``."""

IDENTITY_QUATERNION = Quaternion(0.0, 0.0, 0.0, 1.0)
"""The orientation of a body whose axes are parallel to the world's."""

LEAST_MOMENT = 2.0**-48
"""A moment of inertia in turned axes is rounding if it is at most this fraction of the trace."""


def orientation_of(body: Body) -> Quaternion:
    """Return the orientation of a body, which is the identity if its axes are parallel to the world's."""
    return IDENTITY_QUATERNION if body.orientation is None else Quaternion(*body.orientation)


def body_to_numbers(body: Body) -> list[float]:
    """Return the 23 numbers of a body, in the order of ``BodyStates.msg``.

    The mass of an immovable body is infinite. The inverse inertia of an articulated body is not among them.
    """
    return [
        body.mass,
        *body.inertia,
        *body.com,
        *body.position,
        *orientation_of(body),
        *body.velocity,
        *body.angular_velocity,
    ]


def body_from_numbers(numbers: Sequence[float], inverse_inertia: Sequence[float] | None = None) -> Body:
    """Return the body with these numbers.

    Args:
        numbers: the 23 numbers that :func:`body_to_numbers` returns.
        inverse_inertia: the 21 numbers of an articulated body's inverse inertia; ``None`` or NaN if the body
            is rigid.
    """
    is_rigid = inverse_inertia is None or math.isnan(inverse_inertia[0])
    left = iter(numbers)

    def take(kind: Any) -> Any:
        return kind(*islice(left, len(kind._fields)))

    mass, inertia, com, position = next(left), take(Symmetric3), take(Vec3), take(Vec3)
    orientation, velocity, angular_velocity = take(Quaternion), take(Vec3), take(Vec3)
    return Body(
        mass,
        inertia,
        position,
        None if orientation == IDENTITY_QUATERNION else orientation,
        velocity,
        angular_velocity,
        com,
        None if is_rigid else InverseInertia(*inverse_inertia or ()),
    )


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
