"""The front door: validate, choose what the scene requires, compute, report."""

from __future__ import annotations

from typing import Any, NamedTuple

from .model import Adjustment, Geometry, ImpactModel, Law
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.effective_mass import Approach, Planar, Point, Spatial
from .physics.energy import energy_lost, kinetic_energy
from .physics.laws import (
    Outcome,
    Parameters,
    Regime,
    chatterjee_ruina,
    frictionless,
    moreau,
    routh_poisson,
    routh_stronge,
)
from .physics.vector import Vec3
from .requirements import choose_model
from .status import ImpactError, StatusCode
from .validate import check_coefficient, check_request

GEOMETRIES: dict[Geometry, Any] = {
    Geometry.POINT: Point,
    Geometry.PLANAR: Planar,
    Geometry.SPATIAL: Spatial,
}
LAWS = {
    Law.FRICTIONLESS: frictionless,
    Law.COULOMB: chatterjee_ruina,
    Law.MOREAU: moreau,
    Law.ROUTH_POISSON: routh_poisson,
    Law.ROUTH_STRONGE: routh_stronge,
}
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
        error_bound: upper bound on the relative error of the impulse and of each twist change; -1
            where none is computed.
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


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel = ImpactModel()) -> Impact:
    """The twists of two bodies after they collide.

    Args:
        body_a: one body; the contact's normal points to it.
        body_b: the other body.
        contact: where they touch, and the coefficients.
        model: what to model, and how exactly.

    Returns:
        The twists, how they were computed, and the books of energy.

    Raises:
        ImpactError: the request cannot be answered; its ``code``, ``field`` and ``reason`` say why.
    """
    check_request(body_a, body_b, contact, model)
    model = choose_model(body_a, body_b, contact, model)
    approach = GEOMETRIES[model.geometry].prepare(body_a, body_b, contact)
    normal_speed = approach.normal_velocity() / approach.n.norm()
    contact, adjustments = _fill_in(contact, model, -normal_speed)
    if normal_speed < 0:
        parameters = Parameters(
            contact.restitution, contact.friction, model.tangential_restitution, model.tolerance
        )
        outcome = LAWS[model.law](approach, parameters)
        if outcome.fell_back:
            model, adjustments = model._replace(law=Law.COULOMB), adjustments | Adjustment.LAW_FALLBACK
    else:
        outcome = Outcome(approach.n * 0, Regime.SEPARATING)
    return _report(body_a, body_b, contact, model, approach, outcome, adjustments | _normalised(body_a, body_b))


def _fill_in(contact: Contact, model: ImpactModel, approach_speed: float) -> tuple[Contact, Adjustment]:
    """The contact as used: restitution a number, no friction where the law knows none."""
    restitution, adjustments = contact.restitution, Adjustment.NONE
    if callable(restitution):
        restitution = restitution(max(approach_speed, 0.0))
        check_coefficient("contact.restitution(approach_speed)", restitution, 0, 1)
    if restitution and 0 < approach_speed < model.restitution_threshold:
        restitution, adjustments = 0.0, Adjustment.RESTITUTION_THRESHOLD
    friction = 0.0 if model.law is Law.FRICTIONLESS else contact.friction
    return contact._replace(restitution=restitution, friction=friction), adjustments


def _normalised(*bodies: Body) -> Adjustment:
    for body in bodies:
        if body.orientation is not None:
            if abs(body.orientation.squared_length() - 1) > UNIT_LENGTH_TOLERANCE:
                return Adjustment.NORMALISED_ORIENTATION
    return Adjustment.NONE


def _report(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel,
    approach: Approach[Any],
    outcome: Outcome,
    adjustments: Adjustment,
) -> Impact:
    n, length = approach.n, approach.n.norm()
    response = approach.respond(outcome.impulse)
    after_a, after_b = body_a.moved_by(response.change_a), body_b.moved_by(response.change_b)
    normal_impulse = outcome.impulse.dot(n) / length
    lost = energy_lost(n, outcome.impulse, approach.u, response.velocity_after, outcome.normal_work)
    impact = Impact(
        status=StatusCode.SEPARATING if outcome.regime is Regime.SEPARATING else StatusCode.OK,
        contact=contact,
        model=model,
        twist_a=after_a.twist(),
        twist_b=after_b.twist(),
        change_a=response.change_a,
        change_b=response.change_b,
        impulse=response.impulse,
        normal_impulse=normal_impulse,
        tangential_impulse=(outcome.impulse - n * (normal_impulse / length)).norm(),
        normal_velocity_before=approach.normal_velocity() / length,
        normal_velocity_after=n.dot(response.velocity_after) / length,
        effective_mass=n.dot(n) / approach.inverse_effective_mass(),
        kinetic_energy_before=kinetic_energy(body_a) + kinetic_energy(body_b),
        kinetic_energy_after=kinetic_energy(after_a) + kinetic_energy(after_b),
        energy_lost_restitution=lost.restitution,
        energy_lost_friction=lost.friction,
        regime=outcome.regime,
        error_bound=-1.0,
        adjustments=adjustments,
    )
    return impact
