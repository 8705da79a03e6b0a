"""The result of a law for one cluster."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..numbers.operations import Scalar
from ..physics.body import Twist
from ..physics.laws import Regime
from ..physics.vector import Vec3


class ImpulseEffect(NamedTuple):
    """What impulses do to the movable bodies and the contacts of a cluster.

    Attributes:
        changes, twists: change of each body's twist, and its twist afterwards.
        impulses: on body_a of each contact, in world axes [N s].
        normal_velocities_before, normal_velocities_after: of each contact [m/s]; negative when approaching.
        regimes: what friction did at each contact.
        energies: kinetic energy before and after, energy lost to restitution and to friction [J].
        error_bound: relative error of the changes, as in :class:`~collision_response.SceneImpact`.
        has_massless_spin: whether a body turned about an axis without inertia.
        has_off_unit_orientation: whether a quaternion was not of unit length.
        is_unphysical: whether the contacts gain energy, pull, leave their friction cones, or still approach,
            by more than the error. As the answer of a law, that would be a fault of this package.
    """

    changes: list[Twist]
    twists: list[Twist]
    impulses: list[Vec3]
    normal_velocities_before: list[Scalar]
    normal_velocities_after: list[Scalar]
    regimes: list[Regime]
    energies: tuple[Scalar, Scalar, Scalar, Scalar]
    error_bound: float
    has_massless_spin: bool
    has_off_unit_orientation: bool
    is_unphysical: bool


class ClusterResult(NamedTuple):
    """The result of a law for a cluster: ``ClusterResult`` of ``kernels/scene/resolve_cluster.hpp``.

    Attributes:
        code: how it ended, as a :class:`~collision_response.StatusCode`; UNSET if only fractions may decide.
        effect: what the impulses do, if the code is OK.
        margin: least distance of a decision from its threshold, relative to the fastest approach.
        restitution: the one restitution used for all contacts; ``None`` if each contact has its own.
        no_rebound: whether bodies would rebound without end, so that restitution was taken as 0.
        fell_back: whether the law had no sound answer, and another law answered.
        fault: for PATH_TOO_LONG, why.
        faulty: the contact that the fault is about; -1 for all.
    """

    code: int
    effect: ImpulseEffect
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    no_rebound: bool = False
    fell_back: bool = False
    fault: str = ""
    faulty: int = -1
