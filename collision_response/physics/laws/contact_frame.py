"""A contact in its own axes: two tangents and the normal, each of length 1.

The tangents are those of Duff et al., with x in the place of their z: for a normal in the x-y plane one
tangent is the z axis, up to sign, so a planar contact stays exactly planar.

Source: Duff et al., "Building an Orthonormal Basis, Revisited", J. Comput. Graph. Tech. 6 (2017).
"""

from __future__ import annotations

from typing import NamedTuple

from ...numbers.operations import Condition, Scalar, certain, choose, error_of, fixed, square_root
from ..effective_mass import ContactKinematics
from ..vector import Vec3


class Tangential(NamedTuple):
    """A tangential vector, by its components along the two tangents."""

    x: Scalar
    y: Scalar

    def __add__(self, other: Tangential) -> Tangential:  # type: ignore[override]
        return Tangential(self[0] + other[0], self[1] + other[1])

    def __mul__(self, factor: Scalar) -> Tangential:
        return Tangential(self[0] * factor, self[1] * factor)

    def __neg__(self) -> Tangential:
        return Tangential(-self[0], -self[1])

    def __truediv__(self, divisor: Scalar) -> Tangential:
        return self * (1 / divisor)

    def dot(self, other: Tangential) -> Scalar:
        """The scalar product."""
        return self[0] * other[0] + self[1] * other[1]

    def cross(self, other: Tangential) -> Scalar:
        """The normal component of the vector product."""
        return self[0] * other[1] - self[1] * other[0]

    def length(self) -> Scalar:
        """The Euclidean length."""
        return square_root(self.dot(self))

    def norm_1(self) -> Scalar:
        """The sum of the magnitudes of the components: between the length and sqrt(2) times it."""
        return abs(self[0]) + abs(self[1])


class ContactFrame(NamedTuple):
    """The unit vectors ``t1``, ``t2`` and ``n``, and the components of ``u`` and ``K`` along them."""

    t1: Vec3
    t2: Vec3
    n: Vec3
    u1: Scalar
    u2: Scalar
    un: Scalar
    K11: Scalar
    K12: Scalar
    K22: Scalar
    K1n: Scalar
    K2n: Scalar
    Knn: Scalar

    @classmethod
    def of(cls, contact: ContactKinematics) -> ContactFrame:
        """The frame of a contact."""
        nn, length = contact.n.dot(contact.n), contact.n.norm()
        n = contact.n / length
        x, y, z = n
        sign = choose(fixed(certain(x)) < 0, lambda: -1, lambda: 1)  # at 0 either sign works
        a = -1 / (sign + x)
        b = y * z * a
        t1 = Vec3(-(sign * y), 1 + sign * (y * y * a), sign * b)
        t2 = Vec3(-z, b, sign + z * z * a)
        u, K = contact.u, contact.inverse_effective_mass()
        K1, K2 = K @ t1, K @ t2
        return cls(
            t1, t2, n,
            t1.dot(u), t2.dot(u), contact.n_u / length,
            t1.dot(K1), t2.dot(K1), t2.dot(K2), n.dot(K1), n.dot(K2), contact.n_Kn / nn,
        )  # fmt: skip

    def surely_separates(self) -> Condition:
        """Whether the bodies do not approach, beyond rounding: then no law needs to follow a path."""
        return certain(self.un) >= certain(2 * error_of(self.un))

    def scaled_K(self) -> tuple[Scalar, ...]:
        """``K11``, ``K12``, ``K22``, ``K1n`` and ``K2n`` in units of ``Knn``."""
        return tuple(K / self.Knn for K in (self.K11, self.K12, self.K22, self.K1n, self.K2n))

    def to_world(self, tangential: Tangential, normal: Scalar) -> Vec3:
        """The vector with these components, in world axes."""
        return self.t1 * tangential[0] + self.t2 * tangential[1] + self.n * normal
