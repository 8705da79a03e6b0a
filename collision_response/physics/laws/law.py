"""What every law takes and gives.

A law is a function ``law(contact, coefficients) -> Outcome`` of numbers of any make. It sees two bodies
only through :class:`~collision_response.physics.effective_mass.ContactKinematics`, and its answer counts
only where they approach each other, ``n.u < 0``.
"""

from __future__ import annotations

from typing import NamedTuple

from ...named_enum import NamedEnum
from ...numbers.operations import Condition, Scalar, choose
from ..effective_mass import ContactKinematics, ContactNumbers
from ..vector import Vec3


class Law(NamedEnum):
    """The impact laws; see ``docs/impact-laws.md`` for which to choose."""

    AUTO = 0
    """COULOMB where there is friction, else FRICTIONLESS."""
    FRICTIONLESS = 1
    """Newton's restitution along the normal; no tangential impulse."""
    COULOMB = 2
    """Chatterjee & Ruina's algebraic law with friction; never creates energy."""
    MOREAU = 3
    """Coulomb's friction in one step, as iterative engines converge to; COULOMB where that is unsound."""
    ROUTH_POISSON = 4
    """Friction along the path of the impulse; restitution of impulse."""
    ROUTH_STRONGE = 5
    """Friction along the path of the impulse; restitution of energy."""
    COMPLIANT = 6
    """Springs along and across the normal, friction between them; restitution of energy."""


class Settings(NamedTuple):
    """The numbers of a model, by the names that they have in :class:`~collision_response.ImpactModel`.

    Attributes:
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB.
        restitution_threshold: approach speed [m/s] under which restitution is taken as 0. Laws need not mind.
        tolerance: relative error of the impulse at which a law that integrates may stop.
        stiffness_ratio: tangential over normal stiffness of the contact, > 0, for COMPLIANT.
        law: the number of the law, for a formula that serves two. Left out: of the law that is asked.
    """

    tangential_restitution: Scalar = 0.0
    restitution_threshold: Scalar = 0.0
    tolerance: Scalar = 0.0
    stiffness_ratio: Scalar = 1.0
    law: Scalar | None = None


class Coefficients(NamedTuple):
    """What a law needs to know besides the bodies.

    Attributes:
        restitution: ``e`` in [0, 1].
        friction: ``mu`` >= 0; for the laws of ``BY_SPEED`` a function that gives it for a slip speed [m/s].
        settings: of the model.
    """

    restitution: Scalar
    friction: Scalar = 0.0
    settings: Settings = Settings()


class Solution(NamedTuple):
    """An :class:`Outcome` without its flags."""

    impulse: Vec3
    regime: Scalar
    energy_lost_restitution: Scalar
    energy_lost_friction: Scalar


class Regime(NamedEnum):
    """What friction did: the constants of ``msg/CollisionResult.msg``."""

    SEPARATING = 1
    """The bodies do not approach: no impulse."""
    STICKING = 2
    """Friction holds: it stays below its limit, or the path of the impulse ends without slip."""
    SLIDING = 3
    """Friction is at its limit; or there is none."""
    REVERSED = 4
    """As SLIDING, and the slip ends against its first direction."""
    JAMMED = 5
    """Friction pressed the bodies together for a while (Painleve)."""


class Outcome(NamedTuple):
    """The answer of a law.

    Attributes:
        impulse: on body_a [N s].
        regime: what friction did: the number of a :class:`Regime`.
        energy_lost_restitution: energy lost to the normal impulse [J].
        energy_lost_friction: energy lost to the tangential impulse [J].
        normal_factor: ``j``, if the impulse is ``j n`` by the law; the response is then cheaper.
        fell_back: whether the law had no sound answer, and this is Chatterjee & Ruina's.
        unfinished: whether a loop of the law ended by its budget.
        estimated_error: an estimate of the error of ``impulse`` by a law that can give no bound [N s].
        out_of_range: whether a square that it hangs on leaves the range of its numbers.
    """

    impulse: Vec3
    regime: Scalar
    energy_lost_restitution: Scalar
    energy_lost_friction: Scalar
    normal_factor: Scalar | None = None
    fell_back: Condition = False
    unfinished: Condition = False
    estimated_error: Vec3 | None = None
    out_of_range: Condition = False


def slip_regime(contact: ContactKinematics | ContactNumbers, velocity_after: Vec3) -> Scalar:
    """The regime of a contact that ends with slip: SLIDING, or REVERSED against its first direction."""
    n, u = contact.n, contact.u
    slip_before = u - n * (n.dot(u) / n.dot(n))
    return choose(
        slip_before.dot(velocity_after) < 0, lambda: 1.0 * Regime.REVERSED, lambda: 1.0 * Regime.SLIDING
    )
