"""L2, Coulomb friction in closed form: Chatterjee & Ruina.

Two impulses frame the answer: the frictionless perfectly plastic one, and the one that brings the
contact to rest,

    P_I = -n (n.u) / (n.K n)          P_II = -K^-1 u

Their difference ``D = P_II - P_I = -K^-1 (u + K P_I)`` is K-orthogonal to the normal, so adding any
part of it leaves the normal velocity alone. The law is

    P = (1 + e) P_I + kappa D

with ``kappa = 1 + e_t`` if that lies in the friction cone ``|P_t| <= mu P_n``, else with the
``kappa`` on the cone,

    kappa = mu (1 + e) P_I,n / (|D_t| - mu D_n)

whose denominator is positive there. Hence ``n.u+ = -e n.u`` exactly. Along ``kappa`` the energy is a
parabola, symmetric about ``kappa = 1``: for ``kappa`` in [0, 2] friction never adds any, and the law
cannot create energy for ``e`` in [0, 1] and ``e_t`` in [-1, 1]. No iteration, no branch but the cone.
The two losses separate: restitution takes ``(1 - e^2) j^2 (n.Kn) / 2``, with ``P_I = j n``, and friction
``kappa (2 - kappa) D.KD / 2``, where ``K D = -(u + K P_I)``.

Source: Chatterjee & Ruina, "A New Algebraic Rigid-Body Collision Law Based on Impulse Space
Considerations", J. Appl. Mech. 65 (1998) 939-951, eqs. 17-22.
"""

from __future__ import annotations

from ...numbers.operations import Condition, Scalar, called, choose, leave_range, square_root, varying_as
from ..effective_mass import ContactKinematics, ContactNumbers
from .law import Coefficients, Outcome, Regime, Solution, slip_regime


def chatterjee_ruina(contact: ContactKinematics | ContactNumbers, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact with Coulomb friction and tangential restitution."""
    e, mu, settings = coefficients
    e_t = settings.tangential_restitution
    n, u, K = contact.n, contact.u, contact.inverse_effective_mass()
    nn, Kn = n.dot(n), K @ n
    j = -contact.n_u / contact.n_Kn
    plastic = u + Kn * j
    D = -contact.impulse_for(K, plastic)
    D_n = n.dot(D) / nn
    D_t = D - n * D_n
    slip = D_t.dot(D_t)

    stick = 1 + e_t
    reach = mu * ((1 + e) * j + stick * D_n)
    in_cone = (reach >= 0) & (stick * stick * slip <= reach * reach * nn)

    def on_cone() -> Scalar:
        slope = square_root(slip / nn) - mu * D_n
        reached = mu * (1 + e) * j / choose(slope > 0, lambda: slope, lambda: slope * 0 + 1)
        return choose(mu > 0, lambda: reached, lambda: varying_as(mu, lambda: reached))

    kappa = choose(in_cone, lambda: stick, on_cone)
    P = n * ((1 + e) * j) + D * kappa
    regime = choose(in_cone, lambda: 1.0 * Regime.STICKING, lambda: slip_regime(contact, u + K @ P))
    lost_restitution = (1 - e) * (1 + e) * j * -contact.n_u / 2
    lost_friction = -(kappa * (2 - kappa)) * D.dot(plastic) / 2
    size = slip + j * j * nn
    return Outcome(P, regime, lost_restitution, lost_friction, out_of_range=leave_range(size, size / nn))


def fallback_where(
    fails: Condition, contact: ContactKinematics | ContactNumbers, coefficients: Coefficients, own: Solution
) -> Solution:
    """The answer of another law; this one's where that has none that is sound."""

    def instead() -> Solution:
        seen = ContactNumbers.of(contact)
        return called(fallback, seen._replace(regularized_K=contact.regularized(seen.K)), coefficients)

    return choose(fails, instead, lambda: own)


def fallback(contact: ContactNumbers, coefficients: Coefficients) -> Solution:
    """:func:`chatterjee_ruina` for other laws."""
    return Solution(*chatterjee_ruina(contact, coefficients)[:4])
