"""The answer for a scene, and how it is printed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..answer import BODY_HEAD, CONTACT_HEAD, body_row, contact_row, format_columns, format_energies
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
"""The fields of :class:`SceneImpact` that are one number. Messages and recordings use the same names."""


class SceneImpact(NamedTuple):
    """The answer for a scene. Sequences have one entry for each contact or body, in the order given.

    Attributes:
        status: OK, SEPARATING (no contact approaches) or TOLERANCE_NOT_MET.
        model: as used. Its law is the one for clusters of several contacts.
        contacts: as used. Every restitution is a number. Laws with one restitution for a cluster give it to
            all contacts of a cluster in which a contact approaches.
        twists: of the bodies' reference points after the impact, in world axes [m/s, rad/s].
        changes: of the twists by the impact.
        impulses: on body_a of each contact, in world axes [N s]. Where several sets of impulses have the same
            effect, the one with the least sum of squares; with ROUTH_STRONGE and friction, the one at the end
            of the path.
        normal_velocities_before, normal_velocities_after: of body_a relative to body_b [m/s]; negative when
            approaching.
        regimes: what friction did at each contact; SEPARATING where there is no impulse.
        kinetic_energy_before, kinetic_energy_after: of the dynamic bodies [J].
        energy_lost_restitution, energy_lost_friction: work done against the normal and against the tangential
            impulses [J]; in clusters of one contact the parts that the law names so, as in
            :class:`~collision_response.Impact`. With friction one of them may be negative, but not their sum.
        clusters: indices of the contacts that were resolved together.
        order_sensitivity: greatest distance between the answers if contacts are resolved one after another,
            over the orders tried, relative to the change of velocity, in the cluster where it is greatest;
            infinite if an order does not end, ``None`` if none were tried.
        error_bound: upper bound on the error of the change of any twist, relative to the largest change in
            its cluster, in the norm of :class:`~collision_response.Impact`. Infinite if nothing can be said.
            In clusters resolved by ROUTH_STRONGE, or by MOREAU with friction, it is an estimate; with MOREAU
            it is infinite where the law has several answers.
        decision_margin: distance from the threshold of the nearest velocity that decided whether a contact
            takes part in a reflection, relative to the fastest approach of its cluster. The answer jumps at
            the threshold. COULOMB with friction has other jumps, see ``docs/scenes.md``.
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
        """Return a table of the contacts, a table of the bodies, and what holds for the whole scene."""
        return scene_table(self, self.cluster_of_contacts(), self.order_sensitivity)

    def cluster_of_contacts(self) -> list[int]:
        """Return the number of each contact's cluster."""
        number = {i: c for c, cluster in enumerate(self.clusters) for i in cluster}
        return [number[i] for i in range(len(self.contacts))]


def scene_table(answer: Any, cluster_of: Sequence[int], order_sensitivity: float | None = None) -> str:
    """Return a :class:`SceneImpact`, or a ``SceneResult`` message, as a table.

    Both have fields of the same names, except for the two that are arguments here.

    Args:
        answer: what to show.
        cluster_of: for each contact, the number of its cluster.
        order_sensitivity: as in :class:`SceneImpact`.
    """
    normal_velocities = answer.normal_velocities_before, answer.normal_velocities_after
    of_contacts = zip(answer.regimes, answer.contacts, *normal_velocities, answer.impulses, strict=True)
    contacts = ([str(i), str(cluster_of[i]), *contact_row(*one)] for i, one in enumerate(of_contacts))
    bodies = (body_row(str(i), twist) for i, twist in enumerate(answer.twists))
    status = StatusCode(getattr(answer.status, "code", answer.status))
    lines = [
        f"{status} by {Law(answer.model.law)}, relative error at most {answer.error_bound:.2g}",
        *format_columns(["contact", "cluster", *CONTACT_HEAD], contacts),
        *format_columns(BODY_HEAD, bodies),
        format_energies(answer),
    ]
    if order_sensitivity is not None:
        lines.append(f"order sensitivity {order_sensitivity:.2g}")
    if answer.adjustments:
        lines.append(f"adjusted: {Adjustment(answer.adjustments)}")
    return "\n".join(lines)
