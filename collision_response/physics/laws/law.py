"""The types that every impact law takes and returns.

A law is a function ``law(contact, coefficients) -> Outcome`` of numbers of any type. It sees the two bodies
only through :class:`~collision_response.physics.effective_mass.ContactKinematics`. Its outcome is used only
if they approach each other, ``n.u < 0``.
"""

from __future__ import annotations

from typing import NamedTuple

from ...named_enum import NamedEnum
from ...numbers.operations import Condition, Scalar, choose
from ..effective_mass import ContactKinematics, ContactNumbers
from ..stiffness import METAL_ON_METAL
from ..vector import Vec3


class Law(NamedEnum):
    """The impact laws. ``docs/impact-laws.md`` explains them and helps to choose one."""

    AUTO = 0
    """COULOMB if there is friction, else FRICTIONLESS."""
    FRICTIONLESS = 1
    """Newton's restitution along the normal, no tangential impulse."""
    COULOMB = 2
    """Chatterjee & Ruina's algebraic law with Coulomb friction."""
    MOREAU = 3
    """Moreau's one-step law, to which iterative engines converge; COULOMB if it would create energy."""
    ROUTH_POISSON = 4
    """Routh's path of the impulse with Coulomb friction; Poisson's restitution of impulse."""
    ROUTH_STRONGE = 5
    """Routh's path of the impulse with Coulomb friction; Stronge's restitution of energy."""
    COMPLIANT = 6
    """Normal and tangential springs with Coulomb friction between them; restitution of energy."""


class Settings(NamedTuple):
    """The numbers of an :class:`~collision_response.ImpactModel`, under the same names.

    Attributes:
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB.
        restitution_threshold: approach speed below which restitution is 0 [m/s]. The caller of a law applies
            it.
        tolerance: relative error of the impulse that a law which integrates may make; 0 for its default.
        stiffness_ratio: tangential over normal stiffness of the contact, > 0, for COMPLIANT.
        law: number of the :class:`Law`, for a function that computes several; ``None`` until it is known.
    """

    tangential_restitution: Scalar = 0.0
    restitution_threshold: Scalar = 0.0
    tolerance: Scalar = 0.0
    stiffness_ratio: Scalar = METAL_ON_METAL
    law: Scalar | None = None


class Coefficients(NamedTuple):
    """The coefficients of a contact and the settings of the model.

    Attributes:
        restitution: ``e`` in [0, 1].
        friction: ``mu`` >= 0; for the laws of ``BY_SPEED``, a function of the slip speed [m/s].
        settings: of the model.
    """

    restitution: Scalar
    friction: Scalar = 0.0
    settings: Settings = Settings()


class Solution(NamedTuple):
    """The first four fields of an :class:`Outcome`."""

    impulse: Vec3
    regime: Scalar
    energy_lost_restitution: Scalar
    energy_lost_friction: Scalar


class Regime(NamedEnum):
    """What friction did during the impact. The numbers are those of ``msg/CollisionResult.msg``."""

    SEPARATING = 1
    """The bodies do not approach each other: there is no impulse."""
    STICKING = 2
    """Friction stays below its limit, or the impact ends without slip."""
    SLIDING = 3
    """Friction is at its limit, or there is no friction."""
    REVERSED = 4
    """As SLIDING, and the slip after the impact is against the slip before."""
    JAMMED = 5
    """For part of the impact, friction pressed the bodies together (Painleve's paradox)."""


class Outcome(NamedTuple):
    """The result of a law.

    Attributes:
        impulse: on body_a [N s].
        regime: the number of a :class:`Regime`.
        energy_lost_restitution, energy_lost_friction: how much energy restitution and friction take [J]. Each
            law says how it divides the loss.
        normal_factor: ``j`` if the impulse of this law is always ``j n``, which makes the change of the
            twists cheaper to compute; else ``None``.
        fell_back: whether the law had no sound answer, and this is that of COULOMB.
        unfinished: whether a loop used up its budget of steps.
        estimated_error: estimated error of ``impulse`` [N s], from a law that cannot bound it; else ``None``.
        out_of_range: whether a square that the result depends on overflowed, or lost digits to underflow.
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
    """The regime of a contact that slips after the impact: SLIDING or REVERSED."""
    n, u = contact.n, contact.u
    slip_before = u - n * (n.dot(u) / n.dot(n))
    return choose(
        slip_before.dot(velocity_after) < 0, lambda: 1.0 * Regime.REVERSED, lambda: 1.0 * Regime.SLIDING
    )
