"""Several contacts at once: :func:`resolve_scene`.

From the request to its answer:

    resolve_scene.py      front door: check, divide into clusters, resolve each, combine their answers;
                          a cluster of one contact is resolved by resolve()
    request.py            the request, checked
    clusters.py           which contacts form a cluster, and which of them are copies of another
    resolve_cluster.py    resolve a cluster of several contacts:
        cluster.py        - its bodies and contacts, as the numbers that the laws compute with
        apply_law.py      - the impulses that a law gives, with its fallbacks
        impulses.py       - what impulses do to the bodies and contacts
    cluster_answer.py     the answer for one cluster;  answer.py: for the scene
    order_sensitivity.py  how much the answer depends on the order of impacts, if asked for

The laws: ``reflections.py`` (FRICTIONLESS), ``coulomb.py``, ``moreau.py`` and ``stronge.py``. Each states its
equations and its sources. Most of the arithmetic is in ``kernels/scene/``.

A law is given a *cluster*, which knows what impulses do to its bodies and contacts. There are two kinds:
``Cluster`` of ``kernels/cluster_object.cpp``, in double-double with a bound on its error, and the exact
:class:`~collision_response.scene.rational_cluster.RationalCluster`, which ``rational_algebra.py`` solves.

``kernels/resolve_scene.cpp`` takes the same steps without Python, for the usual scene: all numbers are
floats, clusters of several contacts have the law FRICTIONLESS, COULOMB or MOREAU, no contact is given twice,
and double-double is enough. It leaves every other scene, and every error, to Python.
"""

from .answer import SceneImpact
from .resolve_scene import resolve_scene

__all__ = ["SceneImpact", "resolve_scene"]
