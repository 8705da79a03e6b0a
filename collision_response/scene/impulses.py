"""Impulses in a cluster of several contacts, and what they do to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from ..answer import norm_components
from ..numbers.operations import Scalar
from ..physics.body import Body, Twist
from ..physics.laws import Regime
from ..physics.vector import Vec3


class ClusterImpulses(NamedTuple):
    """The impulses that a law gives for a cluster.

    Attributes:
        normal: along the normals, in the numbers of the cluster: fractions, or the bytes of double-doubles.
        tangential: across the normals, two components for each contact; ``None`` without friction.
        error: bound on the error of the velocities they produce, in the metric of kinetic energy.
        margin: least distance of a decision from its threshold, relative to the fastest approach.
        restitution: the one restitution used for all contacts; ``None`` if each contact has its own.
        no_rebound: whether bodies would rebound without end, so that restitution was taken as 0.
        friction_loss: energy that friction took along the path; ``None`` to compute it from the mean of the
            slip before and after.
        fell_back: whether the law had no sound answer and these are the impulses of another law.
    """

    normal: Any
    tangential: list[float] | None = None
    error: float = 0.0
    margin: Scalar = math.inf
    restitution: Scalar | None = None
    no_rebound: bool = False
    friction_loss: float | None = None
    fell_back: bool = False


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
        creates_energy: whether the contacts gain more energy than rounding explains.
        is_unphysical: whether they gain energy, pull, leave their friction cones, or still approach, by more
            than the error. As the answer of a law, that would be a fault of this package.
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
    creates_energy: bool
    is_unphysical: bool


def effect_of(cluster: Any, impulses: ClusterImpulses, *, sticks_by_slip: bool = False) -> ImpulseEffect:
    """Return what impulses do to a cluster.

    Args:
        cluster: see ``scene/__init__.py``.
        impulses: to apply.
        sticks_by_slip: how to tell that a contact sticks: it does not slip afterwards; else, its friction is
            below the limit.
    """
    given = impulses.normal, impulses.tangential, impulses.error, sticks_by_slip
    return ImpulseEffect._make(cluster.effect_of(*given))


def relative_distance(bodies: Sequence[Body], changes: Sequence[Twist], reference: Sequence[Twist]) -> float:
    """Return how far the twist changes of bodies are from a reference, relative to that, in the norm of
    ``error_bound``.
    """
    distances, sizes = [], []
    for body, change, expected in zip(bodies, changes, reference, strict=True):
        if body.is_movable():
            components = norm_components(body, expected)
            root = math.sqrt(body.mass)
            distances.append(root * math.dist(norm_components(body, change), components))
            sizes.append(root * math.hypot(*components))
    distance, size = math.hypot(*distances), math.hypot(*sizes)
    return 0.0 if distance == 0 else distance / size if size else math.inf
