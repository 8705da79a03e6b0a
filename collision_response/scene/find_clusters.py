"""Which contacts must be resolved together.

Two contacts belong to one cluster if they share a movable body, directly or through further contacts.
Clusters do not affect each other.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from ..kernels import library

Pair = tuple[int, int]
"""Indices of body_a and body_b."""


def find_clusters(pairs: Sequence[Pair], movable: Sequence[bool]) -> list[list[int]]:
    """Return the contacts of each cluster, in order; clusters are ordered by their first contact."""
    sides = array("q", [pair[side] for side in (0, 1) for pair in pairs])
    order, starts, cluster = (array("q", [0] * size) for size in (len(pairs), len(pairs) + 1, len(pairs)))
    count = library.find_clusters(sides, bytes(movable), order, starts, cluster)
    return [order[starts[c] : starts[c + 1]].tolist() for c in range(count)]
