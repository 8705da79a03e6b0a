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


def reflections(cluster: Any, threshold: Scalar) -> Struck:
    """The impulses of GRR.

    Args:
        cluster: see ``collision_response/scene/__init__.py``.
        threshold: below this part of the fastest approach a contact does not count as approaching.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS or PATH_TOO_LONG.
    """
    zero = cluster.none()
    speed, doubt = cluster.approach()
    if not speed > 0:
        return Struck(zero)
    first, error_P = projection(cluster, zero, None)
    e, e_error = cluster.joined_restitution(first)
    inelastic, rounding = cluster.combine(1, zero, 1, first)
    error_P += rounding
    if not e > 0:
        return Struck(inelastic, error=error_P, restitution=e)
    p, error, margin = zero, 0.0, math.inf
    for turn in range(REFLECTIONS):
        violated, near, certain = cluster.violated(p, error, threshold * speed, threshold * doubt)
        margin = min(margin, near / speed)
        if not certain:
            error = math.inf
        if not violated:
            break
        is_first = turn == 0 and len(violated) == cluster.count
        q, q_error = (first, error_P) if is_first else projection(cluster, p, violated)
        p, rounding = cluster.combine(1, p, 2, q)
        error += 2 * q_error + rounding
    else:
        reason = f"the reflections did not end within {REFLECTIONS}"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    elastic, rounding = cluster.combine(1, p, -1, inelastic)
    p, more = cluster.combine(1, inelastic, e, elastic)
    error = float(e) * error + float(1 - e) * error_P + rounding + more
    if e_error:
        error += e_error * cluster.size(elastic)
    if cluster.approaching(p, error):  # slower than the threshold
        q, q_error = projection(cluster, p, None)
        p, rounding = cluster.combine(1, p, 1, q)
        error += q_error + rounding
    return Struck(p, error=error, margin=margin, restitution=e)


def projection(cluster: Any, p: Any, among: list[int] | None) -> tuple[Any, float]:
    """The impulses on top of ``p`` that just keep contacts from approaching, and their error."""
    found = cluster.project(p, among, False)
    if found is None:
        reason = "contradict each other: no velocities keep all of them from approaching"
        raise ImpactError(StatusCode.CONTRADICTORY_CONTACTS, "contacts", reason)
    return found
