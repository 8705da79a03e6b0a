"""The turning part of Routh's path, in the units and letters of ``routh.py``.

Slip that turns is followed step by step, until the rest of the way is straight to the tolerance: ``outlook``
tells how far that is, ``step`` makes one step, or finds a shorter one to try. The method is that of
``dormand_prince.py``, in a variable in which slip that goes straight to its stop is linear.
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import NamedTuple

from ...numbers.operations import Condition, Scalar, choose, fixed, maximum, minimum, square_root
from .dormand_prince import ERROR_5, ORDER_3, STAGES, WEIGHTS, Row

STEP_SHARE = 1 / 2  # of the path's, that each step may take
CAUTION = 1 / 20  # the method's estimate is 20 to 80 times its error where slip dies away
STEP_ROUNDING = 4e-15  # of one step, relative
LONGEST = 0.95  # step, against that on which slip would stop
STEPS = 1000
NEVER = 1e150


class Path(NamedTuple):
    """What stays the same on the way, in the units and letters of the head of this file."""

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
        """``g``, ``w`` and ``r`` along ``t``."""
        m = self.m
        f1 = self.c * self.b1 - m * (self.A11 * t1 + self.A12 * t2)
        f2 = self.c * self.b2 - m * (self.A12 * t1 + self.A22 * t2)
        return t1 * f1 + t2 * f2, t1 * f2 - t2 * f1, self.c - m * (self.b1 * t1 + self.b2 * t2)

    def held(self, v1: Scalar, v2: Scalar) -> tuple[Scalar, Scalar]:
        """``A^-1 v``: what holds ``v``."""
        det = self.A11 * self.A22 - self.A12 * self.A12
        return (self.A22 * v1 - self.A12 * v2) / det, (self.A11 * v2 - self.A12 * v1) / det

    def across(self, t1: Scalar, t2: Scalar) -> tuple[Scalar, Scalar]:
        """``A_qq`` and ``A_tq``, with ``q`` across ``t``."""
        A_qq = self.A11 * t2 * t2 - 2 * self.A12 * t1 * t2 + self.A22 * t1 * t1
        return A_qq, self.A12 * (t1 * t1 - t2 * t2) + (self.A22 - self.A11) * t1 * t2

    def least_eigenvalue(self) -> Scalar:
        """Of ``A``, from below."""
        return (self.A11 * self.A22 - self.A12 * self.A12) / (self.A11 + self.A22)

    def missing(self, p_c: Scalar, W_c: Scalar, p: Scalar, W: Scalar) -> Scalar:
        """What restitution still has to give back: impulse, or work."""
        return choose(self.energetic, lambda: -self.e * self.e * W_c - W, lambda: self.e * p_c - p)

    def distance(self, missing: Scalar, u_n: Scalar, rate: Scalar) -> Scalar:
        """Where on a straight way the ``missing`` is given back."""

        def by_work() -> Scalar:
            square = u_n * u_n + 2 * rate * missing
            both = u_n + square_root(choose(square > 0, lambda: square, lambda: 0 * square))
            there = (square >= 0) & (both > 0)
            ways = choose(there, lambda: 2 * missing / both, lambda: NEVER + 0 * rate)
            return choose(fixed(self.e) == 0, lambda: 0 * missing, lambda: ways)

        return choose(self.energetic, by_work, lambda: missing)


class Turn(NamedTuple):
    """A point of the path while its slip turns.

    Attributes:
        t1, t2, s: direction and speed of the slip.
        u_n: normal velocity.
        x, W: impulse and normal work since the phase began.
        P1, P2: tangential impulse.
        heat: what friction took.
        p_c, W_c: normal impulse and work of compression; 0 until it is over.
        h: the next step; ``aim``: that to the end of the phase.
        left: by how much the slip turns too far to call it straight.
        doubt, drift: errors so far, of the slip and relative.
        slowest: the least ``s``.
        least: the least ``r``; ``crest``: the greatest ``u_n`` from which compression fell back.
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
    aim: Scalar
    left: Scalar
    doubt: Scalar
    drift: Scalar
    slowest: Scalar
    least: Scalar
    crest: Scalar


def outlook(path: Path, y: Turn) -> Turn:
    """With the step to the end of the phase, and what is left of the turn."""
    g, w, r = path.rates(y.t1, y.t2)
    c, m, s, u_n = path.c, path.m, y.s, y.u_n
    never, compressing = NEVER + 0 * r, y.p_c <= 0
    turn = choose(s > 0, lambda: w / s, lambda: 0 * w)
    bend = -m * (path.b2 * y.t1 - path.b1 * y.t2) * turn  # dr/dx

    def to_rest() -> Scalar:
        square = r * r - 2 * bend * u_n
        both = r + square_root(maximum(square, 0 * square))
        return choose((square >= 0) & (both > 0), lambda: -2 * u_n / both, lambda: never)

    def to_goal() -> Scalar:
        x = path.distance(path.missing(y.p_c, y.W_c, c * y.x, y.W) / c, u_n, r)

        def by_work() -> Scalar:
            slope = u_n + x * (r + x * bend / 2)
            bent = choose(slope > 0, lambda: x - bend * x * x * x / (6 * slope), lambda: x)
            falls = (r < 0) & (u_n > 0)
            crest = choose(falls, lambda: maximum(-u_n / r, 0.1 * y.h * s), lambda: never)
            return choose(x < NEVER, lambda: bent, lambda: crest)

        return choose(path.energetic, by_work, lambda: x)

    def to_end() -> Scalar:
        rest = -u_n / r
        missing = path.missing(c * (y.x + rest), y.W + c * u_n * rest / 2, 0 * rest, 0 * rest)
        return abs(rest) + abs(path.distance(missing / c, 0 * rest, r))

    x = choose(compressing, to_rest, to_goal)
    aim = choose((s > 0) & (s + g * x > 0), lambda: x / s, lambda: never)
    far = choose(compressing, lambda: choose(r > 0, to_end, lambda: never), lambda: abs(x))
    far = choose((s + g * far > 0) | (g >= 0), lambda: far, lambda: s / -g)
    allowed = path.tolerance / 4 * maximum(s, m * path.least_eigenvalue())
    crest = choose(compressing & (r < 0), lambda: maximum(y.crest, u_n), lambda: y.crest)
    y = y._replace(
        aim=aim,
        left=m * abs(w) * far - allowed,
        least=minimum(y.least, r),
        slowest=minimum(y.slowest, s),
        crest=crest,
    )

    # Near a direction that slip keeps and is drawn to: put it there.
    q1, q2 = -y.t2, y.t1
    pull = g + m * (path.A11 * q1 * q1 + 2 * path.A12 * q1 * q2 + path.A22 * q2 * q2)
    bent = m * (path.A11 + path.A22) * w * w * far  # over pull^2: what turn is left then
    settled = (
        (pull > 0) & (m * abs(w) * s <= allowed * pull) & (m * bent <= allowed * pull * pull) & (y.left > 0)
    )

    def settle() -> Turn:
        a = w / pull
        doubt = y.doubt + s * (abs(a) + STEP_ROUNDING)
        return y._replace(t1=y.t1 + a * q1, t2=y.t2 + a * q2, doubt=doubt, left=-allowed)

    return choose(settled, settle, lambda: y)


def step(path: Path, y: Turn) -> Turn:
    """One step of the path where slip turns, or a shorter one to try next.

    It counts ``dT = pace dh``, so that slip that goes straight to its stop is linear in ``h``.
    """
    c, m, b1, b2 = path.c, path.m, path.b1, path.b2
    one, (g0, _, _) = 1 + 0 * y.s, path.rates(y.t1, y.t2)
    h = choose(abs(y.aim) < y.h, lambda: y.aim, lambda: y.h)
    h = choose(g0 * h < -LONGEST, lambda: -LONGEST / g0, lambda: h)
    decay, mh, ch = g0 * h, m * h, c * h
    A11, A12, A22, f1, f2 = mh * path.A11, mh * path.A12, mh * path.A22, ch * b1, ch * b2
    mb1, mb2 = m * b1, m * b2
    slopes: list[tuple[Scalar, ...]] = []

    def total(row: Row, i: int) -> Scalar:
        return reduce(add, (weight * slopes[j][i] for j, weight in row))

    start = (y.t1, y.t2, y.s, y.u_n)
    for row in ((), *STAGES):
        t1, t2, s, u_n = (v + total(row, i) for i, v in enumerate(start)) if row else start
        pace = 1 / (1 + decay * sum(weight for _, weight in row)) if row else one
        h1, h2, hs = f1 - A11 * t1 - A12 * t2, f2 - A12 * t1 - A22 * t2, pace * s
        w, dx = pace * (t1 * h2 - t2 * h1), h * hs
        du = dx * (c - mb1 * t1 - mb2 * t2)
        slopes.append((-w * t2, w * t1, hs * (t1 * h1 + t2 * h2), du, dx, dx * u_n, dx * t1, dx * t2, dx * s))
    rises = [total(WEIGHTS, i) for i in range(9)]
    t1, t2, s, u_n = (v + rise for v, rise in zip(start, rises[:4], strict=True))
    dx, work, P1, P2, heat = rises[4:]

    safe = choose(s > 0, lambda: s, lambda: y.s)
    fifth = [total(ERROR_5, i) for i in (0, 1, 2, 5)]
    third = [rises[i] - total(ORDER_3, i) for i in (0, 1, 2, 5)]
    most = maximum(one, maximum(abs(y.u_n), abs(u_n)))  # it grows where friction jams
    e5, e3 = (
        abs(t1 * e[1] - t2 * e[0]) + abs(e[2]) / safe + c * abs(e[3]) / (most * most) for e in (fifth, third)
    )
    square = e5 * e5
    err = choose(square > 0, lambda: CAUTION * square / square_root(square + 0.01 * e3 * e3), lambda: 0 * e5)
    allowed = STEP_SHARE * path.tolerance * maximum(one, m * path.least_eigenvalue() / safe)
    ratio = choose((s > 0) & (err < 1e3), lambda: err / minimum(allowed, 1e-3 * one), lambda: 1e30 * one)
    factor = 0.9 / square_root(square_root(square_root(ratio + 1e-6)))
    size = abs(h) * maximum(minimum(factor, 4 * one), 0.2 * one)
    length, relative = 0.5 * (3 - t1 * t1 - t2 * t2), err + STEP_ROUNDING

    def accepted() -> Turn:
        return y._replace(
            t1=t1 * length, t2=t2 * length, s=s, u_n=u_n, x=y.x + dx, W=y.W + c * work,
            P1=y.P1 - m * P1, P2=y.P2 - m * P2, heat=y.heat + m * heat, h=maximum(size, y.h),
            doubt=y.doubt + relative * maximum(s, y.s), drift=y.drift + relative * abs(dx),
        )  # fmt: skip

    return outlook(path, _turn_over(path, choose(ratio <= 1, accepted, lambda: y._replace(h=size))))


def _turn_over(path: Path, y: Turn) -> Turn:
    """Begin restitution, if the end of compression is so near that the way to it is straight."""
    c, m = path.c, path.m
    g, w, r = path.rates(y.t1, y.t2)
    x = choose(r > 0, lambda: -y.u_n / r, lambda: NEVER + 0 * r)
    a, swing = w * x / y.s, (abs(w) + abs(g)) * abs(x)

    def begin() -> Turn:
        return y._replace(
            t1=y.t1 - a * y.t2, t2=y.t2 + a * y.t1, s=y.s + g * x, u_n=0 * r, x=0 * x, W=0 * x,
            P1=y.P1 - m * x * y.t1, P2=y.P2 - m * x * y.t2, heat=y.heat + m * x * y.s,
            p_c=c * (y.x + x), W_c=y.W + c * x * y.u_n / 2,
            doubt=y.doubt + swing * swing / y.s, drift=y.drift + swing * abs(x) / y.s,
        )  # fmt: skip

    little = path.tolerance / 20 * y.s
    near = (abs(x) < NEVER) & (swing * swing <= little * y.s) & (swing * abs(x) <= little)
    return choose((y.p_c <= 0) & near, begin, lambda: y)
