"""Contacts that are given several times: they count as one contact, and its copies share its impulse."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from ..numbers.operations import Scalar
from ..physics.contact import Contact
from ..physics.laws import Law
from .cluster_result import ClusterAnswer
from .find_clusters import Pair
from .request import SceneRequest


class DistinctContacts(NamedTuple):
    """The contacts of a cluster without copies.

    Attributes:
        indices: scene index of each distinct contact, where it is given first.
        counts: how often each is given.
        places: for each contact of the cluster, its place in ``indices``.
    """

    indices: list[int]
    counts: list[int]
    places: list[int]


def distinct_contacts(
    cluster: list[int], pairs: Sequence[Pair], contacts: Sequence[Contact], law: Law, e_t: Scalar
) -> DistinctContacts:
    """Return the distinct contacts of a cluster. For ROUTH_STRONGE all are: each is a spring.

    ``e_t`` is the tangential restitution of contacts that have none of their own.
    """
    all_distinct = DistinctContacts(cluster, [1] * len(cluster), list(range(len(cluster))))
    if law is Law.ROUTH_STRONGE:
        return all_distinct
    try:
        if len({tuple(contacts[i].position) for i in cluster}) == len(cluster):
            return all_distinct
        keys = [_key(pairs[i], contacts[i], law, e_t) for i in cluster]
        place_of = {key: place for place, key in enumerate(dict.fromkeys(keys))}
    except TypeError:  # something is not a number, and is refused later
        return all_distinct
    distinct = DistinctContacts([], [], [])
    for i, key in zip(cluster, keys, strict=True):
        place = place_of[key]
        distinct.places.append(place)
        if place == len(distinct.indices):
            distinct.indices.append(i)
            distinct.counts.append(1)
        else:
            distinct.counts[place] += 1
    return distinct


def _key(pair: Pair, contact: Contact, law: Law, e_t: Scalar) -> Any:
    """Return a key that copies of a contact have in common, in whichever order they name its bodies.

    Only COULOMB reads a tangential restitution, and only where there is friction.
    """
    (a, b), position, normal = pair, tuple(contact.position), tuple(contact.normal)
    if a > b:
        a, b, normal = b, a, tuple(-x for x in normal)
    own = e_t if contact.tangential_restitution is None else contact.tangential_restitution
    is_read = law is Law.COULOMB and contact.friction != 0
    return a, b, position, normal, contact.restitution, contact.friction, own if is_read else None


def split_among_copies(
    answer: ClusterAnswer, scene: SceneRequest, cluster: Sequence[int], distinct: DistinctContacts
) -> ClusterAnswer:
    """Return the answer with an entry for every contact of ``cluster``, from one for distinct contacts.

    Copies share the impulse of their contact equally. A copy that names the two bodies in the opposite order
    gets its share with the opposite sign.
    """
    effect, places = answer.effect, distinct.places
    contacts, impulses = [], []
    for i, place in zip(cluster, places, strict=True):
        used, impulse, count = answer.contacts[place], effect.impulses[place], distinct.counts[place]
        given = scene.contacts[i]
        share: Scalar = Fraction(1, count) if isinstance(impulse.x, Fraction) else 1 / count
        if scene.pairs[i] == scene.pairs[distinct.indices[place]]:
            contacts.append(used._replace(tangential_restitution=given.tangential_restitution))
            impulses.append(impulse * share)
        else:
            contacts.append(given._replace(restitution=used.restitution, friction=used.friction))
            impulses.append(impulse * -share)
    effect = effect._replace(
        impulses=impulses,
        normal_velocities_before=[effect.normal_velocities_before[place] for place in places],
        normal_velocities_after=[effect.normal_velocities_after[place] for place in places],
        regimes=[effect.regimes[place] for place in places],
    )
    return answer._replace(contacts=contacts, effect=effect)
