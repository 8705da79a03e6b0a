"""FRICTIONLESS for several contacts: generalised reflections.

The inelastic projection P of a velocity v keeps a set V of contacts from approaching by the least change, in
the metric of kinetic energy. It is unique, and so is the reflection R:

    q = argmin_{q >= 0} |v + M^-1 N_V q|         P(v) = v + M^-1 N_V q         R(v) = v + 2 M^-1 N_V q

GR, for e = 1: reflect at all contacts that approach no slower than the threshold, all at once, until no
contact does. A reflection keeps the energy. Because it takes all contacts at once, the answer is as symmetric
as the scene, and depends on no order.

GRR, for e < 1:      p = e p_GR + (1 - e) p_P          p_P: the impulses of one projection at all contacts

Between contacts that are nearly parallel, as in a gripper, reflections do not end in time. Then the answer
is p_P, as for e = 0. Fractions need not try all of them: if two reflections hardly change v, the same two
follow again and again.

After every step v is an exactly known linear function of the impulses. Neither P nor R increases the distance
between two velocities, so errors add up but do not grow. Only the set V can jump: whether a velocity is below
the threshold must be certain.

The computation in fractions is here. The one in double-double, with a bound on the error, is in
``kernels/scene/frictionless.cpp``.

Sources: Smith, Kaufman, Vouga, Tamstorf & Grinspun, "Reflections on Simultaneous Impact", ACM Trans.
Graph. 31 (2012); Vouga, Smith, Kaufman, Tamstorf & Grinspun, "All's Well That Ends Well", ACM Trans.
Graph. 36 (2017), for the proof that the reflections end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from ..in_python.request_numbers import as_fraction
from ..kernels.protocol import REFLECTIONS
from ..numbers.operations import Scalar
from .rational_algebra import Numbers
from .rational_cluster import RationalCluster, RationalImpulses

THRESHOLD = 2.0**-30
"""Approaches slower than this fraction of the fastest one are ignored, so that rounding never decides one."""

DIGITS = 2**23
"""Budget for reflections in fractions, which takes about a second: the sum, over all reflections, of the
binary digits of the longest impulse, or ``LEAST_DIGITS``, times the square of the number of contacts."""

LEAST_DIGITS = 64
"""Impulses of fewer binary digits take no less time."""


def reflections(cluster: RationalCluster, threshold: Scalar) -> RationalImpulses:
    """Return the impulses of GRR.

    Args:
        cluster: in fractions.
        threshold: approaches slower than this fraction of the fastest one are ignored.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching.
    """
    p = cluster.no_impulses()
    if not cluster.fastest_square > 0:
        return RationalImpulses(p)
    q = cluster.project(p)
    e = cluster.cluster_restitution(q)
    inelastic = [x + y for x, y in zip(p, q, strict=True)]
    if e == 0:
        return RationalImpulses(inelastic, restitution=e)
    endless = RationalImpulses(inelastic, restitution=Fraction(0), no_rebound=True)
    margin: Scalar = math.inf
    digits = 0
    turns: list[Turn] = []
    for _ in range(REFLECTIONS):
        violated, distance = cluster.violated(p, as_fraction(threshold))
        margin = min(margin, distance)
        if not violated:
            break
        turns = [*turns[-2:], Turn(p, violated, distance)]
        if _repeats(cluster, turns):
            return endless._replace(margin=margin)
        q = cluster.project(p, violated)
        p = [x + 2 * y for x, y in zip(p, q, strict=True)]
        longest = max(max(x.numerator.bit_length(), x.denominator.bit_length()) for x in p)
        digits += len(p) ** 2 * max(longest, LEAST_DIGITS)
        if digits > DIGITS:
            return endless._replace(margin=margin, is_cut_off=True)
    else:
        return endless._replace(margin=margin)
    p = [e * x + (1 - e) * y for x, y in zip(p, inelastic, strict=True)]
    if cluster.has_approach(p):  # slower than the threshold
        q = cluster.project(p)
        p = [x + y for x, y in zip(p, q, strict=True)]
    return RationalImpulses(p, margin=margin, restitution=e)


class Turn(NamedTuple):
    """The impulses before a reflection, the contacts that it is at, and how certain these are: the least
    distance of an approach from the threshold.
    """

    p: Numbers
    violated: list[int]
    distance: Scalar


def _repeats(cluster: RationalCluster, turns: Sequence[Turn]) -> bool:
    """Whether reflections at the same two sets of contacts certainly go on to the last one in the budget.

    If two reflections change the velocities by d, another n of them change them by n d / 2 at most, because
    reflections increase no distance. Here d is taken twice.
    """
    if len(turns) < 3 or turns[0].violated != turns[2].violated:
        return False
    change = [REFLECTIONS * (x - y) for x, y in zip(turns[2].p, turns[0].p, strict=True)]
    return cluster.moves_less(change, min(turns[0].distance, turns[1].distance))
