"""Coulomb friction in one step: Moreau's law, to which iterative engines converge.

The law applies Newton's restitution and Coulomb's law to the velocity *after* the impact. Let ``u_n`` be the
normal velocity before the impact and ``u_t`` the slip, with unit normal ``n``, and write ``K`` by its normal,
mixed and tangential parts ``K_nn``, ``K_tn``, ``K_tt``. The impulse has the normal part ``P_n`` and the
tangential part ``P_t = -f``:

    u_n+ = u_n + K_nn P_n - K_tn.f        u_t+ = u_t + K_tn P_n - K_tt f

**The slip equation.** The first equation with ``u_n+ = -e u_n`` gives ``P_n``; the second is then linear in
``f``:

    P_n  = j + beta.f      j = -(1 + e) u_n / K_nn      beta = K_tn / K_nn
    u_t+ = V - S f         V = u_t + j K_tn             S = K_tt - K_tn beta^T

``V`` is the slip that would remain without friction. ``S`` is the tangential part of ``K`` while the normal
velocity is held. Friction opposes the slip that remains, ``u_t+ = rho f`` with ``rho >= 0``, so
``f = (rho + S)^-1 V``, and

    stick    rho = 0         if |f| <= mu P_n then
    slip     |f| = mu P_n    otherwise: one equation for rho

**Scaling.** For rigid bodies ``S`` is positive definite. The inverse of the 2x2 matrix ``rho + S``, written
with its adjugate and determinant, and ``rho = sigma tr(S) / h``, turn the slip equation into

    F(sigma) = d + mu beta.x - |x| = 0        x = sigma v + h w        d = sigma^2 + h sigma + h^2 D

    v = c V      w = c W      W = adj(S) V / tr(S)      D = det(S) / tr(S)^2      h = mu c j tr(S)

    f = mu j g      g = x / d      u_t+ = rho f = sigma g / c

with ``1/c = |V| (1 + mu |beta|) + mu j tr(S)``, by 1-norms. With this ``c`` the roots ``sigma`` lie in [0, 1]
for any ``mu``, masses and speeds. There is always a root, and sometimes there are three; the law takes the
one that loses most energy. ``sliding.py`` finds it. The contact sticks if ``F(0) >= 0``.

**Mechanisms.** A mechanism may confine the contact to a plane that does not contain the normal. Then
``det(S) = 0``: friction cannot change the slip along the tangent ``z`` with ``S z = 0``. ``u`` lies in that
plane, so ``u_t.z = u_n beta.z`` and ``V.z = -e u_n beta.z``. Since ``adj(S)`` uses only this component, ``W``
is computed from ``-e u_n beta`` instead of ``V``. The contact sticks only for ``e = 0``; the least ``f`` is
then ``V / tr(S)``, and the condition is ``F'(0) >= 0``, as ``F(0) = 0``.

**Energy.** The law may *create* energy (Kane's paradox). If it does, the answer is that of Chatterjee &
Ruina's law, and says so. The losses are

    restitution    P_n (1 - e) |u_n| / 2        friction    f.(u_t + u_t+) / 2

Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988, section 9;
Kane & Levinson, *Dynamics: Theory and Applications*, 1985, section 5.8, for the paradox.
"""

from __future__ import annotations

import math

from ...numbers.operations import (
    Condition,
    Scalar,
    certain,
    choose,
    error_of,
    fixed,
    for_derivatives,
    negation,
    values,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .contact_frame import ContactFrame, Tangential
from .coulomb import fallback_where
from .law import Coefficients, Outcome, Regime, Solution
from .sliding import MARGIN, Sliding, safe_divisor

GREATEST_FRICTION = 1e100
"""More friction counts as this: what slips presses with less than 1e-100 of its impulse. The error bound
includes the difference."""

ROUNDING = 2.0**-44
"""An energy below this part of the work may be rounding, in numbers that do not bound their error."""


def moreau(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The one-step impulse, or that of COULOMB if the one-step impulse creates energy."""
    e, mu, _ = coefficients
    o = 0 * certain(mu)
    is_capped = certain(certain(mu) * (1 / GREATEST_FRICTION)) > 1  # a product, as float32 has no 1e100
    mu = choose(is_capped, lambda: GREATEST_FRICTION + o, lambda: mu)
    frame = ContactFrame.of(contact)
    K_nn, approach_speed = frame.Knn, -frame.un
    j = (1 + e) * approach_speed / K_nn
    u_t, K_tn = Tangential(frame.u1, frame.u2), Tangential(frame.K1n, frame.K2n)
    beta, V = K_tn / K_nn, u_t + K_tn * j
    S11, S12, S22 = frame.K11 - K_tn.x * beta.x, frame.K12 - K_tn.x * beta.y, frame.K22 - K_tn.y * beta.y
    trace = S11 + S22

    # c = unit * share. The answer does not depend on c, so c needs neither an error nor a derivative.
    share = fixed(certain(1 / (1 + mu)))
    scale = certain(share * (V.norm_1() + mu * (V.norm_1() * beta.norm_1() + j * trace)))
    unit = choose(scale < math.inf, lambda: certain(1 / safe_divisor(scale)), lambda: math.nan + o)
    unit = fixed(unit)
    s11, s12, s22 = S11 / trace, S12 / trace, S22 / trace
    is_locked = contact.has_locked_direction()
    V_for_W = choose(is_locked, lambda: beta * (e * approach_speed), lambda: V)
    W = Tangential(s22 * V_for_W.x - s12 * V_for_W.y, s11 * V_for_W.y - s12 * V_for_W.x)
    D = choose(is_locked, lambda: 0 * s11, lambda: s11 * s22 - s12 * s12)
    v, w, h, mu_beta = V * unit * share, W * unit * share, mu * share * (j * trace * unit), beta * mu
    w_length = w.length()
    F0_over_h = h * D + mu_beta.dot(w) - w_length
    t_dot_v = choose(certain(w_length) > 0, lambda: w.dot(v) / safe_divisor(w_length), lambda: v.length())
    F0_slope = h + mu_beta.dot(v) - t_dot_v

    def is_stuck(F0_over_h: Scalar, F0_slope: Scalar) -> Condition:
        return choose(is_locked, lambda: (F0_over_h >= 0) & (F0_slope >= 0), lambda: F0_over_h >= 0)

    sticks = is_stuck(F0_over_h, F0_slope)
    sliding = Sliding(v, w * h, h, h * h * D, mu_beta)
    root = values(sliding).root(
        certain(F0_over_h * h), certain(F0_slope),
        (certain(approach_speed) > 0) & negation(is_stuck(certain(F0_over_h), certain(F0_slope))),
        mu, values(u_t * unit * share), certain((1 - e) * approach_speed * unit * share),
    )  # fmt: skip
    error = sliding.error_radius(root.sigma, choose(is_capped, lambda: 1 + o, lambda: o))
    # A contact that slips may stick with more friction, if its impulse presses.
    may_stick = is_capped & negation(sticks) & (certain(F0_over_h + w_length) >= 0)
    known = (error < 1) & (root.ambiguous == 0) & negation(may_stick)
    sigma = widened(root.sigma, choose(known, lambda: error, lambda: 0 * error))
    sigma = varying_as(sigma, lambda: sliding.newton_correction(sigma))

    x = sliding.x(sigma)
    g = x / safe_divisor(sliding.d(sigma))
    most_friction = widened(mu, choose(is_capped, lambda: math.inf + o, lambda: o))
    f_slide = choose(known, lambda: g * mu * j, lambda: _in_cone(g * mu * j, most_friction * j, mu_beta))
    slip = choose(
        known,
        lambda: g / share * (sigma / unit),
        lambda: Tangential(V.x - S11 * f_slide.x - S12 * f_slide.y, V.y - S12 * f_slide.x - S22 * f_slide.y),
    )
    f_stuck = choose(is_locked, lambda: V / trace, lambda: W / (safe_divisor(D) * trace))
    has_friction = mu > 0
    with_friction = choose(sticks, lambda: f_stuck, lambda: f_slide)

    def no_friction() -> Tangential:
        return Tangential(varying_as(mu, lambda: with_friction.x), varying_as(mu, lambda: with_friction.y))

    f = choose(has_friction, lambda: with_friction, no_friction)
    slip = choose(sticks, lambda: V * 0, lambda: choose(has_friction, lambda: slip, lambda: V))
    P_n = j + beta.dot(f)

    regime = choose(u_t.dot(x) < 0, lambda: 1.0 * Regime.REVERSED, lambda: 1.0 * Regime.SLIDING)
    regime = choose(sticks, lambda: 1.0 * Regime.STICKING, lambda: regime)
    lost_restitution, lost_friction = P_n * (1 - e) * approach_speed / 2, f.dot(u_t + slip) / 2
    solution = Solution(frame.to_world(-f, P_n), regime, lost_restitution, lost_friction)
    creates_energy = _creates(lost_restitution + lost_friction, P_n * approach_speed + abs(f.dot(u_t)))
    answer = fallback_where(creates_energy, contact, coefficients, solution)
    return Outcome(*answer, fell_back=creates_energy, unfinished=root.unfinished > 0)


def _creates(lost: Scalar, work: Scalar) -> Condition:
    """Whether energy is created: numbers that bound their error must show it beyond that error.

    An exact tie, as for a rod that strikes head-on with ``e = 1`` and sticks, creates none. But next to a tie
    the answer jumps, so derivatives take each loss that may be rounding for one at the limit.
    """
    bounds_errors = error_of((1 + 0 * certain(work)) / 3) > 0
    is_shown = bounds_errors & (certain(lost) + error_of(lost) * (1 + MARGIN) < 0)
    limit = -ROUNDING * work

    def at_limit() -> Scalar:
        return choose(abs(lost) <= -limit, lambda: varying_as(limit, lambda: lost), lambda: lost)

    return is_shown | (for_derivatives(lost, at_limit) < limit)


def _in_cone(f: Tangential, mu_j: Scalar, mu_beta: Tangential) -> Tangential:
    """Friction of which only ``|f| <= mu P_n = mu (j + beta.f)`` is known: ``f`` with that as its error."""
    most = certain(mu_beta.norm_1() + error_of(mu_beta.x) + error_of(mu_beta.y)) * (1 + MARGIN)
    reach = choose(
        most < 1,
        lambda: 2 * certain(mu_j + error_of(mu_j)) * (1 + MARGIN) / safe_divisor(1 - most),
        lambda: math.inf + most,
    )
    return Tangential(widened(certain(f.x), reach), widened(certain(f.y), reach))
