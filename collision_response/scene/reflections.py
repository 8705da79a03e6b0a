"""FRICTIONLESS for several contacts: generalised reflections.

The inelastic projection P of a velocity v keeps a set V of contacts from approaching by the least change, in
the metric of kinetic energy. It is unique, and so is the reflection R:

    q = argmin_{q >= 0} |v + M^-1 N_V q|         P(v) = v + M^-1 N_V q         R(v) = v + 2 M^-1 N_V q

GR, for e = 1: reflect at all contacts that approach no slower than the threshold, all at once, until no
contact does. A reflection keeps the energy. Because it takes all contacts at once, the answer is as symmetric
as the scene, and depends on no order.

GRR, for e < 1:      p = e p_GR + (1 - e) p_P          p_P: the impulses of one projection at all contacts

Between contacts that are nearly parallel, as in a gripper, reflections do not end in time. Then the answer
is p_P, as for e = 0.

After every step v is an exactly known linear function of the impulses. Neither P nor R increases the distance
between two velocities, so errors add up but do not grow. Only the set V can jump: whether a velocity is below
the threshold must be certain.

The computation in fractions is here. The one in double-double, with a bound on the error, is in
``kernels/scene/reflections.hpp``.

Sources: Smith, Kaufman, Vouga, Tamstorf & Grinspun, "Reflections on Simultaneous Impact", ACM Trans.
Graph. 31 (2012); Vouga, Smith, Kaufman, Tamstorf & Grinspun, "All's Well That Ends Well", ACM Trans.
Graph. 36 (2017), for the proof that the reflections end.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from ..kernels.protocol import REFLECTIONS
from ..numbers.operations import Scalar
from ..status import ImpactError, StatusCode
from .impulses import ClusterImpulses
from .rational_cluster import RationalCluster

THRESHOLD = 2.0**-30
"""Approaches slower than this fraction of the fastest one are ignored, so that rounding never decides one."""

DIGITS = 2**23
"""Budget for reflections in fractions, which takes about a second: the sum, over all reflections, of the
binary digits of the longest impulse, or ``LEAST_DIGITS``, times the square of the number of contacts."""

LEAST_DIGITS = 64
"""Impulses of fewer binary digits take no less time."""


def reflections(cluster: Any, threshold: Scalar) -> ClusterImpulses:
    """Return the impulses of GRR.

    Args:
        cluster: see ``scene/__init__.py``.
        threshold: approaches slower than this fraction of the fastest one are ignored.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching;
            PATH_TOO_LONG, if contacts press on each other so that double-double arithmetic cannot tell.
    """
    if isinstance(cluster, RationalCluster):
        impulses = _in_fractions(cluster, Fraction(threshold))
    else:
        found = cluster.reflections(threshold)
        impulses = None if found is None else ClusterImpulses(*found)
    if impulses is None and cluster.is_locked:
        reason = "press on each other, and may or may not contradict: too many to decide exactly"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    if impulses is None:
        raise contradiction()
    return impulses


def contradiction() -> ImpactError:
    """Return the error for contacts that contradict each other."""
    reason = "contradict each other: no velocities keep all of them from approaching"
    return ImpactError(StatusCode.CONTRADICTORY_CONTACTS, "contacts", reason)


def _in_fractions(cluster: RationalCluster, threshold: Fraction) -> ClusterImpulses | None:
    p = cluster.no_impulses()
    if not cluster.fastest_square > 0:
        return ClusterImpulses(p)
    q = cluster.project(p)
    if q is None:
        return None
    e = cluster.cluster_restitution(q)
    inelastic = [x + y for x, y in zip(p, q, strict=True)]
    if e == 0:
        return ClusterImpulses(inelastic, restitution=e)
    endless = ClusterImpulses(inelastic, restitution=Fraction(0), no_rebound=True)
    margin: Scalar = math.inf
    digits = 0
    for _ in range(REFLECTIONS):
        violated, distance = cluster.violated(p, threshold)
        margin = min(margin, distance)
        if not violated:
            break
        q = cluster.project(p, violated)
        if q is None:
            return None
        p = [x + 2 * y for x, y in zip(p, q, strict=True)]
        longest = max(max(x.numerator.bit_length(), x.denominator.bit_length()) for x in p)
        digits += len(p) ** 2 * max(longest, LEAST_DIGITS)
        if digits > DIGITS:
            return endless
    else:
        return endless
    p = [e * x + (1 - e) * y for x, y in zip(p, inelastic, strict=True)]
    if cluster.has_approach(p):  # slower than the threshold
        q = cluster.project(p)
        if q is None:
            return None
        p = [x + y for x, y in zip(p, q, strict=True)]
    return ClusterImpulses(p, margin=margin, restitution=e)
