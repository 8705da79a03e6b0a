"""MOREAU for several contacts: Newton's restitution at each, all at once. Time steppers converge to it.

    u_n+ + e min(u_n, 0) >= 0    complementary to    P_n >= 0

so that a contact that separates never comes to approach, and friction opposes the slip after the impact, as
for a single contact. Without friction this is one linear complementarity problem. With friction,

    u_n+ + e min(u_n, 0) + s    with the shift    s = mu |u_t+|

takes the place of ``u_n+ + e min(u_n, 0)``. For a given ``s`` this is a convex programme, the one of
``coulomb.py``, with a unique ``u+``. ``s`` starts at 0 and is updated until it no longer changes. If there
are several solutions, of which there may be many where friction is great, this always finds the same one, in
whatever order the contacts are given.

The error bound is an estimate. It tries shifts near the one found, and measures how much nearer one update
takes them. If it takes them no nearer, as when contacts lock, or when several ways to share a load lead to
several ``u+``, the bound is infinite.

COULOMB answers instead if ``s`` does not settle, or if no velocities rebound from all contacts. Unequal
coefficients, and friction, may create energy: if they create more than 2^-40 of the work at the contacts,
COULOMB answers, or FRICTIONLESS if there is no friction.

The computation is ``moreau`` of ``kernels/scene/cluster.hpp`` in double-double without friction, and
``moreau_with_friction`` of ``kernels/scene/friction.hpp`` in doubles.

Sources: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988; De Saxce &
Feng, "The Bipotential Method", Math. Comput. Model. 28 (1998), for the shift by mu |u_t|; Acary, Cadoux,
Lemarechal & Malick, "A Formulation of the Linear Discrete Coulomb Friction Problem via Convex
Optimization", Z. Angew. Math. Mech. 91 (2011), for the convex programmes.
"""

from __future__ import annotations

from typing import Any

from .impulses import ClusterImpulses


def moreau(cluster: Any, *, has_friction: bool) -> ClusterImpulses | None:
    """Return the impulses of MOREAU; ``None`` if none are found."""
    found = cluster.moreau(has_friction)
    return None if found is None else ClusterImpulses(*found)
