"""Coulomb friction in closed form: Chatterjee & Ruina's law.

Two impulses frame the answer. ``P_I`` ends the approach without friction, ``P_II`` brings the contact to
rest. With ``u_I = u + K P_I``, the relative velocity after the first,

    P_I = j n        j = -n.u / (n.K n)        P_II = -K^-1 u        D = P_II - P_I = -K^-1 u_I

Since ``n.K D = -n.u_I = 0``, adding any multiple of ``D`` leaves the normal velocity alone. The law is

    P = (1 + e) P_I + kappa D

so that ``n.u+ = -e n.u`` exactly. ``kappa`` is ``1 + e_t`` if the impulse is then in the friction cone,
``|P_t| <= mu P_n``. Otherwise it is the ``kappa`` on the cone. With the parts ``D_n`` along the normal and
``D_t`` across it,

    P_n = (1 + e) j + kappa D_n        |P_t| = kappa |D_t|

    in the cone    (1 + e_t) |D_t| <= mu ((1 + e) j + (1 + e_t) D_n)
    on the cone    kappa = mu (1 + e) j / (|D_t| - mu D_n)

The denominator is positive whenever the first condition fails. In the code ``n`` has any length: the
vectors are ``j n`` and ``D_n n``, and ``|D_t|`` is divided by ``|n|``.

**Energy.** ``P_I`` and ``D`` are orthogonal in the metric of ``K``, and ``u.D = -D.K D``. So the change of
energy ``u.P + P.K P / 2`` separates into the losses

    restitution    (1 - e^2) j^2 (n.K n) / 2
    friction       kappa (2 - kappa) D.K D / 2        K D = -u_I

Neither is negative for ``e`` in [0, 1] and ``kappa`` in [0, 2], that is for ``e_t`` in [-1, 1].

Source: Chatterjee & Ruina, "A New Algebraic Rigid-Body Collision Law Based on Impulse Space
Considerations", J. Appl. Mech. 65 (1998) 939-951, eqs. 17-22.
"""

from __future__ import annotations

from ...numbers.operations import (
    Condition,
    Scalar,
    called,
    choose,
    is_out_of_range,
    or_one,
    positive_part,
    square_root,
    varying_as,
)
from ..effective_mass import ContactKinematics, ContactNumbers
from .law import Coefficients, Outcome, Regime, Solution, slip_regime


def coulomb(contact: ContactKinematics | ContactNumbers, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact with Coulomb friction and tangential restitution."""
    e, mu, settings = coefficients
    e_t = settings.tangential_restitution
    n, u, K = contact.n, contact.u, contact.inverse_effective_mass()
    nn, Kn = n.dot(n), K @ n
    j = -contact.n_u / contact.n_Kn
    u_I = u + Kn * j
    D = -contact.regularized(K).solve(u_I)
    D_n = n.dot(D) / nn
    D_t = D - n * D_n
    D_t_squared = D_t.dot(D_t)

    kappa_stick = 1 + e_t
    friction_limit = mu * ((1 + e) * j + kappa_stick * D_n)
    in_cone = (friction_limit >= 0) & (
        kappa_stick * kappa_stick * D_t_squared <= friction_limit * friction_limit * nn
    )

    def kappa_on_cone() -> Scalar:
        kappa = mu * (1 + e) * j / or_one(square_root(D_t_squared / nn) - mu * D_n)
        return choose(mu > 0, lambda: kappa, lambda: varying_as(mu, lambda: kappa))

    kappa = choose(in_cone, lambda: kappa_stick, kappa_on_cone)
    P = n * ((1 + e) * j) + D * kappa
    regime = choose(in_cone, lambda: 1.0 * Regime.STICKING, lambda: slip_regime(contact, u + K @ P))
    lost_restitution = (1 - e) * (1 + e) * j * -contact.n_u / 2
    D_KD = -D.dot(u_I)
    lost_friction = kappa * (2 - kappa) * positive_part(D_KD) / 2  # D_KD is below 0 only by rounding
    size = D_t_squared + j * j * nn
    return Outcome(P, regime, lost_restitution, lost_friction, out_of_range=is_out_of_range(size, size / nn))


def fallback_where(
    fails: Condition, contact: ContactKinematics | ContactNumbers, coefficients: Coefficients, own: Solution
) -> Solution:
    """The solution of this law where another law fails, else ``own``, the other law's solution."""

    def of_this_law() -> Solution:
        numbers = ContactNumbers.of(contact)
        numbers = numbers._replace(regularized_K=contact.regularized(numbers.K))
        return called(fallback, numbers, coefficients)

    return choose(fails, of_this_law, lambda: own)


def fallback(contact: ContactNumbers, coefficients: Coefficients) -> Solution:
    """:func:`coulomb` in the form that other laws call: compiled, it is a function of its own."""
    return Solution(*coulomb(contact, coefficients)[:4])
