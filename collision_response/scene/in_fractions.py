"""A law for one cluster in fractions: for rational scenes, and for what the kernels leave undecided.

A cluster is left undecided in four cases, which ``kernels/scene/resolve_cluster.hpp`` describes: contacts
lock; it is uncertain whether a contact approaches, or whether one reaches the threshold of reflections; or,
even without friction, the error bound is too large to be useful. In clusters of at most ``RATIONAL_CONTACTS``
contacts, fractions then find the impulses without friction; the kernels compute friction, and what the
impulses do.
"""

from __future__ import annotations

import math
from fractions import Fraction

from ..kernels import library
from ..kernels.protocol import RATIONAL_CONTACTS
from ..model import Adjustment
from ..numbers.operations import Scalar
from ..physics.column import Column
from ..physics.laws import Law
from ..status import StatusCode
from .assemble import ClusterParts, cluster_in_fractions
from .cluster_result import ClusterResult
from .frictionless import reflections
from .in_kernels import NOTHING_DECIDED, Decided, resolve_in_kernels
from .rational_cluster import RationalCluster, RationalImpulses
from .request import SceneOptions


def resolve_in_fractions(cluster: RationalCluster, law: Law, threshold: Scalar) -> ClusterResult:
    """Return the exact result of FRICTIONLESS, or of MOREAU without friction.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching.
    """
    impulses = _without_friction(cluster, law, threshold)
    effect = cluster.effect_of(impulses)
    if impulses.is_cut_off:
        effect = effect._replace(error_bound=math.inf)
    code = StatusCode.INTERNAL_ERROR if cluster.is_unphysical(impulses.normal, effect) else StatusCode.OK
    adjustments = (
        cluster.adjustments()
        | impulses.no_rebound * Adjustment.NO_REBOUND
        | impulses.fell_back * Adjustment.LAW_FALLBACK
    )
    return ClusterResult(code, effect, impulses.margin, impulses.restitution, adjustments)


def decide(
    cluster: library.Cluster, parts: ClusterParts, options: SceneOptions, *, has_friction: bool
) -> ClusterResult:
    """Return the result for a cluster that the kernels leave undecided.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching.
    """
    law, is_small = options.law, len(parts.contacts) <= RATIONAL_CONTACTS
    has_exact_impulses = is_small and law is not Law.ROUTH_STRONGE
    if cluster.is_locked:
        _check_for_contradiction(cluster, parts)
    if cluster.approach_is_uncertain and not (cluster.is_locked and is_small):
        approaches = _has_approach(parts)
        if not (approaches and has_exact_impulses and not has_friction):
            # Without an approach, no impulse is right. With one, its error has no bound.
            zeros = [0.0] * len(parts.contacts)
            nothing = Decided(zeros, zeros, error=math.inf if approaches else 0.0)
            return resolve_in_kernels(cluster, parts, options, Law.FRICTIONLESS, nothing)
    if not has_exact_impulses:
        return resolve_in_kernels(cluster, parts, options, law, NOTHING_DECIDED)
    return _resolve_from_exact_impulses(cluster, parts, options, has_friction)


def _resolve_from_exact_impulses(
    cluster: library.Cluster, parts: ClusterParts, options: SceneOptions, has_friction: bool
) -> ClusterResult:
    """Return the result in the kernels from the impulses without friction in fractions.

    MOREAU with friction does not start from these. Where it has an answer, that is the result.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, as :func:`decide`; OUT_OF_RANGE, if an impulse is beyond float64.
    """
    exact, law = cluster_in_fractions(parts), options.law
    falls_back = has_friction and law is Law.MOREAU
    if falls_back and exact.can_rebound():
        result = resolve_in_kernels(cluster, parts, options, law, NOTHING_DECIDED)
        if not result.adjustments & Adjustment.LAW_FALLBACK:
            return result
    if has_friction:
        law = Law.COULOMB
    impulses = _without_friction(exact, law, options.threshold)
    least = exact.least_norm(impulses.normal, impulses.may_press)
    try:
        normal = list(map(float, least))
    except OverflowError:
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None
    if impulses.is_cut_off and not cluster.is_locked:  # the kernels have more reflections, without a bound
        return resolve_in_kernels(cluster, parts, options, options.law, NOTHING_DECIDED)
    decided = Decided(
        normal,
        rest=[float(x - Fraction(rounded)) for x, rounded in zip(least, normal, strict=True)],
        margin=float(impulses.margin),
        restitution=-1.0 if impulses.restitution is None else float(impulses.restitution),
        no_rebound=impulses.no_rebound,
        error=math.inf if impulses.is_cut_off else 0.0,
    )
    result = resolve_in_kernels(cluster, parts, options, law, decided)
    fell_back = impulses.fell_back or falls_back
    return result._replace(adjustments=result.adjustments | fell_back * Adjustment.LAW_FALLBACK)


def _without_friction(cluster: RationalCluster, law: Law, threshold: Scalar) -> RationalImpulses:
    """Return the impulses of MOREAU if it has a sound answer, else those of FRICTIONLESS."""
    if law is Law.MOREAU:
        impulses = cluster.moreau()
        if impulses is not None and not cluster.creates_energy(impulses.normal):
            return impulses
    return reflections(cluster, threshold)._replace(fell_back=law is Law.MOREAU)


def _check_for_contradiction(cluster: library.Cluster, parts: ClusterParts) -> None:
    """Check a locked cluster, as far as it, or what seems to contradict in it, is small enough.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching.
    """
    is_small = len(parts.contacts) <= RATIONAL_CONTACTS
    suspects = range(len(parts.contacts)) if is_small else cluster.contradictory_contacts()
    if 0 < len(suspects) <= RATIONAL_CONTACTS:
        exact = cluster_in_fractions(parts.select(suspects))
        exact.project(exact.no_impulses())


def _has_approach(parts: ClusterParts) -> bool:
    """Whether a contact approaches, decided in fractions."""
    for *bodies, contact in parts.in_fractions():
        u_a, u_b = (Column.of(body, contact.position, contact.normal).velocity for body in bodies)
        if u_a < u_b:
            return True
    return False
