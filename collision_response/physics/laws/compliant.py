"""L5, springs along and across the normal with Coulomb friction between them: Stronge's bilinear compliance.

The bodies are rigid but for a small region about the contact: a massless particle that is held by a normal
spring of stiffness ``k_n`` and a tangential one of ``k_t = kappa k_n``, and that sticks or slips. With the
compression ``delta``, the deflection ``x`` of the tangential spring and the force ``F`` on body_a,

    u' = K F        delta' = -u_n        F_t = -kappa x        P = int F dt        u+ = u + K P

    loading     F_n = delta                                      until u_n = 0
    unloading   F_n = (delta - (1 - e^2) delta_max) / e^2        and loading again up to delta_max
    stick       x' = u_t                                         while kappa |x| < mu F_n
    slip        kappa |x| = mu F_n,  x' = u_t - lambda x/|x|     while lambda > 0
                lambda = (x/|x|).u_t - mu F_n' / kappa

It begins with stick if ``kappa |u_t| <= mu |u_n|``, and ends where ``F_n`` is 0: then ``F_t`` is 0 too, and
no energy is left in the springs. ``k_n`` drops out: it only says how long the impact takes. What is lost,

    restitution  (1 - e^2) F_max^2 / 2        friction  int mu F_n lambda dt

is never negative: the law creates no energy for ``e`` in [0, 1]. As ``kappa`` grows it becomes
ROUTH_STRONGE, with a difference of about ``kappa^(-1/2)``. With a ``kappa`` of order 1 the tangential spring
gives back within the same impact what it took: a sphere that comes in steeply ends with its contact moving
backwards.

**Units.** ``n.K n``, the first ``|u_n|`` and ``k_n`` are 1. Axis 1 is that of the first slip, or of ``K_tn``
without one: planar impacts, and those of spheres, stay on it to the last digit. In space slip turns the
spring: its direction ``a = x/|x|`` by ``kappa (q.u_t) / (mu F_n)``, with ``q`` across it. That is steep where
``F_n`` is small: the course begins at ``F_n = t`` with the first term of the turn, ``c t^2 q``,

    c = w / (2 s + 4 mu / kappa)        w = q.(K_tn - mu A a),  s = |u_t|

and ends straight from ``F_n = END F_max`` on. The course itself is in ``compliant_path.py``.

**Error.** Let two courses differ by ``(du, dF_t, dF_n)``. Stick keeps

    V = du.K^-1 du + dF_t^2 / kappa + dF_n^2 / k        k = k_n: 1, or 1 / e^2

and slip adds to it only what the normal force does to friction: ``V' <= 2 mu |a.du_t| |dF_n|``, and where it
turns by ``phi`` also ``2 mu |phi'| |dF_t| |dF_n| / kappa``. To stick again adds ``mu^2 k / kappa`` of ``V``.
So errors, of the size of its root, grow at most by

    exp(int mu (a.Aa k)^(1/2) / 2 dt + mu (k / kappa)^(1/2) / 2 |d phi|)        over the slip
    (1 + mu^2 k / kappa)^(1/2)                                                  with each stick after it

What is amiss in the data and in the steps, times that, over the root of the least eigenvalue of ``K``, bounds
``dP``. That is to first order; ``SAFETY`` covers the moments when of two near courses only one slips.

Sources: Stronge, *Impact Mechanics*, 2000, chapter 5; Maw, Barber & Fawcett, "The oblique impact of elastic
spheres", Wear 38 (1976), for what the bilinear springs stand in for.
"""

from __future__ import annotations

import math

from ...numbers.operations import (
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
    square_root,
    values,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .compliant_path import LEAST, STEPS, Course, Springs, step
from .contact_frame import ContactFrame, Tangential
from .law import Coefficients, Outcome, Regime

TOLERANCE = 1e-14  # of a step
COARSEST = 1e-9
SHARE = 1 / 1024  # of the tolerance asked for, that a step may take
EARLY = 1e-4  # when a slip that turns is taken up, in the time of the fastest spring
PLANAR = 2.0**-49  # a part of u, K_tn or A across axis 1 that is rounding
GREATEST_FRICTION = 1e8  # more sticks no better
SAFETY = 4.0


def compliant(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact between springs."""
    e, mu, settings = coefficients
    tolerance, kappa = settings.tolerance, settings.stiffness_ratio
    frame = ContactFrame.of(contact)
    k, speed = frame.Knn, choose(certain(frame.un) < 0, lambda: -frame.un, lambda: 1 + 0 * frame.un)
    j = speed / k
    data = (frame.K11 / k, frame.K12 / k, frame.K22 / k, frame.K1n / k, frame.K2n / k)
    slip = frame.u1 / speed, frame.u2 / speed
    e_K = sum(map(error_of, data[2:]), error_of(data[0]) + 2 * error_of(data[1]))
    e_u, e_e, e_mu, e_kappa = (
        error_of(slip[0]) + error_of(slip[1]),
        error_of(e),
        error_of(mu),
        error_of(kappa),
    )
    e, mu, kappa = certain(e), minimum(certain(mu), GREATEST_FRICTION + 0 * certain(mu)), certain(kappa)
    A11, A12, A22, b1, b2 = map(certain, data)
    o, one = 0 * A11, 1 + 0 * A11

    # Axis 1 along the first slip; what is rounding across it is 0. Axes are fixed: slip may vary from them.
    v1, v2 = map(certain, slip)
    c1, c2 = map(fixed, map(certain, _direction(v1, v2, b1, b2)))
    s, across = c1 * v1 + c2 * v2, varying_as(o, lambda: c1 * v2 - c2 * v1)
    b1, b2 = c1 * b1 + c2 * b2, c1 * b2 - c2 * b1
    A11, A12, A22 = (
        c1 * c1 * A11 + 2 * c1 * c2 * A12 + c2 * c2 * A22,
        c1 * c2 * (A22 - A11) + (c1 * c1 - c2 * c2) * A12,
        c2 * c2 * A11 - 2 * c1 * c2 * A12 + c1 * c1 * A22,
    )
    A11, A12, A22, b1, b2, s = map(certain, (A11, A12, A22, b1, b2, s))
    trace = certain(A11 + A22)
    planar = (abs(b2) <= PLANAR * (1 + trace)) & (abs(A12) <= PLANAR * trace)
    lost_turn = choose(planar, lambda: abs(b2) + abs(A12), lambda: o)
    level = varying_as(o, lambda: b2), varying_as(o, lambda: A12)
    b2, A12 = choose(planar, lambda: level, lambda: (b2, A12))

    tolerance = choose(
        tolerance > 0,
        lambda: maximum(minimum(SHARE * tolerance, COARSEST + o), TOLERANCE + o),
        lambda: TOLERANCE + o,
    )
    springs = values(Springs(A11, A12, A22, b1, b2, s, across, mu, kappa, e, tolerance))
    y = iterate(_start(springs), lambda y: y.going > 0, lambda y: step(springs, y), STEPS)

    # The rest of the way, straight. All of this are values: the bound counts what is off.
    plastic, u_n = e < LEAST, certain(springs.velocity(y.P1, y.P2, y.Pn)[2])
    stiff = choose(y.unloads > 0, lambda: one / choose(plastic, lambda: one, lambda: e * e), lambda: one)
    rate = certain(choose(u_n > 0, lambda: stiff * u_n, lambda: one))
    left = certain(choose(plastic, lambda: o, lambda: y.F / rate))
    force = certain(square_root(y.a1 * y.a1 + y.a2 * y.a2))
    slides = (y.slips > 0) | (mu <= 0)
    grip = mu * y.F
    brief = minimum(certain(force / choose(mu > 0, lambda: mu, lambda: one) / rate), left)
    push = certain(choose(slides, lambda: -grip * left / 2, lambda: left - brief / 2))
    P1, P2, P_n = map(certain, (y.P1 + y.a1 * push, y.P2 + y.a2 * push, y.Pn + y.F * left / 2))
    P_n = for_derivatives(P_n, lambda: P_n * choose(y.going > 0, lambda: math.nan + o, lambda: one))
    w1, w2, w_n = springs.velocity(P1, P2, P_n)
    total = certain(-(P1 * (s + w1) + P2 * w2 + P_n * (w_n - 1)) / 2)
    lost = (1 - e) * (1 + e) * y.most * y.most / 2
    heat = maximum(total - lost, o)

    stuck = (y.stuck > 0) & (mu > 0)
    ahead = choose(stuck, lambda: 1.0 * Regime.STICKING + o, lambda: 1.0 * Regime.SLIDING + o)
    regime = choose(w1 * s < 0, lambda: 1.0 * Regime.REVERSED + o, lambda: ahead)
    regime = choose(y.jams > 0, lambda: 1.0 * Regime.JAMMED + o, lambda: regime)

    # The error, from values alone.
    minors = A11 * A22 - A12 * A12 + A11 - b1 * b1 + A22 - b2 * b2
    det = A11 * (A22 - b2 * b2) - A12 * (A12 - b1 * b2) + b1 * (A12 * b2 - A22 * b1)
    least = det / minors - e_K
    known = (least > 0) & (y.going <= 0)
    root = square_root(choose(known, lambda: least, lambda: one))
    size = 1 + abs(P1) + abs(P2) + P_n
    fine = (e_u + (e_K + lost_turn) * size) / root + 2 * e_e * y.most + e_mu * P_n * square_root(trace)
    fine = fine + (4 * e_kappa / kappa + PLANAR) * size + choose(plastic, lambda: e * y.most, lambda: o)
    E = SAFETY * (fine + y.doubt) * y.growth
    e_P = choose(known & (size > E), lambda: E / root, lambda: math.inf + o)
    P = Tangential(widened(c1 * P1 - c2 * P2, e_P) * j, widened(c2 * P1 + c1 * P2, e_P) * j)
    return Outcome(
        frame.to_world(P, widened(P_n, e_P) * j),
        regime,
        widened(lost, 2 * y.most * E) * (speed * j),
        widened(heat, 4 * (1 + s + y.most) * E) * (speed * j),
        unfinished=y.going > 0,
    )


def _direction(u1: Scalar, u2: Scalar, b1: Scalar, b2: Scalar) -> tuple[Scalar, Scalar]:
    """A unit vector along the first that is not 0, else along axis 1."""
    u, b = abs(u1) + abs(u2), abs(b1) + abs(b2)
    slips, coupled = u > 0, b > 0
    x = choose(slips, lambda: u1 / u, lambda: choose(coupled, lambda: b1 / b, lambda: 1 + 0 * b))
    y = choose(slips, lambda: u2 / u, lambda: choose(coupled, lambda: b2 / b, lambda: 0 * b))
    length = square_root(x * x + y * y)
    return x / length, y / length


def _start(springs: Springs) -> Course:
    """At first touch, or soon after where slip turns."""
    A11, A12, A22, b1, b2, s, across, mu, kappa, _, _ = springs
    o, one = 0 * s, 1 + 0 * s
    slips = (fixed(kappa * s) > mu) | (mu <= 0)  # no kink: there either does
    fastest = 1 + abs(b1) + abs(b2) + (mu + kappa) * (A11 + A22)
    lean = choose(slips, lambda: varying_as(o, lambda: across / s), lambda: o)
    w = b2 - mu * A12 - lean * (b1 + mu * (A22 - A11))
    turns = slips & negation((w == 0) & (lean == 0)) & (mu > 0)
    t = choose(turns, lambda: EARLY / square_root(fastest), lambda: o)
    turned = lean + t * t * w / choose(turns, lambda: 2 * s + 4 * mu / kappa, lambda: one)
    F = t - (1 - mu * b1) * t * t * t / 6
    P = t * t / 2 - (1 - mu * b1) * t * t * t * t / 24
    a1, a2 = choose(slips, lambda: (one, turned), lambda: (o, o))
    slip = choose(slips, lambda: one, lambda: o)
    h = 0.1 / square_root(fastest)
    sticks = choose(slips, lambda: o, lambda: one)
    return Course(
        a1, a2, F, -mu * P * slip, -mu * P * turned * slip, P, slip, o, F, h, one, one, o, sticks, o
    )
