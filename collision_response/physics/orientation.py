"""Orientations as quaternions, rational in their components.

A quaternion ``(v, w)`` turns ``a`` into ``a + 2 (w t + v x t) / (q.q)`` with ``t = v x a``. The
division by ``q.q = v.v + w^2`` makes the length of the quaternion immaterial, takes no square root,
and keeps the rotation exact in exact arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

from .number import Scalar
from .vector import Vec3


class Quaternion(NamedTuple):
    """An orientation: it turns body axes into world axes. Any length but 0."""

    x: Scalar
    y: Scalar
    z: Scalar
    w: Scalar

    def to_world(self, a: Vec3) -> Vec3:
        """World components of a vector given in body axes."""
        return self._turn(a, self.w)

    def to_body(self, a: Vec3) -> Vec3:
        """Body components of a vector given in world axes."""
        return self._turn(a, -self.w)

    def squared_length(self) -> Scalar:
        """``q.q``, 1 for a unit quaternion."""
        x, y, z, w = self
        return x * x + y * y + z * z + w * w

    def _turn(self, a: Vec3, w: Scalar) -> Vec3:
        v = Vec3(self.x, self.y, self.z)
        t = v.cross(a)
        return a + (t * w + v.cross(t)) * (2 / self.squared_length())
