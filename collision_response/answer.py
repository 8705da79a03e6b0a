"""What an answer holds."""

from __future__ import annotations

from typing import NamedTuple

from .model import Adjustment, ImpactModel
from .physics.body import Twist
from .physics.contact import Contact
from .physics.laws import Regime
from .physics.vector import Vec3
from .status import StatusCode


class Impact(NamedTuple):
    """The answer to one request.

    Attributes:
        status: OK, SEPARATING or TOLERANCE_NOT_MET.
        contact: as used; its restitution is a number.
        model: as used, every AUTO decided.
        twist_a, twist_b: of the bodies' reference points after the impact, in world axes [m/s, rad/s].
        change_a, change_b: what the impact changed of them.
        impulse: on body_a, in world axes [N s].
        normal_impulse: its part along the normal, >= 0 [N s].
        tangential_impulse: the length of the rest [N s].
        normal_velocity_before, normal_velocity_after: of body_a relative to body_b at the contact
            [m/s]; negative when approaching.
        effective_mass: of the two bodies along the normal [kg].
        kinetic_energy_before, kinetic_energy_after: of the dynamic bodies [J]. Of an articulated body only
            the change is known: it counts as 0 before, and as its change after.
        energy_lost_restitution, energy_lost_friction: work done against the normal and against the
            tangential impulse [J].
        regime: what friction did.
        error_bound: upper bound on the relative error of the impulse, and of each twist change
            ``(dv, dw)`` in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``, from rounding and from what
            was not modelled. For an articulated body ``m`` is 1 over the trace of the linear part of its
            inverse inertia, and ``tr(I)/3`` 1 over that of the angular part. The bound is infinite where
            nothing can be said in this precision. Numbers below 2.3e-308 are right to the nearest, not
            relatively.
        adjustments: what was changed from what was asked.
    """

    status: StatusCode
    contact: Contact
    model: ImpactModel
    twist_a: Twist
    twist_b: Twist
    change_a: Twist
    change_b: Twist
    impulse: Vec3
    normal_impulse: float
    tangential_impulse: float
    normal_velocity_before: float
    normal_velocity_after: float
    effective_mass: float
    kinetic_energy_before: float
    kinetic_energy_after: float
    energy_lost_restitution: float
    energy_lost_friction: float
    regime: Regime
    error_bound: float
    adjustments: Adjustment
