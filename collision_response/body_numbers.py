"""Bodies as plain numbers: the rows of ``BodyStates.msg`` and of recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice
from typing import Any

from .physics.body import Body
from .physics.inverse_inertia import InverseInertia
from .physics.orientation import Quaternion
from .physics.tensor import Symmetric3
from .physics.vector import Vec3

ROWS = 23
"""How many numbers a rigid body has in ``BodyStates.msg``."""

IDENTITY_QUATERNION = Quaternion(0.0, 0.0, 0.0, 1.0)
"""The orientation of a body whose axes are parallel to the world's."""


def orientation_of(body: Body) -> Quaternion:
    """Return the orientation of a body, which is the identity if its axes are parallel to the world's."""
    return IDENTITY_QUATERNION if body.orientation is None else Quaternion(*body.orientation)


def none_if_parallel(orientation: Quaternion) -> Quaternion | None:
    """Return ``None``, as bodies have it, for axes that are parallel to the world's; else the orientation.

    One of another length than 1 is returned, too: answers say that it was normalised.
    """
    return None if orientation[:3] == (0, 0, 0) and abs(orientation.w) == 1 else orientation


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
        none_if_parallel(orientation),
        velocity,
        angular_velocity,
        com,
        None if is_rigid else InverseInertia(*inverse_inertia or ()),
    )
