"""Coulomb friction along the path of the impulse: Routh's method.

**The path.** The impact is followed from first touch to last in the normal impulse ``p``. While the contact
slips with the speed ``s`` along the unit vector ``t``, friction acts against ``t``:

    dP/dp = n - mu t        du/dp = K (n - mu t)

with the unit normal ``n``. When slip stops, the contact sticks if friction can hold it. Otherwise it slips
on, for good, in the one direction ``z`` in which slip grows straight from rest.

**Its end.** Let ``u_n`` be the normal velocity and ``W = int u_n dp`` the work of the normal impulse.
Compression ends where ``u_n`` reaches 0, at ``p_c`` and ``W_c < 0``. The impact ends where

    Poisson    p = (1 + e) p_c          restitution of impulse
    Stronge    W = (1 - e^2) W_c        restitution of energy

Neither creates energy for e in [0, 1]. In the code ``p`` and ``W`` start again from 0 when restitution
begins, since they are small if e is: restitution ends at ``p = e p_c`` or ``W = -e^2 W_c``. Friction may
press the bodies together at first (``du_n/dp < 0``: jam, Painleve's paradox); slip then always stops, and
``u_n`` rises after all.

**Units.** ``n.K n`` and ``|u_n|`` before the impact are 1, so the unit of impulse is their quotient ``j``.
With two tangential axes, ``A`` is the tangential part of ``K`` and ``b`` the tangential part of ``K n``.
Instead of ``p``, slip counts ``x = (1 + mu) p``. With ``c = 1 / (1 + mu)`` and ``m = mu c``,

    dp = c dx    dP_t = -m t dx    du_t/dx = f(t) = c b - m A t    du_n/dx = r(t) = c - m b.t

are of order 1 for all mu.

**Slip that turns.** Let ``q`` be the tangent perpendicular to ``t``. The slip speed changes at the rate
``g = t.f``, and ``t`` turns at the rate ``w / s`` with ``w = q.f``, infinitely fast where slip stops. With
``dx = s dT`` nothing is singular,

    dt/dT = w q    ds/dT = g s    dx/dT = s    du_n/dT = r s    dW/dT = c u_n s

and no direction is ever computed from a difference (Keller 1986). Planar slip has ``w = 0``.
``routh_path.py`` integrates these equations until, to the tolerance, slip turns no more before it stops or
the impact ends.

**Straight slip.** From there on ``t`` is constant. Over an impulse ``x``,

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

**Error.** Friction draws any two slips together, in the norm of ``A^-1``. So at a given ``p`` the error of
the slip is, in that norm, at most ``E / l``, where ``l^2`` is the least eigenvalue of ``A``, and

    E = |du_t| + p |db| + |P_t| |dA| + ...

is the sum of all errors in the data and in ``du_t = f dx``. Hence ``P_t = A^-1 (u_t - u_t0 - b p)`` has an
error of at most ``2 E / l^2``. While slip is fast, only its direction is in error, and ``P_t`` by
``m x E L / (l s)``, with the greatest eigenvalue ``L^2``; this is less if the impact grazes. ``u_n`` then has
an error of ``D = |b| |dP_t| + |P_t| |db|``, which moves the ends of the phases by

    compression    D / (du_n/dp)
    Poisson        e times that
    Stronge        D (e^2 p_c + p) / u_n, or the root of 2 D (e^2 p_c + p) / (du_n/dp) if that is less

Rounding in the straight pieces is bounded by the numbers themselves.

Sources: Routh, *Dynamics of a System of Rigid Bodies*, 1905, sections 180-199; Keller, "Impact With
Friction", J. Appl. Mech. 53 (1986); Stronge, "Rigid body collisions with friction", Proc. R. Soc. A
431 (1990); Wang & Mason, "Two-Dimensional Rigid-Body Collisions With Friction", J. Appl. Mech. 59
(1992); Batlle, "Rough balanced collisions", J. Appl. Mech. 63 (1996), for the direction ``z``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...numbers.operations import (
    Condition,
    Scalar,
    certain,
    choose,
    error_of,
    fixed,
    iterate,
    maximum,
    minimum,
    negation,
    relative_exponential,
    relative_logarithm,
    square_root,
    values,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .contact_frame import ContactFrame, Tangential
from .law import Coefficients, Law, Outcome, Regime
from .routh_path import STEPS, Path, TurningSlip, look_ahead, step

DEFAULT_TOLERANCE = 1e-12
"""Relative tolerance of the path if the model has none."""

LEAST_TOLERANCE = 1e-13
"""The finest tolerance of the path: about the rounding of its steps in doubles."""

PATH_SHARE = 1 / 4096
"""The part of the tolerance of the model that the path may use; the bound of its error counts the rest."""

COARSEST = 4e-9
"""The coarsest tolerance of the path: a coarser path is no faster, and its bound grows out of proportion."""

GREATEST_FRICTION = 1e100
"""More friction changes nothing: slip stops within 1e-100 of its impulse."""

LEAST_RESTITUTION = 1e-140
"""Less restitution returns nothing that counts."""

RAY_STEPS = 60
SAFETY = 2.01

NO_COUPLING = 2.0**-40
"""Relative size up to which the coupling between two axes is rounding."""

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


def _length(v1: Scalar, v2: Scalar) -> Scalar:
    return square_root(v1 * v1 + v2 * v2)


def ray_from_rest(path: Path, mu: Scalar) -> Ray:
    """The way on from rest.

    ``b``, ``G`` and ``1 / k`` are computed in units of ``|b|``, however small that is; ``a`` is the unit
    vector along ``b``.
    """
    A11, A12, A22, b1, b2, *_ = path
    size, trace = _length(b1, b2), certain(A11 + A22)
    is_coupled, one = certain(size) > 0, 1 + 0 * b1
    a1 = choose(is_coupled, lambda: b1 / size, lambda: one)
    a2 = choose(is_coupled, lambda: b2 / size, lambda: 0 * one)
    hold = _length(A22 * a1 - A12 * a2, A11 * a2 - A12 * a1) / (A11 * A22 - A12 * A12)  # |A^-1 a|
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
    low = choose(sticks, lambda: 0 * one, lambda: maximum(1 - k_value * trace, 0 * one))
    start = Newton(low, choose(sticks, lambda: 0 * one, lambda: one))
    root = iterate(start, lambda at: at.step > 1e-15 * (at.G + k_value * trace), climb, RAY_STEPS)
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
    the end, or 0 if slip stops there.
    """
    t1, t2, first, last, x, g = slip
    A_qq, _ = path.A_along(t1, t2)

    def y_at_end() -> Scalar:
        T = x / first * relative_logarithm(g * x / first)
        return last * T * relative_exponential(-(g + path.m * A_qq) * T)

    y = choose(last > 0, y_at_end, lambda: 0 * last)
    return choose(first > 0, lambda: (y - x) / A_qq, lambda: 0 * first)


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


def routh(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse by Routh's path: ROUTH_POISSON if ``settings.law`` says so, else ROUTH_STRONGE."""
    e, mu, settings = coefficients
    energetic = negation(settings.law == Law.ROUTH_POISSON)
    e_e, e_mu, mu = error_of(e) + LEAST_RESTITUTION, error_of(mu), minimum(certain(mu), GREATEST_FRICTION)
    e = choose(
        certain(e) < LEAST_RESTITUTION,
        lambda: varying_as(0 * certain(e), lambda: certain(e)),
        lambda: certain(e),
    )
    frame = ContactFrame.of(contact)
    K_nn, u_n, slip1, slip2 = frame.Knn, frame.un, frame.u1, frame.u2
    speed = choose(certain(u_n) < 0, lambda: -u_n, lambda: 1 + 0 * u_n)
    j = speed / K_nn
    data = (frame.K11 / K_nn, frame.K12 / K_nn, frame.K22 / K_nn, frame.K1n / K_nn, frame.K2n / K_nn)
    e_A = error_of(data[0]) + 2 * error_of(data[1]) + error_of(data[2])
    e_b, e_u = error_of(data[3]) + error_of(data[4]), error_of(slip1 / speed) + error_of(slip2 / speed)

    o = 0 * certain(slip1)
    tolerance = choose(
        settings.tolerance > 0,
        lambda: maximum(minimum(PATH_SHARE * settings.tolerance, COARSEST + o), LEAST_TOLERANCE + o),
        lambda: DEFAULT_TOLERANCE + o,
    )
    c = 1 / (1 + mu)
    A11, A12, A22, b1, b2 = (certain(x) for x in data)
    path = Path(A11, A12, A22, b1, b2, c, mu * c, e, energetic, tolerance)
    ray, m = ray_from_rest(path, mu), path.m

    # The first slip. If it is 0, or nothing is known of it but its error, it begins along the ray.
    v1, v2 = certain(slip1), certain(slip2)
    span = abs(v1) + abs(v2)
    slips = span > certain(error_of(slip1) + error_of(slip2))
    scale = fixed(span)
    first1, first2 = (
        choose(slips, lambda: v1 / scale, lambda: ray.z1),
        choose(slips, lambda: v2 / scale, lambda: ray.z2),
    )
    size = _length(first1, first2)
    first1, first2 = first1 / size, first2 / size
    s = choose(slips, lambda: scale * size / certain(speed), lambda: o)
    # For derivatives: out of rest, slip grows along the ray; if the contact sticks, it ends any slip at once.
    at_rest, (w1, w2) = fixed(span) <= 0, (v1 / certain(speed), v2 / certain(speed))
    h1, h2 = path.solve(w1, w2)
    starts_stuck = ray.sticks & at_rest
    slip = w1 * ray.z1 + w2 * ray.z2
    s = choose(slips, lambda: s, lambda: varying_as(s, lambda: slip))
    s = choose(starts_stuck, lambda: fixed(s), lambda: s)
    u_n = choose(starts_stuck, lambda: varying_as(o - 1, lambda: -(b1 * h1 + b2 * h2)), lambda: o - 1)

    # The path while slip turns, in values.
    h = 0.3 / (c * (abs(b1) + abs(b2)) + m * (A11 + A22) + 1e-300)
    start = TurningSlip(
        first1, first2, s, u_n, x=o, W=o, P1=o, P2=o, heat=o, p_c=o, W_c=o, h=h, h_end=o, excess_turn=o,
        slip_error=o, impulse_error=o, least_s=s, least_r=1 + o, u_n_crest=o - 1,
    )  # fmt: skip
    exact = path._replace(c=certain(c), m=certain(m))
    y = look_ahead(exact, values(start))
    y = iterate(y, lambda y: y.excess_turn > 0, lambda y: step(exact, y), STEPS)
    turned, in_restitution = y.slip_error > 0, y.p_c > 0
    t1, t2 = choose(turned, lambda: y.t1, lambda: first1), choose(turned, lambda: y.t2, lambda: first2)
    s = choose(turned, lambda: y.s, lambda: s)

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
        return choose(energetic & (fixed(e) == 0), lambda: by_e, lambda: distance)

    to_end = from_zero(path.distance(path.missing(p_c, W_c, p, W) / c, u, r), c * r)
    slips_to_end = slips_on & (s_c + g * to_end >= 0)
    x_r = choose(slips_on, lambda: choose(slips_to_end, lambda: to_end, lambda: s_c / -g), lambda: o)
    s_e = choose(slips_to_end, lambda: s_c + g * x_r, lambda: o)
    p, W, u = p + c * x_r, W + c * (u + r * x_r / 2) * x_r, u + r * x_r

    def after_stop() -> Scalar:
        return from_zero(path.distance(path.missing(p_c, W_c, p, W), u, ray.rate), ray.rate)

    y_r = choose(slips_to_end, lambda: o, after_stop)
    p, W, u = p + y_r, W + (u + ray.rate * y_r / 2) * y_r, u + ray.rate * y_r
    along, rest = x + x_r, y_c + y_r
    P1 = y.P1 - m * t1 * along - ray.kz1 * rest
    P2 = y.P2 - m * t2 * along - ray.kz2 * rest

    # What the impulse varies by where the path is straight now, but would turn.
    P_q = varying_as(
        o, lambda: w * _impulse_of_turn(path, StraightSlip(*map(fixed, (t1, t2, s, s_e, along, g))))
    )
    P1 = choose(starts_stuck, lambda: varying_as(P1, lambda: P1 - h1), lambda: P1 - t2 * P_q)
    P2 = choose(starts_stuck, lambda: varying_as(P2, lambda: P2 - h2), lambda: P2 + t1 * P_q)
    is_straight = slips & (y.slip_error <= 0)
    kink = varying_as(o, lambda: choose(is_straight, lambda: _kink_of_turn(path, t1, t2, w), lambda: o))
    P1, P2, p = P1 + kink, P2 + kink, p + kink
    heat = y.heat + m * ((s + s_c) * x + (s_c + s_e) * x_r) / 2 + ray.k * ray.G * rest * rest / 2
    lost = choose(energetic, lambda: (1 - e) * (1 + e) * -W_c, lambda: -(W_c + W))

    # The regime.
    final1, final2 = s_e * t1 + ray.G * rest * ray.z1, s_e * t2 + ray.G * rest * ray.z2
    is_reversed = first1 * final1 + first2 * final2 < 0
    slides = choose(is_reversed, lambda: 1.0 * Regime.REVERSED + o, lambda: 1.0 * Regime.SLIDING + o)
    sticks = choose(ray.sticks & (rest > 0), lambda: 1.0 * Regime.STICKING + o, lambda: slides)
    least_r = minimum(y.least_r, choose(along > 0, lambda: r, lambda: 1 + o))
    P_n, X = p_c + p, choose(in_restitution, lambda: y.p_c / c + y.x, lambda: y.x) + along
    jams = (certain(least_r) < 0) & (certain(X) > tolerance)  # not while slip is as good as none
    regime = choose(jams, lambda: 1.0 * Regime.JAMMED + o, lambda: sticks)

    # The error, from values. X is the whole impulse of slip, P_t the size of the tangential impulse.
    known = (X, along, rest, p_c, p, s_c, s_e, u_c, u, W_c, g, w, r, *ray[4:8])
    X, along, rest, p_c, p, s_c, s_e, u_c, u, W_c, g, w, r, k, G, rate, misfit = (certain(v) for v in known)
    infinite, L2, P_t, b = math.inf + o, A11 + A22, m * X + k * rest, _length(b1, b2)
    E = e_u + e_b * (p_c + p) + e_A * P_t + e_mu * L2 * c * X
    E = certain(E + abs(w) * abs(along) + y.slip_error + misfit * k * L2 * rest)
    l2, slip_error = (
        certain(path.least_eigenvalue() - e_A),
        certain(E * square_root(L2 / path.least_eigenvalue())),
    )
    least_s = certain(
        minimum(y.least_s, choose(slips_to_end, lambda: minimum(s_c, s_e), lambda: o)) - slip_error
    )
    by_slip = certain(choose(l2 > 0, lambda: SAFETY * E / l2, lambda: infinite))
    by_direction = certain(choose(least_s > 0, lambda: P_t * slip_error / least_s, lambda: infinite))
    e_P = certain(
        minimum(minimum(by_slip, by_direction), certain(SAFETY * P_t)) + y.impulse_error + e_mu * c * X
    )
    D = certain(P_t * e_b + b * e_P + y.impulse_error)
    # The error of p_c: by the least du_n/dp that u_n may have had where it reached 0.
    R = certain(r / c)
    either = choose(r > 0, lambda: minimum(R, rate), lambda: rate)
    sliding_rate = choose(certain(s_c * r + g * D * c) < 0, lambda: either, lambda: R)
    stopped_rate = choose(certain(u_c + D) > 0, lambda: either, lambda: rate)
    e_c = certain(SAFETY * D / choose(slips_on, lambda: sliding_rate, lambda: stopped_rate))

    def error_by_work() -> Scalar:
        e_W = certain(D * (e * e * p_c + p + e_c) - 2 * e * e_e * W_c)
        surely_slips = slips_to_end & (least_s > 0)
        least_rate = choose(
            surely_slips, lambda: R, lambda: choose(slips_on, lambda: minimum(R, rate), lambda: rate)
        )
        either = choose(slips_on, lambda: maximum(abs(R), rate), lambda: rate)
        greatest_rate = choose(surely_slips, lambda: abs(R), lambda: either)
        root = choose(least_rate > 0, lambda: square_root(2 * e_W / least_rate), lambda: infinite)
        is_linear = certain(4 * greatest_rate * e_W) < certain(u * u)
        return choose(is_linear, lambda: SAFETY * e_W / u, lambda: root)

    e_r = choose(energetic, error_by_work, lambda: e * e_c + e_e * p_c)
    e_p, path_work = certain(e_c + e_r), y.slip_error + y.impulse_error
    is_sound = (e_c >= 0) & (certain(-y.u_n_crest - 2 * D) > 0) & (y.excess_turn <= 0)
    friction = choose(slips_to_end | (rest < e_p), lambda: mu, lambda: k)
    e_P = choose(is_sound, lambda: e_P + friction * e_p, lambda: infinite)
    e_p = choose(is_sound, lambda: e_p, lambda: infinite)

    tangential = Tangential(widened(P1, e_P) * j, widened(P2, e_P) * j)
    lost = widened(lost, path_work + D * (p_c + p) + abs(u) * e_p)
    heat = widened(heat, path_work + P_t * slip_error + friction * (s_e + G * rest) * e_p)
    return Outcome(
        frame.to_world(tangential, widened(P_n, e_p) * j),
        regime,
        lost * (speed * j),
        heat * (speed * j),
        unfinished=y.excess_turn > 0,
    )
