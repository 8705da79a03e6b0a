"""Symmetric tensors: apply one with ``@``, undo it with :meth:`solve`.

The three forms share both operations, so a law need not know in which geometry it works.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from .number import Scalar
from .vector import V, Vec2, Vec3


class Isotropic(NamedTuple):
    """``scale`` times the identity, of any dimension."""

    scale: Scalar

    def __matmul__(self, v: V) -> V:
        return v * self.scale

    def solve(self, v: V) -> V:
        """The vector that this tensor maps to ``v``."""
        return v / self.scale


class Symmetric2(NamedTuple):
    """A symmetric 2x2 tensor."""

    xx: Scalar
    xy: Scalar
    yy: Scalar

    def __matmul__(self, v: Vec2) -> Vec2:
        xx, xy, yy = self
        x, y = v
        return Vec2(xx * x + xy * y, xy * x + yy * y)

    def __add__(self, other: Symmetric2) -> Symmetric2:  # type: ignore[override]
        return Symmetric2(*(a + b for a, b in zip(self, other, strict=True)))

    def solve(self, v: Vec2) -> Vec2:
        """The vector that this positive definite tensor maps to ``v``, by ``L D L^T``."""
        xx, xy, yy = self
        l_yx = xy / xx
        d_y = yy - l_yx * xy
        y = (v[1] - l_yx * v[0]) / d_y
        return Vec2(v[0] / xx - l_yx * y, y)


class Symmetric3(NamedTuple):
    """A symmetric 3x3 tensor, in the order of ``geometry_msgs/Inertia``."""

    xx: Scalar
    xy: Scalar
    xz: Scalar
    yy: Scalar
    yz: Scalar
    zz: Scalar

    def __matmul__(self, v: Vec3) -> Vec3:
        xx, xy, xz, yy, yz, zz = self
        x, y, z = v
        return Vec3(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)

    def __add__(self, other: Symmetric3) -> Symmetric3:  # type: ignore[override]
        return Symmetric3(*(a + b for a, b in zip(self, other, strict=True)))

    def trace(self) -> Scalar:
        """The sum of the diagonal."""
        return self.xx + self.yy + self.zz

    def factor(self) -> Factor3:
        """The triangular factors ``L D L^T``. Meaningful as far as the pivots are positive."""
        xx, xy, xz, yy, yz, zz = self
        l_yx, l_zx = xy / xx, xz / xx
        d_y = yy - l_yx * xy
        w = yz - l_zx * xy
        l_zy = w / d_y
        return Factor3(l_yx, l_zx, l_zy, xx, d_y, zz - l_zx * xz - l_zy * w)

    def solve(self, v: Vec3) -> Vec3:
        """The vector that this positive definite tensor maps to ``v``."""
        return self.factor().solve(v)


class Factor3(NamedTuple):
    """``L D L^T`` of a :class:`Symmetric3`: ``L`` is unit lower triangular, ``D`` diagonal."""

    l_yx: Scalar
    l_zx: Scalar
    l_zy: Scalar
    d_x: Scalar
    d_y: Scalar
    d_z: Scalar

    def solve(self, v: Vec3) -> Vec3:
        """The vector that the factored tensor maps to ``v``."""
        l_yx, l_zx, l_zy, d_x, d_y, d_z = self
        x, y, z = v
        y = y - l_yx * x
        z = (z - l_zx * x - l_zy * y) / d_z
        y = y / d_y - l_zy * z
        return Vec3(x / d_x - l_yx * y - l_zx * z, y, z)


class Tensor(Protocol[V]):
    """What the three forms share."""

    def __matmul__(self, v: V) -> V: ...

    def solve(self, v: V) -> V:
        """The vector that this tensor maps to ``v``."""


ZERO_TENSOR = Symmetric3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
