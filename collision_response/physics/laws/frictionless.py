"""Newton's restitution without friction.

The impulse acts along the normal, ``P = j n``, and reverses the normal velocity:

    n.u+ = -e n.u        u+ = u + K P

Hence

    j = -(1 + e) (n.u) / (n.K n)

The law is independent of the length of ``n``, takes no square root and is rational: it is exact in exact
arithmetic. The energy lost,

    (1 - e^2) (n.u)^2 / (2 n.K n)

is never negative for ``e`` in [0, 1].

Source: Brach, *Mechanical Impact Dynamics*, 1991, ch. 2; Baraff, *Physically Based Modeling:
Rigid Body Simulation*, SIGGRAPH course notes 2001, eq. 8-18.
"""

from __future__ import annotations

from ..effective_mass import ContactKinematics
from .law import Coefficients, Outcome, Regime


def frictionless(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact without friction; only ``coefficients.restitution`` is used."""
    e = coefficients.restitution
    j_plastic = -contact.n_u / contact.n_Kn
    lost = (1 - e) * (1 + e) * j_plastic * -contact.n_u / 2
    j = (1 + e) * j_plastic
    return Outcome(contact.n * j, 1.0 * Regime.SLIDING, lost, lost * 0, normal_factor=j)
