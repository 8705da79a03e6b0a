"""Several contacts at once: :func:`resolve_scene`.

From the request to its answer:

    resolve_scene.py  the front door: check, divide, answer each cluster, put together
    request.py        what is asked, checked
    clusters.py       contacts that share a movable body, directly or through others
    alone.py          a cluster of one contact;  several.py: of more, by
    laws              reflections.py (FRICTIONLESS)  coulomb.py  moreau.py  stronge.py: one file each
    answered.py       what becomes of one cluster;  answer.py: of the scene

A scene of floats in which nothing is unusual goes no further than the front door: ``usual`` in
``kernels/scene.cpp`` answers it, by the same steps. Unusual are a cluster of one contact, a contact given
twice, a restitution that is a function, fractions, ROUTH_STRONGE, what needs more digits, and faults.

The laws are written over a cluster, which knows what impulses do: ``collision_response.kernels._scene``
in double-double with a bound on its error, :mod:`~collision_response.scene.rational_cluster` exactly.
"""

from .answer import SceneImpact
from .resolve_scene import resolve_scene

__all__ = ["SceneImpact", "resolve_scene"]
