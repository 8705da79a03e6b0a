"""Symmetric tensors of space: apply one with ``@``, undo it with :meth:`Symmetric3.solve`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

from ..numbers.operations import Condition, Scalar, certain, choose, greater, square_root
from .vector import AXES, Vec3

T = TypeVar("T")

SINGULAR = 2.0**-40
"""A determinant of at most this part of the product of its diagonal is rounding of the tensor's making."""
LEAST_EIGENVALUE = 2.0**-70
"""An eigenvalue of at most this part of the trace is so, too: it is that of a lever arm of 2^-35."""
ASYMMETRY = 1e-9
"""How far the two halves of a matrix may differ, relative to its largest component: by rounding."""


class Symmetric3(NamedTuple):
    """A symmetric 3x3 tensor, in the order of ``geometry_msgs/Inertia``."""

    xx: Scalar
    xy: Scalar
    xz: Scalar
    yy: Scalar
    yz: Scalar
    zz: Scalar

    @classmethod
    def of(cls, values: Iterable[Any]) -> Symmetric3:
        """From ``(xx, xy, xz, yy, yz, zz)``, or from the three rows of a matrix.

        Raises:
            ValueError: it is neither, or the matrix is not symmetric to ``ASYMMETRY`` of its largest
                component. Less asymmetry is averaged out.
        """
        values = tuple(values)
        if len(values) == 6:
            return cls(*values)
        if len(values) != 3 or [len(row) if hasattr(row, "__len__") else 0 for row in values] != [3, 3, 3]:
            raise ValueError(f"must be (xx, xy, xz, yy, yz, zz) or three rows of three, is {values}")
        allowed = ASYMMETRY * max(abs(x) for row in values for x in row)

        def mean(i: int, j: int) -> Scalar:
            if abs(values[i][j] - values[j][i]) > allowed:
                raise ValueError(f"must be symmetric, is {values}")
            return (values[i][j] + values[j][i]) / 2

        return cls(values[0][0], mean(0, 1), mean(0, 2), values[1][1], mean(1, 2), values[2][2])

    def __matmul__(self, v: Vec3) -> Vec3:
        xx, xy, xz, yy, yz, zz = self
        x, y, z = v
        return Vec3(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)

    def __add__(self, other: Symmetric3) -> Symmetric3:  # type: ignore[override]
        return Symmetric3(*(a + b for a, b in zip(self, other, strict=True)))

    def __mul__(self, factor: Scalar) -> Symmetric3:
        return Symmetric3(*(x * factor for x in self))

    def trace(self) -> Scalar:
        """The sum of the diagonal."""
        return self.xx + self.yy + self.zz

    def factor(self) -> Factor3:
        """The triangular factors ``L D L^T``. Meaningful as far as the pivots are positive."""
        xx, xy, xz, yy, yz, zz = self
        i_x = 1 / xx
        l_yx, l_zx = xy * i_x, xz * i_x
        i_y = 1 / (yy - l_yx * xy)
        w = yz - l_zx * xy
        l_zy = w * i_y
        return Factor3(l_yx, l_zx, l_zy, i_x, i_y, 1 / (zz - l_zx * xz - l_zy * w))

    def solve(self, v: Vec3) -> Vec3:
        """The vector that this positive definite tensor maps to ``v``."""
        return self.factor().solve(v)

    def has_rank_one(self, least: Scalar) -> Condition:
        """Whether this positive semi-definite tensor maps all to one line, to rounding.

        Args:
            least: eigenvalues up to this, or up to ``LEAST_EIGENVALUE`` of the trace, count as 0.
        """
        minors, rounding = self._minors(least)
        return certain(minors) <= rounding

    def least_nonzero_eigenvalue(self, least: Scalar) -> Scalar:
        """The least of its eigenvalues but for 0, to a factor of 2, if it is singular."""
        return choose(self.has_rank_one(least), self.trace, lambda: self._minors(least)[0] * self._size())

    def _minors(self, least: Scalar) -> tuple[Scalar, Scalar]:
        """The sum of the principal minors, for a trace of 1, and up to where it is rounding."""
        xx, xy, xz, yy, yz, zz = self * (1 / self._size())
        minors = yy * zz - yz * yz + xx * zz - xz * xz + xx * yy - xy * xy
        coupled = certain(SINGULAR * (xx * yy + yy * zz + xx * zz))
        return minors, greater(coupled, self._share(least))

    def _share(self, least: Scalar) -> Scalar:
        """Of the trace."""
        return greater(certain(least / self._size()), LEAST_EIGENVALUE)

    def _size(self) -> Scalar:
        """The trace, or 1 if that is 0."""
        trace = self.trace()
        return choose(certain(trace) > 0, lambda: trace, lambda: trace * 0 + 1)

    def null_space(self, least: Scalar) -> Symmetric3:
        """The projection on what this positive semi-definite tensor maps to 0, to rounding; 0 if nothing.

        Of rank 2 it is the adjugate over its trace, of rank 1 all but the tensor over its trace.
        """
        xx, xy, xz, yy, yz, zz = self * (1 / self._size())
        a_xx, a_yy, a_zz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
        a_xy, a_xz, a_yz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
        det = xx * a_xx + xy * a_xy + xz * a_xz
        minors, rounding = self._minors(least)
        is_plane = certain(minors) > rounding
        coupled = certain(SINGULAR * (xx * yy * zz))
        is_definite = certain(det) > greater(coupled, self._share(least) * certain(minors))
        size = choose(is_plane, lambda: minors, lambda: xx + yy + zz)
        size = choose(certain(size) > 0, lambda: size, lambda: size * 0 + 1)

        def of_line() -> Symmetric3:
            return Symmetric3(1 - xx / size, -xy / size, -xz / size, 1 - yy / size, -yz / size, 1 - zz / size)

        def of_plane() -> Symmetric3:
            return Symmetric3(*(x / size for x in (a_xx, a_xy, a_xz, a_yy, a_yz, a_zz)))

        projection = choose(is_plane, of_plane, of_line)
        return choose(is_definite, lambda: projection * 0, lambda: projection)


class Factor3(NamedTuple):
    """``L D L^T`` of a :class:`Symmetric3`: ``L`` unit lower triangular, ``D`` diagonal; ``i`` is ``1/D``."""

    l_yx: Scalar
    l_zx: Scalar
    l_zy: Scalar
    i_x: Scalar
    i_y: Scalar
    i_z: Scalar

    def reduced(self, v: Vec3) -> Vec3:
        """``L^-1 v``."""
        y = v[1] - self.l_yx * v[0]
        return Vec3(v[0], y, v[2] - self.l_zx * v[0] - self.l_zy * y)

    def scaled(self, w: Vec3) -> Vec3:
        """``D^-1 w``."""
        return Vec3(w[0] * self.i_x, w[1] * self.i_y, w[2] * self.i_z)

    def restored(self, w: Vec3) -> Vec3:
        """``L^-T w``."""
        y = w[1] - self.l_zy * w[2]
        return Vec3(w[0] - self.l_yx * y - self.l_zx * w[2], y, w[2])

    def solve(self, v: Vec3) -> Vec3:
        """The vector that the factored tensor maps to ``v``."""
        return self.restored(self.scaled(self.reduced(v)))


class RodFactor(NamedTuple):
    """``P D P`` of a thin rod's pseudo-inverse: ``P`` projects across its axis, ``i`` is all of ``D``.

    It does what :class:`Factor3` does. Where there is no inertia at all, ``i`` is 0 and ``P`` means nothing.
    """

    across: Symmetric3
    i: Scalar

    def reduced(self, v: Vec3) -> Vec3:
        """``P v``."""
        return self.across @ v

    def scaled(self, w: Vec3) -> Vec3:
        """``D w``."""
        return w * self.i

    def restored(self, w: Vec3) -> Vec3:
        """``P w``."""
        return self.across @ w

    def effective_spin(self, spin: Vec3) -> Vec3:
        """What of an angular velocity has inertia."""
        return choose(self.i > 0, lambda: self.across @ spin, lambda: spin * 0)


class InverseTensor(NamedTuple):
    """``I^-1`` by the factors of ``I``, or of a thin rod by what it has across its axis.

    Kept apart, factors lose fewer digits of an ill-conditioned tensor than their product would.

    Attributes:
        has_factors: whether there are factors, not a rod.
        factors: of ``I``.
        rod: of the pseudo-inverse.
    """

    has_factors: Condition
    factors: Factor3
    rod: RodFactor

    def __matmul__(self, v: Vec3) -> Vec3:
        return self._by(lambda own: own.restored(own.scaled(own.reduced(v))))

    def quadratic_form(self, v: Vec3) -> Scalar:
        """``v.I^-1 v``: a sum of squares."""

        def squares(own: Factor3 | RodFactor) -> Scalar:
            w = own.reduced(v)
            return w.dot(own.scaled(w))

        return self._by(squares)

    def congruence(self, x: Vec3, y: Vec3, z: Vec3) -> Symmetric3:
        """``G^T I^-1 G`` of the matrix ``G`` with these columns."""

        def products(own: Factor3 | RodFactor) -> Symmetric3:
            gx, gy, gz = own.reduced(x), own.reduced(y), own.reduced(z)
            jx, jy, jz = own.scaled(gx), own.scaled(gy), own.scaled(gz)
            return Symmetric3(gx.dot(jx), gx.dot(jy), gx.dot(jz), gy.dot(jy), gy.dot(jz), gz.dot(jz))

        return self._by(products)

    def square_root_columns(self) -> tuple[Vec3, ...]:
        """Three vectors ``r``: the sum of all ``r r^T`` is ``I^-1``."""

        def of(own: Factor3 | RodFactor) -> tuple[Vec3, ...]:
            sizes = own.scaled(Vec3(1, 1, 1))
            return tuple(own.restored(axis * square_root(i)) for axis, i in zip(AXES, sizes, strict=True))

        return self._by(of)

    def _by(self, formula: Callable[[Factor3 | RodFactor], T]) -> T:
        return choose(self.has_factors, lambda: formula(self.factors), lambda: formula(self.rod))


ZERO_TENSOR = Symmetric3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
UNIT = Symmetric3(1, 0, 0, 1, 0, 1)
