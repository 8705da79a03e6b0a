"""Directions across the normal."""

from __future__ import annotations

import math
from typing import Any

from ..vector import Vec2, Vec3, Vector


def tangents(n: Vector) -> tuple[Any, ...]:
    """Unit vectors across a unit normal: one in the plane; two in space, right-handed with it.

    Source: Duff et al., "Building an Orthonormal Basis, Revisited", J. Comput. Graph. Tech. 6 (2017).
    """
    if isinstance(n, Vec2):
        return (Vec2(n.y, -n.x),)
    sign = math.copysign(1.0, n.z)
    a = -1 / (sign + n.z)
    b = n.x * n.y * a
    return Vec3(1 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3(b, sign + n.y * n.y * a, -n.y)


def across(n: Any, v: Any) -> Any:
    """The part of a vector across a unit normal."""
    return v - n * n.dot(v)


def direction(t_1: Vec3, t_2: Vec3, angle: float) -> Vec3:
    """The unit tangent at ``angle`` [rad] from ``t_1`` towards ``t_2``."""
    return t_1 * math.cos(angle) + t_2 * math.sin(angle)
