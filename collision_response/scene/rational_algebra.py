"""Linear systems and quadratic programmes in exact arithmetic, on lists of fractions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from ..numbers.operations import Scalar

Numbers = list[Scalar]
ZERO = Fraction(0)


class Minimum(NamedTuple):
    """The result of :func:`minimise`.

    Attributes:
        x: the minimum; where there is none, the last point.
        ray: ``None``, or a direction without a minimum: ``A ray = 0`` and ``b.ray < 0``.
    """

    x: Numbers
    ray: Numbers | None


def minimise(A: Sequence[Numbers], b: Numbers, nonnegative: Sequence[int], free: Sequence[int]) -> Minimum:
    """Minimise ``x.A x / 2 + b.x``, for a symmetric positive semi-definite ``A``.

    Components in ``nonnegative`` are >= 0, those in ``free`` have any sign, and the others are 0. A free
    component whose column of ``A`` depends on those of other free components also stays 0.

    This is the active-set method of ``kernels/scene/active_set.cpp``. The component with the smallest index
    enters, so that the method does not cycle.
    """
    x = [ZERO] * len(b)
    active: list[int] = []

    def solve_active(right: Sequence[Scalar]) -> Numbers:
        return solve([[A[j][k] for k in active] for j in active], [right[j] for j in active])

    def dot_active(row: Numbers, factors: Iterable[Scalar]) -> Scalar:
        return dot([row[j] for j in active], list(factors))

    for i in free:
        if A[i][i] - dot_active(A[i], solve_active(A[i])) > 0:
            active.append(i)
    bound = len(active)  # the active components from here on are nonnegative
    for j, value in zip(active, solve_active([-y for y in b]), strict=True):
        x[j] = value
    while True:
        slopes = {i: b[i] + dot_active(A[i], (x[j] for j in active)) for i in nonnegative if i not in active}
        entering = next((i for i, slope in slopes.items() if slope < 0), None)
        if entering is None:
            return Minimum(x, None)
        slope = slopes[entering]
        while True:
            w = solve_active(A[entering])
            curvature = A[entering][entering] - dot_active(A[entering], w)
            steps = [(x[j] / c, j) for j, c in list(zip(active, w, strict=True))[bound:] if c > 0]
            blocked, leaving = min(steps, default=(None, None))
            if curvature > 0 and (blocked is None or -slope / curvature <= blocked):
                step, leaving = -slope / curvature, None
            elif blocked is None:
                ray = [ZERO] * len(b)
                ray[entering] = Fraction(1)
                for j, c in zip(active, w, strict=True):
                    ray[j] = -c
                return Minimum(x, ray)
            else:
                step = blocked
            x[entering] += step
            for j, c in zip(active, w, strict=True):
                x[j] -= step * c
            slope += step * curvature
            if leaving is None:
                active.append(entering)
                break
            active.remove(leaving)


def solve(matrix: Sequence[Sequence[Scalar]], right: Sequence[Scalar]) -> Numbers:
    """Return the solution of a regular system."""
    return solve_each(matrix, [right])[0]


def solve_each(matrix: Sequence[Sequence[Scalar]], rights: Sequence[Sequence[Scalar]]) -> list[Numbers]:
    """Return the solutions of regular systems with the same matrix, by one elimination."""
    n = len(matrix)
    rows = [[*row, *(right[i] for right in rights)] for i, row in enumerate(matrix)]
    _reduce(rows, n)
    return [[row[n + k] for row in rows] for k in range(len(rights))]


def null_space(matrix: Sequence[Sequence[Scalar]]) -> list[Numbers]:
    """Return a basis of the vectors that a square matrix maps to 0."""
    rows, n = [list(row) for row in matrix], len(matrix)
    pivots = _reduce(rows, n)
    basis = []
    for k in range(n):
        if k not in pivots:
            vector = [Fraction(i == k) for i in range(n)]
            for row, pivot in zip(rows, pivots, strict=False):
                vector[pivot] = -row[k]
            basis.append(vector)
    return basis


def _reduce(rows: list[Numbers], columns: int) -> list[int]:
    """Bring the first columns to reduced echelon form, in place, and return the columns of the pivots."""
    pivots: list[int] = []
    for k in range(columns):
        place = len(pivots)
        found = next((i for i in range(place, len(rows)) if rows[i][k] != 0), None)
        if found is None:
            continue
        rows[place], rows[found] = rows[found], rows[place]
        rows[place] = [a / rows[place][k] for a in rows[place]]
        for i, row in enumerate(rows):
            if i != place and row[k] != 0:
                rows[i] = [a - row[k] * c for a, c in zip(row, rows[place], strict=True)]
        pivots.append(k)
    return pivots


def dot(*vectors: Sequence[Scalar]) -> Scalar:
    """Return the sum of the products of corresponding components."""
    total: Scalar = ZERO
    for factors in zip(*vectors, strict=True):
        product = factors[0]
        for factor in factors[1:]:
            product = product * factor
        total = total + product
    return total
