"""What a law finds for one cluster, and what that is of the answer for the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ..model import ImpactModel
from ..numbers.operations import Scalar
from ..physics.body import Twist
from ..physics.contact import Contact
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
    """

    changes: Sequence[Twist]
    twists: Sequence[Twist]
    impulses: Sequence[Vec3]
    normal_velocities_before: Sequence[Scalar]
    normal_velocities_after: Sequence[Scalar]
    regimes: Sequence[Regime]
    energies: tuple[Scalar, Scalar, Scalar, Scalar]
    error_bound: float


class ClusterResult(NamedTuple):
    """The result of a law for a cluster: ``ClusterResult`` of ``kernels/scene/resolve_cluster.hpp``.

    Attributes:
        code: how it ended, as a :class:`~collision_response.StatusCode`; UNSET if only fractions may decide.
        effect: what the impulses do, if the code is OK.
        margin: least distance of a decision from its threshold, relative to the fastest approach.
        restitution: the one restitution used for all contacts; ``None`` if each contact has its own.
        adjustments: an :class:`~collision_response.Adjustment`.
        fault: for PATH_TOO_LONG and INVALID_COEFFICIENT, why.
        faulty: the contact that the fault is about; -1 for all.
    """

    code: int
    effect: ImpulseEffect
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    adjustments: int = 0
    fault: str = ""
    faulty: int = -1


class ClusterAnswer(NamedTuple):
    """The part of a :class:`~collision_response.SceneImpact` that one cluster determines.

    Attributes:
        bodies: indices in the scene of the movable bodies of the cluster.
        contacts: with the coefficients that were used.
        effect: what the impulses do to these bodies and contacts.
        decision_margin, adjustments, model: for the whole cluster.
    """

    bodies: Sequence[int]
    contacts: Sequence[Contact]
    effect: ImpulseEffect
    decision_margin: Scalar
    adjustments: int
    model: ImpactModel
