"""A cluster in exact arithmetic: what :class:`collision_response.kernels._scene.Cluster` is in double-
double.

Impulses are lists of fractions. It is the answer for rational input, and decides what double-double
can't.

Self-locking contacts, of which some impulses ``p >= 0``, not all 0, do nothing (``N p = 0``), are found
here. The sum of ``p_i u_i`` is then the same before and after. Where it is negative, no velocity is
admissible at all. Where it is 0, no velocity of theirs can be above 0 afterwards: they hold, as bilateral
constraints do. Negative is looked for first: with a positive one it may make 0, which holds nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from ..numbers.operations import Scalar
from ..physics.body import Body, Twist
from ..physics.column import Column
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.laws import Regime
from ..physics.vector import Vec3
from ..validity import is_off_unit

Numbers = list[Scalar]
NOUGHT = Fraction(0)
NOTHING = Vec3(NOUGHT, NOUGHT, NOUGHT)
ROUNDING = Fraction(1, 2**40)
"""This part of the work at the contacts may be created: floats can tell no less, and the law is the same."""


class ImpulseEffect(NamedTuple):
    """What becomes of a cluster: see ``answer`` in ``kernels/scene.cpp``."""

    changes: list[Twist]
    twists: list[Twist]
    impulses: list[Vec3]
    before: Numbers
    after: Numbers
    regimes: list[Regime]
    energies: tuple[Scalar, Scalar, Scalar, Scalar]
    error_bound: float
    idle: bool
    off_unit: bool
    creates_energy: bool


class RationalCluster:
    """Contacts of one cluster, of fractions."""

    def __init__(
        self,
        bodies: Sequence[Body],
        pairs: Sequence[tuple[int, int]],
        contacts: Sequence[Contact],
        copies: Sequence[int],
    ) -> None:
        self.count = len(contacts)
        self._bodies = [body for body in bodies if body.is_movable()]
        places = iter(range(len(self._bodies)))
        self._places = [next(places) if body.is_movable() else None for body in bodies]
        self._contacts = contacts
        self._copies = copies
        self._pairs = pairs
        columns = [
            tuple(Column.of(bodies[body], contact.position, contact.normal) for body in pair)
            for pair, contact in zip(pairs, contacts, strict=True)
        ]
        self._columns = columns
        self._u = [a.velocity - b.velocity for a, b in columns]
        units = [[Fraction(i == j) for j in range(self.count)] for i in range(self.count)]
        self.A = [list(row) for row in zip(*(self._velocity_change(unit) for unit in units), strict=True)]
        self._held = self._find_held()
        self.locked = self.doubtful = False

    def none(self) -> Numbers:
        """No impulses, but for those of contacts that hold."""
        zero = [NOUGHT] * self.count
        if not self._held:
            return zero
        found = self._least(self._u, [])
        return zero if found is None else found

    def approach(self) -> Scalar:
        """The speed of the fastest approach."""
        speeds = (-u / c.normal.norm() for u, c in zip(self._u, self._contacts, strict=True))
        return max(NOUGHT, *speeds)

    def violated(self, p: Numbers, limit: Scalar) -> tuple[list[int], Scalar]:
        """The contacts that approach at ``limit`` or faster; the least distance from that."""
        u = [u / c.normal.norm() for u, c in zip(self._velocities(p), self._contacts, strict=True)]
        looked = [i for i in range(self.count) if i not in self._held]
        margin = min((abs(u[i] + limit) for i in looked), default=NOUGHT)
        return [i for i in looked if u[i] <= -limit and u[i] < 0], margin

    def approaching(self, p: Numbers) -> bool:
        """Whether some contact approaches."""
        return any(u < 0 for u in self._velocities(p))

    def project(self, p: Numbers, among: list[int] | None = None) -> Numbers | None:
        """The impulses on top of ``p`` that just keep the contacts ``among`` from approaching."""
        return self._keep_apart(self._velocities(p), range(self.count) if among is None else among)

    def one_step(self, _: bool) -> tuple[Numbers, None, float] | None:
        """The impulses of MOREAU, without friction; ``None``: no velocities rebound from all contacts."""
        if not self.can_rebound():
            return None
        q = self._keep_apart(self._beside_rebound(), range(self.count))
        return None if q is None else (q, None, 0.0)

    def can_rebound(self) -> bool:
        """Whether some velocities are those that MOREAU asks for, or above, at all contacts."""
        return not least(self.A, self._beside_rebound(), range(self.count), []).ray

    def _beside_rebound(self) -> Numbers:
        """The velocities, from those that MOREAU asks for."""
        pairs = zip(self._u, self._contacts, strict=True)
        return [u + c.restitution * min(u, NOUGHT) for u, c in pairs]

    def joined_restitution(self, q: Numbers) -> Scalar:
        """``sum e u q / sum u q`` over the contacts that approach, of the ``q`` of least norm."""
        own = self.least_norm(q, shared=False)
        weights = [min(u, NOUGHT) * x for u, x in zip(self._u, own, strict=True)]
        total = sum(weights)
        if total == 0:
            return NOUGHT
        return sum(w * c.restitution for w, c in zip(weights, self._contacts, strict=True)) / total

    def answer(self, p: Numbers, *_: Any) -> ImpulseEffect:
        """What becomes of the bodies."""
        changes = self._changes(p)
        moved = [
            body._replace(
                velocity=body.velocity + c.linear, angular_velocity=body.angular_velocity + c.angular
            )
            for body, c in zip(self._bodies, changes, strict=True)
        ]
        after = self._velocities(p)
        lost = -sum((x * (b + a) for x, b, a in zip(p, self._u, after, strict=True)), start=NOUGHT) / 2
        work = sum((x * (abs(b) + abs(a)) for x, b, a in zip(p, self._u, after, strict=True)), start=NOUGHT)
        idle = [body.angular_velocity - body.effective_spin()[1] for body in self._bodies]
        lengths = [contact.normal.norm() for contact in self._contacts]
        impulses = [c.normal * x for c, x in zip(self._contacts, self.least_norm(p), strict=True)]
        return ImpulseEffect(
            changes,
            [Twist(body.velocity, body.angular_velocity) for body in moved],
            impulses,
            [u / size for u, size in zip(self._u, lengths, strict=True)],
            [u / size for u, size in zip(after, lengths, strict=True)],
            [Regime.SLIDING if any(impulse) else Regime.SEPARATING for impulse in impulses],
            (sum(map(kinetic_energy, self._bodies)), sum(map(kinetic_energy, moved)), lost, NOUGHT),
            0.0,
            any(spin.dot(spin) > 0 for spin in idle),
            any(map(is_off_unit, self._bodies)),
            lost < -ROUNDING * work,
        )

    def _changes(self, p: Numbers) -> list[Twist]:
        changes = [Twist(NOTHING, NOTHING) for _ in self._bodies]
        for x, pair, sides in zip(p, self._pairs, self._columns, strict=True):
            for body, side, sign in zip(pair, sides, (1, -1), strict=True):
                place = self._places[body]
                if place is not None and x != 0:
                    linear, angular = changes[place]
                    by = side.response
                    changes[place] = Twist(linear + by.linear * (sign * x), angular + by.angular * (sign * x))
        return changes

    def _velocity_change(self, p: Numbers) -> Numbers:
        changes, result = self._changes(p), []
        for contact, pair, sides in zip(self._contacts, self._pairs, self._columns, strict=True):
            total = NOUGHT
            for body, side, sign in zip(pair, sides, (1, -1), strict=True):
                place = self._places[body]
                if place is not None:
                    linear, angular = changes[place]
                    total += sign * (contact.normal.dot(linear) + side.arm.dot(angular))
            result.append(total)
        return result

    def _velocities(self, p: Numbers) -> Numbers:
        return [u + _dot(row, p) for u, row in zip(self._u, self.A, strict=True)]

    def _keep_apart(self, u: Numbers, among: Iterable[int]) -> Numbers | None:
        return self._least(u, [i for i in among if i not in self._held])

    def _least(self, b: Numbers, among: Sequence[int]) -> Numbers | None:
        found = least(self.A, b, among, self._held)
        return None if found.ray else found.x

    def _find_held(self) -> list[int]:
        """The contacts that hold; none do where they contradict each other."""
        everyone = range(self.count)
        if least(self.A, self._u, everyone, []).ray:
            return []
        matrix = self._with_work()
        held: set[int] = set()
        while True:
            found = least(matrix, [NOUGHT if i in held else Fraction(-1) for i in everyone], everyone, [])
            if not found.ray:
                return sorted(held)
            held |= {i for i in everyone if found.ray[i] > 0}

    def _with_work(self) -> list[Numbers]:
        """``A + u u^T``: impulses that it maps to 0 move nothing, and do no work on moving walls either."""
        return [
            [a + x * y for a, y in zip(row, self._u, strict=True)]
            for row, x in zip(self.A, self._u, strict=True)
        ]

    def least_norm(self, p: Numbers, *, shared: bool = True) -> Numbers:
        """Of the impulses ``>= 0`` that do the same, those of least squares; ``shared``: over all copies."""
        Z = null_space(self._with_work())
        if not Z:
            return p
        copies = self._copies if shared else [1] * self.count
        weights = [c.normal.dot(c.normal) / n for c, n in zip(self._contacts, copies, strict=True)]
        H = [[_dot3(weights, z, y) for y in Z] for z in Z]
        back = solve(H, [_dot3(weights, z, p) for z in Z])
        free = [x - sum(c * z[i] for c, z in zip(back, Z, strict=True)) for i, x in enumerate(p)]
        responses = [solve(H, [z[j] for z in Z]) for j in range(self.count)]  # columns of H^-1 Z^T
        matrix = [[_dot([z[i] for z in Z], row) for row in responses] for i in range(self.count)]
        among = [i for i in range(self.count) if matrix[i][i] != 0]
        x = least(matrix, free, among, []).x
        return [f + _dot(row, x) for f, row in zip(free, matrix, strict=True)]


class Least(NamedTuple):
    """The least of ``x.A x / 2 + b.x``; or a ray ``A ray = 0``, ``b.ray < 0`` along which there is none."""

    x: Numbers
    ray: Numbers | None


def least(A: Sequence[Numbers], b: Numbers, among: Sequence[int], free: Sequence[int]) -> Least:
    """The least of ``x.A x / 2 + b.x`` over ``x_i >= 0`` for ``i`` in ``among`` and any ``x_i`` in ``free``.

    The method of ``kernels/scene/active_set.hpp``, by the smallest index, which does not cycle. A column that
    depends on the free ones stays out.
    """
    x = [NOUGHT] * len(b)
    active: list[int] = []

    def solved(right: Sequence[Scalar]) -> Numbers:
        return solve([[A[j][k] for k in active] for j in active], [right[j] for j in active])

    def times(row: Numbers, factors: Iterable[Scalar]) -> Scalar:
        return _dot([row[j] for j in active], list(factors))

    for i in free:
        if A[i][i] - times(A[i], solved(A[i])) > 0:
            active.append(i)
    bound = len(active)
    for j, value in zip(active, solved([-y for y in b]), strict=True):
        x[j] = value
    while True:
        slopes = {i: b[i] + times(A[i], (x[j] for j in active)) for i in among if i not in active}
        entering = next((i for i, slope in slopes.items() if slope < 0), None)
        if entering is None:
            return Least(x, None)
        slope = slopes[entering]
        while True:
            w = solved(A[entering])
            curvature = A[entering][entering] - times(A[entering], w)
            steps = [(x[j] / c, j) for j, c in list(zip(active, w, strict=True))[bound:] if c > 0]
            blocked, leaving = min(steps, default=(None, None))
            if curvature > 0 and (blocked is None or -slope / curvature <= blocked):
                step, leaving = -slope / curvature, None
            elif blocked is None:
                ray = [NOUGHT] * len(b)
                ray[entering] = Fraction(1)
                for j, c in zip(active, w, strict=True):
                    ray[j] = -c
                return Least(x, ray)
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
    """The solution of a regular system."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    _reduce(rows, len(right))
    return [row[-1] for row in rows]


def null_space(matrix: Sequence[Sequence[Scalar]]) -> list[Numbers]:
    """Vectors that span what a square matrix maps to 0."""
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
    """Bring the first columns to reduced echelon form, in place; those of the pivots."""
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


def _dot(v: Sequence[Scalar], w: Sequence[Scalar]) -> Scalar:
    return sum((a * b for a, b in zip(v, w, strict=True)), start=NOUGHT)


def _dot3(v: Sequence[Scalar], w: Sequence[Scalar], z: Sequence[Scalar]) -> Scalar:
    return sum((a * b * c for a, b, c in zip(v, w, z, strict=True)), start=NOUGHT)
