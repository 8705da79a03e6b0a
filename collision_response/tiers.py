"""The precision tiers: what each guarantees, and how.

Every tier returns its answer with a bound on its error. What they promise of that bound:

    SINGLE    it follows the conditioning of the impact: cancellation in the approach speed, inertia,
              friction. One impact is computed in plain float64, which in Python costs no more than
              float32; batches may use float32.
    DOUBLE    cancellation in the approach speed no longer enters: where it would cost more than
              ``GRAZING`` roundings, the speed is computed exactly and rounded once.
    EXTENDED  nothing enters: the impulse and the twist changes are within 1 unit in the last place
              of the exact answer to the given inputs, in norm, whatever the conditioning. For
              FRICTIONLESS and COULOMB.
"""

from __future__ import annotations

import math
from typing import Any

from .model import EXACT_LAWS, Adjustment, Geometry, ImpactModel, Law, Precision
from .numerics import extended
from .numerics.error_bound import (
    NOTHING,
    UNIT_ROUNDOFF,
    Sizes,
    closed_form_bound,
    coulomb_error,
    gain,
    survey,
    total,
    twist_error,
)
from .physics.body import Body
from .physics.contact import Contact
from .physics.effective_mass import Planar, Point, Spatial
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
from .physics.laws.chatterjee_ruina import split
from .physics.laws.routh import path_tolerance
from .physics.number import Scalar
from .report import Impact, is_in_range, normalised, report
from .requirements import Plan
from .validate import check_coefficient

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
GRAZING = 1000.0
"""Roundings that the approach speed may lose before DOUBLE computes it exactly."""

PATH_MARGIN = 10.0
"""A path has up to ten pieces, each with the roundings of a formula."""

INTEGRATION_MARGIN = 3.0
"""The curved ones, at most two, have the integrator's tolerance: a third of one was the most ever seen."""


def single(body_a: Body, body_b: Body, contact: Contact, plan: Plan) -> Impact | None:
    """The plain computation; ``None`` if it leaves the range of float64."""
    return _rounded(body_a, body_b, contact, plan, exact_speed=False)


def double(body_a: Body, body_b: Body, contact: Contact, plan: Plan) -> Impact | None:
    """The computation with the approach speed made good; ``None`` if it leaves the range of float64."""
    return _rounded(body_a, body_b, contact, plan, exact_speed=extended.AVAILABLE)


def extended_tier(body_a: Body, body_b: Body, contact: Contact, plan: Plan) -> Impact | None:
    """The computation with as many digits as it takes; ``None`` if the answer is no float64.

    Nothing is left out: a geometry that drops anything gives way to SPATIAL.
    """
    if plan.dropped != NOTHING:
        plan = Plan(plan.model._replace(geometry=Geometry.SPATIAL), NOTHING)
    geometry, model = GEOMETRIES[plan.model.geometry], extended.lift(plan.model)
    bodies = extended.lift(body_a), extended.lift(body_b)
    contact = extended.lift(contact)

    def compute() -> Impact:
        a, b = (extended.with_inverse_mass(body) for body in bodies)
        return answer(a, b, contact, model, geometry.prepare(a, b, contact))[0]

    def error_of(impact: Impact) -> float:
        return _ball_error(*bodies, impact)

    impact, error = extended.to_enough_digits(compute, error_of)
    impact = extended.lower(impact)
    return impact._replace(error_bound=error + UNIT_ROUNDOFF) if is_in_range(impact) else None


TIERS = {Precision.SINGLE: single, Precision.DOUBLE: double, Precision.EXTENDED: extended_tier}


def answer(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, approach: Any
) -> tuple[Impact, Outcome, Parameters]:
    """The answer in the numbers of the approach, its error unknown; with what the law was given and gave."""
    contact, adjustments = _fill_in(contact, model, -approach.n_u / approach.n.norm())
    parameters = Parameters(
        contact.restitution, contact.friction, model.tangential_restitution, model.tolerance
    )
    if approach.n_u < 0:
        outcome = LAWS[model.law](approach, parameters)
    else:
        outcome = Outcome(approach.n * 0, Regime.SEPARATING)
    if outcome.fell_back:
        model, adjustments = model._replace(law=Law.COULOMB), adjustments | Adjustment.LAW_FALLBACK
    adjustments |= normalised(body_a, body_b)
    impact = report(body_a, body_b, contact, model, approach, outcome, adjustments)
    return impact, outcome, parameters


def _fill_in(contact: Contact, model: ImpactModel, approach_speed: Any) -> tuple[Contact, Adjustment]:
    """The contact as used: restitution a number, no friction where the law knows none."""
    restitution, adjustments = contact.restitution, Adjustment.NONE
    if callable(restitution):
        restitution = restitution(max(float(approach_speed), 0.0))
        check_coefficient("contact.restitution(approach_speed)", restitution, 0, 1)
    if restitution and 0 < approach_speed < model.restitution_threshold:
        restitution, adjustments = 0.0, Adjustment.RESTITUTION_THRESHOLD
    friction = 0.0 if model.law is Law.FRICTIONLESS else contact.friction
    return contact._replace(restitution=restitution, friction=friction), adjustments


def _rounded(body_a: Body, body_b: Body, contact: Contact, plan: Plan, *, exact_speed: bool) -> Impact | None:
    geometry = GEOMETRIES[plan.model.geometry]
    try:
        approach = geometry.prepare(body_a, body_b, contact)
        sizes = survey(approach, plan.dropped)
        if exact_speed and not plan.dropped.speed and is_grazing(sizes):
            n_u = extended.exact_normal_velocity(geometry.prepare, body_a, body_b, contact)
            approach = approach._replace(n_u=n_u)
            sizes = sizes._replace(u_n=n_u / sizes.length, u_n_error=2 * abs(n_u) / sizes.length)
        impact, outcome, parameters = answer(body_a, body_b, contact, plan.model, approach)
        bound = _bound(impact, approach, sizes, outcome, parameters)
    except ArithmeticError:  # a quotient by what has underflowed, or a product that overflows
        return None
    return impact._replace(error_bound=bound) if is_in_range(impact) else None


def is_grazing(sizes: Sizes) -> Scalar:
    """Whether the approach speed loses so much that DOUBLE computes it exactly."""
    return sizes.u_n_error > GRAZING * abs(sizes.u_n)


def _bound(impact: Impact, approach: Any, sizes: Sizes, outcome: Outcome, parameters: Parameters) -> float:
    """The error bound of a rounded answer."""
    if outcome.regime is Regime.SEPARATING:
        return 0.0 if sizes.u_n >= sizes.u_n_error * UNIT_ROUNDOFF else math.inf
    if not sizes.u_n:
        return math.inf
    if impact.model.law is Law.MOREAU:
        return -1.0
    bound: float = bound_of_collision(impact, approach, sizes, outcome, parameters)
    return bound


def bound_of_collision(
    impact: Impact, approach: Any, sizes: Sizes, outcome: Outcome, parameters: Parameters
) -> Scalar:
    """The error bound of a rounded answer about bodies that approach each other, but for MOREAU."""
    law, changes = impact.model.law, (impact.change_a, impact.change_b)
    parts = None if law is Law.FRICTIONLESS else outcome.split or split(approach)
    if law in EXACT_LAWS:
        return closed_form_bound(approach, sizes, parts, parameters, outcome.impulse, changes)
    roundings = coulomb_error(sizes, parts, parameters, approach.n, outcome.impulse)
    curved = impact.model.geometry is Geometry.SPATIAL
    integrated = INTEGRATION_MARGIN * path_tolerance(parameters) / UNIT_ROUNDOFF if curved else 0.0
    roundings = (PATH_MARGIN * roundings + integrated) * outcome.condition
    bodies = approach.body_a, approach.body_b
    return total(roundings * gain(sizes, bodies, changes, outcome.impulse) + twist_error(sizes), sizes)


def _ball_error(body_a: Body, body_b: Body, impact: Impact) -> float:
    """The greatest relative radius of the impulse and of the twist changes, in the norms of the bound."""
    speed: Any = impact.normal_velocity_before
    if speed.contains(0) and not speed.is_exact():
        return math.inf
    errors = [extended.relative_radius(*((x, 1) for x in impact.impulse))]
    for body, change in ((body_a, impact.change_a), (body_b, impact.change_b)):
        moment = body.inertia.trace() / 3
        weighted = [*((x, body.mass) for x in change.linear), *((x, moment) for x in change.angular)]
        errors.append(extended.relative_radius(*weighted))
    return max(errors)
