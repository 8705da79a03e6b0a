"""L4, Coulomb friction along the path of the impulse: Routh's method.

The impact is followed in the normal impulse ``p``, with the unit normal ``n`` and the unit slip
direction ``t``: ``dP/dp = n - mu t`` and ``du/dp = K (n - mu t)`` while the contact slips. When slip stops,
the contact sticks if friction can hold it; else it slips on, for good, along the one ray ``z`` on which slip
grows straight from rest. Compression ends where ``u_n`` rises to 0, at ``p_c`` and with the work ``W_c``
(``W = int u_n dp``), and the impact with

    Poisson    p = (1 + e) p_c              restitution of impulse
    Stronge    W = (1 - e^2) W_c            restitution of energy

Neither creates energy for e in [0, 1]. Restitution counts ``p`` and ``W`` from its own beginning: with a
small e they are small. Friction may press the bodies together at first (``du_n/dp < 0``: jam, Painleve's
paradox); then slip always stops, and ``u_n`` rises after all.

**Units.** ``n.K n``, the first ``|u_n|`` and their quotient, an impulse, are 1. Tangential axes 1, 2:
``A`` is ``K`` across the normal, ``b = K n`` there; both bodies' response along ``n`` is 1. Instead of
``p`` the slip counts ``x = (1 + mu) p``: with ``c = 1 / (1 + mu)`` and ``m = mu c``

    dp = c dx    dP_t = -m t dx    du_t/dx = f(t) = c b - m A t    du_n/dx = r(t) = c - m b.t

are of order 1 for all mu. With ``q`` across ``t``: slip speed changes at ``g = t.f``, and ``t`` turns at
``w / s`` with ``w = q.f``, infinitely fast where slip stops. In ``dx = s dT`` nothing is singular,

    dt/dT = w q    ds/dT = g s    dx/dT = s    du_n/dT = r s    dW/dT = c u_n s

and no direction is ever taken from a difference (Keller 1986). Planar slip has ``w = 0``. The loop of
``routh_path.py`` ends as soon as slip turns no more, to the tolerance, before it stops or the impact ends, or
is that near a direction it is drawn to; it aims its steps at the ends of the phases. The rest is straight.

**After the stop** the contact goes on along ``dP_t/dp = -k z``, ``k = min(mu, |A^-1 b|)``, with the unit
vector ``z = (G + k A)^-1 b``. The root ``G >= 0`` is how fast slip grows: 0 if the contact sticks.
``1 / |z|`` is concave in ``G``, so that Newton's method climbs to the root from below.

**Error.** Friction draws any two slips together in the norm of ``A^-1``. So at a given ``p`` the slip errs
by at most ``E = |du_t| + p |db| + |P_t| |dA| + ...``, all that is amiss in the data and in ``du_t = f dx``,
over the root ``l`` of the least eigenvalue of ``A`` in that norm; hence ``P_t = A^-1 (u_t - u_t0 - b p)`` by
``2 E / l^2``. Fast slip has an error of direction besides, ``m x E L / (l s)``, ``L^2`` the greatest
eigenvalue, which is less where the impact grazes. So ``u_n`` errs by ``D = |b| |dP_t| + |P_t| |db|`` and
that moves the ends:

    compression    D / (du_n/dp)
    Poisson        e times that
    Stronge        D (e^2 p_c + p) / u_n, or the root of 2 D (...) / (du_n/dp) if less

Only rounding in the straight pieces is left to the numbers themselves.

Sources: Routh, *Dynamics of a System of Rigid Bodies*, 1905, sections 180-199; Keller, "Impact With
Friction", J. Appl. Mech. 53 (1986); Stronge, "Rigid body collisions with friction", Proc. R. Soc. A
431 (1990); Wang & Mason, "Two-Dimensional Rigid-Body Collisions With Friction", J. Appl. Mech. 59
(1992); Batlle, "Rough balanced collisions", J. Appl. Mech. 63 (1996), for the ray.
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
from .routh_path import STEPS, Path, Turn, outlook, step

DEFAULT_TOLERANCE = 1e-12  # of the impulse, relative, if none is asked for
LEAST_TOLERANCE = 1e-13  # steps of doubles round by about as much
PATH_SHARE = 1 / 4096  # of the tolerance, that the path may take: the bound counts the rest
COARSEST = 4e-9  # a coarser path is no faster, and its bound loses proportion
GREATEST_FRICTION = 1e100  # more sticks no better: slip stops within 1e-100 of its impulse
LEAST_RESTITUTION = 1e-140  # less gives back nothing that would count
RAY_STEPS = 60
SAFETY = 2.01
NO_COUPLING = 2.0**-40  # this part of a matrix is rounding
FAINT = 2.0**-1000  # a slope that marks a kink and counts for nothing


class Ray(NamedTuple):
    """The way on from rest: against the unit vector ``z``, with the friction ``k``; slip grows by ``G``."""

    z1: Scalar
    z2: Scalar
    kz1: Scalar
    kz2: Scalar
    k: Scalar
    G: Scalar
    rate: Scalar
    misfit: Scalar
    sticks: Condition


class Root(NamedTuple):
    """Of Newton's method for ``G``."""

    G: Scalar
    step: Scalar


def _length(v1: Scalar, v2: Scalar) -> Scalar:
    return square_root(v1 * v1 + v2 * v2)


def ray_from_rest(path: Path, mu: Scalar) -> Ray:
    """The way on from rest. All but ``A`` counts in units of ``|b|``, however small that is."""
    A11, A12, A22, b1, b2, *_ = path
    size, trace = _length(b1, b2), certain(A11 + A22)
    some, one = certain(size) > 0, 1 + 0 * b1
    a1, a2 = choose(some, lambda: b1 / size, lambda: one), choose(some, lambda: b2 / size, lambda: 0 * one)
    hold = _length(A22 * a1 - A12 * a2, A11 * a2 - A12 * a1) / (A11 * A22 - A12 * A12)
    sticks = hold * size <= mu
    k = choose(sticks, lambda: hold, lambda: choose(some, lambda: mu / size, lambda: hold))
    value, v1, v2 = certain(k), certain(a1), certain(a2)

    def solve(G: Scalar, k: Scalar, v1: Scalar, v2: Scalar) -> tuple[Scalar, Scalar]:
        M11, M12, M22 = G + k * A11, k * A12, G + k * A22
        det = M11 * M22 - M12 * M12
        return (M22 * v1 - M12 * v2) / det, (M11 * v2 - M12 * v1) / det

    def climb(root: Root) -> Root:
        z1, z2 = solve(root.G, value, v1, v2)
        y1, y2 = solve(root.G, value, z1, z2)
        square = z1 * z1 + z2 * z2
        step = (square_root(square) - 1) * square / (z1 * y1 + z2 * y2)
        return Root(root.G + step, step)

    low = choose(sticks, lambda: 0 * one, lambda: maximum(1 - value * trace, 0 * one))
    start = Root(low, choose(sticks, lambda: 0 * one, lambda: one))
    root = iterate(start, lambda root: root.step > 1e-15 * (root.G + value * trace), climb, RAY_STEPS)
    G = certain(root.G)
    G = varying_as(G, lambda: climb(Root(fixed(G), G)).G)
    z1, z2 = solve(G, k, a1, a2)
    misfit, k = abs(z1 * z1 + z2 * z2 - 1), k * size
    kz1, kz2, rate = k * z1, k * z2, 1 - k * (b1 * z1 + b2 * z2)
    # What sticks is held by A^-1 b, which is smooth where b is 0.
    h1, h2 = path.held(b1, b2)
    kz1 = choose(sticks, lambda: varying_as(kz1, lambda: h1), lambda: kz1)
    kz2 = choose(sticks, lambda: varying_as(kz2, lambda: h2), lambda: kz2)
    rate = choose(sticks, lambda: varying_as(rate, lambda: 1 - (b1 * h1 + b2 * h2)), lambda: rate)
    return Ray(z1, z2, kz1, kz2, k, G * size, rate, misfit, sticks)


class Straight(NamedTuple):
    """Slip along the unit vector ``s``: its speed at first and at the end, its way, and how it grows."""

    s1: Scalar
    s2: Scalar
    first: Scalar
    last: Scalar
    along: Scalar
    g: Scalar


def _veer(path: Path, way: Straight) -> Scalar:
    """The impulse across a straight way, as ``w`` varies from 0.

    Slip across the way, ``y``, then grows from 0 by ``dy/dx = w - m A_qq y / s``, and takes the impulse
    ``(y - w x) / A_qq``. With ``T = int dx / s`` and ``a = g + m A_qq`` it is ``w s (1 - exp(-a T)) / a``,
    and 0 where slip stops.
    """
    s1, s2, first, last, along, g = way
    A_qq, _ = path.across(s1, s2)

    def slip() -> Scalar:
        time = along / first * relative_logarithm(g * along / first)
        return last * time * relative_exponential(-(g + path.m * A_qq) * time)

    y = choose(last > 0, slip, lambda: 0 * last)
    return choose(first > 0, lambda: (y - along) / A_qq, lambda: 0 * first)


def _edge_by_chance(path: Path, s1: Scalar, s2: Scalar, w: Scalar) -> Scalar:
    """0, with a kink where a way is straight by chance: where what a variation of ``w`` brings across it acts
    along it and on the normal velocity. The ends of the way then vary, which :func:`_veer` leaves out.
    """
    _, A_tq = path.across(s1, s2)
    b_q = path.b2 * s1 - path.b1 * s2
    acts = fixed(path.m * (abs(A_tq) + abs(b_q))) > NO_COUPLING * fixed(path.m * (path.A11 + path.A22))
    varies = choose(acts, lambda: w - fixed(w), lambda: 0 * w)
    # Without friction slip may turn, and nothing follows it: friction then varies a path that is no line.
    varies = choose(fixed(path.m) <= 0, lambda: path.m * abs(fixed(w)), lambda: varies)
    return choose(varies > 0, lambda: 0 * w, lambda: FAINT * varies)


def routh(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """Routh's path: it ends by restitution of impulse by ROUTH_POISSON, else of energy."""
    e, mu, settings = coefficients
    energetic = negation(settings.law == Law.ROUTH_POISSON)
    e_e, e_mu, mu = error_of(e) + LEAST_RESTITUTION, error_of(mu), minimum(certain(mu), GREATEST_FRICTION)
    e = choose(
        certain(e) < LEAST_RESTITUTION,
        lambda: varying_as(0 * certain(e), lambda: certain(e)),
        lambda: certain(e),
    )
    frame = ContactFrame.of(contact)
    k, u_n, slip1, slip2 = frame.Knn, frame.un, frame.u1, frame.u2
    speed = choose(certain(u_n) < 0, lambda: -u_n, lambda: 1 + 0 * u_n)
    j = speed / k
    data = (frame.K11 / k, frame.K12 / k, frame.K22 / k, frame.K1n / k, frame.K2n / k)
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

    # The first slip: along the ray if there is none, or none that is known.
    v1, v2 = certain(slip1), certain(slip2)
    span = abs(v1) + abs(v2)
    slips = span > certain(error_of(slip1) + error_of(slip2))
    scale = fixed(span)
    d1, d2 = (
        choose(slips, lambda: v1 / scale, lambda: ray.z1),
        choose(slips, lambda: v2 / scale, lambda: ray.z2),
    )
    size = _length(d1, d2)
    d1, d2, s = d1 / size, d2 / size, choose(slips, lambda: scale * size / certain(speed), lambda: o)
    # Out of rest, slip grows along the ray; what sticks takes any slip back, at no way.
    at_rest, (w1, w2) = fixed(span) <= 0, (v1 / certain(speed), v2 / certain(speed))
    h1, h2 = path.held(w1, w2)
    starts_stuck = ray.sticks & at_rest
    slip = w1 * ray.z1 + w2 * ray.z2
    s = choose(slips, lambda: s, lambda: varying_as(s, lambda: slip))
    s = choose(starts_stuck, lambda: fixed(s), lambda: s)
    rises = choose(starts_stuck, lambda: varying_as(o - 1, lambda: -(b1 * h1 + b2 * h2)), lambda: o - 1)
    pace = 0.3 / (c * (abs(b1) + abs(b2)) + m * (A11 + A22) + 1e-300)
    first = Turn(d1, d2, s, rises, o, o, o, o, o, o, o, pace, o, o, o, o, s, 1 + o, o - 1)
    exact = path._replace(c=certain(c), m=certain(m))
    y = iterate(outlook(exact, values(first)), lambda y: y.left > 0, lambda y: step(exact, y), STEPS)
    turned, over = y.doubt > 0, y.p_c > 0
    s1, s2 = choose(turned, lambda: y.t1, lambda: d1), choose(turned, lambda: y.t2, lambda: d2)
    s = choose(turned, lambda: y.s, lambda: s)

    # The rest of compression: slip x, then y_c after its stop.
    g, w, r = path.rates(s1, s2)
    on_slip = (r > 0) & (s * r - g * y.u_n >= 0)
    x = choose(over, lambda: o, lambda: choose(on_slip, lambda: -y.u_n / r, lambda: s / -g))
    left = s + g * x  # less than 0 only by rounding; restitution would then have no end
    s_c = choose(on_slip | over, lambda: varying_as(maximum(left, o), lambda: left), lambda: o)
    u_c = choose(on_slip | over, lambda: o, lambda: y.u_n + r * x)
    y_c = choose(on_slip | over, lambda: o, lambda: -u_c / ray.rate)
    W_c = choose(over, lambda: y.W_c, lambda: y.W + c * (y.u_n + r * x / 2) * x + u_c * y_c / 2)
    p_c = choose(over, lambda: y.p_c, lambda: c * (y.x + x) + y_c)
    p, W, u = choose(over, lambda: (c * y.x, y.W, y.u_n), lambda: (o, o, o))
    on_slip = on_slip | over

    # Restitution, likewise.
    def grown(way: Scalar, rate: Scalar) -> Scalar:
        """A way of restitution, which grows from 0 with ``e``."""
        by_e = varying_as(way, lambda: e * square_root(-2 * W_c / rate))
        return choose(energetic & (fixed(e) == 0), lambda: by_e, lambda: way)

    to_goal = grown(path.distance(path.missing(p_c, W_c, p, W) / c, u, r), c * r)
    to_end = on_slip & (s_c + g * to_goal >= 0)
    x_r = choose(on_slip, lambda: choose(to_end, lambda: to_goal, lambda: s_c / -g), lambda: o)
    s_e = choose(to_end, lambda: s_c + g * x_r, lambda: o)
    p, W, u = p + c * x_r, W + c * (u + r * x_r / 2) * x_r, u + r * x_r

    def stuck() -> Scalar:
        return grown(path.distance(path.missing(p_c, W_c, p, W), u, ray.rate), ray.rate)

    y_r = choose(to_end, lambda: o, stuck)
    p, W, u = p + y_r, W + (u + ray.rate * y_r / 2) * y_r, u + ray.rate * y_r
    along, rest = x + x_r, y_c + y_r
    P1 = y.P1 - m * s1 * along - ray.kz1 * rest
    P2 = y.P2 - m * s2 * along - ray.kz2 * rest

    veers = varying_as(o, lambda: w * _veer(path, Straight(*map(fixed, (s1, s2, s, s_e, along, g)))))
    P1 = choose(starts_stuck, lambda: varying_as(P1, lambda: P1 - h1), lambda: P1 - s2 * veers)
    P2 = choose(starts_stuck, lambda: varying_as(P2, lambda: P2 - h2), lambda: P2 + s1 * veers)
    is_straight = slips & (y.doubt <= 0)
    edge = varying_as(o, lambda: choose(is_straight, lambda: _edge_by_chance(path, s1, s2, w), lambda: o))
    P1, P2, p = P1 + edge, P2 + edge, p + edge
    heat = y.heat + m * ((s + s_c) * x + (s_c + s_e) * x_r) / 2 + ray.k * ray.G * rest * rest / 2
    lost = choose(energetic, lambda: (1 - e) * (1 + e) * -W_c, lambda: -(W_c + W))

    final1, final2 = s_e * s1 + ray.G * rest * ray.z1, s_e * s2 + ray.G * rest * ray.z2
    back = d1 * final1 + d2 * final2 < 0
    slides = choose(back, lambda: 1.0 * Regime.REVERSED + o, lambda: 1.0 * Regime.SLIDING + o)
    holds = choose(ray.sticks & (rest > 0), lambda: 1.0 * Regime.STICKING + o, lambda: slides)
    least = minimum(y.least, choose(along > 0, lambda: r, lambda: 1 + o))
    whole, X = p_c + p, choose(over, lambda: y.p_c / c + y.x, lambda: y.x) + along
    jams = (certain(least) < 0) & (certain(X) > tolerance)  # not while slip is as good as none
    regime = choose(jams, lambda: 1.0 * Regime.JAMMED + o, lambda: holds)

    # The error, from values alone.
    known = (X, along, rest, p_c, p, s_c, s_e, u_c, u, W_c, g, w, r, *ray[4:8])
    X, along, rest, p_c, p, s_c, s_e, u_c, u, W_c, g, w, r, k_z, G, rate, misfit = (certain(v) for v in known)
    endless, L2, P_t, b = math.inf + o, A11 + A22, m * X + k_z * rest, _length(b1, b2)
    E = e_u + e_b * (p_c + p) + e_A * P_t + e_mu * L2 * c * X
    E = certain(E + abs(w) * abs(along) + y.doubt + misfit * k_z * L2 * rest)
    room, reach = (
        certain(path.least_eigenvalue() - e_A),
        certain(E * square_root(L2 / path.least_eigenvalue())),
    )
    slowest = certain(minimum(y.slowest, choose(to_end, lambda: minimum(s_c, s_e), lambda: o)) - reach)
    by_slip = certain(choose(room > 0, lambda: SAFETY * E / room, lambda: endless))
    by_turn = certain(choose(slowest > 0, lambda: P_t * reach / slowest, lambda: endless))
    e_P = certain(minimum(minimum(by_slip, by_turn), certain(SAFETY * P_t)) + y.drift + e_mu * c * X)
    D = certain(P_t * e_b + b * e_P + y.drift)
    R = certain(r / c)
    either = choose(r > 0, lambda: minimum(R, rate), lambda: rate)
    sliding = choose(certain(s_c * r + g * D * c) < 0, lambda: either, lambda: R)
    held = choose(certain(u_c + D) > 0, lambda: either, lambda: rate)
    e_c = certain(SAFETY * D / choose(on_slip, lambda: sliding, lambda: held))

    def error_by_work() -> Scalar:
        e_W = certain(D * (e * e * p_c + p + e_c) - 2 * e * e_e * W_c)
        alone = to_end & (slowest > 0)
        flat = choose(alone, lambda: R, lambda: choose(on_slip, lambda: minimum(R, rate), lambda: rate))
        both = choose(on_slip, lambda: maximum(abs(R), rate), lambda: rate)
        steep = choose(alone, lambda: abs(R), lambda: both)
        root = choose(flat > 0, lambda: square_root(2 * e_W / flat), lambda: endless)
        return choose(certain(4 * steep * e_W) < certain(u * u), lambda: SAFETY * e_W / u, lambda: root)

    e_r = choose(energetic, error_by_work, lambda: e * e_c + e_e * p_c)
    e_p, path_work = certain(e_c + e_r), y.doubt + y.drift
    sound = (e_c >= 0) & (certain(-y.crest - 2 * D) > 0) & (y.left <= 0)
    course = choose(to_end | (rest < e_p), lambda: mu, lambda: k_z)
    e_P = choose(sound, lambda: e_P + course * e_p, lambda: endless)
    e_p = choose(sound, lambda: e_p, lambda: endless)

    across = Tangential(widened(P1, e_P) * j, widened(P2, e_P) * j)
    lost = widened(lost, path_work + D * (p_c + p) + abs(u) * e_p)
    heat = widened(heat, path_work + P_t * reach + course * (s_e + G * rest) * e_p)
    return Outcome(
        frame.to_world(across, widened(whole, e_p) * j),
        regime,
        lost * (speed * j),
        heat * (speed * j),
        unfinished=y.left > 0,
    )
