"""What an answer holds, and how it is put together from a law's outcome."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .model import Adjustment, ImpactModel
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.effective_mass import Approach
from .physics.energy import energy_lost, kinetic_energy
from .physics.laws import Outcome, Regime
from .physics.number import Scalar, square_root
from .physics.orientation import Quaternion
from .physics.vector import Vec3
from .status import StatusCode

UNIT_LENGTH_TOLERANCE = 1e-9
"""How far the squared length of a quaternion may be from 1 before its normalising is reported."""


class Impact(NamedTuple):
    """The answer to one request.

    Attributes:
        status: OK, SEPARATING or TOLERANCE_NOT_MET.
        contact: as used; its restitution is a number.
        model: as used, every AUTO decided.
        twist_a, twist_b: of the centres of mass after the impact, in world axes [m/s, rad/s].
        change_a, change_b: what the impact changed of them.
        impulse: on body_a, in world axes [N s].
        normal_impulse: its part along the normal, >= 0 [N s].
        tangential_impulse: the length of the rest [N s].
        normal_velocity_before, normal_velocity_after: of body_a relative to body_b at the contact
            [m/s]; negative when approaching.
        effective_mass: of the two bodies along the normal [kg].
        kinetic_energy_before, kinetic_energy_after: of the dynamic bodies [J].
        energy_lost_restitution, energy_lost_friction: work done against the normal and against the
            tangential impulse [J].
        regime: what friction did.
        error_bound: upper bound on the relative error of the impulse, and of each twist change
            ``(dv, dw)`` in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``, from rounding and from what
            was not modelled; infinite where nothing can be said in this precision, -1 for MOREAU, for
            which none is known. Numbers below 2.3e-308 are right to the nearest, not relatively.
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


NUMBERS = slice(Impact._fields.index("normal_impulse"), Impact._fields.index("regime"))
"""Where the scalars of an answer are."""


def report(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel,
    approach: Approach[Any],
    outcome: Outcome,
    adjustments: Adjustment,
) -> Impact:
    """The answer, all but its error bound, in the numbers of the approach."""
    n, length = approach.n, approach.n.norm()
    response = approach.respond(outcome.impulse)
    after_a, after_b = body_a.moved_by(response.change_a), body_b.moved_by(response.change_b)
    normal_impulse = outcome.impulse.dot(n) / length
    tangential = outcome.impulse - n * (normal_impulse / length)
    lost = energy_lost(n, outcome.impulse, approach.u, response.velocity_after, outcome.normal_work)
    return Impact(
        status=StatusCode.SEPARATING if outcome.regime is Regime.SEPARATING else StatusCode.OK,
        contact=contact,
        model=model,
        twist_a=after_a.twist(),
        twist_b=after_b.twist(),
        change_a=response.change_a,
        change_b=response.change_b,
        impulse=response.impulse,
        normal_impulse=normal_impulse,
        tangential_impulse=square_root(tangential.dot(tangential)),
        normal_velocity_before=approach.n_u / length,
        normal_velocity_after=n.dot(response.velocity_after) / length,
        effective_mass=n.dot(n) / approach.n_Kn,
        kinetic_energy_before=kinetic_energy(body_a) + kinetic_energy(body_b),
        kinetic_energy_after=kinetic_energy(after_a) + kinetic_energy(after_b),
        energy_lost_restitution=lost.restitution,
        energy_lost_friction=lost.friction,
        regime=outcome.regime,
        error_bound=math.inf,
        adjustments=adjustments,
    )


def normalised(*bodies: Body) -> Adjustment:
    """Whether a quaternion was not of unit length."""
    for body in bodies:
        if body.orientation is not None and is_off_unit(body.orientation):
            return Adjustment.NORMALISED_ORIENTATION
    return Adjustment.NONE


def is_off_unit(orientation: Quaternion) -> Scalar:
    """Whether a quaternion is so far from unit length that its normalising is reported."""
    return abs(orientation.squared_length() - 1) > UNIT_LENGTH_TOLERANCE


def is_in_range(impact: Impact) -> bool:
    """Whether all numbers of the answer are finite."""
    twists = (impact.twist_a, impact.twist_b, impact.change_a, impact.change_b)
    vectors = (impact.impulse, *(vector for twist in twists for vector in twist))
    numbers = impact[NUMBERS]
    return all(map(math.isfinite, numbers)) and all(math.isfinite(x) for vector in vectors for x in vector)
