"""The bodies and contacts of one cluster, in numbers, assembled for the laws."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from .. import validity
from ..arguments import check_number
from ..in_python.coefficients_at_speed import approach_speed, initial_friction, restitutions_at_speeds
from ..in_python.request_numbers import as_fraction, body_as_fractions, contact_as_fractions
from ..kernels import library
from ..kernels.protocol import LEAST_SPRING_RESTITUTION, USUAL_EXPONENT
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import PATHS, Law
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from .copies import DistinctContacts
from .find_clusters import Pair
from .rational_cluster import RationalCluster
from .request import ContactIndices, SceneOptions, SceneRequest, as_floats, with_scene_names

if TYPE_CHECKING:  # the documentation is built without compiled modules
    AnyCluster = library.Cluster | RationalCluster
    """A cluster as laws are applied to it: in double-double, or in fractions."""


class ClusterParts(NamedTuple):
    """The bodies and contacts of a cluster.

    Attributes:
        bodies: those that the contacts touch.
        pairs: for each contact, the places of its body_a and body_b in ``bodies``.
        contacts: without copies. All numbers of bodies and contacts are of one type.
        counts: how often each contact is given.
        indices: scene index of each contact.
        body_indices: scene index of each body.
    """

    bodies: list[Body]
    pairs: list[Pair]
    contacts: list[Contact]
    counts: list[int]
    indices: list[int]
    body_indices: list[int]

    def in_fractions(self) -> Iterator[tuple[Body, Body, Contact]]:
        """Yield each contact, after its two bodies, in fractions."""
        bodies = list(map(body_as_fractions, self.bodies))
        for (a, b), contact in zip(self.pairs, self.contacts, strict=True):
            yield bodies[a], bodies[b], contact_as_fractions(contact)

    def select(self, places: Sequence[int]) -> ClusterParts:
        """Return the parts with only some of the contacts."""
        return ClusterParts(
            self.bodies,
            [self.pairs[i] for i in places],
            [self.contacts[i] for i in places],
            [self.counts[i] for i in places],
            [self.indices[i] for i in places],
            self.body_indices,
        )


def assemble(
    scene: SceneRequest, distinct: DistinctContacts, options: SceneOptions
) -> tuple[AnyCluster, ClusterParts, bool]:
    """Return the cluster of some contacts of a scene, to apply laws to.

    Returns:
        The cluster; its bodies and contacts, with a number for each coefficient; and whether an approach is
        so slow that its restitution is taken as 0, or as the least that the law can have.

    Raises:
        ImpactError: if a body or a contact is invalid; ``field`` names it.
        TypeError: if something is not a number.
    """
    places: dict[int, int] = {}
    pairs = []
    for i in distinct.indices:
        a, b = scene.pairs[i]
        pairs.append((places.setdefault(a, len(places)), places.setdefault(b, len(places))))
    contacts = [_with_friction_as_number(scene, i, options.law) for i in distinct.indices]
    bodies = [scene.bodies[body] for body in places]
    parts = ClusterParts(bodies, pairs, contacts, distinct.counts, distinct.indices, list(places))
    return _in_numbers_with_threshold(scene, parts, options)


def with_frictions_as_numbers(scene: SceneRequest) -> SceneRequest:
    """Return the scene for the law AUTO, which depends on whether a contact has friction.

    Raises:
        ImpactError: if a body or a contact is invalid; ``field`` names it.
        TypeError: if something is not a number.
    """
    if not any([callable(contact.friction) for contact in scene.contacts]):
        return scene
    contacts = [
        _with_friction_as_number(scene, i, Law.COULOMB) if callable(contact.friction) else contact
        for i, contact in enumerate(scene.contacts)
    ]
    return scene._replace(contacts=contacts, has_friction=any([c.friction > 0 for c in contacts]))


def with_numbers(scene: SceneRequest, cluster: Sequence[int], options: SceneOptions) -> SceneRequest:
    """Return the scene with the functions of a cluster's contacts evaluated, if the law takes their values.

    Then copies of a contact are the same contact, even if their functions are different objects. For
    FRICTIONLESS no contact has friction, so copies may differ in it.

    Raises:
        ImpactError: if a body or a contact is invalid; ``field`` names it.
        TypeError: if something is not a number.
    """
    has_functions = any(
        [callable(e) or callable(mu) for *_, e, mu, _ in (scene.contacts[i] for i in cluster)]
    )
    if not has_functions and options.law is not Law.FRICTIONLESS:
        return scene
    contacts = list(scene.contacts)
    for i in cluster if options.law not in PATHS else ():
        contacts[i] = _with_friction_as_number(scene, i, options.law)
    numbers = _with_restitution_as_number(scene, cluster, [contacts[i] for i in cluster], exact=options.exact)
    for i, contact in zip(cluster, numbers, strict=True):
        contacts[i] = contact
    return scene._replace(contacts=contacts)


def _with_friction_as_number(scene: SceneRequest, i: int, law: Law) -> Contact:
    """Return contact ``i`` with its coefficient of friction a number; 0 for FRICTIONLESS."""
    contact = scene.contacts[i]
    mu = contact.friction
    if not callable(mu):
        if not (law is Law.FRICTIONLESS and 0 < mu < math.inf):
            return contact
        check_number(f"contacts[{i}].friction", mu, 0, math.inf, StatusCode.INVALID_COEFFICIENT)
        return contact._replace(friction=mu * 0)
    if law is Law.FRICTIONLESS:
        return contact._replace(friction=0.0)
    a, b = scene.pairs[i]
    given = scene.bodies[a], scene.bodies[b], contact, law
    return contact._replace(friction=with_scene_names(ContactIndices(i, a, b), initial_friction, *given))


def _with_restitution_as_number(
    scene: SceneRequest, indices: Sequence[int], contacts: list[Contact], *, exact: bool
) -> list[Contact]:
    """Return contacts with numbers for restitution, evaluated at the approach speeds if it is a function."""
    if not any([callable(contact.restitution) for contact in contacts]):
        return contacts
    speeds = []
    for i, contact in zip(indices, contacts, strict=True):
        a, b = scene.pairs[i]
        given = scene.bodies[a], scene.bodies[b], contact
        speeds.append(with_scene_names(ContactIndices(i, a, b), approach_speed, *given))
    values = restitutions_at_speeds(speeds, contacts, [f"contacts[{i}]" for i in indices])
    if exact:
        values = list(map(as_fraction, values))
    return [c._replace(restitution=e) for c, e in zip(contacts, values, strict=True)]


def _in_numbers_with_threshold(
    scene: SceneRequest, parts: ClusterParts, options: SceneOptions
) -> tuple[AnyCluster, ClusterParts, bool]:
    """Return the cluster, with the least restitution where an approach is below the restitution threshold.

    That needs the speeds: where there is such an approach, the cluster is assembled a second time.
    """
    cluster, parts = _in_numbers(scene, parts, options.exact)
    threshold, contacts = as_fraction(options.model.restitution_threshold), list(parts.contacts)
    any_is_below = False
    if not threshold:
        return cluster, parts, any_is_below
    for i, is_below in enumerate(cluster.approaches_below(threshold)):
        e = contacts[i].restitution
        if e > 0 and (_approaches_below(parts.select([i]), threshold) if is_below is None else is_below):
            least = LEAST_SPRING_RESTITUTION if options.law is Law.ROUTH_STRONGE else e * 0
            contacts[i] = contacts[i]._replace(restitution=min(e, least))
            any_is_below = True
    if contacts != parts.contacts:
        cluster, parts = _in_numbers(scene, parts._replace(contacts=contacts), options.exact)
    return cluster, parts, any_is_below


def _approaches_below(parts: ClusterParts, threshold: Fraction) -> bool:
    """Whether a contact approaches, slower than the threshold, where the kernels cannot tell."""
    (is_below,) = cluster_in_fractions(parts).approaches_below(threshold)
    return is_below


def cluster_in_fractions(parts: ClusterParts) -> RationalCluster:
    """Return a cluster in fractions, for the same impulses as the kernels' cluster of the same parts."""
    bodies = list(map(body_as_fractions, parts.bodies))
    contacts = [contact_as_fractions(_with_scaled_normal(c)) for c in parts.contacts]
    return RationalCluster(bodies, parts.pairs, contacts, parts.counts)


def _with_scaled_normal(contact: Contact) -> Contact:
    """Return the contact with a very long or very short normal scaled by a power of two.

    ``exponent_of`` of ``kernels/scene/assembled.hpp`` does the same. Impulses are multiples of the normal, so
    both kinds of cluster must use the same normals.
    """
    _, exponent = math.frexp(max(map(abs, contact.normal)))
    if abs(exponent) <= USUAL_EXPONENT:
        return contact
    return contact._replace(normal=Vec3(*(math.ldexp(x, -exponent) for x in contact.normal)))


def _in_numbers(scene: SceneRequest, parts: ClusterParts, exact: bool) -> tuple[AnyCluster, ClusterParts]:
    """Return the cluster, and its parts in the numbers that it uses.

    ``library.assemble`` returns ``None`` if a number is not a float, and ``False`` if a contact is invalid.
    """
    indices = [ContactIndices(i, *scene.pairs[i]) for i in parts.indices]
    if not exact:
        cluster = library.assemble(*parts[:4])
        if cluster is None:
            bodies, contacts = as_floats(parts.bodies, parts.pairs, parts.contacts, indices)
            parts = parts._replace(bodies=bodies, contacts=contacts)
            cluster = library.assemble(*parts[:4])
        if cluster:
            return cluster, parts
    for (a, b), contact, own in zip(parts.pairs, parts.contacts, indices, strict=True):
        with_scene_names(own, validity.check, parts.bodies[a], parts.bodies[b], contact, 0.0)
    if not exact:
        raise ImpactError(StatusCode.INTERNAL_ERROR, "contacts", "were refused for no known reason")
    return RationalCluster(*parts[:4]), parts
