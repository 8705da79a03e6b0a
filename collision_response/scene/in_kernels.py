"""A law for one cluster in the kernels: in double-double, or in doubles where there is friction."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..kernels import library, protocol
from ..physics.laws import Law
from .assemble import ClusterParts
from .cluster_result import ClusterResult, ImpulseEffect
from .request import SceneOptions


class Decided(NamedTuple):
    """What fractions have decided about a cluster, for ``kernels/scene/resolve_cluster.hpp``.

    Attributes:
        normal: the impulses without friction, along the normals; empty if they are not known.
        rest: what ``normal`` lacks, being rounded.
        error: bound on the error of the velocities they produce, in the metric of kinetic energy, without
            that of rounding the sum of both.
        margin, no_rebound: as in :class:`ClusterResult`.
        restitution: as there; -1 if each contact has its own.
    """

    normal: list[float]
    rest: list[float]
    error: float = 0.0
    margin: float = math.inf
    restitution: float = -1.0
    no_rebound: bool = False


NOTHING_DECIDED = Decided([], [])
"""Fractions cannot help: the kernels answer as well as they can."""


def resolve_in_kernels(
    cluster: library.Cluster,
    parts: ClusterParts,
    options: SceneOptions,
    law: Law,
    decided: Decided | None = None,
) -> ClusterResult:
    """Return the result of a law. Its code is UNSET if fractions may help and are not asked yet."""
    given = options.stiffness
    stiffness = None if given is None else [float(given[i]) for i in parts.indices]
    springs = stiffness, float(options.exponent), protocol.SPRING_WORK
    numbers = float(options.threshold), float(options.model.tolerance)
    result = ClusterResult._make(cluster.resolve(int(law), *numbers, springs, decided))
    return result._replace(effect=ImpulseEffect._make(result.effect))
