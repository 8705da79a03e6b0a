"""The part of Routh's path after slip has turned, in the letters and units of ``routh.py``.

**Straight slip.** The direction ``t`` is constant. Over an impulse ``x``,

    s, u_n, P_t    change by g x, r x, -m t x
    p, W           change by c x, c (u_n + r x / 2) x
    heat           the work done against friction, changes by m (s + g x / 2) x

Compression takes ``x`` while the contact slips, and leaves the slip ``s_c``. If slip stops before the end of
compression, at ``u_c``, it takes the normal impulse ``y_c`` more. Likewise restitution takes ``x_r``, leaves
``s_e``, and takes ``y_r`` after a stop.

**After the stop** friction is ``-k z`` with ``k = min(mu, |A^-1 b|)``:

    dP_t/dp = -k z    du_t/dp = b - k A z = G z    du_n/dp = rate = 1 - k b.z    z = (G + k A)^-1 b    |z| = 1

The root ``G >= 0`` of the last two is how fast slip grows: 0 if the contact sticks. ``1 / |z|`` is concave in
``G``, so that Newton's method climbs to the root from below.

Source: Batlle, "Rough balanced collisions", J. Appl. Mech. 63 (1996), for the direction ``z``.
"""

from __future__ import annotations

from typing import NamedTuple

from ...numbers.operations import (
    Condition,
    Scalar,
    certain,
    choose,
    error_of,
    fixed,
    for_derivatives,
    iterate,
    maximum,
    minimum,
    negation,
    positive_part,
    relative_exponential,
    relative_logarithm,
    square_root,
    varying_as,
)
from .contact_frame import Tangential
from .routh_path import Path, TurningSlip

RAY_STEPS = 60
"""Steps of Newton's method at most."""

NO_COUPLING = 2.0**-40
"""Relative size up to which the coupling between two axes is rounding."""

SLIGHT = 2.0**-44
"""Slip before the impact, relative to the approach speed, that is rounding, and for derivatives none."""

FAINT = 2.0**-1000
"""A slope that marks a kink for derivatives without changing any of them."""


class Ray(NamedTuple):
    """The way on from rest: see "After the stop" above.

    Attributes:
        z1, z2: direction of the slip.
        kz1, kz2: ``k z``.
        k, G, rate: friction, growth of the slip, growth of ``u_n``.
        misfit: ``| |z|^2 - 1 |``.
        sticks: whether the contact sticks.
    """

    z1: Scalar
    z2: Scalar
    kz1: Scalar
    kz2: Scalar
    k: Scalar
    G: Scalar
    rate: Scalar
    misfit: Scalar
    sticks: Condition


class Newton(NamedTuple):
    """The state of Newton's method for ``G``."""

    G: Scalar
    step: Scalar


def ray_from_rest(path: Path, mu: Scalar) -> Ray:
    """The way on from rest.

    ``b``, ``G`` and ``1 / k`` are computed in units of ``|b|``, however small that is; ``a`` is the unit
    vector along ``b``.
    """
    A11, A12, A22, b1, b2, *_ = path
    size, trace = Tangential(b1, b2).length(), certain(A11 + A22)
    is_coupled, one = certain(size) > 0, 1 + 0 * b1
    a1 = choose(is_coupled, lambda: b1 / size, lambda: one)
    a2 = choose(is_coupled, lambda: b2 / size, lambda: 0 * one)
    hold = Tangential(A22 * a1 - A12 * a2, A11 * a2 - A12 * a1).length() / (A11 * A22 - A12 * A12)  # |A^-1 a|
    sticks = hold * size <= mu
    k = choose(sticks, lambda: hold, lambda: choose(is_coupled, lambda: mu / size, lambda: hold))
    k_value, v1, v2 = certain(k), certain(a1), certain(a2)

    def solve(G: Scalar, k: Scalar, v1: Scalar, v2: Scalar) -> tuple[Scalar, Scalar]:
        """``(G + k A)^-1 v``."""
        M11, M12, M22 = G + k * A11, k * A12, G + k * A22
        det = M11 * M22 - M12 * M12
        return (M22 * v1 - M12 * v2) / det, (M11 * v2 - M12 * v1) / det

    def climb(at: Newton) -> Newton:
        """A step for ``1 / |z| = 1``; ``y = -dz/dG``."""
        z1, z2 = solve(at.G, k_value, v1, v2)
        y1, y2 = solve(at.G, k_value, z1, z2)
        square = z1 * z1 + z2 * z2
        step = (square_root(square) - 1) * square / (z1 * y1 + z2 * y2)
        return Newton(at.G + step, step)

    # From |a| = |(G + k A) z| <= G + k tr(A): a lower bound of the root.
    low = choose(sticks, lambda: 0 * one, lambda: positive_part(1 - k_value * trace))
    start = Newton(low, choose(sticks, lambda: 0 * one, lambda: one))
    root = iterate(start, lambda at: at.step > 1e-15 * minimum(at.G + k_value * trace, one), climb, RAY_STEPS)
    G = certain(root.G)
    G = varying_as(G, lambda: climb(Newton(fixed(G), G)).G)
    z1, z2 = solve(G, k, a1, a2)
    misfit, k = abs(z1 * z1 + z2 * z2 - 1), k * size
    kz1, kz2, rate = k * z1, k * z2, 1 - k * (b1 * z1 + b2 * z2)
    # If the contact sticks, k z = A^-1 b, which is smooth where b is 0.
    h1, h2 = path.solve(b1, b2)
    kz1 = choose(sticks, lambda: varying_as(kz1, lambda: h1), lambda: kz1)
    kz2 = choose(sticks, lambda: varying_as(kz2, lambda: h2), lambda: kz2)
    rate = choose(sticks, lambda: varying_as(rate, lambda: 1 - (b1 * h1 + b2 * h2)), lambda: rate)
    return Ray(z1, z2, kz1, kz2, k, G * size, rate, misfit, sticks)


class FirstSlip(NamedTuple):
    """The slip with which the path begins.

    Attributes:
        t1, t2, s, u_n: direction and speed of the slip, and normal velocity.
        slips: whether the contact slips before the impact, by more than the error of its slip.
        sticks: whether it neither slips before the impact, but for rounding, nor after it.
        h1, h2: for derivatives, the impulse that ends a slip which begins and ends at once.
        kink: 0, with a kink for derivatives if slip out of rest could begin in another direction.
    """

    t1: Scalar
    t2: Scalar
    s: Scalar
    u_n: Scalar
    slips: Condition
    sticks: Condition
    h1: Scalar
    h2: Scalar
    kink: Scalar


def first_slip(path: Path, ray: Ray, slip: Tangential, speed: Scalar) -> FirstSlip:
    """The first slip. If it is 0, or nothing is known of it but its error, it begins along the ray."""
    o = 0 * path.A11
    v1, v2 = certain(slip.x), certain(slip.y)
    w1, w2 = v1 / certain(speed), v2 / certain(speed)
    # For derivatives: out of rest, slip grows along the ray; if the contact sticks, any slip ends at once.
    is_slight = fixed(abs(w1) + abs(w2)) <= SLIGHT
    sticks = ray.sticks & is_slight
    v1 = for_derivatives(v1, lambda: choose(is_slight, lambda: o, lambda: v1))
    v2 = for_derivatives(v2, lambda: choose(is_slight, lambda: o, lambda: v2))
    span = abs(v1) + abs(v2)
    slips = span > certain(error_of(slip.x) + error_of(slip.y))
    scale = fixed(span)
    t1 = choose(slips, lambda: v1 / scale, lambda: ray.z1)
    t2 = choose(slips, lambda: v2 / scale, lambda: ray.z2)
    size = Tangential(t1, t2).length()
    t1, t2 = t1 / size, t2 / size
    along_ray = choose(sticks, lambda: o, lambda: w1 * ray.z1 + w2 * ray.z2)
    s = choose(slips, lambda: scale * size / certain(speed), lambda: varying_as(o, lambda: along_ray))
    h1, h2 = path.solve(w1, w2)
    u_n = choose(sticks, lambda: varying_as(o - 1, lambda: -(path.b1 * h1 + path.b2 * h2)), lambda: o - 1)
    grows = abs(varying_as(o, lambda: w1)) + abs(varying_as(o, lambda: w2))
    kink = varying_as(o, lambda: choose(is_slight & negation(sticks), lambda: FAINT * grows, lambda: o))
    return FirstSlip(t1, t2, s, u_n, slips, sticks, h1, h2, kink)


class StraightRest(NamedTuple):
    """The path after slip has turned: straight slip, and after a stop the ray.

    Attributes:
        t1, t2, s: direction of the slip, and its speed at the beginning.
        g, w, r: the rates of the slip.
        x, x_r, along: impulse of the slip in compression, in restitution, and in both.
        after_stop: normal impulse after the stop, ``y_c + y_r``.
        p_c, W_c: normal impulse and work of the whole compression.
        s_c, u_c: slip at the end of compression; normal velocity at which slip stopped before, else 0.
        p, W, u: normal impulse and work of the whole restitution, and the normal velocity after it.
        s_e: slip at the end of the impact.
        slips_on, slips_to_end: whether the contact slips until the end of compression; of the impact.
        in_restitution: whether slip turned until restitution.
    """

    t1: Scalar
    t2: Scalar
    s: Scalar
    g: Scalar
    w: Scalar
    r: Scalar
    x: Scalar
    x_r: Scalar
    along: Scalar
    after_stop: Scalar
    p_c: Scalar
    W_c: Scalar
    s_c: Scalar
    u_c: Scalar
    p: Scalar
    W: Scalar
    u: Scalar
    s_e: Scalar
    slips_on: Condition
    slips_to_end: Condition
    in_restitution: Condition


def straight_rest(path: Path, ray: Ray, first: FirstSlip, y: TurningSlip) -> StraightRest:
    """The path from where slip turns no more to its end."""
    o, c, e = 0 * path.A11, path.c, path.e
    turned, in_restitution = y.slip_error > 0, y.p_c > 0
    t1, t2 = choose(turned, lambda: y.t1, lambda: first.t1), choose(turned, lambda: y.t2, lambda: first.t2)
    s = choose(turned, lambda: y.s, lambda: first.s)

    # The rest of compression.
    g, w, r = path.rates(t1, t2)
    slips_on = (r > 0) & (s * r - g * y.u_n >= 0)
    x = choose(in_restitution, lambda: o, lambda: choose(slips_on, lambda: -y.u_n / r, lambda: s / -g))
    s_after = s + g * x  # less than 0 only by rounding; restitution would then have no end
    s_c = choose(
        slips_on | in_restitution, lambda: varying_as(maximum(s_after, o), lambda: s_after), lambda: o
    )
    u_c = choose(slips_on | in_restitution, lambda: o, lambda: y.u_n + r * x)
    y_c = choose(slips_on | in_restitution, lambda: o, lambda: -u_c / ray.rate)
    W_c = choose(in_restitution, lambda: y.W_c, lambda: y.W + c * (y.u_n + r * x / 2) * x + u_c * y_c / 2)
    p_c = choose(in_restitution, lambda: y.p_c, lambda: c * (y.x + x) + y_c)
    p, W, u = choose(in_restitution, lambda: (c * y.x, y.W, y.u_n), lambda: (o, o, o))
    slips_on = slips_on | in_restitution

    # Restitution.
    def from_zero(distance: Scalar, rate: Scalar) -> Scalar:
        """A distance of restitution, which for derivatives grows from 0 with ``e``."""
        by_e = varying_as(distance, lambda: e * square_root(-2 * W_c / rate))
        return choose(path.energetic & (fixed(e) == 0), lambda: by_e, lambda: distance)

    to_end = from_zero(path.distance(path.missing(p_c, W_c, p, W) / c, u, r), c * r)
    slips_to_end = slips_on & (s_c + g * to_end >= 0)
    x_r = choose(slips_on, lambda: choose(slips_to_end, lambda: to_end, lambda: s_c / -g), lambda: o)
    s_e = choose(slips_to_end, lambda: s_c + g * x_r, lambda: o)
    p, W, u = p + c * x_r, W + c * (u + r * x_r / 2) * x_r, u + r * x_r

    def after_stop() -> Scalar:
        return from_zero(path.distance(path.missing(p_c, W_c, p, W), u, ray.rate), ray.rate)

    y_r = choose(slips_to_end, lambda: o, after_stop)
    p, W, u = p + y_r, W + (u + ray.rate * y_r / 2) * y_r, u + ray.rate * y_r
    return StraightRest(
        t1, t2, s, g, w, r, x, x_r, x + x_r, y_c + y_r, p_c, W_c, s_c, u_c, p, W, u, s_e,
        slips_on, slips_to_end, in_restitution,
    )  # fmt: skip


def tangential_impulse(
    path: Path, ray: Ray, first: FirstSlip, y: TurningSlip, rest: StraightRest
) -> tuple[Scalar, Scalar, Scalar]:
    """The tangential impulse of the whole path; and 0, with a kink for derivatives."""
    o, t1, t2 = 0 * path.A11, rest.t1, rest.t2
    P1 = y.P1 - path.m * t1 * rest.along - ray.kz1 * rest.after_stop
    P2 = y.P2 - path.m * t2 * rest.along - ray.kz2 * rest.after_stop

    # What the impulse varies by where the path is straight now, but would turn.
    slip = StraightSlip(*map(fixed, (t1, t2, rest.s, rest.s_e, rest.along, rest.g)))
    P_q = varying_as(o, lambda: rest.w * _impulse_of_turn(path, slip))
    P1 = choose(first.sticks, lambda: varying_as(P1, lambda: P1 - first.h1), lambda: P1 - t2 * P_q)
    P2 = choose(first.sticks, lambda: varying_as(P2, lambda: P2 - first.h2), lambda: P2 + t1 * P_q)
    is_straight = first.slips & (y.slip_error <= 0)
    turn = choose(is_straight, lambda: _kink_of_turn(path, t1, t2, rest.w), lambda: o)
    kink = varying_as(o, lambda: turn + first.kink)
    return P1 + kink, P2 + kink, kink


class StraightSlip(NamedTuple):
    """Straight slip: its direction ``t``, its speed at the beginning and the end, ``x``, and ``g``."""

    t1: Scalar
    t2: Scalar
    first: Scalar
    last: Scalar
    x: Scalar
    g: Scalar


def _impulse_of_turn(path: Path, slip: StraightSlip) -> Scalar:
    """Derivative of the impulse along ``q`` with respect to ``w``, on a straight path, where ``w`` is 0.

    The slip ``y`` along ``q`` grows from 0 by ``dy/dx = w - m A_qq y / s``, and so the impulse is
    ``(y - w x) / A_qq``. With ``T = int dx / s`` and ``a = g + m A_qq``, ``y = w s (1 - exp(-a T)) / a`` at
    the end, or 0 if slip stops there. Without friction ``y = w x``, also where slip turns back.
    """
    t1, t2, first, last, x, g = slip
    A_qq, _ = path.A_along(t1, t2)
    growth = g * x / first

    def y_at_end() -> Scalar:
        T = x / first * relative_logarithm(growth)
        return last * T * relative_exponential(-(g + path.m * A_qq) * T)

    # Where slip all but stops, `growth` may round to -1, which only a stop takes for ever to reach.
    y = choose((last > 0) & (growth > -1), y_at_end, lambda: 0 * last)
    return choose((first > 0) & (fixed(path.m) > 0), lambda: (y - x) / A_qq, lambda: 0 * first)


def _kink_of_turn(path: Path, t1: Scalar, t2: Scalar, w: Scalar) -> Scalar:
    """0, with a kink for derivatives if the path is straight only by chance.

    That is if a variation of ``w`` would change the slip along ``t`` or the normal velocity, and so the ends
    of the phases, which :func:`_impulse_of_turn` leaves out.
    """
    _, A_tq = path.A_along(t1, t2)
    b_q = path.b2 * t1 - path.b1 * t2
    is_coupled = fixed(path.m * (abs(A_tq) + abs(b_q))) > NO_COUPLING * fixed(path.m * (path.A11 + path.A22))
    varies = choose(is_coupled, lambda: w - fixed(w), lambda: 0 * w)
    # Without friction slip may turn without any effect. A variation of friction then acts on a curved path.
    varies = choose(fixed(path.m) <= 0, lambda: path.m * abs(fixed(w)), lambda: varies)
    return choose(varies > 0, lambda: 0 * w, lambda: FAINT * varies)
