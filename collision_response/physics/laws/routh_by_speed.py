"""Routh's path of the impulse where friction depends on the speed of slip: ``mu(s)``, any function.

The letters, the units and both ends of the path are those of ``routh.py``:

    dp = c dx    dP_t = -m t dx    du_t/dx = f = c b - m A t    du_n/dx = r = c - m b.t

Now ``c = 1 / (1 + mu)`` and ``m = mu c`` vary with the slip ``s = |u_t|`` on the way, so that slip may turn
in each phase and stop more than once. ``v = u_t`` follows a law of its own, ``dv/dx = f(v)``, and all else
is integrated beside it, by the method of ``dormand_prince.py``. ``f`` is smooth but where slip stops and
where ``mu`` is not, and no step leads farther than ``LONGEST`` of the way to the stop. So steps shrink with
the slip, down to one that is none: ``l`` times the tolerance, with the least eigenvalue ``l`` of ``A``. The
impulse that stops it, ``A^-1 v``, is below the tolerance. Friction opposes slip whatever its size, so energy
never grows, by either end.

**Straight steps.** Slip near a direction that it is drawn to would take steps as short as the time in which
it gets there, however long it stays. So a step keeps its direction if what it would turn by moves the slip
by less than counts: ``|w| dx``; or, where slip is drawn back at the rate ``pull / s`` and so turns by
``|w| / pull`` in all, ``s |w| / pull`` across, and along what such a turn does to ``g dx``: a part of the
slip however small that is, for it may grow in one direction and stop in another. Planar slip takes no other
steps.

**Slip stops.** ``h = A^-1 b`` would hold it: it sticks if ``|h| <= mu(0)``, to the end, for the forces keep
their ratio. Else it slips on along the ray of ``mu(0)`` at first. If friction jumps at 0 (static above
kinetic) it soon follows the ray of the friction beside 0 instead: slip that grows from rest is drawn to
that.

**Slip stays** where friction rises with the speed through ``|h|``: at ``v = s h / |h|`` there is ``f = 0``,
and slip is drawn to it. So friction that is 0 at rest never sticks, but creeps; and slip ends at a speed at
which friction jumps upwards, once it has the direction of ``h``. What is so near that it counts as there
stays.

**The ends of the phases** lie on a step that leads across: it is cut, by secants, until it leads there.

**Error.** Of a function that is only asked for values, nothing can bound it. So the path is followed once
more, to a tolerance ``COARSER`` times as great, with data and friction ``OTHER`` than those given, and with
a tie of stick and slip decided the other way. The difference is the doubt.

Sources: those of ``routh.py``, Keller's equation first; for slip that stays at a jump, Filippov,
*Differential Equations with Discontinuous Righthand Sides*, 1988.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

from ...numbers.operations import Scalar
from ...status import ImpactError, StatusCode
from ..effective_mass import ContactKinematics
from ..vector import Vec3
from .contact_frame import ContactFrame, Tangential
from .dormand_prince import ERROR_5, ORDER_3, STAGES, WEIGHTS, Row
from .law import Coefficients, Law, Outcome, Regime
from .routh import (
    DEFAULT_TOLERANCE,
    GREATEST_FRICTION,
    LEAST_RESTITUTION,
    LEAST_TOLERANCE,
    PATH_SHARE,
    Ray,
    ray_from_rest,
)
from .routh_path import LONGEST, Path

FINEST = LEAST_TOLERANCE / PATH_SHARE
"""The least tolerance that makes a difference."""

COARSEST = 1e-9  # a coarser path is hardly faster, and passes by what the function has
COARSER = 10.0
OTHER = 2.0**-50  # relative, times a small number for each
TIE = 2.0**-45  # friction, relative: more than the other data can move a tie of stick and slip
STEPS = 4000
ROUNDING = 2.0**-50
STEP_SHARE = 1 / 16  # of the tolerance, that a step may seem to err by
STRAIGHT = 1 / 16  # of the tolerance, that a straight step may leave out
CUTS = 60
BEYOND = 1.01  # a step aims so far beyond the end of a phase, to lead across


class Point(NamedTuple):
    """A point of the path.

    Attributes:
        v1, v2: slip.
        u: normal velocity.
        p, W: normal impulse and its work, since the phase began.
        P1, P2: tangential impulse.
        heat: what friction took.
        p_c, W_c: normal impulse and work of compression; 0 until it is over.
    """

    v1: float
    v2: float
    u: float = -1.0
    p: float = 0.0
    W: float = 0.0
    P1: float = 0.0
    P2: float = 0.0
    heat: float = 0.0
    p_c: float = 0.0
    W_c: float = 0.0


class Slope(NamedTuple):
    """Direction and speed of the slip of a point, and how they change: the letters of ``routh.py``."""

    t1: float
    t2: float
    s: float
    c: float
    m: float
    g: float
    w: float
    r: float


def of_path(tolerance: Scalar) -> float:
    """To what tolerance the path is followed."""
    return max(LEAST_TOLERANCE, min(PATH_SHARE * tolerance, COARSEST)) if tolerance else DEFAULT_TOLERANCE


def routh_by_speed(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """As :func:`~collision_response.physics.laws.routh.routh`; ``coefficients.friction`` is a function."""
    energetic = coefficients.settings.law != Law.ROUTH_POISSON
    frame = ContactFrame.of(contact)
    k, speed, nothing = frame.Knn, -frame.un, contact.n * 0
    if not speed > 0:
        return Outcome(nothing, 1.0 * Regime.SEPARATING, 0, 0)
    j = speed / k
    of_K = (K / k for K in (frame.K11, frame.K12, frame.K22, frame.K1n, frame.K2n))
    unit, *data = _floats(speed, *of_K, frame.u1 / speed, frame.u2 / speed)
    e = float(coefficients.restitution)
    e = 0.0 if e < LEAST_RESTITUTION else e
    tolerance = of_path(coefficients.settings.tolerance)

    def walk(data: list[float], factor: float, tolerance: float) -> tuple[Point, Regime] | None:
        *K, v1, v2 = data
        path = Path._make([*K, math.nan, math.nan, e, energetic, tolerance])
        return Walk(path, lambda s: factor * coefficients.friction(s * unit)).course(v1, v2)

    def impulse(P1: Fraction, P2: Fraction, p: Fraction) -> Vec3:
        return frame.to_world(Tangential(P1 * j, P2 * j), p * j)

    found = walk(data, 1.0, tolerance)
    sticks = found is not None and found[1] is Regime.STICKING
    beside = [x * (1 + i * OTHER) for i, x in enumerate(data)]
    other = found and walk(beside, 1 - TIE if sticks else 1 + TIE, COARSER * tolerance)
    if found is None or other is None:
        return Outcome(nothing, 1.0 * Regime.SLIDING, 0, 0, unfinished=True)
    end, regime = found
    ends = [[Fraction(x) for x in (y.P1, y.P2, y.p_c + y.p)] for y in (end, other[0])]
    lost = (1 - e) * (1 + e) * -end.W_c if energetic else -(end.W_c + end.W)
    return Outcome(
        impulse(*ends[0]),
        1.0 * regime,
        Fraction(lost) * (speed * j),
        Fraction(end.heat) * (speed * j),
        estimated_error=impulse(*(y - x for x, y in zip(*ends, strict=True))),
    )


def _floats(*numbers: Scalar) -> list[float]:
    try:
        return [float(x) for x in numbers]
    except OverflowError:
        reason = "slip, approach and what an impulse moves are too unlike for float64"
        raise ImpactError(StatusCode.OUT_OF_RANGE, "contact", reason) from None


class Walk:
    """One way along the path.

    Args:
        path: what stays the same on the way, which is all but ``c`` and ``m``.
        mu: the friction at a slip in units of the approach speed.
    """

    def __init__(self, path: Path, mu: Callable[[float], float]) -> None:
        self._path, self._mu = path, mu
        self._h = path.solve(path.b1, path.b2)
        self._hold = math.hypot(*self._h)
        self._room = path.least_eigenvalue()
        self._none = path.tolerance * self._room

    def course(self, v1: float, v2: float) -> tuple[Point, Regime] | None:
        """The end of the path from a first slip, and what friction did; ``None`` if none is in sight."""
        y, jams, length = Point(v1, v2), False, 0.0
        first = (v1, v2) if math.hypot(v1, v2) > self._none else (0.0, 0.0)
        for _ in range(STEPS):
            if y.v1 == y.v2 == 0:
                way = ray_from_rest(self._path, max(self._friction(0.0), self._friction(self._none)))
                start, length = self._out_of_rest(y, way), 0.0
                if start.v1 == start.v2 == 0:  # it sticks, or slip never counts
                    return self._held(y, Regime.JAMMED if jams else Regime.STICKING)
                y = start
                first = first if any(first) else (y.v1, y.v2)
            at = self._slope(y.v1, y.v2)
            if at.g < 0 and at.s <= self._none:
                y = self._stopped(y)
                continue
            if self._stays(at):
                return self._held(y, _regime(y, first, jams=jams))
            length = length or self._first_length(at)
            h = self._longest(y, at, length)
            turns = not self._is_straight(at, h)
            to, ratio = self._step(y, at, h, turns=turns)
            if not turns and not ratio < math.inf:
                turns = True
                to, ratio = self._step(y, at, h, turns=True)
            factor = 0.9 * max(ratio, 1e-6) ** -0.125
            if not ratio <= 1:
                length = h * max(0.2, factor)
                continue
            length = max(length, h * min(4.0, factor))
            jams = jams or at.r * h < -self._path.tolerance
            if self._left(to) <= 0:
                y = self._cut(y, at, h, to, turns=turns)
                y = _turned_over(y) if y.p_c == 0 else y
                if self._left(y) <= 0:
                    return y, _regime(y, first, jams=jams)
            else:
                y = to
        return None

    def _friction(self, s: float) -> float:
        return min(self._mu(s), GREATEST_FRICTION)

    def _stopped(self, y: Point) -> Point:
        """Slip that is none, stopped."""
        path, (P1, P2) = self._path, self._path.solve(y.v1, y.v2)
        u = y.u - path.b1 * P1 - path.b2 * P2
        return y._replace(v1=0.0, v2=0.0, u=u, P1=y.P1 - P1, P2=y.P2 - P2)

    def _out_of_rest(self, y: Point, way: Ray) -> Point:
        """The first slip that is not none."""
        p = self._none / max(1.0, way.G)
        return Point(
            way.G * p * way.z1,
            way.G * p * way.z2,
            y.u + way.rate * p,
            y.p + p,
            y.W + (y.u + way.rate * p / 2) * p,
            y.P1 - way.kz1 * p,
            y.P2 - way.kz2 * p,
            y.heat,
            y.p_c,
            y.W_c,
        )

    def _slope(self, v1: float, v2: float) -> Slope:
        s = math.hypot(v1, v2)
        mu = self._friction(s)
        c, t1, t2 = 1 / (1 + mu), v1 / s, v2 / s
        m = mu * c
        return Slope(t1, t2, s, c, m, *self._path._replace(c=c, m=m).rates(t1, t2))

    def _first_length(self, at: Slope) -> float:
        path = self._path
        pace = at.c * (abs(path.b1) + abs(path.b2)) + at.m * (path.A11 + path.A22)
        return 0.3 * min(1.0, at.s) / pace if pace > 0 else 1.0

    def _longest(self, y: Point, at: Slope, length: float) -> float:
        """At most ``length``, not to the stop of slip, and hardly beyond the end of the phase."""
        if at.g < 0:
            length = min(length, LONGEST * at.s / -at.g)
        if y.p_c == 0:
            return min(length, BEYOND * -y.u / at.r) if at.r > 0 else length
        missing = self._path.missing(y.p_c, y.W_c, y.p, y.W) / at.c
        return min(length, BEYOND * self._path.distance(missing, y.u, at.r))

    def _left(self, y: Point) -> float:
        """How much of the phase is left: of normal velocity, or of what restitution has to give back."""
        return -y.u if y.p_c == 0 else self._path.missing(y.p_c, y.W_c, y.p, y.W)

    def _stays(self, at: Slope) -> bool:
        """Whether slip is where nothing moves it any more."""
        (h1, h2), hold, near = self._h, self._hold, self._path.tolerance * max(at.s, self._room)
        apart = math.hypot(hold * at.t1 - h1, hold * at.t2 - h2) * at.s
        return (
            hold > 0
            and apart <= near * hold
            and (self._friction(max(at.s - near, 0.0)) <= hold <= self._friction(at.s + near))
        )

    def _is_straight(self, at: Slope, h: float) -> bool:
        """Whether what a step turns by is less than counts."""
        w, share = abs(at.w), STRAIGHT * self._path.tolerance
        A_qq, A_tq = self._path.A_along(at.t1, at.t2)
        pull = at.g + at.m * A_qq
        gain = (w + at.m * abs(A_tq)) * h  # of speed, by a turn
        is_small = w <= ROUNDING * pull or w * gain <= share * at.s * pull
        drawn = pull > 0 and is_small and w * at.s <= share * max(at.s, self._room) * pull
        return w * h <= share * at.s or drawn

    def _step(self, y: Point, at: Slope, h: float, *, turns: bool) -> tuple[Point, float]:
        """Where a step leads, and its error in units of what it may be.

        It is infinite if the step leads past the stop of slip, which gives ``y``, or is not as straight as it
        was taken to be.
        """
        slopes: list[tuple[float, ...]] = []

        def total(row: Row, i: int) -> float:
            return h * sum([weight * slopes[j][i] for j, weight in row])

        start, bends = (y.v1, y.v2, y.u), False
        for row in ((), *STAGES):
            v1, v2, u = (x + total(row, i) for i, x in enumerate(start)) if row else start
            if not at.t1 * v1 + at.t2 * v2 > 0:
                return y, math.inf
            here = self._slope(v1, v2) if row else at
            bends = bends or not (turns or self._is_straight(here, h))
            t1, t2, s, c, m, g, w, r = here
            w = w if turns else 0.0
            slopes.append((g * t1 - w * t2, g * t2 + w * t1, r, c, c * u, -m * t1, -m * t2, m * s))
        rises = [total(WEIGHTS, i) for i in range(8)]
        to = Point._make([*(x + rise for x, rise in zip(y[:8], rises, strict=True)), y.p_c, y.W_c])
        if not at.t1 * to.v1 + at.t2 * to.v2 > 0:
            return y, math.inf
        size = max(min(at.s, math.hypot(to.v1, to.v2)), self._room)
        fifth = [total(ERROR_5, i) for i in range(3)]
        third = [rises[i] - total(ORDER_3, i) for i in range(3)]
        pace = max(1.0, abs(to.u))  # which is greater than 1 once friction jams
        e5, e3 = (math.hypot(e[0], e[1]) / size + abs(e[2]) / pace for e in (fifth, third))
        error = e5 * e5 / math.hypot(e5, 0.1 * e3) if e5 > 0 else e5
        return to, math.inf if bends else error / (STEP_SHARE * self._path.tolerance)

    def _cut(self, y: Point, at: Slope, h: float, to: Point, *, turns: bool) -> Point:
        """Where the phase ends, on the step that leads across its end."""
        low, left_low, high, left_high = 0.0, self._left(y), h, self._left(to)
        goal = 1.0 if y.p_c == 0 else self._path.missing(y.p_c, y.W_c, 0.0, 0.0)
        for _ in range(CUTS):
            if abs(self._left(to)) <= ROUNDING * goal:
                break
            h = low + (high - low) * left_low / (left_low - left_high)
            if not low < h < high:
                break
            trial, _ = self._step(y, at, h, turns=turns)
            left = self._left(trial)
            if left <= ROUNDING * goal:
                to = trial
            if left > 0:
                low, left_low, left_high = h, left, left_high / 2
            else:
                high, left_high, left_low = h, left, left_low / 2
        return to

    def _held(self, y: Point, regime: Regime) -> tuple[Point, Regime] | None:
        """The end of the path where slip stays as it is."""
        path = self._path
        rate = 1 - (path.b1 * self._h[0] + path.b2 * self._h[1])
        if not rate > 0:
            return None
        if y.p_c == 0:
            y = _turned_over(self._on(y, -y.u / rate, rate))
        return self._on(y, path.distance(path.missing(y.p_c, y.W_c, y.p, y.W), y.u, rate), rate), regime

    def _on(self, y: Point, p: float, rate: float) -> Point:
        """On by ``p``, where slip stays as it is."""
        h1, h2 = self._h
        return y._replace(
            u=y.u + rate * p,
            p=y.p + p,
            W=y.W + (y.u + rate * p / 2) * p,
            P1=y.P1 - h1 * p,
            P2=y.P2 - h2 * p,
            heat=y.heat + self._hold * math.hypot(y.v1, y.v2) * p,
        )


def _turned_over(y: Point) -> Point:
    """The end of compression as the begin of restitution."""
    return y._replace(u=0.0, p=0.0, W=0.0, p_c=y.p, W_c=y.W)


def _regime(y: Point, first: tuple[float, float], *, jams: bool) -> Regime:
    """What friction did, where slip is left."""
    if jams:
        return Regime.JAMMED
    return Regime.REVERSED if first[0] * y.v1 + first[1] * y.v2 < 0 else Regime.SLIDING
