"""Resolve a cluster of one contact: it is an ordinary impact of two bodies."""

from __future__ import annotations

import math

from ..model import ImpactModel
from ..physics.body import Body
from ..resolve import resolve
from .cluster_answer import ClusterAnswer
from .request import ContactIndices, SceneRequest, with_scene_names


def resolve_single_contact(scene: SceneRequest, i: int, model: ImpactModel) -> ClusterAnswer:
    """Return the answer of :func:`~collision_response.resolve` for contact ``i``, to the last bit.

    Raises:
        ImpactError, TypeError: those of ``resolve``, with the fields named as in the scene.
    """
    bodies = scene.bodies
    a, b = scene.pairs[i]
    # resolve() refuses one object as both bodies, but two bodies of a scene may be one object.
    body_b = bodies[b] if bodies[b] is not bodies[a] else Body(*bodies[b])
    impact = with_scene_names(ContactIndices(i, a, b), resolve, bodies[a], body_b, scene.contacts[i], model)
    sides = ((a, impact.change_a, impact.twist_a), (b, impact.change_b, impact.twist_b))
    moved = [side for side in sides if scene.movable[side[0]]]
    return ClusterAnswer(
        bodies=[body for body, _, _ in moved],
        changes=[change for _, change, _ in moved],
        twists=[twist for _, _, twist in moved],
        contacts=(impact.contact,),
        impulses=(impact.impulse,),
        normal_velocities_before=(impact.normal_velocity_before,),
        normal_velocities_after=(impact.normal_velocity_after,),
        regimes=(impact.regime,),
        energies=(
            impact.kinetic_energy_before,
            impact.kinetic_energy_after,
            impact.energy_lost_restitution,
            impact.energy_lost_friction,
        ),
        error_bound=impact.error_bound,
        decision_margin=math.inf,
        adjustments=impact.adjustments,
        model=impact.model,
    )
