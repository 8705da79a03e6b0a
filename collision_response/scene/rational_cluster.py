"""A cluster in exact arithmetic: the counterpart of ``Cluster`` of ``kernels/cluster_object.cpp``.

Its impulses are lists of fractions. It answers rational input, and decides what double-double cannot.

It also finds the contacts that *lock*: some impulses ``p >= 0`` of theirs, not all 0, do nothing, ``N p =
0``. The sum of ``p_i u_i`` is then the same before and after the impact. If it is negative, no velocities
keep these contacts from approaching: they contradict each other. If it is 0, none of these contacts can
separate, and each *holds*, as a bilateral constraint does. Contradictions must be looked for first, because a
negative sum and a positive one may add up to 0, which holds nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from ..impact import with_change
from ..model import Adjustment
from ..numbers.operations import Scalar, square_root
from ..physics.body import Body, Twist
from ..physics.column import Column
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.laws import Regime
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from ..validity import is_not_normalised
from .cluster_result import ImpulseEffect
from .rational_algebra import ZERO, Numbers, dot, minimise, null_space, solve_each

ZERO_VECTOR = Vec3(ZERO, ZERO, ZERO)

ROUNDING = Fraction(1, 2**40)
"""A law may create this fraction of the work at the contacts: the same as in floats, where it is rounding."""


def contradiction() -> ImpactError:
    """Return the error for contacts that contradict each other."""
    reason = "contradict each other: no velocities keep all of them from approaching"
    return ImpactError(StatusCode.CONTRADICTORY_CONTACTS, "contacts", reason)


class RationalImpulses(NamedTuple):
    """Impulses along the normals, in fractions; the rest as in :class:`ClusterResult`.

    ``may_press`` has the contacts that may have an impulse, by the law; ``None``: any. ``is_cut_off`` says
    whether reflections were too long for fractions.
    """

    normal: Numbers
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    no_rebound: bool = False
    fell_back: bool = False
    may_press: Sequence[int] | None = None
    is_cut_off: bool = False


class RationalCluster:
    """The contacts of one cluster, in fractions. ``counts`` says how often each contact is given.

    ``A`` is the matrix of normal velocities by normal impulses; impulses and velocities are along normals of
    any length. ``fastest_square`` is the square of the speed of the fastest approach before the impact.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        pairs: Sequence[tuple[int, int]],
        contacts: Sequence[Contact],
        counts: Sequence[int],
    ) -> None:
        self.count = len(contacts)
        self._bodies = [body for body in bodies if body.is_movable()]
        places = iter(range(len(self._bodies)))
        self._places = [next(places) if body.is_movable() else None for body in bodies]
        self._contacts = contacts
        self._counts = counts
        self._pairs = pairs
        self._columns = [
            tuple(Column.of(bodies[body], contact.position, contact.normal) for body in pair)
            for pair, contact in zip(pairs, contacts, strict=True)
        ]
        self._u = [a.velocity - b.velocity for a, b in self._columns]
        units = [[Fraction(i == j) for j in range(self.count)] for i in range(self.count)]
        self.A = [list(row) for row in zip(*(self._velocity_changes(unit) for unit in units), strict=True)]
        self._holding = self._find_holding()
        self.fastest_square = max(ZERO, *(-square for square in self._signed_squares(self._u)))

    def normal_velocities(self) -> Numbers:
        """Return the normal velocity of each contact before the impact [m/s]."""
        return [u / contact.normal.norm() for u, contact in zip(self._u, self._contacts, strict=True)]

    def approaches_below(self, threshold: Fraction) -> list[bool]:
        """Whether each contact approaches, slower than a threshold [m/s]."""
        return [0 > square > -(threshold**2) for square in self._signed_squares(self._u)]

    def no_impulses(self) -> Numbers:
        """Return impulses of 0, except for those that contacts that hold need at once."""
        zero = [ZERO] * self.count
        if not self._holding:
            return zero
        found = self._minimise(self._u, [])
        return zero if found is None else found

    def violated(self, p: Numbers, threshold: Scalar) -> tuple[list[int], Scalar]:
        """Return the contacts that approach no slower than the threshold after impulses ``p``, and the least
        distance of any speed from the threshold. Both are relative to the fastest approach before the impact.

        Squares are compared, because the lengths of normals may be irrational.
        """
        squares = [square / self.fastest_square for square in self._signed_squares(self._velocities(p))]
        candidates = [i for i in range(self.count) if i not in self._holding]
        margin = min((abs(_signed_root(squares[i]) + threshold) for i in candidates), default=ZERO)
        return [i for i in candidates if 0 > squares[i] <= -(threshold**2)], margin

    def _signed_squares(self, u: Numbers) -> Numbers:
        """Return the squares of speeds, with the signs of the normal velocities ``u``."""
        return [x * abs(x) / c.normal.dot(c.normal) for x, c in zip(u, self._contacts, strict=True)]

    def has_approach(self, p: Numbers) -> bool:
        """Whether some contact approaches after impulses ``p``."""
        return any(u < 0 for u in self._velocities(p))

    def moves_less(self, p: Numbers, distance: Scalar) -> bool:
        """Whether impulses change every normal velocity by less than ``distance``, which is relative to the
        fastest approach before the impact.

        By Cauchy & Schwarz: ``(N M^-1 N^T p)_i^2 <= (N M^-1 N^T)_ii (p.A p)``.
        """
        reach = max(self.A[i][i] / c.normal.dot(c.normal) for i, c in enumerate(self._contacts))
        return reach * dot(p, [dot(row, p) for row in self.A]) < distance**2 * self.fastest_square

    def project(self, p: Numbers, among: list[int] | None = None) -> Numbers:
        """Return the impulses, on top of ``p``, that just keep contacts from approaching.

        Only the contacts ``among`` are looked at, or all if it is left out.

        Raises:
            ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep them from approaching.
        """
        found = self._keep_from_approaching(
            self._velocities(p), range(self.count) if among is None else among
        )
        if found is None:
            raise contradiction()
        return found

    def moreau(self) -> RationalImpulses | None:
        """Return the impulses of MOREAU without friction; ``None`` if there are none.

        Contacts that leave faster than they rebound may have no impulse.
        """
        if not self.can_rebound():
            return None
        u = self._velocities_minus_rebound()
        found = self._keep_from_approaching(u, range(self.count))
        if found is None:
            return None
        faster = [x + dot(row, found) for x, row in zip(u, self.A, strict=True)]
        return RationalImpulses(found, may_press=[i for i, x in enumerate(faster) if x <= 0])

    def can_rebound(self) -> bool:
        """Whether all contacts can have at least the velocities ``-e min(u, 0)`` that MOREAU asks for."""
        return not minimise(self.A, self._velocities_minus_rebound(), range(self.count), []).ray

    def _velocities_minus_rebound(self) -> Numbers:
        pairs = zip(self._u, self._contacts, strict=True)
        return [u + c.restitution * min(u, ZERO) for u, c in pairs]

    def cluster_restitution(self, q: Numbers) -> Scalar:
        """Return ``sum e u q / sum u q`` over the contacts that approach, for the ``q`` of least norm."""
        q = self.least_norm(q, over_copies=False)
        weights = [min(u, ZERO) * x for u, x in zip(self._u, q, strict=True)]
        total = sum(weights)
        if total == 0:  # only contacts that hold approach
            return ZERO
        return sum(w * c.restitution for w, c in zip(weights, self._contacts, strict=True)) / total

    def effect_of(self, impulses: RationalImpulses) -> ImpulseEffect:
        """Return what impulses do."""
        p = impulses.normal
        changes = self._twist_changes(p)
        moved = list(map(with_change, self._bodies, changes))
        after = self._velocities(p)
        lost = -dot(p, [b + a for b, a in zip(self._u, after, strict=True)]) / 2
        lengths = [contact.normal.norm() for contact in self._contacts]
        least = self.least_norm(p, impulses.may_press)
        vectors = [c.normal * x for c, x in zip(self._contacts, least, strict=True)]
        return ImpulseEffect(
            changes=changes,
            twists=[body.twist for body in moved],
            impulses=vectors,
            normal_velocities_before=self.normal_velocities(),
            normal_velocities_after=[u / length for u, length in zip(after, lengths, strict=True)],
            regimes=[Regime.SLIDING if any(impulse) else Regime.SEPARATING for impulse in vectors],
            energies=(sum(map(kinetic_energy, self._bodies)), sum(map(kinetic_energy, moved)), lost, ZERO),
            error_bound=0.0,
        )

    def is_unphysical(self, p: Numbers, effect: ImpulseEffect) -> bool:
        """Whether impulses ``p``, with their effect, create energy, pull, or leave an approach.

        As the answer of a law, that would be a fault of this package.
        """
        along = (c.normal.dot(impulse) for c, impulse in zip(self._contacts, effect.impulses, strict=True))
        return self.creates_energy(p) or min(along) < 0 or self.has_approach(p)

    def adjustments(self) -> Adjustment:
        """Return what is left out of the bodies, or changed in them."""
        spins = [body.angular_velocity - body.effective_spin()[1] for body in self._bodies]
        found = Adjustment(0)
        if any(spin.dot(spin) > 0 for spin in spins):
            found |= Adjustment.MASSLESS_SPIN
        if any(map(is_not_normalised, self._bodies)):
            found |= Adjustment.NORMALISED_ORIENTATION
        return found

    def creates_energy(self, p: Numbers) -> bool:
        """Whether the contacts gain more energy by normal impulses than rounding would explain in floats."""
        after = self._velocities(p)
        gained = dot(p, [b + a for b, a in zip(self._u, after, strict=True)])
        return gained > 2 * ROUNDING * dot(p, [abs(b) + abs(a) for b, a in zip(self._u, after, strict=True)])

    def _twist_changes(self, p: Numbers) -> list[Twist]:
        """Return the change of each movable body's twist by impulses ``p``."""
        changes = [Twist(ZERO_VECTOR, ZERO_VECTOR) for _ in self._bodies]
        for x, pair, sides in zip(p, self._pairs, self._columns, strict=True):
            for body, side, sign in zip(pair, sides, (1, -1), strict=True):
                place = self._places[body]
                if place is not None and x != 0:
                    linear, angular = changes[place]
                    by = side.response
                    changes[place] = Twist(linear + by.linear * (sign * x), angular + by.angular * (sign * x))
        return changes

    def _velocity_changes(self, p: Numbers) -> Numbers:
        """Return the change of each normal velocity by impulses ``p``."""
        changes, result = self._twist_changes(p), []
        for contact, pair, sides in zip(self._contacts, self._pairs, self._columns, strict=True):
            total = ZERO
            for body, side, sign in zip(pair, sides, (1, -1), strict=True):
                place = self._places[body]
                if place is not None:
                    linear, angular = changes[place]
                    total += sign * (contact.normal.dot(linear) + side.arm.dot(angular))
            result.append(total)
        return result

    def _velocities(self, p: Numbers) -> Numbers:
        """Return the normal velocities after impulses ``p``."""
        return [u + dot(row, p) for u, row in zip(self._u, self.A, strict=True)]

    def _keep_from_approaching(self, u: Numbers, among: Iterable[int]) -> Numbers | None:
        return self._minimise(u, [i for i in among if i not in self._holding])

    def _minimise(self, b: Numbers, among: Sequence[int]) -> Numbers | None:
        found = minimise(self.A, b, among, self._holding)
        return None if found.ray else found.x

    def _find_holding(self) -> list[int]:
        """Return the contacts that hold; none if contacts contradict each other."""
        everyone = range(self.count)
        if minimise(self.A, self._u, everyone, []).ray:
            return []
        matrix = self._with_work()
        holding: set[int] = set()
        while True:
            weights = [ZERO if i in holding else Fraction(-1) for i in everyone]
            found = minimise(matrix, weights, everyone, [])
            if not found.ray:
                return sorted(holding)
            holding |= {i for i in everyone if found.ray[i] > 0}

    def _with_work(self) -> list[Numbers]:
        """Return ``A + u u^T``: impulses that it maps to 0 move nothing, and do no work on moving walls."""
        return [
            [a + x * y for a, y in zip(row, self._u, strict=True)]
            for row, x in zip(self.A, self._u, strict=True)
        ]

    def least_norm(
        self, p: Numbers, among: Sequence[int] | None = None, *, over_copies: bool = True
    ) -> Numbers:
        """Return the impulses >= 0 with the effect of ``p`` whose sum of squares is least.

        Only those of the contacts ``among`` change, or all if it is left out. ``over_copies``: count the
        square of every copy of a contact, which share its impulse.
        """
        of = range(self.count) if among is None else among
        matrix = self._with_work()
        Z = [_spread(z, of, self.count) for z in null_space([[matrix[i][j] for j in of] for i in of])]
        if not Z:
            return p
        counts = self._counts if over_copies else [1] * self.count
        weights = [c.normal.dot(c.normal) / n for c, n in zip(self._contacts, counts, strict=True)]
        H = [[dot(weights, z, y) for y in Z] for z in Z]
        # The last ones are the columns of H^-1 Z^T.
        back, *responses = solve_each(H, [[dot(weights, z, p) for z in Z], *map(list, zip(*Z, strict=True))])
        unconstrained = [x - sum(c * z[i] for c, z in zip(back, Z, strict=True)) for i, x in enumerate(p)]
        matrix = [[dot([z[i] for z in Z], row) for row in responses] for i in range(self.count)]
        changed = [i for i in range(self.count) if matrix[i][i] != 0]
        x = minimise(matrix, unconstrained, changed, []).x
        return [f + dot(row, x) for f, row in zip(unconstrained, matrix, strict=True)]


def _spread(x: Numbers, places: Sequence[int], count: int) -> Numbers:
    """Return ``count`` numbers: those of ``x`` at their places, and 0 elsewhere."""
    result = [ZERO] * count
    for place, one in zip(places, x, strict=True):
        result[place] = one
    return result


def _signed_root(x: Scalar) -> Scalar:
    """Return the square root of ``|x|`` with the sign of ``x``; exact if it is rational."""
    return square_root(x) if x > 0 else -square_root(-x)
