"""Resolve one impact: the compiled kernels answer nearly every request, Python the few that they hand over.

A request takes this path:

1. ``kernels/resolve.cpp`` looks up the model's plan (``plan_model`` in ``model.py``), reads the bodies and
   the contact, checks them by the rules of ``validity.py``, and computes the formulas of ``impact.py`` in the
   first precision of the plan, then in the next ones, until the error bound is low enough. Whether bodies
   approach, and below the threshold, is decided without rounding where digits may not tell. Nearly every
   request ends here.
2. Otherwise :func:`_resolve_in_python` takes over. If the bound is still too large, or nothing is known of
   the answer, ``in_python/arbitrary_precision.py`` computes with as many digits as it takes. The other
   reasons are things that the kernels cannot compute: fractions, coefficients that are functions, a
   tangential restitution of the contact, a geometry that leaves out part of the impact, and requests that
   break a rule.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NoReturn

from . import validity
from .answer import Impact, relative_difference
from .arguments import check_number
from .geometry import reduce_body, reduce_contact
from .impact import with_change
from .in_python import arbitrary_precision, exact_fractions, friction_along_path
from .in_python.coefficients_at_speed import approach_speed, initial_friction, restitutions_at_speeds
from .in_python.request_numbers import read_request
from .kernels import library
from .kernels.protocol import Handover
from .model import (
    DEFAULT,
    ULP,
    Adjustment,
    Geometry,
    ImpactModel,
    Precision,
    bound_limit,
    in_finest_steps,
    law_for,
    plan_model,
    settled_bound,
)
from .physics.body import Body
from .physics.contact import Contact
from .physics.laws import BY_SPEED, Law, Regime
from .status import ImpactError, StatusCode


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel = DEFAULT) -> Impact:
    """Compute the impact of two bodies: their twists afterwards, and how exact these are.

    Args:
        body_a: one body. The contact's normal points from ``body_b`` to ``body_a``.
        body_b: the other body.
        contact: where the bodies touch, with restitution and friction.
        model: what to model, and how exactly.

    Returns:
        The twists after the impact, the impulse, the energies, the model that was used, and a bound on the
        relative error. If a number of the request is a :class:`fractions.Fraction`, the law is
        FRICTIONLESS, and no body is articulated, the answer is exact and consists of fractions.

    Raises:
        ImpactError: if the request cannot be answered. Its ``code``, ``field`` and ``reason`` say why.
        TypeError: if an argument or one of its fields has the wrong type.
    """
    return library.resolve(body_a, body_b, contact, model, _resolve_in_python)


def _resolve_in_python(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, answer: Impact | int
) -> Impact:
    """Answer a request that the kernels did not answer, or not exactly enough.

    Args:
        body_a, body_b, contact, model: the request.
        answer: the kernels' answer, if its error bound is too large; else the number of the
            :class:`~collision_response.kernels.protocol.Handover` that says why there is no answer.
    """
    if isinstance(answer, Impact):
        return _resolve_more_exactly(body_a, body_b, contact, model, answer)
    if answer == Handover.NOTHING_KNOWN:
        return _resolve_more_exactly(body_a, body_b, contact, model, None)
    if answer == Handover.NOT_ONLY_NUMBERS:
        return _resolve_with_own_coefficients(body_a, body_b, contact, model)
    if answer == Handover.RATIONAL:
        return exact_fractions.resolve(body_a, body_b, contact, model)
    if answer == Handover.GEOMETRY_TOO_SMALL:
        return _resolve_reduced(body_a, body_b, contact, model)
    _raise_fault(body_a, body_b, contact, model)


def _raise_fault(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> NoReturn:
    """Raise the error that says which rule a request breaks."""
    validity.check_distinct(body_a, body_b)
    a, b, numeric_contact = read_request(body_a, body_b, contact)
    e_t = plan_model(model).settings.tangential_restitution
    validity.check(a, b, numeric_contact, e_t, (body_a, body_b, contact))
    raise ImpactError(StatusCode.INTERNAL_ERROR, "request", "was refused for no known reason")


def _resolve_more_exactly(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, answer: Impact | None
) -> Impact:
    """Answer with more digits than the kernels have, as far as the model allows more and more digits help.

    Args:
        body_a, body_b, contact, model: the request.
        answer: the best answer of the kernels; ``None`` if they know no number of it.
    """
    plan = plan_model(model)
    is_settled = answer is not None and answer.error_bound < settled_bound(answer.model)
    if plan.last_precision is Precision.EXTENDED and not is_settled:
        if model.restitution_threshold > 0 and contact.restitution > 0:
            return _resolve_with_threshold_decided(body_a, body_b, contact, model)
        more = arbitrary_precision.resolve(body_a, body_b, contact, model)
        if more is not None and (answer is None or not answer.error_bound < more.error_bound):
            return more
    if answer is None:
        if plan.last_precision is Precision.EXTENDED:
            raise library.refusal(StatusCode.OUT_OF_RANGE)
        reason = f"{model.precision.name} leaves no digit of the answer: ask for AUTO or EXTENDED"
        raise ImpactError(StatusCode.OUT_OF_RANGE, "model.precision", reason)
    if not answer.error_bound <= plan.bound_limit:
        answer = _with_finest_steps(body_a, body_b, contact, model.precision, answer)
    if not answer.error_bound <= plan.bound_limit:
        return answer._replace(status=StatusCode.TOLERANCE_NOT_MET)
    # The kernels aimed at plan.target_bound, which may be lower.
    separates = answer.regime is Regime.SEPARATING
    return answer._replace(status=StatusCode.SEPARATING if separates else StatusCode.OK)


def _with_finest_steps(
    body_a: Body, body_b: Body, contact: Contact, precision: Precision, answer: Impact
) -> Impact:
    """Return the answer with the finest steps of a path, if its bound is lower."""
    finest = in_finest_steps(answer.model)
    if finest is None:
        return answer
    try:
        finer = resolve(body_a, body_b, contact, finest._replace(precision=precision))
    except ImpactError:  # PATH_TOO_LONG, mostly: the answer that there is stands
        return answer
    if not finer.error_bound < answer.error_bound:
        return answer
    return finer._replace(model=finer.model._replace(tolerance=answer.model.tolerance))


def _resolve_with_threshold_decided(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel
) -> Impact:
    """Answer where double-doubles may leave open whether the approach is slower than the threshold.

    That does not depend on the law, so fractions decide it by FRICTIONLESS. No number of digits could if the
    two speeds are equal.
    """
    approach = exact_fractions.resolve(body_a, body_b, contact._replace(friction=0.0), model)
    is_below = Adjustment.RESTITUTION_THRESHOLD in approach.adjustments
    used = contact._replace(restitution=0.0) if is_below else contact
    impact = resolve(body_a, body_b, used, model._replace(restitution_threshold=0.0))
    return impact._replace(
        model=impact.model._replace(restitution_threshold=model.restitution_threshold),
        adjustments=impact.adjustments | (is_below * Adjustment.RESTITUTION_THRESHOLD),
    )


def _resolve_with_own_coefficients(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel
) -> Impact:
    """Answer where a coefficient is a function, or the contact has its own tangential restitution."""
    e_t = contact.tangential_restitution
    if e_t is not None:
        number = check_number("contact.tangential_restitution", e_t, -1, 1, StatusCode.INVALID_COEFFICIENT)
        e_t = number if e_t.__hash__ is None else e_t  # an array of one number
        contact = contact._replace(tangential_restitution=None)
        impact = resolve(body_a, body_b, contact, model._replace(tangential_restitution=e_t))
        return impact._replace(contact=impact.contact._replace(tangential_restitution=e_t))
    contact = _with_initial_coefficients(body_a, body_b, contact, model)
    if not callable(contact.friction):
        return resolve(body_a, body_b, contact, model)
    followed = friction_along_path.resolve(body_a, body_b, contact, model)
    if followed is not None:
        return followed
    if not (body_a.is_articulated() or body_b.is_articulated()):
        return _resolve_reduced(body_a, body_b, contact, model)
    first = initial_friction(body_a, body_b, contact, Law.COULOMB)
    coulomb = model._replace(law=Law.COULOMB)
    impact = resolve(body_a, body_b, contact._replace(friction=first), coulomb)
    return impact._replace(adjustments=impact.adjustments | Adjustment.LAW_FALLBACK)


def _with_initial_coefficients(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Contact:
    """Evaluate the coefficients that are functions, at the approach and slip speed before the impact.

    Friction stays a function for the laws that follow it along the path of the impulse.
    """
    if callable(contact.friction) and model.law not in BY_SPEED:
        law = law_for(model.law, has_friction=True)
        mu = 0.0 if law is Law.FRICTIONLESS else initial_friction(body_a, body_b, contact, law)
        contact = contact._replace(friction=mu)
    if callable(contact.restitution):
        speed = approach_speed(body_a, body_b, contact)
        (e,) = restitutions_at_speeds([speed], [contact], ["contact"])
        contact = contact._replace(restitution=e)
    return contact


BODY_ADJUSTMENTS = Adjustment.NORMALISED_ORIENTATION | Adjustment.MASSLESS_SPIN
"""Adjustments of bodies, which a reduced geometry no longer shows."""


def _resolve_reduced(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """Answer in a geometry that leaves out part of the impact. The error bound counts what is left out.

    Raises:
        ImpactError: INVALID_MODEL, if a body is articulated. INVALID_NORMAL, if the geometry is PLANAR and
            the normal is along z.
    """
    geometry = model.geometry
    if body_a.is_articulated() or body_b.is_articulated():
        reason = f"must be AUTO or SPATIAL for an articulated body, is {geometry.name}"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)
    if geometry is Geometry.PLANAR and not (contact.normal[0] or contact.normal[1]):
        reason = f"must not be along z in the geometry PLANAR; is {tuple(contact.normal)}"
        raise ImpactError(StatusCode.INVALID_NORMAL, "contact.normal", reason)
    full = resolve(body_a, body_b, contact, model._replace(geometry=Geometry.SPATIAL))
    body_a, body_b, _ = read_request(body_a, body_b, contact)
    reduced_a, reduced_b = (reduce_body(body, geometry) for body in (body_a, body_b))
    reduced = resolve(reduced_a, reduced_b, reduce_contact(contact, geometry), model)
    left_out, unknown = relative_difference(reduced, full, body_a, body_b), full.error_bound
    # Relative to the exact answer, which may be smaller than that of `full`; 2^-40 is more than rounding.
    left_out = (left_out + unknown) / (1 - unknown) * (1 + 2.0**-40) if unknown < 1 else math.inf
    bound = max(reduced.error_bound, left_out)
    if isinstance(reduced.impulse.x, Fraction):  # the difference was taken in floats
        bound += ULP
    try:
        energy_before = float(full.kinetic_energy_before)
        energy_after = energy_before + float(reduced.kinetic_energy_after - reduced.kinetic_energy_before)
        twist_a = with_change(body_a, reduced.change_a).twist
        twist_b = with_change(body_b, reduced.change_b).twist
    except OverflowError:  # a fraction beyond float64
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None
    return reduced._replace(
        status=reduced.status if bound <= bound_limit(model) else StatusCode.TOLERANCE_NOT_MET,
        twist_a=twist_a,
        twist_b=twist_b,
        kinetic_energy_before=energy_before,
        kinetic_energy_after=energy_after,
        error_bound=bound,
        adjustments=reduced.adjustments | (full.adjustments & BODY_ADJUSTMENTS),
    )
