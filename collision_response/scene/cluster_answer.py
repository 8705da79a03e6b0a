"""The answer for one cluster, and how copies of a contact share it."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from ..model import ImpactModel
from ..numbers.operations import Scalar
from ..physics.body import Twist
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.vector import Vec3
from .find_clusters import DistinctContacts
from .request import SceneRequest


class ClusterAnswer(NamedTuple):
    """The part of a :class:`~collision_response.SceneImpact` that one cluster determines.

    Attributes:
        bodies: indices in the scene of the movable bodies of the cluster.
        changes, twists: one for each of those bodies.
        contacts, impulses, normal_velocities_before, normal_velocities_after, regimes: one for each contact.
        energies: kinetic energy before and after, energy lost to restitution and to friction [J].
        error_bound, decision_margin, adjustments, model: for the whole cluster.
    """

    bodies: Sequence[int]
    changes: Sequence[Twist]
    twists: Sequence[Twist]
    contacts: Sequence[Contact]
    impulses: Sequence[Vec3]
    normal_velocities_before: Sequence[Scalar]
    normal_velocities_after: Sequence[Scalar]
    regimes: Sequence[Regime]
    energies: Sequence[Scalar]
    error_bound: float
    decision_margin: Scalar
    adjustments: int
    model: ImpactModel


def split_among_copies(
    answer: ClusterAnswer, scene: SceneRequest, cluster: Sequence[int], distinct: DistinctContacts
) -> ClusterAnswer:
    """Return the answer with an entry for every contact of ``cluster``, from one for distinct contacts.

    Copies share the impulse of their contact equally. A copy that names the two bodies in the opposite order
    gets its share with the opposite sign.
    """
    contacts, impulses = [], []
    for i, place in zip(cluster, distinct.places, strict=True):
        used, impulse, count = answer.contacts[place], answer.impulses[place], distinct.counts[place]
        share: Scalar = Fraction(1, count) if isinstance(impulse.x, Fraction) else 1 / count
        if scene.pairs[i] == scene.pairs[distinct.indices[place]]:
            contacts.append(used)
            impulses.append(impulse * share)
        else:
            given = scene.contacts[i]
            contacts.append(given._replace(restitution=used.restitution, friction=used.friction))
            impulses.append(impulse * -share)
    return answer._replace(
        contacts=contacts,
        impulses=impulses,
        normal_velocities_before=[answer.normal_velocities_before[place] for place in distinct.places],
        normal_velocities_after=[answer.normal_velocities_after[place] for place in distinct.places],
        regimes=[answer.regimes[place] for place in distinct.places],
    )
