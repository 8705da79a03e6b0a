"""L3, Coulomb friction in one step: Moreau's law, to which iterative engines converge.

The normal velocity is reversed, ``u_n+ = -e u_n``, and Coulomb's law is applied to the velocity *after*
the impact. Without friction the normal impulse would be ``j`` and the slip left ``V``. Friction ``-f``
adds ``beta.f`` to the normal impulse and takes ``S f`` from the slip, where ``S`` is the compliance across
a normal whose velocity is held:

    j = -(1 + e) u_n / K_nn     beta = K_tn / K_nn     V = u_t + j K_tn     S = K_tt - K_tn beta
    P_n = j + beta.f            P_t = -f               u_t+ = V - S f

Friction opposes the slip that remains: ``u_t+ = rho f`` with ``rho >= 0``. So ``f = (rho + S)^-1 V``, and

    stick   rho = 0         if |f| <= mu P_n
    slide   |f| = mu P_n    one equation for rho

Of rigid bodies ``S`` is positive definite: no slide is lost by this, and ``rho + S`` is never singular.
Without fractions the equation is that of ``sliding.py``, whose ``sigma`` in [0, 1] is ``rho`` in units of
``tr(S) / h``:

    x = sigma v + h w     d = sigma^2 + h sigma + h^2 D     d + mu beta.x = |x|     f = mu j x / d

    v = c V     w = adj(S) v / tr(S)     D = det(S) / tr(S)^2     h = mu c j tr(S)

with any ``c > 0``; it is chosen such that ``mu``, masses and speeds may have any size. There is always a
solution, and sometimes there are three: the one that loses most energy is then taken.

A mechanism may move the contact in a plane alone that does not hold the normal. Then ``det(S) = 0``: friction
changes the slip along one tangent, and along the other it is what restitution makes of it, so ``w`` is that
of ``-e u_n beta`` in place of ``V``. Only for ``e = 0`` does the contact stick, and the least such ``f`` is
``V / tr(S)``.

The law may *create* energy (Kane's paradox). That is detected; the answer is then Chatterjee & Ruina's,
and says so.

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
    negation,
    values,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .chatterjee_ruina import fallback_where
from .contact_frame import ContactFrame, Tangential
from .law import Coefficients, Outcome, Regime, Solution
from .sliding import NEAR, Sliding, divisor

ROUNDING = 2.0**-44
"""An energy that is less than this part of the work may be rounding, in numbers that bound no error."""


def moreau(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The one-step impulse, or Chatterjee & Ruina's where that one creates energy."""
    e, mu, _ = coefficients
    frame = ContactFrame.of(contact)
    k, approach = frame.Knn, -frame.un
    j = (1 + e) * approach / k
    u, K_tn = Tangential(frame.u1, frame.u2), Tangential(frame.K1n, frame.K2n)
    beta, V = K_tn / k, u + K_tn * j
    S11, S12, S22 = frame.K11 - K_tn.x * beta.x, frame.K12 - K_tn.x * beta.y, frame.K22 - K_tn.y * beta.y
    trace = S11 + S22

    # c = unit * share: all that follows is relative to it, so that it need not vary
    share = fixed(certain(1 / (1 + mu)))
    scale = certain(share * (V.size() + mu * (V.size() * beta.size() + j * trace)))
    unit = fixed(certain(1 / divisor(scale)))
    s11, s12, s22 = S11 / trace, S12 / trace, S22 / trace
    locks = contact.has_locked_direction()
    left = choose(locks, lambda: beta * (e * approach), lambda: V)
    W = Tangential(s22 * left.x - s12 * left.y, s11 * left.y - s12 * left.x)
    det = choose(locks, lambda: 0 * s11, lambda: s11 * s22 - s12 * s12)
    v, w, h, mu_beta = V * unit * share, W * unit * share, mu * share * (j * trace * unit), beta * mu
    w_length = w.length()
    spare = h * det + mu_beta.dot(w) - w_length
    turned = choose(certain(w_length) > 0, lambda: w.dot(v) / divisor(w_length), lambda: v.length())
    slope = h + mu_beta.dot(v) - turned

    def is_held(spare: Scalar, slope: Scalar) -> Condition:
        return choose(locks, lambda: (spare >= 0) & (slope >= 0), lambda: spare >= 0)

    sticks = is_held(spare, slope)
    sliding = Sliding(v, w * h, h, h * h * det, mu_beta)
    root = values(sliding).solution(
        certain(spare * h), certain(slope),
        (certain(approach) > 0) & negation(is_held(certain(spare), certain(slope))),
        mu, values(u * unit * share), certain((1 - e) * approach * unit * share),
    )  # fmt: skip
    doubt = sliding.doubt(root.sigma)
    known = (doubt < 1) & (root.open == 0)
    sigma = widened(root.sigma, choose(known, lambda: doubt, lambda: 0 * doubt))
    sigma = varying_as(sigma, lambda: sliding.variation(sigma))

    x = sliding.x(sigma)
    g = x / divisor(sliding.d(sigma))
    slide = choose(known, lambda: g * mu * j, lambda: _in_cone(g * mu * j, mu * j, mu_beta))
    slip = choose(
        known,
        lambda: g / share * (sigma / unit),
        lambda: Tangential(V.x - S11 * slide.x - S12 * slide.y, V.y - S12 * slide.x - S22 * slide.y),
    )
    stuck = choose(locks, lambda: V / trace, lambda: W / (divisor(det) * trace))
    rubs = mu > 0
    held = choose(sticks, lambda: stuck, lambda: slide)
    f = choose(
        rubs, lambda: held, lambda: Tangential(varying_as(mu, lambda: held.x), varying_as(mu, lambda: held.y))
    )
    slip = choose(sticks, lambda: V * 0, lambda: choose(rubs, lambda: slip, lambda: V))
    P_n = j + beta.dot(f)

    regime = choose(u.dot(x) < 0, lambda: 1.0 * Regime.REVERSED, lambda: 1.0 * Regime.SLIDING)
    regime = choose(sticks, lambda: 1.0 * Regime.STICKING, lambda: regime)
    lost_restitution, lost_friction = P_n * (1 - e) * approach / 2, f.dot(u + slip) / 2
    own = Solution(frame.to_world(-f, P_n), regime, lost_restitution, lost_friction)
    creates_energy = _creates(lost_restitution + lost_friction, P_n * approach + abs(f.dot(u)))
    answer = fallback_where(creates_energy, contact, coefficients, own)
    return Outcome(*answer, fell_back=creates_energy, unfinished=root.unfinished > 0)


def _creates(lost: Scalar, work: Scalar) -> Condition:
    """Whether energy is created: where numbers bound their error, as soon as they show it.

    Nothing decides an exact tie, as of a rod that strikes head-on with ``e = 1`` and sticks: it creates none.
    """
    bounds_errors = error_of(certain(work) / 3) > 0
    is_shown = bounds_errors & (certain(lost) + error_of(lost) * (1 + NEAR) < 0)
    return is_shown | (lost < -ROUNDING * work)


def _in_cone(f: Tangential, mu_j: Scalar, mu_beta: Tangential) -> Tangential:
    """Friction of which no more is known than ``|f| <= mu P_n = mu (j + beta.f)``."""
    most = certain(mu_beta.size() + error_of(mu_beta.x) + error_of(mu_beta.y)) * (1 + NEAR)
    reach = choose(
        most < 1,
        lambda: 2 * certain(mu_j + error_of(mu_j)) * (1 + NEAR) / divisor(1 - most),
        lambda: math.inf + most,
    )
    return Tangential(widened(certain(f.x), reach), widened(certain(f.y), reach))
