"""Which contacts belong together.

Two contacts are of one cluster if they share a body that can move, directly or through further
contacts. What happens in one cluster does not matter to another.
"""

from __future__ import annotations

from collections.abc import Sequence

Pair = tuple[int, int]


def clusters_of(pairs: Sequence[Pair], movable: Sequence[bool]) -> list[list[int]]:
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
