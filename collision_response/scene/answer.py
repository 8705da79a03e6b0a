"""What an answer for a scene holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..answer import as_tuple, energies_of, in_columns, in_digits
from ..model import Adjustment, ImpactModel
from ..numbers.operations import Scalar
from ..physics.body import Twist
from ..physics.contact import Contact
from ..physics.laws import Law, Regime
from ..physics.vector import Vec3
from ..status import StatusCode

NUMBERS = (
    "kinetic_energy_before",
    "kinetic_energy_after",
    "energy_lost_restitution",
    "energy_lost_friction",
    "error_bound",
    "decision_margin",
)
"""Fields of :class:`SceneImpact` that are one number; messages and recordings have them by the same names."""


class SceneImpact(NamedTuple):
    """The answer for a scene. Of contacts and bodies there is one entry each, in the order given.

    Attributes:
        status: OK, SEPARATING (no contact approaches) or TOLERANCE_NOT_MET.
        model: as used; its law is that of the clusters of several contacts.
        contacts: as used: every restitution is a number, and one for a cluster where the law has one and a
            contact approaches.
        twists: of the bodies' reference points after the impact, in world axes [m/s, rad/s].
        changes: what the impact changed of them.
        impulses: on body_a of each contact, in world axes [N s]. Where several do the same, those of least
            sum of squares; of ROUTH_STRONGE with friction, those that its path ended with.
        normal_velocities_before, normal_velocities_after: of body_a relative to body_b [m/s]; negative when
            approaching.
        regimes: what friction did at each contact; SEPARATING where there is no impulse.
        kinetic_energy_before, kinetic_energy_after: of the dynamic bodies [J].
        energy_lost_restitution, energy_lost_friction: work done against the normal and against the
            tangential impulses [J]; by MOREAU one may be negative, not their sum.
        clusters: the contacts that were resolved together.
        order_sensitivity: how far the answers of one impact after another lie apart, over the orders tried,
            relative to the change of velocity; ``None`` if none were tried.
        error_bound: upper bound on the error of the change of any twist, relative to the largest change in
            its cluster, in the norm of :class:`~collision_response.Impact`. Infinite where nothing can be
            said. Of MOREAU with friction and ROUTH_STRONGE in clusters: an estimate; of MOREAU infinite where
            the law has several answers.
        decision_margin: how far the nearest velocity that decided whether a contact is struck was from the
            threshold, relative to the fastest approach of its cluster; the answer jumps there.
        adjustments: what was changed from what was asked.
    """

    status: StatusCode
    model: ImpactModel
    contacts: tuple[Contact, ...]
    twists: tuple[Twist, ...]
    changes: tuple[Twist, ...]
    impulses: tuple[Vec3, ...]
    normal_velocities_before: tuple[Scalar, ...]
    normal_velocities_after: tuple[Scalar, ...]
    regimes: tuple[Regime, ...]
    kinetic_energy_before: Scalar
    kinetic_energy_after: Scalar
    energy_lost_restitution: Scalar
    energy_lost_friction: Scalar
    clusters: tuple[tuple[int, ...], ...]
    order_sensitivity: float | None
    error_bound: float
    decision_margin: float
    adjustments: Adjustment

    def __str__(self) -> str:
        """A table of the contacts, one of the bodies, and what holds for all."""
        of = {contact: number for number, cluster in enumerate(self.clusters) for contact in cluster}
        return scene_table(self, of, self.order_sensitivity)


def scene_table(
    answer: Any, cluster_of: Mapping[int, int] | Sequence[int], order_sensitivity: float | None = None
) -> str:
    """A :class:`SceneImpact`, or a ``SceneResult`` message: its fields have the same names, but for two.

    Args:
        answer: what to show.
        cluster_of: the number of the cluster of each contact.
        order_sensitivity: as in :class:`SceneImpact`.
    """
    contacts = [
        [
            str(i),
            str(cluster_of[i]),
            Regime(answer.regimes[i]).name,
            *map(in_digits, (contact.restitution, contact.friction)),
            *map(in_digits, (answer.normal_velocities_before[i], answer.normal_velocities_after[i])),
            as_tuple(answer.impulses[i]),
        ]
        for i, contact in enumerate(answer.contacts)
    ]
    bodies = [
        [str(i), as_tuple(twist.linear), as_tuple(twist.angular)] for i, twist in enumerate(answer.twists)
    ]
    status = StatusCode(getattr(answer.status, "code", answer.status))
    lines = [
        f"{status.name} by {Law(answer.model.law).name}, error <= {answer.error_bound:.2g}",
        *in_columns(
            [*["contact", "cluster", "regime", "e", "mu"], "u before", "u after", "impulse"], contacts
        ),
        *in_columns(["body", "velocity", "angular velocity"], bodies),
        energies_of(answer),
    ]
    if order_sensitivity is not None:
        lines.append(f"order sensitivity {order_sensitivity:.2g}")
    if answer.adjustments:
        lines.append(f"adjusted: {Adjustment(answer.adjustments)}")
    return "\n".join(lines)
