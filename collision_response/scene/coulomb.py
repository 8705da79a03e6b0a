"""COULOMB for several contacts: the frictionless answer, then the friction that does the least work.

First comes the answer without friction, by generalised reflections with restitution: GRR, ``reflections.py``.
The contacts that it loads may then have any impulses P in the friction cones of their own normal impulses,
|P_t| <= mu P_n. Of those that keep the normal velocities of GRR, the law takes the P with the least work on
the relative velocities u:

    P.A P / 2 + u.P  ->  min

This is a convex programme. The impulses of GRR are admissible in it, so energy cannot grow. It is strictly
convex in the velocities, so these are unique, and as symmetric as the scene. If another contact then
approaches, one more projection, with e = 0, stops that. It only takes energy, too; and because it adds normal
impulse, friction stays in its cones.

The work is that on relative velocities, not the change of kinetic energy: next to a moving floor, the latter
depends on the observer.

All contacts that can carry a load share it, if that hardly changes its effect. So a box whose corners are
slightly off a plane slides like one whose corners are in it. Where normals or lever arms differ by more than
about 1e-4, a contact that the load does not need takes less and less part in it. Nor are normal velocities
kept where such small differences decide them. Both change gradually, so that no choice of contacts has to be
made, which would depend on their order.

For one contact this is Chatterjee & Ruina's law in each of three cases: in the plane; where the contact
sticks; and where normal and slip are uncoupled. In space, sliding, they differ by up to 23 % of the impulse.

The computation is ``least_work_friction`` of ``kernels/scene/friction.hpp``, which solves the programme with
``kernels/scene/cones.hpp``.

Sources: Kaufman, Sueda, James & Pai, "Staggered Projections for Frictional Contact in Multibody
Systems", ACM Trans. Graph. 27 (2008), for maximal dissipation over actual cones; Smith et al. 2012 (see
``reflections.py``), for friction after reflections.
"""

from __future__ import annotations

from ..kernels import library
from .impulses import ClusterImpulses


def add_friction(cluster: library.Cluster, impulses: ClusterImpulses) -> ClusterImpulses:
    """Return the impulses with friction, from those of GRR."""
    normal, tangential, error, *_ = cluster.least_work_friction(impulses.normal, impulses.error)
    return impulses._replace(normal=normal, tangential=tangential, error=error)
