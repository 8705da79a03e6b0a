"""Apply a law to a cluster, with the fallbacks where the law or double-double arithmetic has no answer.

Without friction, most clusters are answered in double-double, with a bound on the error. Friction and
ROUTH_STRONGE are computed in doubles. Three cases need more:

* Contacts that press on each other without end, such as a ball between two walls, are *locked*: no velocity
  separates all of them. Exact arithmetic decides what happens, in clusters of up to ``RATIONAL_CONTACTS``.
  Larger ones do not rebound, and their error has no bound.
* Double-double may be too coarse to tell whether a contact approaches, or reaches the threshold of
  reflections. Exact arithmetic decides that too.
* MOREAU may have no solution, or one that creates energy. Then COULOMB answers, or FRICTIONLESS if there is
  no friction.
"""

from __future__ import annotations

import math
from typing import Any

from ..in_python.request_numbers import body_as_fractions, contact_as_fractions
from ..kernels import library
from ..numbers.operations import ROUNDOFF, Scalar
from ..physics.body import Twist
from ..physics.column import Column
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from .cluster import ClusterParts
from .coulomb import add_friction
from .impulses import ClusterImpulses, ImpulseEffect, effect_of, relative_distance
from .moreau import moreau
from .rational_cluster import RationalCluster
from .reflections import contradiction, reflections
from .request import SceneOptions
from .stronge import LEAST_RESTITUTION, follow_springs

RATIONAL_CONTACTS = 8
"""Clusters of at most this many contacts are decided in fractions where double-double cannot decide."""


def apply_law(
    cluster: Any, parts: ClusterParts, options: SceneOptions, *, has_friction: bool
) -> tuple[ClusterImpulses, ImpulseEffect]:
    """Return the impulses that the law of ``options`` gives, and what they do.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching;
            PATH_TOO_LONG, if no answer is found within a budget, or if a restitution is too small for
            ROUTH_STRONGE.
    """
    exact = _exact_if_locked(cluster, parts)
    if cluster.approach_is_uncertain and exact is None:
        approaches = _has_approach(parts)
        only_in_doubles = has_friction or options.law is Law.ROUTH_STRONGE
        if not approaches or only_in_doubles or len(parts.contacts) > RATIONAL_CONTACTS:
            nothing = ClusterImpulses(cluster.no_impulses(), error=math.inf if approaches else 0.0)
            return nothing, effect_of(cluster, nothing)
        exact = _in_fractions(parts)
    if options.law is Law.ROUTH_STRONGE:
        return _by_stronge(cluster, parts, options, has_friction=has_friction)
    if options.law is Law.MOREAU:
        by_moreau = _by_moreau(cluster, exact, has_friction=has_friction)
        if by_moreau is not None:
            effect = effect_of(cluster, by_moreau)
            if not effect.creates_energy:
                return by_moreau, effect
    impulses = _by_reflections(cluster, parts, exact, options.threshold)
    if has_friction:
        impulses = add_friction(cluster, impulses)
    impulses = impulses._replace(fell_back=options.law is Law.MOREAU)
    return impulses, effect_of(cluster, impulses)


def _by_moreau(cluster: Any, exact: RationalCluster | None, *, has_friction: bool) -> ClusterImpulses | None:
    """Return the impulses of MOREAU, or ``None``. A locked cluster without friction is computed exactly.

    If it is too large for that, it does not rebound, as MOREAU requires.
    """
    if exact is None and cluster.is_locked and not has_friction:
        return None
    if exact is None or (has_friction and exact.can_rebound()):
        return moreau(cluster, has_friction=has_friction)
    if has_friction:
        return None
    impulses = moreau(exact, has_friction=False)
    if impulses is None or exact.effect_of(impulses.normal).creates_energy:
        return None
    return _as_floats(cluster, exact, impulses)


def _by_reflections(
    cluster: Any, parts: ClusterParts, exact: RationalCluster | None, threshold: Scalar
) -> ClusterImpulses:
    """Return the impulses of FRICTIONLESS, in fractions where double-double cannot decide."""
    if exact is None:
        impulses = reflections(cluster, threshold)
        if impulses.error < math.inf or len(parts.contacts) > RATIONAL_CONTACTS:
            return impulses
        exact = _in_fractions(parts)
    return _as_floats(cluster, exact, reflections(exact, threshold))


def _by_stronge(
    cluster: Any, parts: ClusterParts, options: SceneOptions, *, has_friction: bool
) -> tuple[ClusterImpulses, ImpulseEffect]:
    """Return the impulses of ROUTH_STRONGE, and what they do; the error bound includes that of the path."""
    nothing = ClusterImpulses(cluster.no_impulses())
    effect = effect_of(cluster, nothing, sticks_by_slip=True)
    if not min(effect.normal_velocities_before) < 0:
        return nothing, effect._replace(error_bound=0.0)
    restitution = [contact.restitution for contact in parts.contacts]
    least = min(restitution)
    if least < LEAST_RESTITUTION:
        field = f"contacts[{parts.indices[restitution.index(least)]}].restitution"
        reason = f"must be at least {LEAST_RESTITUTION} for ROUTH_STRONGE in a cluster, is {least}"
        raise ImpactError(StatusCode.PATH_TOO_LONG, field, reason)
    movable = [body for body in parts.bodies if body.is_movable()]

    def changes(impulses: ClusterImpulses) -> list[Twist]:
        return effect_of(cluster, impulses, sticks_by_slip=True).changes

    given = options.stiffness
    impulses, error = follow_springs(
        cluster,
        [1.0 if given is None else float(given[i]) for i in parts.indices],
        float(options.exponent),
        options.model.tolerance,
        has_friction=has_friction,
        distance=lambda one, other: relative_distance(movable, changes(one), changes(other)),
    )
    bound = error + effect_of(cluster, impulses, sticks_by_slip=True).error_bound
    impulses = impulses._replace(error=error * cluster.velocity_size(impulses.normal))
    return impulses, effect_of(cluster, impulses, sticks_by_slip=True)._replace(error_bound=bound)


def _exact_if_locked(cluster: Any, parts: ClusterParts) -> RationalCluster | None:
    """Return the cluster in fractions, if it is locked and small enough.

    Raises:
        ImpactError: CONTRADICTORY_CONTACTS, if no velocities keep all contacts from approaching.
    """
    if not cluster.is_locked:
        return None
    is_small = len(parts.contacts) <= RATIONAL_CONTACTS
    suspects = range(len(parts.contacts)) if is_small else cluster.contradictory_contacts()
    if not 0 < len(suspects) <= RATIONAL_CONTACTS:
        return None
    exact = _in_fractions(parts.select(suspects))
    if exact.project(exact.no_impulses()) is None:
        raise contradiction()
    return exact if is_small else None


def _has_approach(parts: ClusterParts) -> bool:
    """Whether a contact approaches, decided in fractions."""
    bodies = list(map(body_as_fractions, parts.bodies))
    for (a, b), given in zip(parts.pairs, parts.contacts, strict=True):
        contact = contact_as_fractions(given)
        u_a, u_b = (Column.of(bodies[k], contact.position, contact.normal).velocity for k in (a, b))
        if u_a < u_b:
            return True
    return False


def _in_fractions(parts: ClusterParts) -> RationalCluster:
    bodies = list(map(body_as_fractions, parts.bodies))
    contacts = [contact_as_fractions(_with_scaled_normal(c)) for c in parts.contacts]
    return RationalCluster(bodies, parts.pairs, contacts, parts.counts)


def _with_scaled_normal(contact: Contact) -> Contact:
    """Return the contact with a very long or very short normal scaled by a power of two.

    ``exponent_of`` of ``kernels/scene/assembled.hpp`` does the same. Impulses are multiples of the normal, so
    both kinds of cluster must use the same normals.
    """
    _, exponent = math.frexp(max(map(abs, contact.normal)))
    if abs(exponent) <= 100:
        return contact
    return contact._replace(normal=Vec3(*(math.ldexp(x, -exponent) for x in contact.normal)))


def _as_floats(
    cluster: library.Cluster, exact: RationalCluster, impulses: ClusterImpulses
) -> ClusterImpulses:
    """Convert the impulses of an exact cluster to those of the compiled one, rounded to floats."""
    normal = cluster.impulses_from_floats([float(x) for x in exact.least_norm(impulses.normal)])
    e = None if impulses.restitution is None else float(impulses.restitution)
    error = cluster.velocity_size(normal) * ROUNDOFF
    margin = float(impulses.margin)
    return ClusterImpulses(normal, error=error, margin=margin, restitution=e, no_rebound=impulses.no_rebound)
