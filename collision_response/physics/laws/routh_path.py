"""Integrate Routh's path while slip turns, in the letters and units of ``routh.py``.

:func:`turn` repeats :func:`step` as long as slip turns. A step is one of the method of
``dormand_prince.py``, or reduces the step that is tried next; then :func:`look_ahead` finds whether the rest
of the path is straight to the tolerance, and how far the end of the phase is. The variable of a step is
``eta``, with

    dT = d eta / (1 + g_0 eta)        g_0 = g at the beginning of the step

in which slip on a straight path is linear: ``s = s_0 (1 + g_0 eta)``, and ``x = s_0 eta``.

A phase ends where a number, ``u_n`` or the work, reaches a limit. If friction jams, the number may reach it
and fall back within one step. So where it rises and then falls, the step ends at its crest, unless the crest
surely stays below. A step that passes the limit is repeated up to it, unless the way back is straight: what
lies beyond tells nothing.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from ...numbers.operations import (
    Condition,
    Scalar,
    add_up,
    certain,
    choose,
    fixed,
    iterate,
    maximum,
    minimum,
    negation,
    positive_part,
    square_root,
    values,
)
from .dormand_prince import ERROR_5, ORDER_3, STAGES, TOO_LONG, WEIGHTS, row_sum, step_error, step_factor
from .hermite import Cubic

Pair: TypeAlias = tuple[Scalar, Scalar]

STEP_SHARE = 1 / 2
"""The part of the tolerance of the path that each step may use."""

CAUTION = 1 / 5
"""Factor of the error estimate, which is 20 to 80 times the true error where slip dies away."""

DECAY = 5e-5
"""Error of a step, in units of ``z^5`` times its difference from order 3, for slip that decays by
``exp(-z)``. It is 1.4e-5 where nothing else happens, and more where slip turns, too. Unlike the estimate,
this does not vanish for some ``z``."""

STEP_ROUNDING = 4e-15
"""Relative rounding error of a step."""

CREST_SHARE = 1 / 100
"""The part of the tolerance of the path by which a crest of ``u_n`` may be uncertain."""

SHORTER = 1 - 2.0**-20
"""The part to which a step that passes the end of a phase is reduced, at most."""

LONGEST = 0.95
"""The longest step, in units of the step at whose end slip would stop."""

CONVERGED = 2.0**-40
"""Relative size up to which the rate of a turn is not reduced further."""

STEPS = 1000
"""Steps at most."""

NEVER = 1e150
"""Stands for infinity."""


class ToEnd(NamedTuple):
    """A number that is negative until a phase ends, and its first two derivatives by ``x``."""

    value: Scalar
    slope: Scalar
    bend: Scalar


class Crest(NamedTuple):
    """The greatest value of a number that rises from below 0 and then falls within a step.

    Attributes:
        exists: whether the number does so, or hardly rises for a while.
        at: the part of the step up to the crest.
        height: the value there.
        error: how uncertain it is.
    """

    exists: Condition
    at: Scalar
    height: Scalar
    error: Scalar

    @classmethod
    def of(cls, cubic: Cubic, first: ToEnd, last: ToEnd) -> Crest:
        """The crest of the cubic between both ends of a step.

        It is corrected by the polynomial of degree 5 with the same second derivatives, too. What they may add
        counts as its error.
        """
        flattens, flattest = cubic.flattest()
        x = choose(flattens, lambda: minimum(cubic.crest(), flattest), cubic.crest)
        rest, dx = 1 - x, cubic.h
        by_first = (first.bend * dx - cubic.b) * dx * rest / 2
        by_last = (last.bend * dx - cubic.b - 2 * cubic.a) * dx * x / 2
        inside = x * x * rest * rest
        falls = (last.value < 0) & (last.slope < 0)
        return cls(
            exists=(first.value < 0) & (first.slope > 0) & (falls | flattens),
            at=x,
            height=cubic.at(x) + inside * (by_first + by_last),
            error=inside * (abs(by_first) + abs(by_last)),
        )

    def below_zero(self) -> Scalar:
        """How far below 0 it is, at least."""
        return -self.height - self.error

    def is_missed(self, fine: Scalar) -> Condition:
        """Whether the crest may be above 0 by more than ``fine``."""
        return self.exists & (self.below_zero() < 0) & ((self.height > fine) | (self.error > fine))


class Path(NamedTuple):
    """The constants of a path, in the letters of ``routh.py``.

    Attributes:
        A11, A12, A22, b1, b2: the tangential and the mixed part of ``K``.
        c, m: ``1 / (1 + mu)`` and ``mu / (1 + mu)``.
        e: restitution.
        energetic: whether restitution is of energy (Stronge), not of impulse (Poisson).
        tolerance: relative, of the path.
    """

    A11: Scalar
    A12: Scalar
    A22: Scalar
    b1: Scalar
    b2: Scalar
    c: Scalar
    m: Scalar
    e: Scalar
    energetic: Condition
    tolerance: Scalar

    def rates(self, t1: Scalar, t2: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """``g``, ``w`` and ``r`` for slip along ``t``."""
        m = self.m
        f1 = self.c * self.b1 - m * (self.A11 * t1 + self.A12 * t2)
        f2 = self.c * self.b2 - m * (self.A12 * t1 + self.A22 * t2)
        return t1 * f1 + t2 * f2, t1 * f2 - t2 * f1, self.c - m * (self.b1 * t1 + self.b2 * t2)

    def bend_of_u_n(self, t1: Scalar, t2: Scalar, s: Scalar, w: Scalar) -> Scalar:
        """The second derivative of ``u_n`` by ``x``, for slip ``s t`` that turns at the rate ``w``."""
        turn = choose(s > 0, lambda: w / s, lambda: 0 * w)  # of t, by x
        return -self.m * (self.b2 * t1 - self.b1 * t2) * turn

    def fastest_rate(self) -> Scalar:
        """An upper bound of the rates at which slip changes, relative to itself."""
        return self.c * (abs(self.b1) + abs(self.b2)) + self.m * (self.A11 + self.A22)

    def solve(self, v1: Scalar, v2: Scalar) -> tuple[Scalar, Scalar]:
        """``A^-1 v``: the tangential impulse that changes slip by ``v``."""
        det = self.A11 * self.A22 - self.A12 * self.A12
        return (self.A22 * v1 - self.A12 * v2) / det, (self.A11 * v2 - self.A12 * v1) / det

    def A_along(self, t1: Scalar, t2: Scalar) -> tuple[Scalar, Scalar]:
        """``A_qq`` and ``A_tq``, with ``q`` perpendicular to ``t``."""
        A_qq = self.A11 * t2 * t2 - 2 * self.A12 * t1 * t2 + self.A22 * t1 * t1
        return A_qq, self.A12 * (t1 * t1 - t2 * t2) + (self.A22 - self.A11) * t1 * t2

    def least_eigenvalue(self) -> Scalar:
        """A lower bound of the least eigenvalue of ``A``: ``det(A) / tr(A)``."""
        return (self.A11 * self.A22 - self.A12 * self.A12) / (self.A11 + self.A22)

    def missing(self, p_c: Scalar, W_c: Scalar, p: Scalar, W: Scalar) -> Scalar:
        """What restitution has yet to return after ``p`` and ``W``: impulse (Poisson) or work (Stronge)."""
        return choose(self.energetic, lambda: -self.e * self.e * W_c - W, lambda: self.e * p_c - p)

    def to_end_of_phase(self, y: TurningSlip) -> ToEnd:
        """What is missing to the end of a phase: ``u_n`` in compression, work over ``c`` in restitution.

        The impulse that restitution by Poisson misses cannot grow again.
        """
        _, w, r = self.rates(y.t1, y.t2)
        work = -self.missing(y.p_c, y.W_c, 0 * y.W, y.W) / self.c
        return choose(
            y.p_c <= 0,
            lambda: ToEnd(y.u_n, r, self.bend_of_u_n(y.t1, y.t2, y.s, w)),
            lambda: ToEnd(work, choose(self.energetic, lambda: y.u_n, lambda: 1 + 0 * y.u_n), r),
        )

    def distance(self, missing: Scalar, u_n: Scalar, rate: Scalar) -> Scalar:
        """Impulse over which a straight path returns ``missing``, while ``u_n`` grows at ``rate``."""

        def by_work() -> Scalar:  # the root of u_n x + rate x^2 / 2 = missing
            square = u_n * u_n + 2 * rate * missing
            both = u_n + square_root(choose(square > 0, lambda: square, lambda: 0 * square))
            exists = (square >= 0) & (both > 0)
            x = choose(exists, lambda: 2 * missing / both, lambda: NEVER + 0 * rate)
            return choose(fixed(self.e) == 0, lambda: 0 * missing, lambda: x)

        return choose(self.energetic, by_work, lambda: missing)


class TurningSlip(NamedTuple):
    """The state of the path while slip turns. A phase is compression or restitution.

    Attributes:
        t1, t2, s: direction and speed of the slip.
        u_n: normal velocity.
        x, W: impulse ``x`` and normal work since the phase began.
        P1, P2: tangential impulse.
        heat: work done against friction.
        p_c, W_c: normal impulse and work of compression; 0 until it is over.
        h: length of the next step, in ``eta``.
        h_end: length of the step to the end of the phase.
        excess_turn: by how much slip turns more than a straight path may; the loop ends when it is <= 0.
        slip_error: error of the slip so far.
        impulse_error: error of the impulses so far, except that caused by ``slip_error``.
        least_s, least_r: the least ``s`` and ``r`` so far.
        slope: of ``u_n`` where compression ended.
        crest, crest_of_work: how far the crests that decide when a phase ends are from its end, at least:
            those of ``u_n`` in compression, and those of the work over ``c`` in restitution.
    """

    t1: Scalar
    t2: Scalar
    s: Scalar
    u_n: Scalar
    x: Scalar
    W: Scalar
    P1: Scalar
    P2: Scalar
    heat: Scalar
    p_c: Scalar
    W_c: Scalar
    h: Scalar
    h_end: Scalar
    excess_turn: Scalar
    slip_error: Scalar
    impulse_error: Scalar
    least_s: Scalar
    least_r: Scalar
    slope: Scalar
    crest: Scalar
    crest_of_work: Scalar


def turn(path: Path, t1: Scalar, t2: Scalar, s: Scalar, u_n: Scalar) -> TurningSlip:
    """Follow the path, in values, until slip turns no more.

    Args:
        path: the constants of the path.
        t1, t2, s: direction and speed of the first slip.
        u_n: normal velocity before the impact.
    """
    o = 0 * path.A11
    h = 0.3 / (path.fastest_rate() + 1e-300)
    start = TurningSlip(
        t1, t2, s, u_n, x=o, W=o, P1=o, P2=o, heat=o, p_c=o, W_c=o, h=h, h_end=o, excess_turn=o,
        slip_error=o, impulse_error=o, least_s=s, least_r=1 + o, slope=o, crest=1 + o,
        crest_of_work=NEVER + o,
    )  # fmt: skip
    exact = path._replace(c=certain(path.c), m=certain(path.m))
    y = look_ahead(exact, values(start))
    return iterate(y, lambda y: y.excess_turn > 0, lambda y: step(exact, y), STEPS, rounded=True)


def look_ahead(path: Path, y: TurningSlip) -> TurningSlip:
    """The state with ``h_end``, ``excess_turn`` and the extremes brought up to date.

    If slip is near a direction that it keeps and is drawn to, it is put there.
    """
    g, w, r = path.rates(y.t1, y.t2)
    c, m, s, u_n = path.c, path.m, y.s, y.u_n
    never, compressing = NEVER + 0 * r, y.p_c <= 0
    r_slope = path.bend_of_u_n(y.t1, y.t2, s, w)

    def x_to_rest() -> Scalar:  # the root of u_n + r x + r_slope x^2 / 2 = 0
        square = r * r - 2 * r_slope * u_n
        both = r + square_root(positive_part(square))
        return choose((square >= 0) & (both > 0), lambda: -2 * u_n / both, lambda: never)

    def x_to_goal() -> Scalar:
        x = path.distance(path.missing(y.p_c, y.W_c, c * y.x, y.W) / c, u_n, r)

        def by_work() -> Scalar:
            u_end = u_n + x * (r + x * r_slope / 2)
            corrected = choose(u_end > 0, lambda: x - r_slope * x * x * x / (6 * u_end), lambda: x)
            falls = (r < 0) & (u_n > 0)
            to_crest = choose(falls, lambda: maximum(-u_n / r, 0.1 * y.h * s), lambda: never)  # of W
            return choose(x < NEVER, lambda: corrected, lambda: to_crest)

        return choose(path.energetic, by_work, lambda: x)

    def x_to_end_of_impact() -> Scalar:
        rest = -u_n / r
        missing = path.missing(c * (y.x + rest), y.W + c * u_n * rest / 2, 0 * rest, 0 * rest)
        return abs(rest) + abs(path.distance(missing / c, 0 * rest, r))

    x = choose(compressing, x_to_rest, x_to_goal)
    h_end = choose((s > 0) & (s + g * x > 0), lambda: x / s, lambda: never)
    far = choose(compressing, lambda: choose(r > 0, x_to_end_of_impact, lambda: never), lambda: abs(x))
    far = choose((s + g * far > 0) | (g >= 0), lambda: far, lambda: s / -g)
    allowed = path.tolerance / 4 * maximum(s, m * path.least_eigenvalue())
    y = y._replace(
        h_end=h_end,
        excess_turn=m * abs(w) * far - allowed,
        least_r=minimum(y.least_r, r),
        least_s=minimum(y.least_s, s),
    )
    return _keep_direction(path, y, g, w, far, allowed)


def _keep_direction(
    path: Path, y: TurningSlip, g: Scalar, w: Scalar, far: Scalar, allowed: Scalar
) -> TurningSlip:
    """The state with slip in the direction that it keeps, if it is near that and drawn to it.

    Where ``w = 0``, ``t`` is kept. A small turn ``a`` away from there is drawn back at the rate ``pull / s``
    if ``pull > 0``. If slip is so slow that it is there at once, Newton's method finds the direction: each of
    its steps is followed by a step of the path of length 0, which looks ahead again. The path alone could
    take steps without end, where friction is just below what holds the contact and slip hardly grows.

    Args:
        path: the constants of the path.
        y: the state, with ``excess_turn``.
        g, w: rates of the slip.
        far: impulse until slip stops or the impact ends.
        allowed: what ``m |w| far`` may be on a straight path.
    """
    m, s = path.m, y.s
    q1, q2 = -y.t2, y.t1
    pull = g + m * (path.A11 * q1 * q1 + 2 * path.A12 * q1 * q2 + path.A22 * q2 * q2)
    remainder = m * (path.A11 + path.A22) * w * w * far  # over pull^2: the excess turn after it is put there
    is_drawn = (pull > 0) & (m * abs(w) * s <= allowed * pull) & (y.excess_turn > 0)
    bend = path.c * (abs(path.b1) + abs(path.b2)) + 4 * m * (path.A11 + path.A22)  # w'' is at most this
    is_there = abs(w) <= CONVERGED * bend
    converges = 4 * bend * abs(w) <= pull * pull
    stays = is_there & (m * remainder <= allowed * pull * pull)
    is_near = is_drawn & (stays | negation(is_there) & converges)

    def turned() -> TurningSlip:
        a = w / pull
        unit = 1 / square_root(1 + a * a)
        return y._replace(
            t1=(y.t1 + a * q1) * unit,
            t2=(y.t2 + a * q2) * unit,
            slip_error=y.slip_error + s * (abs(a) + STEP_ROUNDING),
            excess_turn=choose(is_there, lambda: -allowed, lambda: y.excess_turn),
            h_end=choose(is_there, lambda: y.h_end, lambda: 0 * s),
        )

    return choose(is_near, turned, lambda: y)


def step(path: Path, y: TurningSlip) -> TurningSlip:
    """The state after one step; or, if the step is too long, with a smaller ``h``."""
    m, one, (g_0, _, _) = path.m, 1 + 0 * y.s, path.rates(y.t1, y.t2)
    h = choose(abs(y.h_end) < y.h, lambda: y.h_end, lambda: y.h)
    h = choose(g_0 * h < -LONGEST, lambda: -LONGEST / g_0, lambda: h)
    decay = g_0 * h
    slopes = _slopes(path, y, h, decay)
    rises = [row_sum(WEIGHTS, slopes, i) for i in range(9)]
    t1, t2, s, u_n = (v + rise for v, rise in zip((y.t1, y.t2, y.s, y.u_n), rises[:4], strict=True))
    dx, work, P1, P2, heat = rises[4:]

    safe_s = choose(s > 0, lambda: s, lambda: y.s)
    fifth = [row_sum(ERROR_5, slopes, i) for i in (0, 1, 2, 5)]
    third = [rises[i] - row_sum(ORDER_3, slopes, i) for i in (0, 1, 2, 5)]
    u_size = maximum(one, maximum(abs(y.u_n), abs(u_n)))  # u_n exceeds 1 if friction jams
    e5, e3 = (
        abs(t1 * e[1] - t2 * e[0]) + abs(e[2]) / safe_s + path.c * abs(e[3]) / (u_size * u_size)
        for e in (fifth, third)
    )
    z = path.fastest_rate() * abs(h) * (1 + 1 / (1 + decay)) / 2
    err = maximum(CAUTION * step_error(e5, e3), DECAY * (z * z) * (z * z) * z * e3)
    allowed = STEP_SHARE * path.tolerance * maximum(one, m * path.least_eigenvalue() / safe_s)
    ratio = choose((s > 0) & (err < 1e3), lambda: err / minimum(allowed, 1e-3 * one), lambda: TOO_LONG * one)
    next_h = abs(h) * step_factor(ratio, one)
    unit = 0.5 * (3 - t1 * t1 - t2 * t2)  # 1 / |t|, as |t| is nearly 1
    relative_error = err + STEP_ROUNDING
    moved = y._replace(
        t1=t1 * unit, t2=t2 * unit, s=s, u_n=u_n, x=y.x + dx, W=y.W + path.c * work,
        P1=y.P1 - m * P1, P2=y.P2 - m * P2, heat=y.heat + m * heat, h=maximum(next_h, y.h),
        slip_error=y.slip_error + relative_error * maximum(s, y.s),
        impulse_error=y.impulse_error + relative_error * abs(dx),
    )  # fmt: skip
    first, last = path.to_end_of_phase(y), path.to_end_of_phase(moved)
    cubic = Cubic.between(first.value, first.slope, last.value, last.slope, dx)
    crest = Crest.of(cubic, first, last)
    is_too_long, is_missed = negation(ratio <= 1), crest.is_missed(CREST_SHARE * path.tolerance)
    back = choose(last.value > 0, lambda: dx, lambda: 0 * dx)
    is_past = (first.value < 0) & (last.value > 0) & negation(_is_near(path, moved, _x_to_end(last, back)))

    def shorter() -> Scalar:
        up_to = choose(is_missed, lambda: crest.at, lambda: minimum(cubic.crossing(), SHORTER * one))
        return choose(is_too_long, lambda: next_h, lambda: up_to * h)

    after = choose(
        is_too_long | is_missed | is_past, lambda: y._replace(h=shorter()), lambda: _with_crest(moved, crest)
    )
    return look_ahead(path, _restitution_if_near(path, after, back))


def _x_to_end(end: ToEnd, back: Scalar) -> Scalar:
    """The impulse to the end of a phase if the slope stays, which leads back by ``back`` at most."""
    ahead = choose(end.value > 0, lambda: -back, lambda: NEVER + 0 * back)
    return maximum(choose(end.slope > 0, lambda: -end.value / end.slope, lambda: ahead), -back)


def _is_near(path: Path, y: TurningSlip, x: Scalar) -> Condition:
    """Whether the path is straight over an impulse ``x``, which may lead back."""
    g, w, _ = path.rates(y.t1, y.t2)
    change, allowed = (abs(w) + abs(g)) * abs(x), path.tolerance / 20 * y.s  # change: of slip
    return (abs(x) < NEVER) & (change * change <= allowed * y.s) & (change * abs(x) <= allowed)


def _slopes(path: Path, y: TurningSlip, h: Scalar, decay: Scalar) -> list[tuple[Scalar, ...]]:
    """The slopes at the stages of a step, times its length ``h``.

    They are those of ``t1, t2, s, u_n, x, W / c, -P1 / m, -P2 / m`` and ``heat / m``. ``decay`` is ``g_0 h``.
    """
    c, m, b1, b2 = path.c, path.m, path.b1, path.b2
    mh, ch = m * h, c * h
    A11, A12, A22, f1, f2 = mh * path.A11, mh * path.A12, mh * path.A22, ch * b1, ch * b2
    mb1, mb2 = m * b1, m * b2
    slopes: list[tuple[Scalar, ...]] = []
    start = (y.t1, y.t2, y.s, y.u_n)
    for row in ((), *STAGES):
        t1, t2, s, u_n = (v + row_sum(row, slopes, i) for i, v in enumerate(start)) if row else start
        pace = 1 / (1 + decay * add_up(weight for _, weight in row)) if row else 1 + 0 * y.s  # dT / d eta
        h1, h2, hs = f1 - A11 * t1 - A12 * t2, f2 - A12 * t1 - A22 * t2, pace * s
        w, dx = pace * (t1 * h2 - t2 * h1), h * hs
        du = dx * (c - mb1 * t1 - mb2 * t2)
        slopes.append((-w * t2, w * t1, hs * (t1 * h1 + t2 * h2), du, dx, dx * u_n, dx * t1, dx * t2, dx * s))
    return slopes


def _with_crest(y: TurningSlip, crest: Crest) -> TurningSlip:
    """The state after a step with this crest."""

    def least(so_far: Scalar, counts: Condition) -> Scalar:
        return choose(counts, lambda: minimum(so_far, crest.below_zero()), lambda: so_far)

    return y._replace(
        crest=least(y.crest, crest.exists & (y.p_c <= 0)),
        crest_of_work=least(y.crest_of_work, crest.exists & (y.p_c > 0)),
    )


def _restitution_if_near(path: Path, y: TurningSlip, back: Scalar) -> TurningSlip:
    """Begin restitution if the end of compression is so near that the path to it is straight."""
    c, m = path.c, path.m
    g, w, r = path.rates(y.t1, y.t2)
    bend = path.bend_of_u_n(y.t1, y.t2, y.s, w)
    x = _x_to_end(ToEnd(y.u_n, r, bend), back)
    a, change = w * x / y.s, (abs(w) + abs(g)) * abs(x)  # the turn, and how far slip changes

    def begin() -> TurningSlip:
        return y._replace(
            t1=y.t1 - a * y.t2, t2=y.t2 + a * y.t1, s=y.s + g * x, u_n=0 * r, x=0 * x, W=0 * x,
            P1=y.P1 - m * x * y.t1, P2=y.P2 - m * x * y.t2, heat=y.heat + m * x * y.s,
            p_c=c * (y.x + x), W_c=y.W + c * x * y.u_n / 2,
            slip_error=y.slip_error + change * change / y.s,
            impulse_error=y.impulse_error + change * abs(x) / y.s,
            slope=r, crest=minimum(y.crest, r * r / (2 * abs(bend) + 1 / NEVER)),  # before the end, or beyond
        )  # fmt: skip

    return choose((y.p_c <= 0) & _is_near(path, y, x), begin, lambda: y)
