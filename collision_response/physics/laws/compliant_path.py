"""The course of an impact between springs, in the units and letters of ``compliant.py``.

It goes on by the method of ``dormand_prince.py``, from event to event: a step that goes past one is taken
again, shorter, until it ends there to ``EVENT``. What holds between events is a number that stays positive:

    stick      mu F_n - |F_t|               slip       lambda
    loading    -u_n                         unloading  F_max - F_n
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import NamedTuple

from ...numbers.operations import (
    Condition,
    Scalar,
    choose,
    fixed,
    for_derivatives,
    maximum,
    minimum,
    negation,
    square_root,
    varying_as,
)
from .dormand_prince import ERROR_5, ORDER_3, STAGES, WEIGHTS, Row

EVENT = 2.0**-48
"""How far past its event a phase may end, relative to what the event is decided by."""

END = 1e-8
"""Normal force, relative to its greatest, from which on the rest of the way is straight."""

STEP_ROUNDING = 4e-15
STEPS = 10000


class Springs(NamedTuple):
    """What stays the same on the way.

    Attributes:
        A11, A12, A22, b1, b2: ``K`` across the normal, and beside it.
        v1, v2: the first slip.
        mu, kappa: friction, and tangential over normal stiffness.
        e: restitution of energy, not 0.
        tolerance: of a step.
    """

    A11: Scalar
    A12: Scalar
    A22: Scalar
    b1: Scalar
    b2: Scalar
    v1: Scalar
    v2: Scalar
    mu: Scalar
    kappa: Scalar
    e: Scalar
    tolerance: Scalar

    def velocity(self, P1: Scalar, P2: Scalar, Pn: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """``u``, after an impulse."""
        return (
            self.v1 + self.A11 * P1 + self.A12 * P2 + self.b1 * Pn,
            self.v2 + self.A12 * P1 + self.A22 * P2 + self.b2 * Pn,
            self.b1 * P1 + self.b2 * P2 + Pn - 1,
        )

    def reach(self, P1: Scalar, P2: Scalar, Pn: Scalar) -> Scalar:
        """The size of what :meth:`velocity` sums up, and so of its rounding."""
        b, P_t = abs(self.b1) + abs(self.b2), abs(P1) + abs(P2)
        return 1 + abs(self.v1) + abs(self.v2) + (self.A11 + self.A22 + b) * P_t + (1 + b) * Pn


class Course(NamedTuple):
    """A point of the course.

    Attributes:
        a1, a2: the tangential force if it sticks, the direction of the spring's deflection if it slips.
        F: the normal force.
        P1, P2, Pn: the impulse.
        slips, unloads: 1 or 0.
        most: the greatest normal force so far.
        h: the next step.
        going: not 0 until it ends.
        growth: by how much what is amiss may have grown; ``doubt``: the steps' errors.
        stuck, jams: not 0 if it ever stuck, or friction pressed the bodies together.
    """

    a1: Scalar
    a2: Scalar
    F: Scalar
    P1: Scalar
    P2: Scalar
    Pn: Scalar
    slips: Scalar
    unloads: Scalar
    most: Scalar
    h: Scalar
    going: Scalar
    growth: Scalar
    doubt: Scalar
    stuck: Scalar
    jams: Scalar


class Event(NamedTuple):
    """A number that is positive until the event, and how fast it rises."""

    value: Scalar
    slope: Scalar

    def is_passed(self) -> Condition:
        """Whether it is long over."""
        return self.value < -EVENT

    def is_now(self) -> Condition:
        """Whether it is just over."""
        return (self.value <= 0) & (self.slope < 0)

    def delay(self) -> Scalar:
        """0: by how much later it comes as its value varies."""
        return varying_as(0 * self.value, lambda: -self.value / fixed(self.slope))


def step(springs: Springs, y: Course) -> Course:
    """One step of the course, or a shorter one to try next."""
    mu, kappa = springs.mu, springs.kappa
    one, zero = 1 + 0 * y.F, 0 * y.F
    slips, unloads = y.slips > 0, y.unloads > 0
    k = choose(unloads, lambda: one / (springs.e * springs.e), lambda: one)

    def rates(a1: Scalar, a2: Scalar, F: Scalar, *P: Scalar) -> tuple[Scalar, ...]:
        u1, u2, u_n = springs.velocity(*P)
        grip = mu * F
        w = choose(
            grip > 0,
            lambda: kappa * (a1 * u2 - a2 * u1) / choose(grip > 0, lambda: grip, lambda: one),
            lambda: zero,
        )
        forces = choose(slips, lambda: (-grip * a1, -grip * a2), lambda: (a1, a2))
        turns = choose(slips, lambda: (-w * a2, w * a1), lambda: (-kappa * u1, -kappa * u2))
        return (*turns, -k * u_n, *forces, F)

    def events(a1: Scalar, a2: Scalar, F: Scalar, P1: Scalar, P2: Scalar, Pn: Scalar) -> list[Event]:
        u1, u2, u_n = springs.velocity(P1, P2, Pn)
        d1, d2, dF, F1, F2, _ = rates(a1, a2, F, P1, P2, Pn)
        du1 = springs.A11 * F1 + springs.A12 * F2 + springs.b1 * F
        du2 = springs.A12 * F1 + springs.A22 * F2 + springs.b2 * F
        dun = springs.b1 * F1 + springs.b2 * F2 + F
        size = square_root(a1 * a1 + a2 * a2)
        safe = choose(size > 0, lambda: size, lambda: one)
        # In units in which what they are made of is 1: EVENT is more than its rounding.
        grip, speed = (1 + mu) * (1 + y.most), (1 + share) * reach
        stick = Event((mu * F - size) / grip, (mu * dF - (a1 * d1 + a2 * d2) / safe) / grip)
        fades = a1 * du1 + a2 * du2 + d1 * u1 + d2 * u2 + share * dun
        slip = Event((a1 * u1 + a2 * u2 + share * u_n) / speed, fades / speed)
        friction = choose(slips, lambda: slip, lambda: stick)
        rough = choose(mu > 0, lambda: friction, lambda: Event(one, zero))
        full = Event((y.most - F) / (1 + y.most), -dF / (1 + y.most))
        return [rough, choose(unloads, lambda: full, lambda: Event(-u_n / reach, -dun / reach))]

    start = (y.a1, y.a2, y.F, y.P1, y.P2, y.Pn)
    share, reach = mu * k / kappa, springs.reach(y.P1, y.P2, y.Pn)
    h = for_derivatives(
        y.h, lambda: fixed(choose(slips, lambda: minimum(y.h, _reach(springs, y, k)), lambda: y.h))
    )
    slopes: list[tuple[Scalar, ...]] = []

    def total(row: Row, i: int) -> Scalar:
        return h * reduce(add, (weight * slopes[j][i] for j, weight in row))

    for row in ((), *STAGES):
        slopes.append(rates(*(v + total(row, i) for i, v in enumerate(start))) if row else rates(*start))
    end = tuple(v + total(WEIGHTS, i) for i, v in enumerate(start))
    fifth = [total(ERROR_5, i) for i in range(6)]
    third = [total(WEIGHTS, i) - total(ORDER_3, i) for i in range(6)]
    scale = maximum(one, (abs(y.P1) + abs(y.P2) + y.Pn) / 4)  # above 1 where friction jams
    e5, e3 = (_size(e, slips, mu, kappa, k, y.most) / scale for e in (fifth, third))
    square = e5 * e5
    err = choose(square > 0, lambda: square / square_root(square + 0.01 * e3 * e3), lambda: zero)
    ratio = choose(square < 1e6, lambda: err / springs.tolerance, lambda: 1e30 * one)  # nor if it is none
    factor = 0.9 / square_root(square_root(square_root(ratio + 1e-6)))
    size = h * maximum(minimum(factor, 4 * one), 0.2 * one)

    # The first event on the way, if there is one.
    before, after = events(*start), events(*end)
    to = [_aim(first, last, h) for first, last in zip(before, after, strict=True)]
    F = end[2]
    fell = F < 0
    to.append(
        choose(fell, lambda: 0.98 * h * y.F / choose(fell, lambda: y.F - F, lambda: one), lambda: 2 * h)
    )
    nearest = reduce(minimum, to)
    is_fine = ratio <= 1
    passed = (nearest < h) & is_fine
    again = choose(is_fine, lambda: nearest, lambda: size)

    def accepted() -> Course:
        switches, turns = (event.is_now() for event in after)
        delay = choose(turns, after[1].delay, lambda: zero)
        delay = choose(switches, after[0].delay, lambda: delay)
        a1, a2, F, P1, P2, Pn = (v + rate * delay for v, rate in zip(end, rates(*end), strict=True))
        u_n = springs.velocity(P1, P2, Pn)[2]
        length = choose(slips, lambda: 0.5 * (3 - a1 * a1 - a2 * a2), lambda: one)
        a1, a2 = a1 * length, a2 * length
        # stick <-> slip
        grip = mu * F
        force = square_root(a1 * a1 + a2 * a2)
        safe = choose(force > 0, lambda: force, lambda: one)
        other = choose(slips, lambda: (-grip * a1, -grip * a2), lambda: (-a1 / safe, -a2 / safe))
        b1, b2 = choose(switches, lambda: other, lambda: (a1, a2))
        now = choose(switches, lambda: 1 - y.slips, lambda: y.slips)
        unloads_now = choose(turns, lambda: 1 - y.unloads, lambda: y.unloads)
        begins = turns & (y.unloads < 1)
        most = maximum(y.most, F)
        over = choose(
            springs.e < LEAST, lambda: begins, lambda: (y.unloads > 0) & (END * most >= F) & (u_n > 0)
        )
        along = y.a1 * y.a1 * springs.A11 + 2 * y.a1 * y.a2 * springs.A12 + y.a2 * y.a2 * springs.A22
        slid = mu * square_root(along * k) * h / 2
        turned = mu * square_root(k / kappa) * (abs(a1 - y.a1) + abs(a2 - y.a2)) / 2
        gain = choose(slips, lambda: slid + turned, lambda: zero)
        held = choose(slips & switches, lambda: mu * mu * k / kappa, lambda: zero)
        missed = choose(switches | turns, lambda: EVENT * reach, lambda: zero)
        pressed = (y.unloads < 1) & (u_n < springs.velocity(y.P1, y.P2, y.Pn)[2])
        return Course(
            b1, b2, F, P1, P2, Pn, now, unloads_now, most,
            choose(begins, lambda: size * springs.e, lambda: size),
            choose(over, lambda: zero, lambda: one),
            y.growth * _exponential(gain) * square_root(1 + held),
            y.doubt + (err + STEP_ROUNDING) * scale + missed,
            choose(now > 0, lambda: y.stuck, lambda: one), choose(pressed, lambda: one, lambda: y.jams),
        )  # fmt: skip

    return choose(is_fine & negation(passed), accepted, lambda: y._replace(h=again))


LEAST = 1e-12
"""Less restitution gives back nothing that would count: 0 is answered, and the bound says so."""


def _reach(springs: Springs, y: Course, k: Scalar) -> Scalar:
    """How far slip may go in one step: its direction is stiff where ``F_n`` is small.

    Steps that are fine for planar slip are too long for how it leaves its plane as the data vary.
    """
    u1, u2, u_n = springs.velocity(y.P1, y.P2, y.Pn)
    force, turn = y.F / (k * abs(u_n)), springs.mu * y.F / (springs.kappa * (abs(u1) + abs(u2)))
    far = minimum(force / 2, minimum(turn / 2 + force / 100, 3 * turn))
    return choose(y.F > 0, lambda: far, lambda: y.h)


def _exponential(x: Scalar) -> Scalar:
    """``exp``, from above if ``x`` is at most 8; more grows beyond all use in a few steps."""
    power = 1 + x / 8 * (1 + x / 8)
    for _ in range(3):
        power = power * power
    return power


def _aim(first: Event, last: Event, h: Scalar) -> Scalar:
    """The step that ends at an event; twice ``h`` if that holds none."""
    never = 2 * h
    # Newton's step back from the end, within what is known.
    safe = choose(last.slope < 0, lambda: last.slope, lambda: -1 + 0 * h)
    back = h - (last.value + EVENT / 2) / safe
    rise = first.value - last.value
    chord = h * first.value / choose(rise > 0, lambda: rise, lambda: 1 + 0 * h)
    inside = (last.slope < 0) & (back > 0) & (back < h)
    guess = choose(inside, lambda: back, lambda: maximum(minimum(chord, 0.9 * h), 0.1 * h))
    # A dip between two ends above 0: the least of the cubic.
    dips = (first.slope < 0) & (last.slope > 0) & (last.value > 0)
    fall = choose(
        dips,
        lambda: -first.slope / choose(dips, lambda: last.slope - first.slope, lambda: 1 + 0 * h),
        lambda: 0 * h,
    )
    low = _cubic(first, last, h, fall)
    passed = choose(last.is_passed(), lambda: guess, lambda: never)
    return choose(dips & (low < 0) & (fall < 0.99), lambda: fall * h, lambda: passed)


def _cubic(first: Event, last: Event, h: Scalar, s: Scalar) -> Scalar:
    """Hermite's interpolation at ``s h``."""
    r = 1 - s
    ends = first.value * (r * r * (1 + 2 * s)) + last.value * (s * s * (3 - 2 * s))
    return ends + h * (first.slope * (s * r * r) - last.slope * (s * s * r))


def _size(e: list[Scalar], slips: Condition, mu: Scalar, kappa: Scalar, k: Scalar, most: Scalar) -> Scalar:
    """An error of the state, as a speed."""
    turn = abs(e[0]) + abs(e[1])
    across = choose(slips, lambda: mu * most * turn, lambda: turn) / square_root(kappa)
    return across + abs(e[2]) / square_root(k) + abs(e[3]) + abs(e[4]) + abs(e[5])
