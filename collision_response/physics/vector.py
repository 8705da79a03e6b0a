"""Vectors of two and three components, of any kind of number."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from .number import Scalar, square_root


class Vec3(NamedTuple):
    """A vector in space. ``v * s`` scales; write the vector first."""

    x: Scalar
    y: Scalar
    z: Scalar

    def __add__(self, other: Vec3) -> Vec3:  # type: ignore[override]
        return Vec3(self[0] + other[0], self[1] + other[1], self[2] + other[2])

    def __sub__(self, other: Vec3) -> Vec3:
        return Vec3(self[0] - other[0], self[1] - other[1], self[2] - other[2])

    def __neg__(self) -> Vec3:
        return Vec3(-self[0], -self[1], -self[2])

    def __mul__(self, factor: Scalar) -> Vec3:
        return Vec3(self[0] * factor, self[1] * factor, self[2] * factor)

    def __truediv__(self, divisor: Scalar) -> Vec3:
        return Vec3(self[0] / divisor, self[1] / divisor, self[2] / divisor)

    def dot(self, other: Vec3) -> Scalar:
        """The scalar product."""
        return self[0] * other[0] + self[1] * other[1] + self[2] * other[2]

    def cross(self, other: Vec3) -> Vec3:
        """The vector product."""
        ax, ay, az = self
        bx, by, bz = other
        return Vec3(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)

    def norm(self) -> Scalar:
        """The Euclidean length."""
        return square_root(self.dot(self))


class Vec2(NamedTuple):
    """A vector in the x-y plane, with the operations of :class:`Vec3`."""

    x: Scalar
    y: Scalar

    def __add__(self, other: Vec2) -> Vec2:  # type: ignore[override]
        return Vec2(self[0] + other[0], self[1] + other[1])

    def __sub__(self, other: Vec2) -> Vec2:
        return Vec2(self[0] - other[0], self[1] - other[1])

    def __neg__(self) -> Vec2:
        return Vec2(-self[0], -self[1])

    def __mul__(self, factor: Scalar) -> Vec2:
        return Vec2(self[0] * factor, self[1] * factor)

    def __truediv__(self, divisor: Scalar) -> Vec2:
        return Vec2(self[0] / divisor, self[1] / divisor)

    def dot(self, other: Vec2) -> Scalar:
        """The scalar product."""
        return self[0] * other[0] + self[1] * other[1]

    def cross(self, other: Vec2) -> Scalar:
        """The z component of the vector product."""
        return self[0] * other[1] - self[1] * other[0]

    def turned(self, rate: Scalar) -> Vec2:
        """The vector product of ``(0, 0, rate)`` and this vector."""
        return Vec2(-(self[1] * rate), self[0] * rate)

    def norm(self) -> Scalar:
        """The Euclidean length."""
        return square_root(self.dot(self))


Vector = Vec2 | Vec3
V = TypeVar("V", Vec2, Vec3)

ZERO = Vec3(0.0, 0.0, 0.0)
