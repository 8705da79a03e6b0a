"""Integrate an impact between springs, in the letters and units of ``compliant.py``.

The method is that of ``dormand_prince.py``. The motion is smooth between events. Each state has a number that
is positive until the event that ends it:

    stick      mu F_n - |F_t|        slip         lambda
    loading    -u_n                  unloading    F_max - F_n

A step that leads past an event is repeated with a shorter length until it ends at the event, to ``EVENT``. A
number may also dip and rise again within a step. If the dip goes near 0, the step ends at its bottom.
"""

from __future__ import annotations

from functools import reduce
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
    or_one,
    positive_part,
    square_root,
    varying_as,
)
from .dormand_prince import ERROR_5, ORDER_3, STAGES, TOO_LONG, WEIGHTS, Row, row_sum, step_error, step_factor
from .hermite import Cubic

EVENT = 2.0**-48
"""How far past the event a step may end, in units of the terms that make up the number of the event."""

NEAR = 1 / 5
"""A dip goes near 0 if its bottom is less than this part of the number at the ends of the step."""

AT_BOTTOM = 1 - 2.0**-13
"""The part of a step after which a dip is at its end."""

END = 1e-8
"""Normal force, relative to its maximum, at which the rest of the path counts as straight."""

STEP_ROUNDING = 4e-15
"""Rounding error of a step."""

STEPS = 20000
"""Steps at most."""

LATE = 2.0**-8
"""A spring whose delay changes by less than this within its delay follows the slip: see "Slip that turns" in
``compliant.py``."""

NOT_LATE = 2.0**-3, 2.0**-43
"""A spring whose delay changes by less than the first follows the slip, too, if its force errs by less than
the second."""

LEAST_SQUARE = 1e-100
"""The square of a slip speed that counts as 0."""

LEAST_WEIGHT = 1e-9
"""Less friction weighs the error of a direction as much as this: it must stay a direction."""

LEAST_RESTITUTION = 1e-12
"""With less restitution, the impact ends with compression. The bound counts what it would return."""


class Springs(NamedTuple):
    """The constants of an impact between springs.

    Attributes:
        A11, A12, A22, b1, b2: the tangential and the mixed part of ``K``.
        v1, v2: the slip before the impact.
        mu, kappa: friction, and the ratio of tangential to normal stiffness.
        e: restitution of energy.
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
        """``u`` after an impulse."""
        return (
            self.v1 + self.A11 * P1 + self.A12 * P2 + self.b1 * Pn,
            self.v2 + self.A12 * P1 + self.A22 * P2 + self.b2 * Pn,
            self.b1 * P1 + self.b2 * P2 + Pn - 1,
        )

    def weight(self) -> Scalar:
        """The weight ``w`` of errors of ``F`` during slip: see "Error" in ``compliant.py``."""
        return maximum(1 + 0 * self.mu, self.mu * square_root(self.A11 + self.A22))

    def direction(
        self, F: Scalar, dF: Scalar, u1: Scalar, u2: Scalar, inverse: Scalar
    ) -> tuple[Scalar, Scalar, Scalar]:
        """The direction of a spring that follows the slip, and the sine of the angle by which it lags.

        Args:
            F, dF: the normal force and its rate.
            u1, u2: the slip.
            inverse: ``1 / |u_t|``.
        """
        mu, c1, c2, turn = self.mu, u1 * inverse, u2 * inverse, F * inverse
        r1, r2 = mu * (self.A11 * c1 + self.A12 * c2), mu * (self.A12 * c1 + self.A22 * c2)
        d1, d2 = self.b1 - r1, self.b2 - r2
        held = mu * (self.A11 + self.A22) - c1 * r1 - c2 * r2
        delay = mu / self.kappa * inverse
        change = delay * (2 * dF - turn * F * (3 * (c1 * d1 + c2 * d2) + held))
        lag = delay * turn * F * (c1 * d2 - c2 * d1) * (1 - change)
        length = 1 - lag * lag / 2
        return (c1 + lag * c2) * length, (c2 - lag * c1) * length, lag

    def bends(self) -> Scalar:
        """1 if slip may leave the plane of the first slip, else 0."""
        one = 1 + 0 * self.mu
        is_planar = (self.b2 == 0) & (self.A12 == 0) & (self.v2 == 0) | (self.mu <= 0)
        return choose(is_planar, lambda: 0 * one, lambda: one)

    def turning(self) -> Scalar:
        """The rate at which slip of speed 1 turns or slows down under a normal force of 1, at most."""
        return abs(self.b1) + abs(self.b2) + 2 * self.mu * (self.A11 + self.A22)

    def size_of_terms(self, P1: Scalar, P2: Scalar, Pn: Scalar) -> tuple[Scalar, Scalar]:
        """The sizes of the terms that :meth:`velocity` adds up: for all of ``u``, and for ``u_n``."""
        b, P_t = abs(self.b1) + abs(self.b2), abs(P1) + abs(P2)
        slip = abs(self.v1) + abs(self.v2) + (self.A11 + self.A22) * P_t + b * Pn
        normal = 1 + b * P_t + Pn
        return slip + normal, normal


class State(NamedTuple):
    """The state of the contact during the impact. Flags are 1 or 0.

    Attributes:
        a1, a2: the tangential force if it sticks; the direction of the spring's deflection if it slips.
        F: the normal force.
        P1, P2, Pn: the impulse so far.
        slips, unloads: whether it slips, not sticks; and unloads, not loads.
        F_max: the greatest normal force so far.
        h: length of the next step, in time.
        is_running: 1 until the impact ends.
        growth: the factor by which an initial error may have grown.
        weighted: a second bound of that factor, from a norm in which errors of ``F`` weigh more during slip.
        step_error: the sum of the errors of the steps.
        has_stuck, has_jammed: whether it ever stuck, and whether friction ever pressed the bodies together.
        crest: how far ``u_n`` was from 0, at least, where it rose and then fell during loading.
    """

    a1: Scalar
    a2: Scalar
    F: Scalar
    P1: Scalar
    P2: Scalar
    Pn: Scalar
    slips: Scalar
    unloads: Scalar
    F_max: Scalar
    h: Scalar
    is_running: Scalar
    growth: Scalar
    weighted: Scalar
    step_error: Scalar
    has_stuck: Scalar
    has_jammed: Scalar
    crest: Scalar


class Event(NamedTuple):
    """A number that is positive until an event, and its derivative by time."""

    value: Scalar
    slope: Scalar

    def is_now(self) -> Condition:
        """Whether the number has just reached 0, falling."""
        return (self.value <= 0) & (self.slope < 0)

    def delay(self) -> Scalar:
        """0, with the derivatives of the time by which the event comes later."""
        return varying_as(0 * self.value, lambda: -self.value / fixed(self.slope))


class Following(NamedTuple):
    """A spring that follows the slip.

    Attributes:
        a1, a2: its direction.
        delay: the time by which it lags.
        late: how much that time, and the rate at which slip turns, change within that time, at most.
        error: the angle by which its direction is wrong, at most.
    """

    a1: Scalar
    a2: Scalar
    delay: Scalar
    late: Scalar
    error: Scalar

    @classmethod
    def of(cls, springs: Springs, k: Scalar, F: Scalar, *P: Scalar) -> Following:
        """The spring at a normal force and an impulse."""
        u1, u2, u_n = springs.velocity(*P)
        inverse = _inverse_length(u1, u2)
        a1, a2, lag = springs.direction(F, -k * u_n, u1, u2, inverse)
        delay = springs.mu * inverse / springs.kappa
        swing = 2 * F * square_root(k) * (1 + springs.mu * (abs(springs.b1) + abs(springs.b2)))
        late = delay * (2 * k * abs(u_n) + 3 * F * F * springs.turning() * inverse + swing)
        # Slip in a plane has no lag, but its derivatives out of the plane do.
        lag = for_derivatives(abs(lag), lambda: maximum(abs(lag), late))
        return cls(a1, a2, delay * F, late, lag * late * late)


class Motion(NamedTuple):
    """The equations of motion up to the next event.

    Attributes:
        springs: the constants.
        slips, unloads: whether the contact slips, not sticks; and unloads, not loads.
        follows: whether the spring follows the slip.
        before: the spring as it would follow the slip, at the beginning.
        missed: how much the impulse changes if it begins to follow.
        k: stiffness of the normal spring.
        share: ``mu k / kappa``.
        terms, normal_terms: the units of the rounding of ``u`` and of ``u_n``. Slip may be far faster.
        F_max: the greatest normal force so far.
    """

    springs: Springs
    slips: Condition
    unloads: Condition
    follows: Condition
    before: Following
    missed: Scalar
    k: Scalar
    share: Scalar
    terms: Scalar
    normal_terms: Scalar
    F_max: Scalar

    @classmethod
    def of(cls, springs: Springs, y: State) -> Motion:
        """The motion from a state on."""
        one, slips, unloads = 1 + 0 * y.F, y.slips > 0, y.unloads > 0
        k = choose(unloads, lambda: one / (springs.e * springs.e), lambda: one)
        share, terms = springs.mu * k / springs.kappa, springs.size_of_terms(y.P1, y.P2, y.Pn)
        spring = Following.of(springs, k, y.F, y.P1, y.P2, y.Pn)
        off = abs(spring.a1 - y.a1) + abs(spring.a2 - y.a2)
        missed = 2 * springs.mu * y.F * spring.delay * off
        turns = for_derivatives(springs.bends(), lambda: one) > 0
        is_exact = (spring.late < NOT_LATE[0]) & (springs.mu * y.F * spring.error < NOT_LATE[1])
        follows = slips & turns & ((spring.late < LATE) | is_exact)
        follows = follows & ((off <= spring.late) | (missed <= springs.tolerance))
        return cls(springs, slips, unloads, follows, spring, missed, k, share, *terms, y.F_max)

    def rates(self, a1: Scalar, a2: Scalar, F: Scalar, *P: Scalar) -> tuple[Scalar, ...]:
        """The rates of the first six numbers of a state; 0 for the direction of a spring that follows."""
        springs, kappa, zero = self.springs, self.springs.kappa, 0 * F
        u1, u2, u_n = springs.velocity(*P)
        grip = springs.mu * F
        w = choose(grip > 0, lambda: kappa * (a1 * u2 - a2 * u1) / or_one(grip), lambda: zero)
        c1, c2, _ = springs.direction(F, -self.k * u_n, u1, u2, _inverse_length(u1, u2))
        a1, a2 = choose(self.follows, lambda: (c1, c2), lambda: (a1, a2))
        w = choose(self.follows, lambda: zero, lambda: w)
        forces = choose(self.slips, lambda: (-grip * a1, -grip * a2), lambda: (a1, a2))
        turns = choose(self.slips, lambda: (-w * a2, w * a1), lambda: (-kappa * u1, -kappa * u2))
        return (*turns, -self.k * u_n, *forces, F)

    def events(self, a1: Scalar, a2: Scalar, F: Scalar, P1: Scalar, P2: Scalar, Pn: Scalar) -> list[Event]:
        """The next changes between stick and slip, and between loading and unloading.

        In units of the terms that they are made of, so that EVENT is more than their rounding.
        """
        springs, mu, share, normal_terms = self.springs, self.springs.mu, self.share, self.normal_terms
        one, zero = 1 + 0 * F, 0 * F
        u1, u2, u_n = springs.velocity(P1, P2, Pn)
        d1, d2, dF, F1, F2, _ = self.rates(a1, a2, F, P1, P2, Pn)
        du1 = springs.A11 * F1 + springs.A12 * F2 + springs.b1 * F
        du2 = springs.A12 * F1 + springs.A22 * F2 + springs.b2 * F
        dun = springs.b1 * F1 + springs.b2 * F2 + F
        size = square_root(a1 * a1 + a2 * a2)
        force_unit, speed_unit = (1 + mu) * (1 + self.F_max), (1 + share) * self.terms
        stick = Event(
            (mu * F - size) / force_unit, (mu * dF - (a1 * d1 + a2 * d2) / or_one(size)) / force_unit
        )
        d_lambda = a1 * du1 + a2 * du2 + d1 * u1 + d2 * u2 + share * dun
        slip = Event((a1 * u1 + a2 * u2 + share * u_n) / speed_unit, d_lambda / speed_unit)
        friction = choose(self.slips, lambda: slip, lambda: stick)
        friction_event = choose(mu > 0, lambda: friction, lambda: Event(one, zero))
        full = Event((self.F_max - F) / (1 + self.F_max), -dF / (1 + self.F_max))
        return [
            friction_event,
            choose(self.unloads, lambda: full, lambda: Event(-u_n / normal_terms, -dun / normal_terms)),
        ]


class Trial(NamedTuple):
    """A step that is tried.

    Attributes:
        h: its length.
        end: the first six numbers of the state at its end.
        error, scale: its error in units of ``scale``, which is 1, or greater if friction jams.
        ratio: its error over the tolerance: the step is short enough if it is <= 1.
        next_h: length of the next step.
    """

    h: Scalar
    end: tuple[Scalar, ...]
    error: Scalar
    scale: Scalar
    ratio: Scalar
    next_h: Scalar


def step(springs: Springs, y: State) -> State:
    """The state after one step; or, if the step is too long, with a smaller ``h``."""
    motion = Motion.of(springs, y)
    trial = _try_step(motion, y)
    h, F = trial.h, trial.end[2]
    # The first event within the step, if there is one.
    before, after = motion.events(*y[:6]), motion.events(*trial.end)
    dips = [Dip.of(first, last, h) for first, last in zip(before, after, strict=True)]
    to = [_step_to(first, last, dip, h) for first, last, dip in zip(before, after, dips, strict=True)]
    fell, one = F < 0, 1 + 0 * F
    to.append(
        choose(fell, lambda: 0.98 * h * y.F / choose(fell, lambda: y.F - F, lambda: one), lambda: 2 * h)
    )
    nearest = reduce(minimum, to)
    is_fine = trial.ratio <= 1
    passed = (nearest < h) & is_fine
    again = choose(is_fine, lambda: nearest, lambda: trial.next_h)
    is_accepted = is_fine & negation(passed)
    return choose(
        is_accepted, lambda: _accepted(motion, y, trial, after, dips[1]), lambda: y._replace(h=again)
    )


def _try_step(motion: Motion, y: State) -> Trial:
    """One step of the method of ``dormand_prince.py``."""
    one, start = 1 + 0 * y.F, y[:6]
    follows = motion.follows
    h = choose(follows, lambda: fixed(_longest_following(motion, y)), lambda: y.h)
    h = for_derivatives(h, lambda: fixed(choose(follows, lambda: h, lambda: minimum(h, _longest(motion, y)))))
    slopes: list[tuple[Scalar, ...]] = []

    def total(row: Row, i: int) -> Scalar:
        return h * row_sum(row, slopes, i)

    for row in ((), *STAGES):
        slopes.append(motion.rates(*(v + total(row, i) for i, v in enumerate(start)) if row else start))
    end = tuple(v + total(WEIGHTS, i) for i, v in enumerate(start))
    fifth = [total(ERROR_5, i) for i in range(6)]
    third = [total(WEIGHTS, i) - total(ORDER_3, i) for i in range(6)]
    scale = maximum(one, (abs(y.P1) + abs(y.P2) + y.Pn) / 4)
    e5, e3 = (_error_norm(e, motion) / scale for e in (fifth, third))
    error = step_error(e5, e3)
    # NaN is too long, too.
    ratio = choose(e5 * e5 < 1e6, lambda: error / motion.springs.tolerance, lambda: TOO_LONG * one)
    return Trial(h, end, error, scale, ratio, h * step_factor(ratio, one))


def _accepted(motion: Motion, y: State, trial: Trial, events: list[Event], dip: Dip) -> State:
    """The state after a step from ``y`` that is short enough.

    If it ends at one of the events, another motion begins. ``dip`` is that of the second.
    """
    springs, slips, end = motion.springs, motion.slips, trial.end
    mu, one, zero = springs.mu, 1 + 0 * y.F, 0 * y.F
    switches, turns = (event.is_now() for event in events)
    delay = choose(turns, events[1].delay, lambda: zero)
    delay = choose(switches, events[0].delay, lambda: delay)
    a1, a2, F, P1, P2, Pn = (v + rate * delay for v, rate in zip(end, motion.rates(*end), strict=True))
    _, _, u_n = springs.velocity(P1, P2, Pn)
    length = choose(slips, lambda: 0.5 * (3 - a1 * a1 - a2 * a2), lambda: one)
    spring = Following.of(springs, motion.k, F, P1, P2, Pn)
    follows = motion.follows
    a1, a2 = choose(follows, lambda: (spring.a1, spring.a2), lambda: (a1 * length, a2 * length))
    # stick <-> slip
    grip = mu * F
    force = or_one(square_root(a1 * a1 + a2 * a2))
    other = choose(slips, lambda: (-grip * a1, -grip * a2), lambda: (-a1 / force, -a2 / force))
    b1, b2 = choose(switches, lambda: other, lambda: (a1, a2))
    now = choose(switches, lambda: 1 - y.slips, lambda: y.slips)
    unloads_now = choose(turns, lambda: 1 - y.unloads, lambda: y.unloads)
    begins = turns & (y.unloads < 1)
    F_max = maximum(y.F_max, F)
    over = choose(
        springs.e < LEAST_RESTITUTION,
        lambda: begins,
        lambda: (y.unloads > 0) & (END * F_max >= F) & (u_n > 0),
    )
    turned = abs(a1 - y.a1) + abs(a2 - y.a2)
    missed = choose(turns, lambda: EVENT * motion.normal_terms, lambda: zero)
    missed = choose(switches, lambda: EVENT * motion.terms, lambda: missed)
    error = mu * maximum(y.F, F) * trial.h * maximum(motion.before.error, spring.error)
    missed = missed + choose(follows, lambda: motion.missed + error, lambda: zero)
    pressed = (y.unloads < 1) & (u_n < springs.velocity(y.P1, y.P2, y.Pn)[2])
    crests = (y.unloads < 1) & dip.exists
    return State(
        b1, b2, F, P1, P2, Pn, now, unloads_now, F_max,
        choose(begins, lambda: trial.next_h * springs.e, lambda: trial.next_h),
        choose(over, lambda: zero, lambda: one),
        *_growths(motion, y, trial.h, turned, switches),
        y.step_error + (trial.error + STEP_ROUNDING) * trial.scale + missed,
        choose(now > 0, lambda: y.has_stuck, lambda: one),
        choose(pressed, lambda: one, lambda: y.has_jammed),
        choose(crests, lambda: minimum(y.crest, dip.low * motion.normal_terms), lambda: y.crest),
    )  # fmt: skip


def _growths(
    motion: Motion, y: State, h: Scalar, turned: Scalar, switches: Condition
) -> tuple[Scalar, Scalar]:
    """``growth`` and ``weighted`` after a step that turns the spring, and after a change that ends it."""
    springs, slips, one = motion.springs, motion.slips, 1 + 0 * y.F
    w, held = springs.weight(), springs.mu * springs.mu * motion.k / springs.kappa
    growth = y.growth * _slip_growth(motion, y, h, turned, one)
    weighted = y.weighted * _slip_growth(motion, y, h, turned, w)
    sticks = minimum(growth * square_root(1 + held), weighted * square_root(maximum(one, (1 + held) / w)))
    slid = choose(switches, lambda: (sticks, sticks), lambda: (growth, weighted))
    stuck = y.growth, choose(switches, lambda: y.growth * square_root(w), lambda: y.growth)
    return choose(slips, lambda: slid, lambda: stuck)


def _slip_growth(motion: Motion, y: State, h: Scalar, turned: Scalar, w: Scalar) -> Scalar:
    """The factor by which errors may grow in a step of slip, if ``w`` is the weight of that of ``F``."""
    springs, k, mu = motion.springs, motion.k, motion.springs.mu
    a_A_a = y.a1 * y.a1 * springs.A11 + 2 * y.a1 * y.a2 * springs.A12 + y.a2 * y.a2 * springs.A22
    a_b = y.a1 * springs.b1 + y.a2 * springs.b2
    v_K_v = (w - 1) * (w - 1) + 2 * (w - 1) * mu * a_b + mu * mu * a_A_a
    push = square_root(positive_part(v_K_v) * k / w) * h
    return _exponential((push + mu * square_root(k / (springs.kappa * w)) * turned) / 2)


def _longest_following(motion: Motion, y: State) -> Scalar:
    """The next step of a spring that follows the slip: at most one in which slip changes by half."""
    u1, u2, u_n = motion.springs.velocity(y.P1, y.P2, y.Pn)
    turn = motion.springs.turning() * _inverse_length(u1, u2)
    return y.h / (1 + y.h * (2 * y.F_max * turn + square_root(abs(u_n) * turn)))


def _inverse_length(u1: Scalar, u2: Scalar) -> Scalar:
    """``1 / |u|``; huge if u is 0."""
    square = u1 * u1 + u2 * u2
    return 1 / square_root(choose(square > LEAST_SQUARE, lambda: square, lambda: LEAST_SQUARE + 0 * square))


def _longest(motion: Motion, y: State) -> Scalar:
    """The longest step for derivatives.

    A step that suits planar motion may be too long for the derivatives of how the motion leaves its plane. It
    swings across the plane at a rate whose square is at most ``kappa (A11 + A22)``; and the direction of slip
    is stiff where ``F_n`` is small.
    """
    springs = motion.springs
    u1, u2, u_n = springs.velocity(y.P1, y.P2, y.Pn)
    s = abs(u1) + abs(u2)
    force = y.F / (motion.k * abs(u_n))
    turn = springs.mu * y.F / (springs.kappa * s)
    far = minimum(force / 2, minimum(turn / 2 + force / 100, 3 * turn))
    swing = 1 / (2 * square_root(springs.kappa * (springs.A11 + springs.A22)))
    return choose(motion.slips & (y.F > 0), lambda: minimum(far, swing), lambda: swing)


def _exponential(x: Scalar) -> Scalar:
    """An upper bound of ``exp(x)`` for ``x`` up to 8. A greater ``x`` leaves no useful error bound."""
    power = 1 + x / 8 * (1 + x / 8)
    for _ in range(3):
        power = power * power
    return power


class Dip(NamedTuple):
    """Where the number of an event is least in a step, if it falls and rises again.

    Attributes:
        exists: whether it does so.
        at: the part of the step up to there.
        low: the number there, by Hermite's cubic.
    """

    exists: Condition
    at: Scalar
    low: Scalar

    @classmethod
    def of(cls, first: Event, last: Event, h: Scalar) -> Dip:
        """The dip between the number at the beginning and at the end of a step."""
        exists = (first.slope < 0) & (last.slope > 0) & (last.value > 0)
        cubic = Cubic.between(-first.value, -first.slope, -last.value, -last.slope, h)
        at = choose(exists, cubic.crest, lambda: 0 * h)
        return cls(exists, at, -cubic.at(at))

    def is_near_zero(self, first: Event, last: Event) -> Condition:
        """Whether the number may pass 0 in the dip, between these ends."""
        return self.exists & (self.low < NEAR * minimum(first.value, last.value))


def _step_to(first: Event, last: Event, dip: Dip, h: Scalar) -> Scalar:
    """The length of the step that ends at the event; ``2 h`` if there is none within ``h``."""
    never = 2 * h
    # Newton's step back from the end, if it stays within the step; else the chord.
    safe = choose(last.slope < 0, lambda: last.slope, lambda: -1 + 0 * h)
    back = h - (last.value + EVENT / 2) / safe
    chord = h * first.value / or_one(first.value - last.value)
    inside = (last.slope < 0) & (back > 0) & (back < h)
    guess = choose(inside, lambda: back, lambda: maximum(minimum(chord, 0.9 * h), 0.1 * h))
    passed = choose(last.value < -EVENT, lambda: guess, lambda: never)
    # Where a step ends at the bottom, rounding may keep the dip within.
    return choose(dip.is_near_zero(first, last) & (dip.at < AT_BOTTOM), lambda: dip.at * h, lambda: passed)


def _error_norm(e: list[Scalar], motion: Motion) -> Scalar:
    """The size of an error of the state, as a speed: about the root of ``V``."""
    turn = abs(e[0]) + abs(e[1])
    springs = motion.springs
    weight = maximum(springs.mu, LEAST_WEIGHT + 0 * springs.mu)
    across = choose(motion.slips, lambda: weight * motion.F_max * turn, lambda: turn)
    across = across / square_root(springs.kappa)
    return across + abs(e[2]) / square_root(motion.k) + abs(e[3]) + abs(e[4]) + abs(e[5])
