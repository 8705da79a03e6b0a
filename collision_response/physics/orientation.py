"""Orientations as quaternions of any length but 0.

A quaternion ``q = (v, w)``, with the vector part ``v`` and the scalar part ``w``, rotates body axes into
world axes by the matrix

    R = 1 + 2 / (q.q) (w [v]x + [v]x [v]x)        q.q = v.v + w^2

``R`` does not depend on the length of ``q``. It is rational in the components of ``q``, so it is exact in
exact arithmetic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..numbers.operations import Condition, Scalar, all_zero, choose, negation
from .vector import AXES, Vec3


class Rotation(NamedTuple):
    """A rotation matrix from body axes to world axes.

    Attributes:
        x, y, z: the rows of the matrix.
        turns: whether it is not the identity.
    """

    x: Vec3
    y: Vec3
    z: Vec3
    turns: Condition

    def to_world(self, a: Vec3) -> Vec3:
        """World components of a vector given in body axes."""
        return choose(self.turns, lambda: Vec3(self.x.dot(a), self.y.dot(a), self.z.dot(a)), lambda: a)

    def to_body(self, a: Vec3) -> Vec3:
        """Body components of a vector given in world axes."""
        return choose(self.turns, lambda: self.x * a[0] + self.y * a[1] + self.z * a[2], lambda: a)

    def moments(self, r: Vec3) -> tuple[Vec3, Vec3, Vec3]:
        """The columns of ``R^T [r]x``: moments in body axes of unit forces at ``r`` along the world axes."""
        x, y, z = r
        zero = 0 * x
        return choose(
            self.turns,
            lambda: (self.y * z - self.z * y, self.z * x - self.x * z, self.x * y - self.y * x),
            lambda: (Vec3(zero, z, -y), Vec3(-z, zero, x), Vec3(y, -x, zero)),
        )


class Quaternion(NamedTuple):
    """An orientation: the rotation from body axes to world axes. Any length but 0."""

    x: Scalar
    y: Scalar
    z: Scalar
    w: Scalar

    def squared_length(self) -> Scalar:
        """``q.q``: 1 for a unit quaternion."""
        x, y, z, w = self
        return x * x + y * y + z * z + w * w

    def scaled(self) -> Quaternion:
        """The same orientation, by floats with a length near 1: no square overflows, and not all vanish."""
        if not all(isinstance(x, float) for x in self):
            return self
        exponent = math.frexp(max(map(abs, self)))[1]
        return Quaternion(*(math.ldexp(x, -exponent) for x in self))

    def rotation(self) -> Rotation:
        """The rotation matrix."""
        x, y, z, w = self
        s = 2 / self.squared_length()
        sx, sy, sz = x * s, y * s, z * s
        xx, xy, xz, xw = x * sx, y * sx, z * sx, w * sx
        yy, yz, yw, zz, zw = y * sy, z * sy, w * sy, z * sz, w * sz
        return Rotation(
            Vec3(1 - (yy + zz), xy - zw, xz + yw),
            Vec3(xy + zw, 1 - (xx + zz), yz - xw),
            Vec3(xz - yw, yz + xw, 1 - (xx + yy)),
            negation(all_zero((x, y, z))),
        )


ALIGNED = Rotation(*AXES, False)
"""Body axes parallel to the world axes."""
