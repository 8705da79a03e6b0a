"""Which contacts must be resolved together.

Two contacts belong to one cluster if they share a movable body, directly or through further contacts.
Clusters do not affect each other. A contact that is given several times counts as one contact, and its copies
share its impulse.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Any, NamedTuple

from ..kernels import library
from ..physics.contact import Contact

Pair = tuple[int, int]
"""Indices of body_a and body_b."""


def find_clusters(pairs: Sequence[Pair], movable: Sequence[bool]) -> list[list[int]]:
    """Return the contacts of each cluster, in order; clusters are ordered by their first contact."""
    sides = array("q", [pair[side] for side in (0, 1) for pair in pairs])
    order, starts, cluster = (array("q", [0] * size) for size in (len(pairs), len(pairs) + 1, len(pairs)))
    count = library.find_clusters(sides, bytes(movable), order, starts, cluster)
    return [order[starts[c] : starts[c + 1]].tolist() for c in range(count)]


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
    cluster: list[int], pairs: Sequence[Pair], contacts: Sequence[Contact], *, merge_copies: bool
) -> DistinctContacts:
    """Return the distinct contacts of a cluster; without ``merge_copies`` all contacts are distinct."""
    all_distinct = DistinctContacts(cluster, [1] * len(cluster), list(range(len(cluster))))
    if not merge_copies:
        return all_distinct
    try:
        if len({tuple(contacts[i].position) for i in cluster}) == len(cluster):
            return all_distinct
        keys = [_key(pairs[i], contacts[i]) for i in cluster]
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


def _key(pair: Pair, contact: Contact) -> Any:
    """Return a key that copies of a contact have in common, in whichever order they name its bodies."""
    (a, b), position, normal = pair, tuple(contact.position), tuple(contact.normal)
    if a > b:
        a, b, normal = b, a, tuple(-x for x in normal)
    return a, b, position, normal, *contact[2:]
