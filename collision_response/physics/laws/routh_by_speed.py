"""Routh's path of the impulse for friction that depends on the slip speed: ``mu(s)``, any function.

Letters, units and the two ends of the path are those of ``routh.py``:

    dp = c dx    dP_t = -m t dx    du_t/dx = f = c b - m A t    du_n/dx = r = c - m b.t

Here ``c = 1 / (1 + mu)`` and ``m = mu c`` vary with the slip speed ``s = |u_t|`` along the path. So slip may
turn in both phases and stop more than once. The slip ``v = u_t`` obeys an equation of its own, ``dv/dx =
f(v)``. The method of ``dormand_prince.py`` integrates it, and everything else along with it.

**Steps.** ``f`` is smooth except where slip stops and where ``mu`` is not smooth. No step goes farther than
``LONGEST`` of the way to the stop, so steps shrink with the slip; nor changes the speed so much that it could
jump over a peak of ``mu``. Slip counts as stopped when it is below ``l2`` times the tolerance, with the least
eigenvalue ``l2`` of ``A``: the impulse that stops it, ``A^-1 v``, is then below the tolerance.

**Straight steps.** Slip near a direction to which it is drawn would need steps as short as the time in which
it gets there, however long it stays. So a step keeps the direction of slip if its turn is negligible. Either
the turn is small, ``|w| dx`` against ``s``. Or slip is drawn back at the rate ``pull / s`` with
``pull = g + m A_qq``, and so turns by ``|w| / pull`` at most. Then both ``s |w| / pull`` and the effect of
the turn on ``g dx`` must be negligible; the latter compared with the slip, however small, since slip may grow
in one direction and stop in another. A turn below the rounding of a step is none. Planar slip takes straight
steps only.

**Slip stops.** ``h = A^-1 b`` would hold the contact. It sticks if ``|h| <= mu(0)``, and then to the end, as
the forces keep their ratio. Otherwise it first slips on along the ray of ``mu(0)`` (see ``routh.py``). If
friction jumps at 0, from static to kinetic, slip soon follows the ray of the friction next to 0 instead, as
slip that grows from rest is drawn to it.

**Slip stays** where friction rises through ``|h|`` as the speed grows: at ``v = s h / |h|``, ``f`` is 0, and
slip is drawn there. So if ``mu(0)`` is 0 the contact never sticks, but creeps; and slip that has the
direction of ``h`` may stay at a speed at which friction jumps upwards. Once slip is so near that the
difference is negligible, it stays.

**Energy.** Friction opposes slip whatever its size, so energy does not grow at Stronge's end. At Poisson's it
may: where friction is great in compression and drops as slip grows, ``p_c`` is great, and ``u_n`` rises fast
in restitution. So with Poisson, restitution ends no later than where it has returned the energy that
compression and friction took:

    W_c + W = heat

**The ends of the phases.** A step that leads across the end of a phase is shortened by the secant method
until it ends there.

**Error.** A function that can only be evaluated gives no bound. So the path is computed a second time, with a
tolerance ``COARSER`` times as great, with data and friction that differ in the last digits, and with a tie of
stick and slip decided the other way. The difference of the two impulses is the estimated error.

Sources: those of ``routh.py``, Keller's equation in particular; for slip that stays at a jump, Filippov,
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
from .dormand_prince import ERROR_5, ORDER_3, STAGES, WEIGHTS, Row, row_sum, step_error, step_factor
from .law import Coefficients, Law, Outcome, Regime
from .routh import DEFAULT_TOLERANCE, GREATEST_FRICTION, LEAST_RESTITUTION, LEAST_TOLERANCE, PATH_SHARE
from .routh_path import LONGEST, Path
from .routh_straight import Ray, ray_from_rest

FINEST = LEAST_TOLERANCE / PATH_SHARE
"""The least tolerance of a model that makes a difference."""

COARSEST = 1e-9
"""The coarsest tolerance of the path: a coarser one is hardly faster, and may miss features of ``mu``."""

COARSER = 10.0
"""Factor of the tolerance of the second path."""

PERTURBATION = 2.0**-50
"""Relative change of the data of the second path, times the index of each number."""

TIE = 2.0**-45
"""Relative change of the friction of the second path: more than ``PERTURBATION`` can move a tie."""

STEPS = 4000
"""Steps at most."""

ROUNDING = 2.0**-50
"""Relative rounding of a step."""

STEP_SHARE = 1 / 16
"""The part of the tolerance of the path that the estimated error of a step may use."""

LEAST_SHARE = 1e-3
"""Greatest error of a step in units of the slip, however small: its direction decides whether it grows."""

SPEED_SHARE = 1 / 2
SPEED_ORDER = 0.1
"""No step changes the speed of slip by more than ``SPEED_SHARE * tolerance**SPEED_ORDER`` of it. Friction may
have a narrow peak that holds the slip: longer steps, which constant friction would allow, jump over it."""

SLOWEST = 1 / 64
"""Slip below this part of the approach speed may change by more than that part of its speed."""

STRAIGHT = 1 / 16
"""The part of the tolerance of the path that a straight step may neglect."""

CUTS = 60
"""Secant steps at most."""

BEYOND = 1.01
"""Factor by which a step goes beyond the expected end of a phase, so that it leads across."""


class Point(NamedTuple):
    """A point of the path. A phase is compression or restitution.

    Attributes:
        v1, v2: slip.
        u: normal velocity.
        p, W: normal impulse and its work since the phase began.
        P1, P2: tangential impulse.
        heat: work done against friction.
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
    """Direction and speed of the slip at a point, and the rates of change there: letters of ``routh.py``."""

    t1: float
    t2: float
    s: float
    c: float
    m: float
    g: float
    w: float
    r: float


def path_tolerance(tolerance: Scalar) -> float:
    """The tolerance of the path for the tolerance of a model."""
    return max(LEAST_TOLERANCE, min(PATH_SHARE * tolerance, COARSEST)) if tolerance else DEFAULT_TOLERANCE


def routh_by_speed(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse by Routh's path; ``coefficients.friction`` is a function of the slip speed [m/s]."""
    energetic = coefficients.settings.law != Law.ROUTH_POISSON
    frame = ContactFrame.of(contact)
    speed, no_impulse = -frame.un, contact.n * 0
    if not speed > 0:
        return Outcome(no_impulse, 1.0 * Regime.SEPARATING, 0, 0)
    j = speed / frame.Knn
    unit, *data = _floats(speed, *frame.scaled_K(), frame.u1 / speed, frame.u2 / speed)
    e = float(coefficients.restitution)
    e = 0.0 if e < LEAST_RESTITUTION else e
    tolerance = path_tolerance(coefficients.settings.tolerance)

    def follow(data: list[float], factor: float, tolerance: float) -> tuple[Point, Regime] | None:
        *K, v1, v2 = data
        path = Path._make([*K, math.nan, math.nan, e, energetic, tolerance])
        if not path.A11 * path.A22 > path.A12 * path.A12:  # as it must be, but for rounding
            raise _too_far_apart()
        return PathFollower(path, lambda s: factor * coefficients.friction(s * unit)).follow(v1, v2)

    def impulse(P1: Fraction, P2: Fraction, p: Fraction) -> Vec3:
        return frame.to_world(Tangential(P1 * j, P2 * j), p * j)

    result = follow(data, 1.0, tolerance)
    sticks = result is not None and result[1] is Regime.STICKING
    perturbed = [x * (1 + i * PERTURBATION) for i, x in enumerate(data)]
    other = result and follow(perturbed, 1 - TIE if sticks else 1 + TIE, COARSER * tolerance)
    if result is None or other is None:
        return Outcome(no_impulse, 1.0 * Regime.SLIDING, 0, 0, unfinished=True)
    end, regime = result
    ends = [[Fraction(x) for x in (y.P1, y.P2, y.p_c + y.p)] for y in (end, other[0])]
    lost = (1 - e) * (1 + e) * -end.W_c if energetic else -(end.W_c + end.W)
    lost = max(lost, -end.heat)  # less only by rounding
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
        raise _too_far_apart() from None


def _too_far_apart() -> ImpactError:
    reason = "slip, approach speed and inverse effective mass differ too much in size for float64"
    return ImpactError(StatusCode.OUT_OF_RANGE, "contact", reason)


class PathFollower:
    """Follows the path from a first slip to its end.

    Args:
        path: the constants of the path; ``c`` and ``m`` vary and are not used.
        mu: friction as a function of the slip speed, in units of the approach speed.
    """

    def __init__(self, path: Path, mu: Callable[[float], float]) -> None:
        self._path, self._mu = path, mu
        self._by_energy = path._replace(energetic=True)
        self._h = path.solve(path.b1, path.b2)
        self._h_size = math.hypot(*self._h)
        self._l2 = path.least_eigenvalue()
        self._least_slip = path.tolerance * self._l2
        self._speed_share = SPEED_SHARE * path.tolerance**SPEED_ORDER

    def follow(self, v1: float, v2: float) -> tuple[Point, Regime] | None:
        """The end of the path for a first slip, and the regime; ``None`` if it does not end."""
        y, jams, length = Point(v1, v2), False, 0.0
        first = (v1, v2) if math.hypot(v1, v2) > self._least_slip else (0.0, 0.0)
        for _ in range(STEPS):
            if y.v1 == y.v2 == 0:
                ray = ray_from_rest(self._path, max(self._friction(0.0), self._friction(self._least_slip)))
                start, length = self._leave_rest(y, ray), 0.0
                if start.v1 == start.v2 == 0:  # it sticks, or slip remains negligible
                    return self._end_without_change(y, Regime.JAMMED if jams else Regime.STICKING)
                y = start
                first = first if any(first) else (y.v1, y.v2)
            if self._remaining(y) <= 0:  # a stop, and the way on from rest, may lead past the end of a phase
                y = _begin_restitution(y) if y.p_c == 0 else y
                if self._remaining(y) <= 0:
                    return y, _regime(y, first, jams=jams)
            at = self._slope(y.v1, y.v2)
            if at.g < 0 and at.s <= self._least_slip:
                y = self._stop(y)
                continue
            if self._stays(at):
                return self._end_without_change(y, _regime(y, first, jams=jams))
            length = length or self._first_length(at)
            h = self._longest(y, at, length)
            turns = not self._is_straight(at, h)
            to, ratio = self._step(y, at, h, turns=turns)
            if not turns and not ratio < math.inf:
                turns = True
                to, ratio = self._step(y, at, h, turns=True)
            next_length = h * step_factor(ratio, 1.0)
            if not ratio <= 1:
                length = next_length
                continue
            length = max(length, next_length)
            jams = jams or at.r * h < -self._path.tolerance
            y = to if self._remaining(to) > 0 else self._end_of_phase(y, at, h, to, turns=turns)
        return None

    def _friction(self, s: float) -> float:
        return min(self._mu(s), GREATEST_FRICTION)

    def _stop(self, y: Point) -> Point:
        """The point after the impulse that stops a negligible slip."""
        path, (P1, P2) = self._path, self._path.solve(y.v1, y.v2)
        u = y.u - path.b1 * P1 - path.b2 * P2
        return y._replace(v1=0.0, v2=0.0, u=u, P1=y.P1 - P1, P2=y.P2 - P2)

    def _leave_rest(self, y: Point, ray: Ray) -> Point:
        """The point on the ray from rest at which slip is no longer negligible."""
        p = self._least_slip / max(1.0, ray.G)
        return Point(
            ray.G * p * ray.z1,
            ray.G * p * ray.z2,
            y.u + ray.rate * p,
            y.p + p,
            y.W + (y.u + ray.rate * p / 2) * p,
            y.P1 - ray.kz1 * p,
            y.P2 - ray.kz2 * p,
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
        pace = self._pace(at)
        return 0.3 * min(1.0, at.s) / pace if pace > 0 else 1.0

    def _pace(self, at: Slope) -> float:
        """A bound on ``|f|``. The turn ``w`` is known to this times the rounding."""
        path = self._path
        return at.c * (abs(path.b1) + abs(path.b2)) + at.m * (path.A11 + path.A22)

    def _longest(self, y: Point, at: Slope, length: float) -> float:
        """``length``, limited to before the stop of slip and just beyond the end of the phase."""
        if at.g < 0:
            length = min(length, LONGEST * at.s / -at.g)
        if at.g != 0:
            length = min(length, self._speed_share * max(at.s, SLOWEST) / abs(at.g))
        if y.p_c == 0:
            return min(length, BEYOND * -y.u / at.r) if at.r > 0 else length
        return min(length, BEYOND * self._distance(y, at.c, at.m / at.c * at.s, at.r))

    def _remaining(self, y: Point) -> float:
        """What the phase lacks: normal velocity, or what restitution has yet to return; <= 0 at the end."""
        if y.p_c == 0:
            return -y.u
        missing = self._path.missing(y.p_c, y.W_c, y.p, y.W)
        return missing if self._path.energetic else min(missing, _not_returned(y))

    def _distance(self, y: Point, c: float, heating: float, rate: float) -> float:
        """Impulse, in units of ``c``, up to the end of restitution, while ``u_n`` grows at ``rate``.

        ``heating`` is the work done against friction, by normal impulse.
        """
        path = self._path
        missing = path.distance(path.missing(y.p_c, y.W_c, y.p, y.W) / c, y.u, rate)
        if path.energetic:
            return missing
        return min(missing, self._by_energy.distance(_not_returned(y) / c, y.u - heating, rate))

    def _stays(self, at: Slope) -> bool:
        """Whether slip is where ``f`` is 0 and to which it is drawn: see "Slip stays" above."""
        (h1, h2), h_size, near = self._h, self._h_size, self._path.tolerance * max(at.s, self._l2)
        apart = math.hypot(h_size * at.t1 - h1, h_size * at.t2 - h2) * at.s
        return (
            h_size > 0
            and apart <= near * h_size
            and (self._friction(max(at.s - near, 0.0)) <= h_size <= self._friction(at.s + near))
        )

    def _is_straight(self, at: Slope, h: float) -> bool:
        """Whether the turn of a step is negligible: see "Straight steps" above."""
        w, share, pace = abs(at.w), STRAIGHT * self._path.tolerance, self._pace(at)
        A_qq, A_tq = self._path.A_along(at.t1, at.t2)
        pull = at.g + at.m * A_qq
        gain = (w + at.m * abs(A_tq)) * h  # of the speed, by a turn
        rounding = ROUNDING * pace * max(1.0, h * pace / at.s)  # a stage adds up slips of h * pace
        is_small = w <= rounding or w * gain <= share * at.s * pull
        drawn = pull > 0 and is_small and w * at.s <= share * max(at.s, self._l2) * pull
        return w * h <= share * at.s or drawn

    def _step(self, y: Point, at: Slope, h: float, *, turns: bool) -> tuple[Point, float]:
        """The point after a step, and the error of the step in units of the allowed one.

        The error is infinite if the step leads past the stop of slip, and the point is then ``y``; or if a
        step without ``turns`` is not straight throughout.
        """
        slopes: list[tuple[float, ...]] = []

        def total(row: Row, i: int) -> float:
            return h * row_sum(row, slopes, i)

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
        least, allowed = min(at.s, math.hypot(to.v1, to.v2)), STEP_SHARE * self._path.tolerance
        size = min(max(least, self._l2), LEAST_SHARE * least / allowed)
        fifth = [total(ERROR_5, i) for i in range(3)]
        third = [rises[i] - total(ORDER_3, i) for i in range(3)]
        pace = max(1.0, abs(to.u))  # u exceeds 1 if friction jams
        e5, e3 = (math.hypot(e[0], e[1]) / size + abs(e[2]) / pace for e in (fifth, third))
        error = step_error(e5, e3) / allowed
        return to, error if error >= 0 and not bends else math.inf  # NaN is infinite, too

    def _end_of_phase(self, y: Point, at: Slope, h: float, to: Point, *, turns: bool) -> Point:
        """The point at which the phase ends, within a step of length ``h`` that leads across to ``to``.

        The end of compression is the beginning of restitution.
        """
        low, remaining_low, high, remaining_high = 0.0, self._remaining(y), h, self._remaining(to)
        goal = 1.0 if y.p_c == 0 else self._path.missing(y.p_c, y.W_c, 0.0, 0.0)
        for _ in range(CUTS):
            if abs(self._remaining(to)) <= ROUNDING * goal:
                break
            h = low + (high - low) * remaining_low / (remaining_low - remaining_high)
            if not low < h < high:
                break
            trial, _ = self._step(y, at, h, turns=turns)
            remaining = self._remaining(trial)
            if remaining <= ROUNDING * goal:
                to = trial
            if remaining > 0:
                low, remaining_low, remaining_high = h, remaining, remaining_high / 2
            else:
                high, remaining_high, remaining_low = h, remaining, remaining_low / 2
        return _begin_restitution(to) if y.p_c == 0 else to

    def _end_without_change(self, y: Point, regime: Regime) -> tuple[Point, Regime] | None:
        """The end of the path if slip stays as it is, and the regime; ``None`` if ``u_n`` never rises."""
        path = self._path
        rate = 1 - (path.b1 * self._h[0] + path.b2 * self._h[1])
        if not rate > 0:
            return None
        if y.p_c == 0:
            y = _begin_restitution(self._advance(y, -y.u / rate, rate))
        return self._advance(y, self._distance(y, 1.0, self._heating(y), rate), rate), regime

    def _advance(self, y: Point, p: float, rate: float) -> Point:
        """The point after the normal impulse ``p`` while slip stays as it is."""
        h1, h2 = self._h
        return y._replace(
            u=y.u + rate * p,
            p=y.p + p,
            W=y.W + (y.u + rate * p / 2) * p,
            P1=y.P1 - h1 * p,
            P2=y.P2 - h2 * p,
            heat=y.heat + self._heating(y) * p,
        )

    def _heating(self, y: Point) -> float:
        """The work done against friction, by normal impulse, while slip stays as it is."""
        return self._h_size * math.hypot(y.v1, y.v2)


def _not_returned(y: Point) -> float:
    """The energy that compression and friction have taken, and restitution has not returned."""
    return y.heat - y.W_c - y.W


def _begin_restitution(y: Point) -> Point:
    """The point at the end of compression as the beginning of restitution."""
    return y._replace(u=0.0, p=0.0, W=0.0, p_c=y.p, W_c=y.W)


def _regime(y: Point, first: tuple[float, float], *, jams: bool) -> Regime:
    """The regime of a path that ends with slip."""
    if jams:
        return Regime.JAMMED
    return Regime.REVERSED if first[0] * y.v1 + first[1] * y.v2 < 0 else Regime.SLIDING
