"""Several contacts at once: :func:`resolve_scene`.

From the request to its answer:

    request.py        what is asked, checked, of plain floats or exact rationals
    clusters.py       contacts that share a movable body, directly or through others
    laws              reflections.py (FRICTIONLESS)  coulomb.py  moreau.py  stronge.py: one file each
    resolve_scene.py  puts these together
    answer.py         what comes out

The laws are written over a cluster, which knows what impulses do: ``collision_response.kernels._scene``
in double-double with a bound on its error, :mod:`~collision_response.scene.rational` exactly.
"""

from .answer import SceneImpact
from .resolve_scene import resolve_scene

__all__ = ["SceneImpact", "resolve_scene"]
