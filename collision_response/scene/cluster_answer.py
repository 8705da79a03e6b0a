"""What becomes of one cluster, and what each copy of a contact has of it."""

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
from .clusters import DistinctContacts
from .request import SceneRequest


class ClusterAnswer(NamedTuple):
    """What becomes of one cluster: see :class:`~collision_response.SceneImpact`.

    Attributes:
        places: the bodies that moved, by their indices in the scene.
        changes, twists: one for each of those.
        contacts, impulses, before, after, regimes: one for each contact.
        energies: before and after, and what restitution and friction lost.
        bound, margin, adjustments, model: of the whole cluster.
    """

    places: Sequence[int]
    changes: Sequence[Twist]
    twists: Sequence[Twist]
    contacts: Sequence[Contact]
    impulses: Sequence[Vec3]
    before: Sequence[Scalar]
    after: Sequence[Scalar]
    regimes: Sequence[Regime]
    energies: Sequence[Scalar]
    bound: float
    margin: Scalar
    adjustments: int
    model: ImpactModel


def split_among_copies(
    answered: ClusterAnswer, scene: SceneRequest, cluster: Sequence[int], copies: DistinctContacts
) -> ClusterAnswer:
    """With an entry for every copy of a contact: they share its impulse, whichever body is given first."""
    contacts, impulses = [], []
    for i, place in zip(cluster, copies.places, strict=True):
        used, count = answered.contacts[place], copies.counts[place]
        same = scene.pairs[i] == scene.pairs[copies.first[place]]
        share: Scalar = Fraction(1, count) if isinstance(answered.impulses[place].x, Fraction) else 1 / count
        impulses.append(answered.impulses[place] * (share if same else -share))
        own = scene.contacts[i]
        contacts.append(used if same else own._replace(restitution=used.restitution, friction=used.friction))
    return answered._replace(
        contacts=contacts,
        impulses=impulses,
        before=[answered.before[place] for place in copies.places],
        after=[answered.after[place] for place in copies.places],
        regimes=[answered.regimes[place] for place in copies.places],
    )
