"""MOREAU for several contacts: Newton's restitution at each, all at once, as time steppers converge to.

    u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0

so that a contact that separates never comes to approach, and friction opposes the slip after the
impact, as in the single contact. Without friction this is one linear complementarity problem; with it,
block Gauss-Seidel on

    P = proj_cone(P - rho (u+ + (e min(u_n, 0) + mu |u_t+|) n))

Unequal coefficients, and friction, may create energy: that is detected, and COULOMB answers, or
FRICTIONLESS.

Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988; De Saxce &
Feng, "The Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Jourdan,
Alart & Jean, "A Gauss-Seidel Like Algorithm to Solve Frictional Contact Problems", Comput. Methods
Appl. Mech. Eng. 155 (1998).
"""

from __future__ import annotations

from typing import Any

from .reflections import Struck


def one_step(cluster: Any, *, has_friction: bool) -> Struck | None:
    """The impulses; ``None`` if none are found."""
    found = cluster.project(cluster.none(), None, True)
    if found is None:
        return None
    p, error = found
    if not has_friction:
        return Struck(p, error=error)
    rubbed = cluster.one_step(p)
    if rubbed is None:
        return None
    p, tangential, off = rubbed
    return Struck(p, tangential, error + off)
