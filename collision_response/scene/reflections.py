"""FRICTIONLESS for several contacts: generalised reflections.

The inelastic projection of a velocity keeps a set V of contacts from approaching by the least change,
in the metric of kinetic energy; it is unique, and so is the reflection at it:

    q = argmin_{q >= 0} |v + M^-1 N_V q|         P(v) = v + M^-1 N_V q         R(v) = v + 2 M^-1 N_V q

GR, for e = 1: reflect at all contacts that approach, no slower than the threshold, at once, until there are
none. A reflection keeps the energy. All at once: so the answer is as symmetric as the scene, and
depends on no order.

GRR, for e < 1:      p = e p_GR + (1 - e) p_P          p_P: of one projection at all contacts

Every step leaves v in exactly known linear relation to the impulses, and neither P nor R lets two
velocities part: errors add and do not grow. What jumps is which contacts are in V: that a velocity is
below the threshold must be certain.

It stands here for fractions, and in ``kernels/scene/reflections.hpp`` for double-double, with the errors.

Sources: Smith, Kaufman, Vouga, Tamstorf & Grinspun, "Reflections on Simultaneous Impact", ACM Trans.
Graph. 31 (2012); Vouga, Smith, Kaufman, Tamstorf & Grinspun, "All's Well That Ends Well", ACM Trans.
Graph. 36 (2017), that it ends.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

from ..numbers.operations import Scalar
from ..status import ImpactError, StatusCode
from .rational_cluster import RationalCluster

REFLECTIONS = 10_000
"""A budget. A chain of n equal balls takes n."""

DIGITS = 2**25
"""A budget for fractions, less than a second or two: binary digits of the longest impulse, which each
reflection adds to, times the square of the contacts, of all reflections together."""

ANSWERED, CONTRADICTORY, ENDLESS = range(3)
"""How reflections end."""


class ClusterImpulses(NamedTuple):
    """What a law gives for a cluster.

    Attributes:
        p: impulses along the normals.
        tangential: across them, or ``None``.
        error: of the velocities, in the metric of kinetic energy.
        margin: the least distance of a decision from its threshold, relative to the fastest approach.
        restitution: of all contacts, or ``None``: each has its own.
        rubbed: the energy that friction took on the way; ``None``: that at the mean of the slip before and
            after.
        fell_back: whether the law had no sound answer, and this is another's.
    """

    p: Any
    tangential: list[float] | None = None
    error: float = 0.0
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    rubbed: float | None = None
    fell_back: bool = False


def reflections(cluster: Any, threshold: Scalar) -> ClusterImpulses:
    """The impulses of GRR.

    Args:
        cluster: see ``collision_response/scene/__init__.py``.
        threshold: below this part of the fastest approach a contact does not count as approaching.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS or PATH_TOO_LONG.
    """
    if isinstance(cluster, RationalCluster):
        end, struck = _exactly(cluster, Fraction(threshold))
    else:
        end, p, error, margin, e = cluster.reflections(threshold, REFLECTIONS)
        struck = ClusterImpulses(p, None, error, margin, e)
    if end == CONTRADICTORY:
        raise contradiction()
    if end == ENDLESS:
        reason = f"the reflections did not end within {REFLECTIONS}, or their fractions grew too long"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    return struck


def contradiction() -> ImpactError:
    """Why there is no answer to contacts that contradict each other."""
    reason = "contradict each other: no velocities keep all of them from approaching"
    return ImpactError(StatusCode.CONTRADICTORY_CONTACTS, "contacts", reason)


def _exactly(cluster: RationalCluster, threshold: Fraction) -> tuple[int, ClusterImpulses]:
    p, speed = cluster.none(), cluster.approach()
    if not speed > 0:
        return ANSWERED, ClusterImpulses(p)
    q = cluster.project(p)
    if q is None:
        return CONTRADICTORY, ClusterImpulses(p)
    e = cluster.joined_restitution(q)
    inelastic = [x + y for x, y in zip(p, q, strict=True)]
    if e == 0:
        return ANSWERED, ClusterImpulses(inelastic, restitution=e)
    margin: Scalar = math.inf
    digits = 0
    for _ in range(REFLECTIONS):
        violated, near = cluster.violated(p, threshold * speed)
        margin = min(margin, near / speed)
        if not violated:
            break
        q = cluster.project(p, violated)
        if q is None:
            return CONTRADICTORY, ClusterImpulses(p)
        p = [x + 2 * y for x, y in zip(p, q, strict=True)]
        digits += len(p) ** 2 * max(x.denominator.bit_length() for x in p)
        if digits > DIGITS:
            return ENDLESS, ClusterImpulses(p)
    else:
        return ENDLESS, ClusterImpulses(p)
    p = [e * x + (1 - e) * y for x, y in zip(p, inelastic, strict=True)]
    if cluster.approaching(p):  # slower than the threshold
        q = cluster.project(p)
        if q is None:
            return CONTRADICTORY, ClusterImpulses(p)
        p = [x + y for x, y in zip(p, q, strict=True)]
    return ANSWERED, ClusterImpulses(p, margin=margin, restitution=e)
