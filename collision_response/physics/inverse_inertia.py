"""The response of a link of a mechanism to an impulse: Khatib's inverse inertia ``J M^-1 J^T``, 6x6.

``M`` is the mass matrix of the mechanism and ``J`` the Jacobian of the link's twist. An impulse ``P`` on the
link, with the moment ``T`` about the origin of the body frame, changes the twist of that frame by

    (dv, dw) = Lambda^-1 (P, T)        Lambda^-1 = J M^-1 J^T = [[L, C], [C^T, W]]

in world axes. If ``P`` acts at ``d`` from the origin, then ``T = d x P``, and the velocity there changes by
``dv + dw x d = K P`` with the inverse effective mass

    K = [1 -[d]x] Lambda^-1 [1 -[d]x]^T = L - C [d]x + [d]x C^T - [d]x W [d]x

Source: Khatib, "A Unified Approach for Motion and Force Control of Robot Manipulators", IEEE J. Robotics
and Automation 3 (1987), eq. 51.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import reduce
from typing import Any, NamedTuple

from ..arguments import is_finite, of_one_type, real_number
from ..numbers.operations import (
    Condition,
    Scalar,
    all_of,
    choose,
    maximum,
    negation,
    or_one,
    positive_part,
    square_root,
)
from ..status import ImpactError, StatusCode, format_value
from .tensor import Symmetric3
from .vector import AXES, Vec3

ROUNDING = 2.0**-40
"""A pivot of at most this part of its diagonal entry is rounding of the computation that made the matrix."""

SYMMETRY_TOLERANCE = 2.0**-30
"""How far entries may be from symmetry, and from 0 in the row of a pivot that is rounding.

For the entry ``(i, j)``, in units of the square root of the diagonal entries ``i`` and ``j``.
"""


class InverseInertia(NamedTuple):
    """The upper triangle of a symmetric 6x6 matrix, row by row.

    ``x``, ``y``, ``z`` are the linear axes and ``a``, ``b``, ``c`` the rotations about them. ``xx`` to ``zz``
    are in 1/kg, ``xa`` to ``zc`` in 1/(kg m), ``aa`` to ``cc`` in 1/(kg m^2).
    """

    xx: Scalar
    xy: Scalar
    xz: Scalar
    xa: Scalar
    xb: Scalar
    xc: Scalar
    yy: Scalar
    yz: Scalar
    ya: Scalar
    yb: Scalar
    yc: Scalar
    zz: Scalar
    za: Scalar
    zb: Scalar
    zc: Scalar
    aa: Scalar
    ab: Scalar
    ac: Scalar
    bb: Scalar
    bc: Scalar
    cc: Scalar

    @classmethod
    def of(cls, matrix: Iterable[Any]) -> InverseInertia:
        """The matrix given by six rows of six numbers, or by its 36 numbers row by row.

        The two halves of the matrix are averaged.

        Raises:
            ImpactError: if there are not 36 numbers, or they are not symmetric to rounding
                (INVALID_INERTIA); if a number is not finite (NOT_FINITE). The field is ``inverse_inertia``.
            TypeError: if ``matrix`` is not a sequence, or an element is not a number.
        """
        numbers = _flat(matrix)
        if len(numbers) != 36:
            raise _error(StatusCode.INVALID_INERTIA, f"must be 6 x 6 numbers, are {len(numbers)}")
        if not all(map(is_finite, numbers)):
            raise _error(StatusCode.NOT_FINITE, "must be finite")
        rows = [numbers[i : i + 6] for i in range(0, 36, 6)]

        def mean(j: int, i: int) -> Scalar:
            a, b = rows[i][j], rows[j][i]
            if a == b:  # numbers of any type, and the least floats
                return a
            if type(a) is not type(b):
                a, b = of_one_type({f"inverse_inertia[{i}, {j}]": a, f"inverse_inertia[{j}, {i}]": b})
            scale = math.sqrt(abs(rows[i][i])) * math.sqrt(abs(rows[j][j]))
            if not abs(a - b) <= SYMMETRY_TOLERANCE * scale:
                reason = f"must be symmetric; ({i}, {j}) is {a} and ({j}, {i}) {b}"
                raise _error(StatusCode.INVALID_INERTIA, reason)
            return a / 2 + b / 2

        return cls(*(mean(*place) for place in _PLACES))

    def matrix(self) -> list[Scalar]:
        """The 36 numbers of the matrix, row by row."""
        entries = dict(zip(_PLACES, self, strict=True))
        return [entries[min(i, j), max(i, j)] for i in range(6) for j in range(6)]

    def blocks(self) -> tuple[Symmetric3, tuple[Vec3, Vec3, Vec3], Symmetric3]:
        """The blocks ``L`` and ``W``, with the rows of ``C`` between them."""
        xx, xy, xz, xa, xb, xc, yy, yz, ya, yb, yc, zz, za, zb, zc, *angular = self
        rows = Vec3(xa, xb, xc), Vec3(ya, yb, yc), Vec3(za, zb, zc)
        return Symmetric3(xx, xy, xz, yy, yz, zz), rows, Symmetric3(*angular)

    def twist_change(self, d: Vec3, impulse: Vec3) -> tuple[Vec3, Vec3]:
        """Change of the twist, ``(dv, dw)``, caused by an impulse at ``d`` from the origin."""
        L, (x, y, z), W = self.blocks()
        moment = d.cross(impulse)
        linear = L @ impulse + Vec3(x.dot(moment), y.dot(moment), z.dot(moment))
        return linear, x * impulse[0] + y * impulse[1] + z * impulse[2] + W @ moment

    def inverse_effective_mass(self, d: Vec3) -> Symmetric3:
        """``K`` of the point at ``d`` from the origin [1/kg]."""

        def column(axis: Vec3) -> Vec3:
            linear, angular = self.twist_change(d, axis)
            return linear + angular.cross(d)

        x, y, z = map(column, AXES)
        return Symmetric3(x.x, y.x, z.x, y.y, z.y, z.z)

    def is_semi_definite(self) -> Condition:
        """Whether the matrix is positive semi-definite: no impulse creates energy.

        The matrix is scaled to a unit diagonal and eliminated with the greatest pivot first, since each pivot
        makes the later ones as uncertain as its own rounding. Pivots of at most ``ROUNDING`` are not
        eliminated; every entry that remains must be at most ``SYMMETRY_TOLERANCE``. The result does not
        depend on the units of mass and length.
        """
        full = {(i, j): x for (i, j), x in zip(_PLACES, self, strict=True)}
        linear = ROUNDING * self.xx + ROUNDING * self.yy + ROUNDING * self.zz  # their sum may be infinite
        angular = ROUNDING * self.aa + ROUNDING * self.bb + ROUNDING * self.cc
        floors = [linear] * 3 + [angular] * 3
        units = [or_one(square_root(positive_part(maximum(full[i, i], floors[i])))) for i in range(6)]
        s = {(i, j): full[i, j] / units[i] / units[j] for i, j in _PLACES}
        for _ in range(6):
            pivot = reduce(maximum, (s[i, i] for i in range(6)))
            row = _row_of(pivot, s)
            share = choose(pivot > ROUNDING, lambda: 1.0, lambda: 0.0) / or_one(pivot)
            for j, k in _PLACES:
                s[j, k] = s[j, k] - row[j] * row[k] * share
        return all_of(abs(x) <= SYMMETRY_TOLERANCE for x in s.values())


_PLACES = [(i, j) for i in range(6) for j in range(i, 6)]


def _row_of(pivot: Scalar, s: dict[tuple[int, int], Scalar]) -> tuple[Scalar, ...]:
    """The first row of ``s`` with this pivot on its diagonal."""
    row, found = (0 * pivot,) * 6, False
    for i in range(6):
        is_it = (s[i, i] >= pivot) & negation(found)
        here = tuple(s[min(i, j), max(i, j)] for j in range(6))
        row = choose(is_it, lambda: here, lambda: row)  # noqa: B023
        found = found | is_it
    return row


def _flat(matrix: Iterable[Any]) -> list[Any]:
    """The numbers of a matrix given by rows, or by one flat sequence."""
    try:
        entries = [x for row in matrix for x in (row if isinstance(row, Iterable) else (row,))]
    except TypeError:
        raise TypeError(f"inverse_inertia: must be 6 x 6 numbers, is {format_value(matrix)}") from None
    return [real_number("inverse_inertia", x) for x in entries]


def _error(code: StatusCode, reason: str) -> ImpactError:
    return ImpactError(code, "inverse_inertia", reason)
