"""Springs along and across the normal with Coulomb friction between them: Stronge's bilinear compliance.

**Model.** The bodies are rigid except for a small region at the contact: a massless particle that is held by
a normal spring of stiffness ``k_n`` and a tangential spring of stiffness ``k_t = kappa k_n``, and that sticks
or slips. Let ``delta`` be the compression of the normal spring, ``x`` the deflection of the tangential one,
and ``F`` the force on body_a. With ``k_n = 1``,

    u' = K F        delta' = -u_n        F_t = -kappa x        P = int F dt        u+ = u + K P

    loading     F_n = delta                                     until u_n = 0
    unloading   F_n = (delta - (1 - e^2) delta_max) / e^2       and reloading, up to delta_max
    stick       x' = u_t                                        while kappa |x| < mu F_n
    slip        kappa |x| = mu F_n,  x' = u_t - lambda x/|x|    while lambda > 0
                lambda = (x/|x|).u_t - mu F_n' / kappa

The impact begins with stick if ``kappa |u_t| <= mu |u_n|``. It ends where ``F_n`` is 0: then ``F_t`` is 0
too, and the springs hold no energy. ``k_n`` drops out of the impulse: it only determines how long the impact
takes.

**Energy.** With the greatest normal force ``F_max``, the losses are

    restitution    (1 - e^2) F_max^2 / 2        friction    int mu F_n lambda dt

They are never negative for ``e`` in [0, 1]: the law creates no energy. As ``kappa`` grows, it approaches
ROUTH_STRONGE, with a difference of about ``kappa^(-1/2)``. If ``kappa`` is of order 1, the tangential spring
gives back within the same impact what it took: a sphere that comes in steeply ends with its contact moving
backwards.

**Units.** ``n.K n``, ``|u_n|`` before the impact and ``k_n`` are 1; the unit of impulse is
``j = |u_n| / n.K n``. ``A`` is the tangential part of ``K``, ``b`` that of ``K n``. Axis 1 is along the first
slip, or along ``b`` if there is none. Planar impacts and those of spheres stay on axis 1 exactly.

**Slip that turns.** In space, slip turns the tangential spring: its direction ``a = x/|x|`` turns at the rate
``kappa (q.u_t) / (mu F_n)``, with ``q`` perpendicular to ``a``. This is fast while ``F_n`` is small. So the
integration begins at the time ``t``, when ``F_n = t``, with the first term of the turn,
``coefficient t^2 q``:

    coefficient = w / (2 s + 4 mu / kappa)        w = q.(b - mu A a)        s = |u_t|

Little friction, fast slip and stiff springs make the equation stiff: ``a`` then follows the direction ``c``
of slip with the delay ``tau = mu F_n / (kappa s)``. Where ``tau`` and the rate ``w F_n / s`` at which slip
turns change little within that time, the spring need not be integrated: to second order, the sine of its lag
is

    tau w F_n / s (1 - g)        g = tau (2 F_n' / F_n - F_n / s (3 c.d + mu q.A q))        d = b - mu A c

Let ``late`` bound ``g``: then ``a`` errs by at most about the lag times ``late^2``, and the impulse by
``mu F_n dt`` times that. The bound counts it, and also that the spring begins to follow at once.

The rest of the path is straight once ``F_n`` has fallen to ``END F_max``. ``compliant_path.py`` integrates
what is in between.

**Error.** Let two solutions differ by ``(du, dF_t, dF_n)``. While the contact sticks,

    V = du.K^-1 du + dF_t^2 / kappa + w dF_n^2 / k        k = 1 in loading, 1 / e^2 in unloading

is constant with ``w = 1``. Slip adds to it only what the normal force does to friction. With ``a.dF_t`` left
out of ``V``, and any ``w``,

    V' <= 2 |v.du| |dF_n| + 2 mu |phi'| |dF_t| |dF_n| / kappa        v = (w - 1) n + mu a

while it turns by the angle ``phi``. A change to slip multiplies ``V`` by up to ``w``, and so does a slip at
first touch. A change to stick adds ``(a.dF_t)^2 / kappa = mu^2 dF_n^2 / kappa``. So errors, measured by the
root of ``V``, grow at most by the factor

    exp(int (v.K v k / w)^(1/2) / 2 dt + mu (k / (kappa w))^(1/2) / 2 |d phi|)    over the slip
    w^(1/2)                                                                     at each change to slip
    max(1, (1 + mu^2 k / kappa) / w)^(1/2)                                      at each change to stick

Of each slip, the lesser of two factors counts: with ``w = 1``, and with ``w = max(1, mu tr(A)^(1/2))``, which
makes the exponent of order ``(mu tr(A)^(1/2))^(1/2)`` in place of ``mu tr(A)^(1/2)``: much friction leaves
digits.

The errors of the data and of the steps, times this factor, divided by the root of the least eigenvalue of
``K``, bound ``dP`` to first order. The factor ``SAFETY`` covers the times when only one of two near solutions
slips.

**Little restitution.** As ``e`` falls to 0, so does the time of unloading. Meanwhile ``u`` and the tangential
spring keep still while the contact sticks, and with ``c = b.F_t`` at its beginning, and ``F_0 = F_n`` there,

    e^2 F_n'' = -(F_n + c)           until F_n = F_s = |F_t| / mu; then the contact slips:
    e^2 F_n'' = -(1 + c / F_s) F_n

So ``(e F_n')^2 = F_0^2 + 2 F_0 c - c F_s`` where ``F_n = 0``. If this is positive, the impulse of unloading
is of order ``e F_0``. Else the tangential spring presses the bodies together before ``F_n`` is 0, whatever
``e`` is. With ``e = 0`` the impact ends with compression in any case.

Sources: Stronge, *Impact Mechanics*, 2000, chapter 5; Maw, Barber & Fawcett, "The oblique impact of elastic
spheres", Wear 38 (1976), for the elastic bodies that the bilinear springs approximate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...numbers.operations import (
    Condition,
    Scalar,
    add_up,
    certain,
    choose,
    error_of,
    fixed,
    for_derivatives,
    iterate,
    maximum,
    minimum,
    negation,
    or_one,
    positive_part,
    square_root,
    values,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .compliant_path import LEAST_RESTITUTION, STEPS, Springs, State, step
from .contact_frame import ContactFrame, Tangential
from .law import Coefficients, Outcome, Regime

TOLERANCE = 1e-14
"""The finest tolerance of a step, and the default."""

COARSEST = 1e-9
"""The coarsest tolerance of a step."""

SHARE = 1 / 1024
"""The part of the tolerance of the model that a step may use."""

EARLY = 1e-4
"""The time at which the integration begins if slip turns, in units of the fastest spring's."""

PLANAR = 2.0**-49
"""Relative size up to which a component of u, b or A perpendicular to axis 1 is rounding."""

GREATEST_FRICTION = 1e8
"""More friction changes nothing but the very end of the impact, and the bound says so."""

SAFETY = 4.0


def compliant(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact with normal and tangential springs."""
    e, mu, settings = coefficients
    tolerance, kappa = settings.tolerance, settings.stiffness_ratio
    frame = ContactFrame.of(contact)
    speed = choose(certain(frame.un) < 0, lambda: -frame.un, lambda: 1 + 0 * frame.un)
    j = speed / frame.Knn
    data = frame.scaled_K()
    slip = Tangential(frame.u1 / speed, frame.u2 / speed)
    errors = InputErrors(
        add_up([error_of(data[0]) + 2 * error_of(data[1]), *map(error_of, data[2:])]),
        error_of(slip.x) + error_of(slip.y),
        error_of(e),
        error_of(mu),
        error_of(kappa),
    )
    e, mu, kappa = certain(e), minimum(certain(mu), GREATEST_FRICTION), certain(kappa)
    axis, flattened, (A11, A12, A22, b1, b2, s, slip_across) = _in_axes_of_slip(data, slip)
    o = 0 * A11
    tolerance = choose(
        tolerance > 0, lambda: maximum(minimum(SHARE * tolerance, COARSEST), TOLERANCE), lambda: TOLERANCE
    )
    given = Springs(A11, A12, A22, b1, b2, s, slip_across, mu, kappa, e, tolerance)
    springs = values(given)
    is_running = choose(frame.surely_separates(), lambda: o, lambda: 1 + o)
    start = _start(springs)._replace(is_running=is_running)
    y = iterate(start, lambda y: y.is_running > 0, lambda y: step(springs, y), STEPS)

    P1, P2, P_n = _impulse_at_end(springs, y, e, mu)
    w1, w2, w_n = springs.velocity(P1, P2, P_n)
    total = certain(-(P1 * (s + w1) + P2 * w2 + P_n * (w_n - 1)) / 2)
    lost = (1 - e) * (1 + e) * y.F_max * y.F_max / 2
    heat = positive_part(total - lost)

    stuck = (y.has_stuck > 0) & (mu > 0)
    forward = choose(stuck, lambda: 1.0 * Regime.STICKING, lambda: 1.0 * Regime.SLIDING)
    regime = choose(w1 * s < 0, lambda: 1.0 * Regime.REVERSED, lambda: forward)
    regime = choose(y.has_jammed > 0, lambda: 1.0 * Regime.JAMMED, lambda: regime)

    E, e_P = _error(given, y, Tangential(P1, P2), P_n, flattened, errors)
    P = Tangential(widened(axis.x * P1 - axis.y * P2, e_P) * j, widened(axis.y * P1 + axis.x * P2, e_P) * j)
    return Outcome(
        frame.to_world(P, widened(P_n, e_P) * j),
        regime,
        widened(lost, 2 * y.F_max * E) * (speed * j),
        widened(heat, 4 * (1 + s + y.F_max) * E) * (speed * j),
        unfinished=y.is_running > 0,
    )


def _in_axes_of_slip(
    data: tuple[Scalar, ...], slip: Tangential
) -> tuple[Tangential, Scalar, tuple[Scalar, ...]]:
    """The values of the data with axis 1 along the first slip.

    Components across it that are rounding become 0. For derivatives the axes are fixed, and the first slip
    may vary from them.

    Args:
        data: ``A11``, ``A12``, ``A22``, ``b1`` and ``b2``.
        slip: the first slip.

    Returns:
        Axis 1; the size of the components that became 0; and the data, the slip, and the slip across axis 1.
    """
    A11, A12, A22, b1, b2 = map(certain, data)
    o = 0 * A11
    v1, v2 = map(certain, slip)
    c1, c2 = map(fixed, map(certain, _direction(v1, v2, b1, b2)))
    s, slip_across = c1 * v1 + c2 * v2, varying_as(o, lambda: c1 * v2 - c2 * v1)
    b1, b2 = c1 * b1 + c2 * b2, c1 * b2 - c2 * b1
    A11, A12, A22 = (
        c1 * c1 * A11 + 2 * c1 * c2 * A12 + c2 * c2 * A22,
        c1 * c2 * (A22 - A11) + (c1 * c1 - c2 * c2) * A12,
        c2 * c2 * A11 - 2 * c1 * c2 * A12 + c1 * c1 * A22,
    )
    A11, A12, A22, b1, b2, s = map(certain, (A11, A12, A22, b1, b2, s))
    trace = certain(A11 + A22)
    planar = (abs(b2) <= PLANAR * (1 + trace)) & (abs(A12) <= PLANAR * trace)
    flattened = choose(planar, lambda: abs(b2) + abs(A12), lambda: o)
    flat = varying_as(o, lambda: b2), varying_as(o, lambda: A12)
    b2, A12 = choose(planar, lambda: flat, lambda: (b2, A12))
    return Tangential(c1, c2), flattened, (A11, A12, A22, b1, b2, s, slip_across)


def _impulse_at_end(springs: Springs, y: State, e: Scalar, mu: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """The impulse of the whole path, the rest of which is straight, in values: the bound counts its error."""
    o, one = 0 * y.F, 1 + 0 * y.F
    plastic, u_n = e < LEAST_RESTITUTION, certain(springs.velocity(y.P1, y.P2, y.Pn)[2])
    stiff = choose(y.unloads > 0, lambda: one / choose(plastic, lambda: one, lambda: e * e), lambda: one)
    fall = certain(choose(u_n > 0, lambda: stiff * u_n, lambda: one))
    time_left = certain(choose(plastic, lambda: o, lambda: y.F / fall))
    force = certain(square_root(y.a1 * y.a1 + y.a2 * y.a2))
    slides = (y.slips > 0) | (mu <= 0)
    friction = mu * y.F
    until_slip = minimum(certain(force / or_one(mu) / fall), time_left)
    along_a = certain(choose(slides, lambda: -friction * time_left / 2, lambda: time_left - until_slip / 2))
    P1, P2, P_n = map(certain, (y.P1 + y.a1 * along_a, y.P2 + y.a2 * along_a, y.Pn + y.F * time_left / 2))
    P_n = for_derivatives(P_n, lambda: P_n * choose(y.is_running > 0, lambda: math.nan + o, lambda: one))
    return P1, P2, P_n


class InputErrors(NamedTuple):
    """The errors of the data: of ``K``, of the first slip, of restitution, friction and stiffness ratio."""

    K: Scalar
    slip: Scalar
    e: Scalar
    mu: Scalar
    kappa: Scalar


def _error(
    springs: Springs, y: State, P_t: Tangential, P_n: Scalar, flattened: Scalar, errors: InputErrors
) -> tuple[Scalar, Scalar]:
    """The error of the path, measured by the root of ``V``, and that of the impulse; in values.

    Args:
        springs: the constants.
        y: the last state.
        P_t, P_n: the impulse.
        flattened: size of the components of the data that became 0.
        errors: of the data.
    """
    A11, A12, A22, b1, b2, s, _, mu, kappa, e, _ = springs
    o, one = 0 * A11, 1 + 0 * A11
    (w1, w2, w_n), plastic = springs.velocity(P_t.x, P_t.y, P_n), e < LEAST_RESTITUTION
    u_n = abs(w_n)
    # det / minors is a lower bound of the least eigenvalue of K.
    minors = A11 * A22 - A12 * A12 + A11 - b1 * b1 + A22 - b2 * b2
    det = A11 * (A22 - b2 * b2) - A12 * (A12 - b1 * b2) + b1 * (A12 * b2 - A22 * b1)
    least = det / minors - errors.K
    known = (least > 0) & (y.is_running <= 0)
    root = square_root(choose(known, lambda: least, lambda: one))
    size = 1 + abs(P_t.x) + abs(P_t.y) + P_n
    data_error = (errors.slip + (errors.K + flattened) * size) / root + 2 * errors.e * y.F_max
    data_error = data_error + errors.mu * P_n * square_root(certain(A11 + A22))
    data_error = data_error + (4 * errors.kappa / kappa + PLANAR) * size
    data_error = data_error + choose(plastic, lambda: e * y.F_max, lambda: o)
    E = SAFETY * (data_error + y.step_error) * minimum(y.growth, y.weighted)
    # Without restitution the impact ends where u_n is 0. If not, the forces acted too long or too short.
    # More friction than GREATEST_FRICTION would hold until F_n is 0, and not only until kappa |x| = mu F_n.
    grip = choose(y.slips > 0, lambda: -mu * y.F, lambda: one)
    F1, F2 = grip * y.a1, grip * y.a2
    capped = (mu >= GREATEST_FRICTION) & negation(plastic)
    missed = choose(plastic, lambda: (abs(F1) + abs(F2) + y.F) * (E + u_n), lambda: o)
    missed = choose(capped, lambda: kappa * (1 + s * s) / (root * root * mu), lambda: missed)
    rate = choose(plastic, lambda: y.F + b1 * F1 + b2 * F2, lambda: one)
    rate = choose(capped, lambda: u_n / (e * e), lambda: rate)
    # u_n then reaches 0 surely, if it rises beyond by more than its error, and did not do so before.
    turn = choose(y.slips > 0, lambda: y.a1 * w2 - y.a2 * w1, lambda: one)
    bend = choose(y.slips > 0, lambda: (b2 * y.a1 - b1 * y.a2) * turn, lambda: b1 * w1 + b2 * w2)
    is_sure = (y.crest > 2 * E) & (rate * rate > 4 * E * kappa * bend)
    is_sure = is_sure & ((e <= 0) | _surely_returns(y, F1, F2, b1 * F1 + b2 * F2, mu))
    known = known & (rate > 0) & (size > E) & (negation(plastic) | is_sure)
    missed = missed / or_one(rate)
    return E, choose(known, lambda: E / root + missed, lambda: math.inf + o)


def _surely_returns(y: State, F1: Scalar, F2: Scalar, pressure: Scalar, mu: Scalar) -> Condition:
    """Whether little restitution lets the normal force fall to 0 at once: see "Little restitution" above.

    ``-e F_n'`` ends at ``F_0 / SAFETY`` or more, so the impulse is at most about ``SAFETY e F_0``.
    """
    slips_at = square_root(F1 * F1 + F2 * F2) / or_one(mu)
    rate_squared = y.F * (y.F + 2 * pressure) - pressure * slips_at
    return SAFETY * SAFETY * rate_squared > y.F * y.F


def _direction(u1: Scalar, u2: Scalar, b1: Scalar, b2: Scalar) -> tuple[Scalar, Scalar]:
    """A unit vector along ``u`` if it is not 0, else along ``b`` if that is not 0, else along axis 1."""
    u, b = abs(u1) + abs(u2), abs(b1) + abs(b2)
    slips, coupled = u > 0, b > 0
    x = choose(slips, lambda: u1 / u, lambda: choose(coupled, lambda: b1 / b, lambda: 1 + 0 * b))
    y = choose(slips, lambda: u2 / u, lambda: choose(coupled, lambda: b2 / b, lambda: 0 * b))
    length = square_root(x * x + y * y)
    return x / length, y / length


def _start(springs: Springs) -> State:
    """The state at first touch; if slip turns, soon after it: see "Slip that turns" above."""
    A11, A12, A22, b1, b2, s, slip_across, mu, kappa, _, _ = springs
    o, one = 0 * s, 1 + 0 * s
    slips = (fixed(kappa * s) > mu) | (mu <= 0)  # fixed: at the limit both give the same, so there is no kink
    fastest = 1 + abs(b1) + abs(b2) + (mu + kappa) * (A11 + A22)
    # Slip that begins so near the limit that it ends before `early` counts as stick. Its lambda is `above` at
    # first, and falls by slowing t^2 / 2.
    early = EARLY / square_root(fastest)
    above = choose(mu > 0, lambda: fixed(s) - fixed(mu / kappa), lambda: one)
    slowing = mu * A11 - b1 - mu / kappa * (1 - mu * b1)
    ends = slips & (above < slowing * early * early)
    ignored = choose(ends, lambda: square_root(kappa) * early * abs(above), lambda: o)
    slips = slips & negation(ends)
    angle = choose(slips, lambda: varying_as(o, lambda: slip_across / s), lambda: o)
    w = b2 - mu * A12 - angle * (b1 + mu * (A22 - A11))
    turns = slips & negation((w == 0) & (angle == 0)) & (mu > 0)
    t = choose(turns, lambda: early, lambda: o)
    turned = angle + t * t * w / choose(turns, lambda: 2 * s + 4 * mu / kappa, lambda: one)
    F = t - (1 - mu * b1) * t * t * t / 6
    P = t * t / 2 - (1 - mu * b1) * t * t * t * t / 24
    a1, a2 = choose(slips, lambda: (one, turned), lambda: (o, o))
    slip = choose(slips, lambda: one, lambda: o)
    h = 0.1 / square_root(fastest)
    sticks = choose(slips, lambda: o, lambda: one)
    weighted = square_root(choose(slips, springs.weight, lambda: one))
    return State(
        a1, a2, F, -mu * P * slip, -mu * P * turned * slip, P, slip, o, F, h, one, one, weighted,
        step_error=ignored, has_stuck=sticks, has_jammed=o, crest=one,
    )  # fmt: skip
