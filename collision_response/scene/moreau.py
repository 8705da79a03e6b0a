"""MOREAU for several contacts: Newton's restitution at each, all at once, as time steppers converge to.

    u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0

so that a contact that separates never comes to approach, and friction opposes the slip after the
impact, as in the single contact. Without friction this is one linear complementarity problem. With it,

    u_n+ + e min(u_n, 0) + s    s = mu |u_t+|

takes the place of ``u_n+ + e min(u_n, 0)``. With ``s`` held this is a convex programme, that of
``coulomb.py``, with one ``u+``; ``s`` begins at 0 and is renewed until it stays. So of several
solutions, of which there may be many where friction is great, always the same one is found, in whatever
order the contacts are given.

The error bound is an estimate: it looks at shifts beside those found, and how much nearer a round
takes them. Where it does not, as when contacts lock, or where several splits of a load leave several
``u+``, it is infinite.

Where ``s`` does not settle, or no velocities rebound from all contacts, COULOMB answers. Unequal
coefficients, and friction, may create energy: if more than 2^-40 of the work at the contacts, COULOMB
answers, or FRICTIONLESS.

Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988; De Saxce &
Feng, "The Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Acary, Cadoux,
Lemarechal & Malick, "A Formulation of the Linear Discrete Coulomb Friction Problem via Convex
Optimization", Z. Angew. Math. Mech. 91 (2011), for the convex programmes.
"""

from __future__ import annotations

from typing import Any

from .reflections import ClusterImpulses


def one_step(cluster: Any, *, has_friction: bool) -> ClusterImpulses | None:
    """The impulses; ``None`` if none are found."""
    found = cluster.one_step(has_friction)
    return None if found is None else ClusterImpulses(*found)
