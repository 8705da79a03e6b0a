"""A body as a column of 23 numbers, in the order of ``BodyStates.msg``."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .physics.body import Body
from .physics.inverse_inertia import InverseInertia
from .physics.orientation import Quaternion
from .physics.tensor import Symmetric3
from .physics.vector import Vec3

ROWS = 23

PARALLEL = Quaternion(0.0, 0.0, 0.0, 1.0)
"""The orientation of a body whose axes are those of the frame."""


def numbers_of(body: Body) -> list[float]:
    """The numbers of a body; the mass of an immovable one is infinite."""
    turn = body.orientation or PARALLEL
    return [
        body.mass,
        *body.inertia,
        *body.com,
        *body.position,
        *turn,
        *body.velocity,
        *body.angular_velocity,
    ]


def body_of(numbers: Sequence[float], inverse_inertia: Sequence[float] | None = None) -> Body:
    """The body with these numbers.

    Args:
        numbers: as :func:`numbers_of` gives them.
        inverse_inertia: of a link of a mechanism, its 21 numbers; NaN or ``None``: of a rigid body.
    """
    is_rigid = inverse_inertia is None or math.isnan(inverse_inertia[0])
    turn = Quaternion(*numbers[13:17])
    return Body(
        numbers[0],
        Symmetric3(*numbers[1:7]),
        Vec3(*numbers[10:13]),
        None if turn == PARALLEL else turn,
        Vec3(*numbers[17:20]),
        Vec3(*numbers[20:23]),
        Vec3(*numbers[7:10]),
        None if is_rigid else InverseInertia(*inverse_inertia or ()),
    )
