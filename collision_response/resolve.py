"""The front door for one impact: check, decide, compute in growing precision, answer."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from . import validity
from .answer import Impact, norm_components
from .geometry import reduce_body, reduce_contact
from .in_python import arbitrary_precision, exact_fractions, friction_along_path
from .in_python.coefficients_at_speed import initial_friction, restitution_at_speed
from .kernels import library
from .kernels.protocol import Handover
from .model import (
    DEFAULT,
    USEFUL_BOUND,
    Adjustment,
    Geometry,
    ImpactModel,
    Precision,
    check_number,
    law_for,
    plan_model,
)
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.laws import BY_SPEED, Law, Regime
from .physics.vector import Vec3
from .status import ImpactError, StatusCode

NOT_MET = StatusCode.TOLERANCE_NOT_MET
"""Of the kernels: look for more digits; it may turn out that these are enough for what was asked."""


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel = DEFAULT) -> Impact:
    """The twists of two bodies after they collide.

    Args:
        body_a: one body; the contact's normal points to it. If a number of the request is a
            :class:`fractions.Fraction`, FRICTIONLESS answers exactly, in fractions.
        body_b: the other body.
        contact: where they touch, and the coefficients.
        model: what to model, and how exactly.

    Returns:
        The twists, how they were computed and how exactly, and what became of the energy.

    Raises:
        ImpactError: the request cannot be answered; its ``code``, ``field`` and ``reason`` say why.
        TypeError: a field is not of the kind that it should be.
    """
    impact = library.resolve(body_a, body_b, contact, model)
    if impact.__class__ is Impact and impact.status is not NOT_MET:
        return impact
    return _left_to_python(body_a, body_b, contact, model, impact)


OF_BODIES = Adjustment.NORMALISED_ORIENTATION | Adjustment.MASSLESS_SPIN


def _left_to_python(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, answer: Impact | int
) -> Impact:
    """What the kernels do not answer, or not exactly enough: then ``answer`` is theirs, else it says why."""
    if answer == Handover.INVALID:
        validity.check_distinct(body_a, body_b)
        a, b, numeric = arbitrary_precision.read_request(body_a, body_b, contact)
        e_t = plan_model(model).settings.tangential_restitution
        validity.check(a, b, numeric, e_t, (body_a, body_b, contact))
        raise ImpactError(StatusCode.INTERNAL_ERROR, "request", "was refused for no known reason")
    if answer == Handover.NOT_ONLY_NUMBERS:
        if contact.tangential_restitution is not None:
            return _with_own_tangential(body_a, body_b, contact, model)
        contact = _with_numbers(body_a, body_b, contact, model)
        if callable(contact.friction):
            return _along_path(body_a, body_b, contact, model)
        return resolve(body_a, body_b, contact, model)
    if answer == Handover.RATIONAL:
        return exact_fractions.resolve(body_a, body_b, contact, model)
    if answer == Handover.GEOMETRY_TOO_SMALL:
        return _leaving_out(body_a, body_b, contact, model)
    may_climb = plan_model(model).last_precision is Precision.EXTENDED
    more = arbitrary_precision.resolve(body_a, body_b, contact, model) if may_climb else None
    if more is not None and not (isinstance(answer, Impact) and answer.error_bound < more.error_bound):
        return more
    has_threshold = model.restitution_threshold > 0 and contact.restitution > 0
    if may_climb and has_threshold and model.law is not Law.FRICTIONLESS:
        decided = _with_threshold_decided(body_a, body_b, contact, model)
        if decided is not None:
            return decided
    if not isinstance(answer, Impact):
        raise library.refusal(StatusCode.OUT_OF_RANGE)
    return (
        answer._replace(status=_status(answer))
        if answer.error_bound <= plan_model(model).bound_limit
        else answer
    )


def _status(answer: Impact) -> StatusCode:
    return StatusCode.SEPARATING if answer.regime is Regime.SEPARATING else StatusCode.OK


def _with_numbers(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Contact:
    """The contact with the coefficients that its functions give for the speeds at first touch.

    Friction stays a function for laws that follow it on its way.
    """
    if callable(contact.friction) and model.law not in BY_SPEED:
        law = law_for(model.law, has_friction=True)
        mu = 0.0 if law is Law.FRICTIONLESS else initial_friction(body_a, body_b, contact, law)
        contact = contact._replace(friction=mu)
    if callable(contact.restitution):
        elastic = contact._replace(restitution=1.0, friction=0.0)
        simple = model._replace(restitution_threshold=0.0, tolerance=0.0, precision=Precision.EXTENDED)
        before = resolve(body_a, body_b, elastic, simple).normal_velocity_before
        e = restitution_at_speed(float(max(-before, 0.0)), contact, "contact")
        contact = contact._replace(restitution=e)
    return contact


def _along_path(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """The answer where friction is a function, by a law that follows it."""
    impact = friction_along_path.resolve(body_a, body_b, contact, model)
    return _leaving_out(body_a, body_b, contact, model) if impact is None else impact


def _with_threshold_decided(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel
) -> Impact | None:
    """The answer by a law that more digits make no more exact; ``None`` if no digits decide the threshold.

    Whether an approach is slower than that no law decides, so FRICTIONLESS does.
    """
    bare = model._replace(law=Law.FRICTIONLESS, precision=Precision.EXTENDED, tolerance=0.0)
    approach = resolve(body_a, body_b, contact._replace(restitution=1.0, friction=0.0), bare)
    if not approach.error_bound <= USEFUL_BOUND:
        return None
    is_slow = Adjustment.RESTITUTION_THRESHOLD in approach.adjustments
    used = contact._replace(restitution=0.0) if is_slow else contact
    impact = resolve(body_a, body_b, used, model._replace(restitution_threshold=0.0))
    return impact._replace(
        model=impact.model._replace(restitution_threshold=model.restitution_threshold),
        adjustments=impact.adjustments | (is_slow * Adjustment.RESTITUTION_THRESHOLD),
    )


def _with_own_tangential(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """The answer where the contact, not the model, says what the tangential restitution is."""
    e_t = contact.tangential_restitution
    check_number("contact.tangential_restitution", e_t, -1, 1, StatusCode.INVALID_COEFFICIENT)
    given = contact._replace(tangential_restitution=None)
    impact = resolve(body_a, body_b, given, model_with(model, e_t))
    return impact._replace(contact=impact.contact._replace(tangential_restitution=e_t))


@lru_cache(maxsize=64)
def model_with(model: ImpactModel, tangential_restitution: Any) -> ImpactModel:
    """Equal ones are one object: the kernels remember by that what a model comes to."""
    return model._replace(tangential_restitution=tangential_restitution)


def _leaving_out(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """The answer of a geometry that leaves out what matters; the bound counts that too."""
    geometry = model.geometry
    if body_a.is_articulated() or body_b.is_articulated():
        reason = f"must be AUTO or SPATIAL for an articulated body, is {geometry.name}"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)
    if geometry is Geometry.PLANAR and not (contact.normal[0] or contact.normal[1]):
        reason = f"has no part in the x-y plane, which is all that PLANAR models: {tuple(contact.normal)}"
        raise ImpactError(StatusCode.INVALID_NORMAL, "contact.normal", reason)
    whole = resolve(body_a, body_b, contact, model._replace(geometry=Geometry.SPATIAL))
    flat_a, flat_b = (reduce_body(body, geometry) for body in (body_a, body_b))
    flat = resolve(flat_a, flat_b, reduce_contact(contact, geometry), model)
    bound = max(
        flat.error_bound,
        _apart(flat.impulse, whole.impulse, whole.error_bound),
        _apart(
            norm_components(body_a, flat.change_a), norm_components(body_a, whole.change_a), whole.error_bound
        ),
        _apart(
            norm_components(body_b, flat.change_b), norm_components(body_b, whole.change_b), whole.error_bound
        ),
    )
    limit = plan_model(model).bound_limit
    return flat._replace(
        status=flat.status if bound <= limit else StatusCode.TOLERANCE_NOT_MET,
        twist_a=_sum(body_a, flat.change_a),
        twist_b=_sum(body_b, flat.change_b),
        kinetic_energy_before=whole.kinetic_energy_before,
        kinetic_energy_after=whole.kinetic_energy_before
        + flat.kinetic_energy_after
        - flat.kinetic_energy_before,
        error_bound=bound,
        adjustments=flat.adjustments | (whole.adjustments & OF_BODIES),
    )


def _sum(body: Body, change: Twist) -> Twist:
    return Twist(Vec3(*body.velocity) + change.linear, Vec3(*body.angular_velocity) + change.angular)


def _apart(flat: tuple[float, ...], whole: tuple[float, ...], whole_bound: float) -> float:
    """The relative distance of an answer from another, which is itself within a bound of the truth."""
    if not whole_bound < 1:
        return math.inf
    size = math.hypot(*whole)
    if size == 0.0:  # as is the truth then
        return 0.0 if math.hypot(*flat) == 0.0 else math.inf
    return (math.dist(flat, whole) / size + whole_bound) / (1 - whole_bound) * (1 + 2.0**-40)
