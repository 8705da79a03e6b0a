"""A cluster of one contact: that is one impact."""

from __future__ import annotations

import math

from ..model import ImpactModel
from ..physics.body import Body
from ..resolve import resolve
from .cluster_answer import ClusterAnswer
from .request import ContactIndices, SceneRequest, with_scene_names


def resolve_single_contact(scene: SceneRequest, i: int, model: ImpactModel) -> ClusterAnswer:
    """What :func:`~collision_response.resolve` says of contact ``i``, to the last bit.

    Raises:
        ImpactError, TypeError: of ``resolve``, with the names of the scene.
    """
    bodies, contacts = scene.bodies, scene.contacts
    a, b = scene.pairs[i]
    body_b = bodies[b] if bodies[b] is not bodies[a] else Body(*bodies[b])  # two bodies may be equal
    impact = with_scene_names(ContactIndices(i, a, b), resolve, bodies[a], body_b, contacts[i], model)
    sides = ((a, impact.change_a, impact.twist_a), (b, impact.change_b, impact.twist_b))
    moved = [side for side in sides if scene.movable[side[0]]]
    return ClusterAnswer(
        [place for place, _, _ in moved],
        [change for _, change, _ in moved],
        [twist for _, _, twist in moved],
        (impact.contact,),
        (impact.impulse,),
        (impact.normal_velocity_before,),
        (impact.normal_velocity_after,),
        (impact.regime,),
        (
            impact.kinetic_energy_before, impact.kinetic_energy_after,
            impact.energy_lost_restitution, impact.energy_lost_friction,
        ),
        impact.error_bound,
        math.inf,
        impact.adjustments,
        impact.model,
    )  # fmt: skip
