"""The bodies and contacts of one cluster, in numbers, assembled for the laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from ..arguments import check_number
from ..in_python.coefficients_at_speed import initial_friction, restitution_at_speed
from ..in_python.request_numbers import as_fraction
from ..kernels import library
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..status import ImpactError, StatusCode
from .copies import DistinctContacts
from .find_clusters import Pair
from .rational_cluster import RationalCluster
from .request import ContactIndices, SceneOptions, SceneRequest, as_floats, check_contact, with_scene_names

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


class AssembledCluster(NamedTuple):
    """A cluster that laws can be applied to.

    Attributes:
        cluster: the cluster.
        parts: its bodies and contacts, with the numbers that are used: every coefficient is a number.
        below_restitution_threshold: whether an approach is so slow that its restitution is taken as 0.
    """

    cluster: AnyCluster
    parts: ClusterParts
    below_restitution_threshold: bool


def assemble(scene: SceneRequest, distinct: DistinctContacts, options: SceneOptions) -> AssembledCluster:
    """Return the cluster of some contacts of a scene.

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
    return _with_restitution(scene, parts, options)


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


def _with_restitution(scene: SceneRequest, parts: ClusterParts, options: SceneOptions) -> AssembledCluster:
    """Return the cluster with numbers for restitution.

    Restitution that is a function of the approach speed, or subject to the restitution threshold, needs the
    speeds: then the cluster is assembled a second time, with the restitution that they give.
    """
    given, threshold = parts.contacts, as_fraction(options.model.restitution_threshold)
    has_function = any([callable(contact.restitution) for contact in given])
    if has_function:
        numbers = [c._replace(restitution=1.0) if callable(c.restitution) else c for c in given]
        parts = parts._replace(contacts=numbers)
    cluster, parts = _in_numbers(scene, parts, options.exact)
    if not (has_function or threshold):
        return AssembledCluster(cluster, parts, False)
    speeds = [-u for u in cluster.normal_velocities()]
    fastest, is_slow, contacts = max(0.0, *speeds), False, []
    for original, contact, speed, i in zip(given, parts.contacts, speeds, parts.indices, strict=True):
        e = contact.restitution
        if callable(original.restitution):
            e = restitution_at_speed(speed if speed > 0 else fastest, original, f"contacts[{i}]")
        if 0 < speed < threshold and e > 0:
            e, is_slow = e * 0, True
        contacts.append(contact._replace(restitution=Fraction(e) if options.exact else float(e)))
    cluster, parts = _in_numbers(scene, parts._replace(contacts=contacts), options.exact)
    return AssembledCluster(cluster, parts, is_slow)


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
        check_contact(parts.bodies[a], parts.bodies[b], contact, own)
    if not exact:
        raise ImpactError(StatusCode.INTERNAL_ERROR, "contacts", "were refused for no known reason")
    return RationalCluster(*parts[:4]), parts
