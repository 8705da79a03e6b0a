"""Which contacts belong together.

Two contacts are of one cluster if they share a body that can move, directly or through further
contacts. What happens in one cluster does not matter to another. A contact that is given several times
is one contact, whose impulse its copies share.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..physics.contact import Contact
from ..physics.vector import Vec3

Pair = tuple[int, int]


def find_clusters(pairs: Sequence[Pair], movable: Sequence[bool]) -> list[list[int]]:
    """The contacts of each cluster, in order."""
    leader = list(range(len(movable)))

    def find(body: int) -> int:
        while leader[body] != body:
            leader[body] = leader[leader[body]]
            body = leader[body]
        return body

    for a, b in pairs:
        if movable[a] and movable[b]:
            leader[find(a)] = find(b)
    clusters: dict[int, list[int]] = {}
    for contact, (a, b) in enumerate(pairs):
        clusters.setdefault(find(a if movable[a] else b), []).append(contact)
    return list(clusters.values())


class DistinctContacts(NamedTuple):
    """The contacts of a cluster, each once.

    Attributes:
        first: of each, its index in the scene, where it is given first.
        counts: of each, how often it is given.
        places: of each contact of the cluster, its place among those.
    """

    first: list[int]
    counts: list[int]
    places: list[int]


def distinct_contacts(
    cluster: list[int], pairs: Sequence[Pair], contacts: Sequence[Contact], *, join: bool
) -> DistinctContacts:
    """Which contacts of a cluster are given several times; without ``join``, none is taken as such."""
    places: dict[Any, int] = {}
    copies = DistinctContacts([], [], [])
    try:
        may_be = join and len({contacts[i].position for i in cluster}) < len(cluster)
    except TypeError:  # lists or arrays, which have no hash
        may_be = False
    if not may_be:
        return DistinctContacts(cluster, [1] * len(cluster), list(range(len(cluster))))
    for i in cluster:
        place = places.setdefault(_key(pairs[i], contacts[i]), len(places))
        copies.places.append(place)
        if place == len(copies.first):
            copies.first.append(i)
            copies.counts.append(1)
        else:
            copies.counts[place] += 1
    return copies


def _key(pair: Pair, contact: Contact) -> Any:
    """What is the same for the same contact, whichever of its bodies is given first."""
    a, b = pair
    if a < b:
        return pair, contact
    return (b, a), contact._replace(normal=Vec3(*(-x for x in contact.normal)))
