"""COULOMB for several contacts: friction does the least work it can, beside the frictionless answer.

First GRR, without friction. Then, over all impulses P of the contacts that it loads, each in the cone
of friction of its own normal impulse, |P_t| <= mu P_n, the work on the relative velocities u,

    P.A P / 2 + u.P  ->  least         with the normal velocities after GRR kept

is a convex programme. GRR itself is admissible, so energy can't grow; the velocities of the least are
unique, since the programme is strictly convex in them, and so as symmetric as the scene. If another
contact then approaches, one more projection, with e = 0, keeps it from that; it takes energy too, and
only widens cones.

The work is that on relative velocities, not the kinetic energy: beside a moving floor the latter is not
the same for every observer.

A load is shared by all contacts that can carry it, to a change of its effect by 1e-4: so a box whose corners
are a hair from flat slides as one that is flat. What those of them that depend on others do to each other's
normal velocities, by that hair, is in the bound.

In the plane, where a contact sticks, and where normal and slip are uncoupled, this is Chatterjee &
Ruina's law of one contact. In space, sliding, it is not: the two differ by up to 23 % of the impulse.

Sources: Kaufman, Sueda, James & Pai, "Staggered Projections for Frictional Contact in Multibody
Systems", ACM Trans. Graph. 27 (2008), for maximal dissipation over actual cones; Smith et al. 2012 (see
``reflections.py``), for friction after reflections.
"""

from __future__ import annotations

from typing import Any

from .reflections import ClusterImpulses


def with_friction(cluster: Any, struck: ClusterImpulses) -> ClusterImpulses:
    """The impulses with friction, from those of GRR."""
    p, tangential, error = cluster.least_work(struck.p, struck.error)
    return struck._replace(p=p, tangential=tangential, error=error)
