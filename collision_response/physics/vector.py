"""Three-component vectors of any type of number."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from typing import NamedTuple

from ..numbers.operations import Scalar, square_root
from ..status import format_value

LEAST_SQUARE = sys.float_info.min / sys.float_info.epsilon
"""A sum of squares of floats that is smaller than this may have lost digits to underflow."""


class Vec3(NamedTuple):
    """A vector in space, of numbers of any type.

    The other vector of a sum, a difference or a product may be a plain tuple or an array. ``*`` and ``/``
    take a number; two vectors are multiplied by :meth:`dot` or :meth:`cross`.
    """

    x: Scalar
    y: Scalar
    z: Scalar

    def __add__(self, other: Iterable[Scalar]) -> Vec3:
        x, y, z = other
        return Vec3(self[0] + x, self[1] + y, self[2] + z)

    def __radd__(self, other: Iterable[Scalar]) -> Vec3:
        return self + other  # without this, a plain tuple + Vec3 would concatenate

    def __sub__(self, other: Iterable[Scalar]) -> Vec3:
        x, y, z = other
        return Vec3(self[0] - x, self[1] - y, self[2] - z)

    def __rsub__(self, other: Iterable[Scalar]) -> Vec3:
        return -self + other

    def __neg__(self) -> Vec3:
        return Vec3(-self[0], -self[1], -self[2])

    def __mul__(self, factor: Scalar) -> Vec3:
        if isinstance(factor, (tuple, list)):
            raise TypeError("a vector is multiplied by a number, or with another by dot() or cross()")
        return Vec3(self[0] * factor, self[1] * factor, self[2] * factor)

    def __rmul__(self, factor: Scalar) -> Vec3:
        return self * factor

    def __truediv__(self, divisor: Scalar) -> Vec3:
        return Vec3(self[0] / divisor, self[1] / divisor, self[2] / divisor)

    def dot(self, other: Iterable[Scalar]) -> Scalar:
        """Scalar product with another vector."""
        x, y, z = other
        return self[0] * x + self[1] * y + self[2] * z

    def cross(self, other: Iterable[Scalar]) -> Vec3:
        """Vector product with another vector."""
        ax, ay, az = self
        bx, by, bz = other
        return Vec3(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)

    def norm(self) -> Scalar:
        """Euclidean length."""
        square = self.dot(self)
        if isinstance(square, float) and not LEAST_SQUARE <= square < math.inf:
            return math.hypot(*self)
        return square_root(square)


NO_VECTORS = bytes, bytearray, set, frozenset, dict
"""Types that can be iterated over, but are no numbers in an order."""


def as_vector(field: str, values: Iterable[Scalar]) -> Vec3:
    """Return ``Vec3(*values)``.

    Raises:
        TypeError: if ``values`` does not have three components, in an order; the message names the field.
    """
    try:
        if isinstance(values, NO_VECTORS):
            raise TypeError
        return Vec3(*values)
    except TypeError:
        raise TypeError(f"{field}: must be (x, y, z), is {format_value(values)}") from None


ZERO = Vec3(0.0, 0.0, 0.0)
AXES = Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)
