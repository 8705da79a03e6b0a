"""FRICTIONLESS for several contacts: generalised reflections.

The inelastic projection of a velocity keeps a set V of contacts from approaching by the least change,
in the metric of kinetic energy; it is unique, and so is the reflection at it:

    q = argmin_{q >= 0} |v + M^-1 N_V q|         P(v) = v + M^-1 N_V q         R(v) = v + 2 M^-1 N_V q

GR, for e = 1: reflect at all contacts that approach faster than the threshold, at once, until there are
none. A reflection keeps the energy. All at once: so the answer is as symmetric as the scene, and
depends on no order.

GRR, for e < 1:      p = e p_GR + (1 - e) p_P          p_P: of one projection at all contacts

Every step leaves v in exactly known linear relation to the impulses, and neither P nor R lets two
velocities part: errors add and do not grow. What jumps is which contacts are in V: that a velocity is
below the threshold must be certain.

Sources: Smith, Kaufman, Vouga, Tamstorf & Grinspun, "Reflections on Simultaneous Impact", ACM Trans.
Graph. 31 (2012); Vouga, Smith, Kaufman, Tamstorf & Grinspun, "All's Well That Ends Well", ACM Trans.
Graph. 36 (2017), that it ends.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..numbers.number import Scalar
from ..status import ImpactError, StatusCode

REFLECTIONS = 10_000
"""A budget. A chain of n equal balls takes n."""


class Struck(NamedTuple):
    """What a law gives for a cluster.

    Attributes:
        p: impulses along the normals.
        tangential: across them, or ``None``.
        error: of the velocities, in the metric of kinetic energy.
        margin: the least distance of a decision from its threshold, relative to the fastest approach.
        restitution: of all contacts, or ``None``: each has its own.
        fell_back: whether the law had no sound answer, and this is another's.
    """

    p: Any
    tangential: list[float] | None = None
    error: float = 0.0
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    fell_back: bool = False


def compiled_reflections(cluster: Any, threshold: float) -> Struck:
    """The impulses of GRR by the kernels, with a bound on their error: see ``kernels/scene/reflections.hpp``.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS or PATH_TOO_LONG.
    """
    found = cluster.reflections(threshold, REFLECTIONS)
    if found is False:
        raise contradictory()
    if found is True:
        raise endless()
    p, error, margin, restitution = found
    return Struck(p, None, error, margin, restitution)


def reflections(cluster: Any, threshold: Scalar) -> Struck:
    """The impulses of GRR, without error.

    Args:
        cluster: of rational numbers.
        threshold: below this part of the fastest approach a contact does not count as approaching.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS or PATH_TOO_LONG.
    """
    zero = cluster.none()
    speed, _ = cluster.approach()
    if not speed > 0:
        return Struck(zero)
    first = _projection(cluster, zero, None)
    e, _ = cluster.joined_restitution(first)
    inelastic, _ = cluster.combine(1, zero, 1, first)
    if not e > 0:
        return Struck(inelastic, restitution=e)
    p, margin = zero, math.inf
    for _ in range(REFLECTIONS):
        violated, near, _ = cluster.violated(p, 0.0, threshold * speed, 0.0)
        margin = min(margin, near / speed)
        if not violated:
            break
        p, _ = cluster.combine(1, p, 2, _projection(cluster, p, violated))
    else:
        raise endless()
    p, _ = cluster.combine(1 - e, inelastic, e, p)
    if cluster.approaching(p, 0.0):  # slower than the threshold
        p, _ = cluster.combine(1, p, 1, _projection(cluster, p, None))
    return Struck(p, margin=margin, restitution=e)


def _projection(cluster: Any, p: Any, among: list[int] | None) -> Any:
    """The impulses on top of ``p`` that just keep contacts from approaching."""
    found = cluster.project(p, among, False)
    if found is None:
        raise contradictory()
    return found[0]


def contradictory() -> ImpactError:
    """That no velocities satisfy a cluster."""
    reason = "contradict each other: no velocities keep all of them from approaching"
    return ImpactError(StatusCode.CONTRADICTORY_CONTACTS, "contacts", reason)


def endless() -> ImpactError:
    """That the budget was too small."""
    reason = f"the reflections did not end within {REFLECTIONS}"
    return ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
