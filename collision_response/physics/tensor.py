"""Symmetric 3x3 tensors: apply one with ``@``, its inverse with :meth:`Symmetric3.solve`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

from ..numbers.operations import Condition, Scalar, certain, choose, maximum, of_python, square_root
from ..status import format_value
from .vector import AXES, Vec3

T = TypeVar("T")

SINGULAR = 2.0**-40
"""A determinant or minor of at most this part of the product of its diagonal counts as 0: it is rounding."""
LEAST_EIGENVALUE = 2.0**-70
"""An eigenvalue of at most this part of the trace counts as 0: it belongs to a lever arm of 2^-35."""
ASYMMETRY = 1e-9
"""Greatest difference between the two halves of a matrix, relative to its largest component."""


class Symmetric3(NamedTuple):
    """A symmetric 3x3 tensor, with the component order of ``geometry_msgs/Inertia``."""

    xx: Scalar
    xy: Scalar
    xz: Scalar
    yy: Scalar
    yz: Scalar
    zz: Scalar

    @classmethod
    def of(cls, values: Iterable[Any]) -> Symmetric3:
        """The tensor given by ``(xx, xy, xz, yy, yz, zz)`` or by the three rows of a matrix.

        The two halves of a matrix are averaged.

        Raises:
            ValueError: if ``values`` has neither form, or if the halves of the matrix differ by more than
                ``ASYMMETRY`` of its largest component.
        """
        values = tuple(values)
        if len(values) == 6:
            return cls(*values)
        if len(values) != 3 or [len(row) if hasattr(row, "__len__") else 0 for row in values] != [3, 3, 3]:
            hint = "; principal moments a, b, c are (a, 0, 0, b, 0, c)" if len(values) == 3 else ""
            raise ValueError(
                f"must be (xx, xy, xz, yy, yz, zz) or three rows of three, is {format_value(values)}{hint}"
            )
        rows = [[of_python(x) for x in row] for row in values]
        largest = max(abs(x) for row in rows for x in row)

        def mean(i: int, j: int) -> Scalar:
            a, b = rows[i][j], rows[j][i]
            if a == b:  # numbers of any type and size
                return a
            if abs(b - a) / largest > ASYMMETRY:
                raise ValueError(f"must be symmetric, is {format_value(values)}")
            return a + (b - a) / 2  # a sum may overflow

        return cls(rows[0][0], mean(0, 1), mean(0, 2), rows[1][1], mean(1, 2), rows[2][2])

    def __matmul__(self, v: Vec3) -> Vec3:
        xx, xy, xz, yy, yz, zz = self
        x, y, z = v
        return Vec3(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)

    def __add__(self, other: Symmetric3) -> Symmetric3:  # type: ignore[override]
        return Symmetric3(*(a + b for a, b in zip(self, other, strict=True)))

    def __mul__(self, factor: Scalar) -> Symmetric3:
        return Symmetric3(*(x * factor for x in self))

    def rows(self) -> tuple[Vec3, Vec3, Vec3]:
        """The rows of the matrix."""
        xx, xy, xz, yy, yz, zz = self
        return Vec3(xx, xy, xz), Vec3(xy, yy, yz), Vec3(xz, yz, zz)

    def trace(self) -> Scalar:
        """The sum of the diagonal."""
        return self.xx + self.yy + self.zz

    def solve(self, v: Vec3) -> Vec3:
        """The vector that this positive definite tensor maps to ``v``."""
        xx, xy, xz, yy, yz, zz = self
        i_x = 1 / xx
        l_yx, l_zx = xy * i_x, xz * i_x
        i_y = 1 / (yy - l_yx * xy)
        w = yz - l_zx * xy
        l_zy = w * i_y
        return Factor3(l_yx, l_zx, l_zy, i_x, i_y, 1 / (zz - l_zx * xz - l_zy * w)).solve(v)

    def has_rank_one(self, least: Scalar) -> Condition:
        """Whether this positive semi-definite tensor has at most one non-zero eigenvalue, to rounding.

        Args:
            least: eigenvalues up to this, or up to ``LEAST_EIGENVALUE`` of the trace, count as 0.
        """
        minors, rounding = self._minors(least)
        return certain(minors) <= rounding

    def least_nonzero_eigenvalue(self, least: Scalar) -> Scalar:
        """The least non-zero eigenvalue of a singular positive semi-definite tensor, to a factor of 2.

        Args:
            least: as in :meth:`has_rank_one`.
        """
        return choose(
            self.has_rank_one(least), self.trace, lambda: self._minors(least)[0] * self._trace_or_one()
        )

    def null_space(self, least: Scalar) -> Symmetric3:
        """The projection on the null space of this positive semi-definite tensor; 0 if it is invertible.

        With the trace scaled to 1, the projection is the adjugate over its own trace if the rank is 2, and
        ``1`` minus the tensor if the rank is 1.

        Args:
            least: as in :meth:`has_rank_one`.
        """
        xx, xy, xz, yy, yz, zz = self * (1 / self._trace_or_one())
        a_xx, a_yy, a_zz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
        a_xy, a_xz, a_yz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
        det = xx * a_xx + xy * a_xy + xz * a_xz
        minors, rounding = self._minors(least)
        has_rank_two = certain(minors) > rounding
        coupled = certain(SINGULAR * (xx * yy * zz))
        least_det = maximum(coupled, self._least_share(least) * certain(minors))
        is_definite = has_rank_two & (certain(det) > least_det)  # of rank one, det is rounding of either sign
        size = choose(has_rank_two, lambda: minors, lambda: xx + yy + zz)
        size = choose(certain(size) > 0, lambda: size, lambda: size * 0 + 1)

        def of_rank_one() -> Symmetric3:
            return Symmetric3(1 - xx / size, -xy / size, -xz / size, 1 - yy / size, -yz / size, 1 - zz / size)

        def of_rank_two() -> Symmetric3:
            return Symmetric3(*(x / size for x in (a_xx, a_xy, a_xz, a_yy, a_yz, a_zz)))

        projection = choose(has_rank_two, of_rank_two, of_rank_one)
        return choose(is_definite, lambda: projection * 0, lambda: projection)

    def _minors(self, least: Scalar) -> tuple[Scalar, Scalar]:
        """The sum of the principal 2x2 minors for a trace of 1, and the value up to which it is rounding."""
        xx, xy, xz, yy, yz, zz = self * (1 / self._trace_or_one())
        minors = yy * zz - yz * yz + xx * zz - xz * xz + xx * yy - xy * xy
        coupled = certain(SINGULAR * (xx * yy + yy * zz + xx * zz))
        return minors, maximum(coupled, self._least_share(least))

    def _least_share(self, least: Scalar) -> Scalar:
        """The part of the trace up to which an eigenvalue counts as 0."""
        return maximum(certain(least / self._trace_or_one()), LEAST_EIGENVALUE)

    def _trace_or_one(self) -> Scalar:
        """The trace, or 1 if it is 0."""
        trace = self.trace()
        return choose(certain(trace) > 0, lambda: trace, lambda: trace * 0 + 1)


class Factor3(NamedTuple):
    """The factors ``L D L^T`` of a :class:`Symmetric3`: ``L`` is unit lower triangular, ``D`` diagonal.

    Attributes:
        l_yx, l_zx, l_zy: ``L`` below its diagonal.
        i_x, i_y, i_z: ``1/D``.
    """

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
    """The factors ``P i P`` of the pseudo-inverse of a thin rod's inertia; methods as in :class:`Factor3`.

    Attributes:
        projection: ``P``, the projection on the plane perpendicular to the rod; meaningless if ``i`` is 0.
        i: the inverse of the moment of inertia about axes in that plane; 0 for a body without any inertia.
    """

    projection: Symmetric3
    i: Scalar

    def reduced(self, v: Vec3) -> Vec3:
        """``P v``."""
        return self.projection @ v

    def scaled(self, w: Vec3) -> Vec3:
        """``i w``."""
        return w * self.i

    def restored(self, w: Vec3) -> Vec3:
        """``P w``."""
        return self.projection @ w

    def effective_spin(self, spin: Vec3) -> Vec3:
        """The part of an angular velocity about axes that have inertia."""
        return choose(self.i > 0, lambda: self.projection @ spin, lambda: spin * 0)


class InverseTensor(NamedTuple):
    """``I^-1``, kept as the factors of ``I``; or the pseudo-inverse of a thin rod or a point mass.

    If ``I`` is ill-conditioned, its factors lose fewer digits than their product would.

    Attributes:
        has_factors: whether ``factors`` hold; else ``rod`` does.
        factors: of ``I``.
        rod: of the pseudo-inverse.
    """

    has_factors: Condition
    factors: Factor3
    rod: RodFactor

    def __matmul__(self, v: Vec3) -> Vec3:
        return self._by_factors(lambda f: f.restored(f.scaled(f.reduced(v))))

    def quadratic_form(self, v: Vec3) -> Scalar:
        """``v.I^-1 v``, as a sum of squares."""

        def sum_of_squares(f: Factor3 | RodFactor) -> Scalar:
            w = f.reduced(v)
            return w.dot(f.scaled(w))

        return self._by_factors(sum_of_squares)

    def congruence(self, x: Vec3, y: Vec3, z: Vec3) -> Symmetric3:
        """``G^T I^-1 G`` for the matrix ``G`` with the columns ``x``, ``y`` and ``z``."""

        def products(f: Factor3 | RodFactor) -> Symmetric3:
            gx, gy, gz = f.reduced(x), f.reduced(y), f.reduced(z)
            jx, jy, jz = f.scaled(gx), f.scaled(gy), f.scaled(gz)
            return Symmetric3(gx.dot(jx), gx.dot(jy), gx.dot(jz), gy.dot(jy), gy.dot(jz), gz.dot(jz))

        return self._by_factors(products)

    def square_root_columns(self) -> tuple[Vec3, ...]:
        """Three vectors ``s`` with ``I^-1 = sum s s^T``."""

        def columns(f: Factor3 | RodFactor) -> tuple[Vec3, ...]:
            diagonal = f.scaled(Vec3(1, 1, 1))
            return tuple(f.restored(axis * square_root(i)) for axis, i in zip(AXES, diagonal, strict=True))

        return self._by_factors(columns)

    def _by_factors(self, formula: Callable[[Factor3 | RodFactor], T]) -> T:
        return choose(self.has_factors, lambda: formula(self.factors), lambda: formula(self.rod))


ZERO_TENSOR = Symmetric3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
UNIT = Symmetric3(1, 0, 0, 1, 0, 1)
