"""Several contacts at once: :func:`resolve_scene`.

From the request to its answer:

    resolve_scene.py      front door: check, divide into clusters, resolve each, combine their answers;
                          a cluster of one contact is resolved by resolve()
    request.py            the request, checked
    find_clusters.py      which contacts form a cluster
    copies.py             which of these are copies of another, and their shares of its impulse
    resolve_cluster.py    resolve a cluster of several contacts:
        assemble.py       - its bodies and contacts, as the numbers that the laws compute with
        in_kernels.py     - a law in double-double, or in doubles where there is friction
        in_fractions.py   - a law in fractions, for rational scenes and for what the kernels leave undecided
    cluster_result.py     the result of a law, and the part of the answer for the scene that it is
    answer.py             the answer for the scene
    order_sensitivity.py  how much an order of impacts would change, if asked for; no law has an order

Each law has its derivation and its sources at the head of one file: FRICTIONLESS in ``frictionless.py``,
the others in ``coulomb.cpp``, ``moreau.cpp`` and ``routh_stronge.cpp`` of ``kernels/scene/``.

There are two kinds of cluster: ``Cluster`` of ``kernels/cluster_object.cpp``, in double-double with a bound
on its error, and the exact one of ``rational_cluster.py``, which ``rational_algebra.py`` solves.

``kernels/resolve_scene.cpp`` takes the same steps without Python, for the usual scene: all numbers are
floats, clusters of several contacts have the law FRICTIONLESS, COULOMB or MOREAU, no contact is given twice,
and double-double is enough. It leaves every other scene, and every error, to Python.
"""

from .answer import SceneImpact
from .resolve_scene import resolve_scene

__all__ = ["SceneImpact", "resolve_scene"]
