"""L1, Newton's restitution without friction (and L0, the same for point masses).

The impulse has the direction of the normal, ``P = j n``, and reverses the normal velocity:

    n.u+ = -e n.u    with    u+ = u + K P

    =>  P = -(1 + e) (n.u) / (n.K n)  n

Both quotients are homogeneous in ``n``, so the normal need not be of unit length, no square root is
taken, and the law is rational: exact in exact arithmetic. The energy that is lost,
``(1 - e^2) (n.u)^2 / (2 n.K n)``, is never negative for ``e`` in [0, 1].

Source: Brach, *Mechanical Impact Dynamics*, 1991, ch. 2; Baraff, *Physically Based Modeling:
Rigid Body Simulation*, SIGGRAPH course notes 2001, eq. 8-18.
"""

from __future__ import annotations

from ..effective_mass import ContactKinematics
from .law import Coefficients, Outcome, Regime


def frictionless(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse of a contact without friction; only ``coefficients.restitution`` matters."""
    e = coefficients.restitution
    j = -contact.n_u / contact.n_Kn
    lost = (1 - e) * (1 + e) * j * -contact.n_u / 2
    j = (1 + e) * j
    return Outcome(contact.n * j, 1.0 * Regime.SLIDING, lost, lost * 0, normal_factor=j)
