"""One impact by a law that follows friction, a function of the slip speed, along the path of the impulse.

The path is followed in floats. Everything else is computed in fractions, exactly up to the rounding of roots.
The error of the path is estimated, not bounded: no bound follows from values of an unknown function.
"""

from __future__ import annotations

import math
from operator import itemgetter

from .. import validity
from ..answer import Impact, bounded_vectors, make_impact
from ..geometry import geometry_for, suffices
from ..impact import ImpactNumbers, has_no_free_slip, impact
from ..kernels import library
from ..model import ImpactModel, Precision, plan_model
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.effective_mass import ContactKinematics
from ..physics.laws import Law, Settings
from ..physics.laws.routh_by_speed import FINEST, path_tolerance
from ..status import StatusCode
from .coefficients_at_speed import friction_at_speed, initial_slip_speed
from .request_numbers import as_fraction, body_as_fractions, contact_as_fractions

SAFETY = 4
"""The error bound is the estimated error times this factor, plus ``ADDED_TOLERANCES``."""

ADDED_TOLERANCES = 8.0
"""How many tolerances of the path the error bound adds, because an estimate may be small by chance."""


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """Answer a request by a law of ``BY_SPEED``.

    Args:
        body_a, body_b: the bodies.
        contact: the contact; its friction is a function of the slip speed, its restitution a number.
        model: the model; its law is one of ``BY_SPEED``.

    Returns:
        The answer, or ``None`` if the geometry of the model leaves out part of the impact, or a mechanism
        moves in one direction only, or wedges, so that no path determines its impulse.

    Raises:
        ImpactError: if the request cannot be answered. If the function returns a value that is not a
            coefficient of friction, the field is ``contact.friction(slip_speed)``.
    """
    validity.check_distinct(body_a, body_b)
    bodies = body_as_fractions(body_a), body_as_fractions(body_b)
    exact_contact = contact_as_fractions(contact)
    plan = plan_model(model)
    given = body_a, body_b, contact
    validity.check(*bodies, exact_contact, plan.settings.tangential_restitution, given)
    geometry = geometry_for(model.geometry, *bodies, exact_contact, frictionless=False)
    if not suffices(geometry, *bodies, exact_contact, frictionless=False):
        return None
    first = friction_at_speed(initial_slip_speed(body_a, body_b, contact), contact)
    # Check as with friction also if its initial value is 0, because it may not stay 0.
    validity.check(*bodies, exact_contact._replace(friction=first or 1), plan.settings.tangential_restitution)
    kinematics = ContactKinematics.of(*bodies, exact_contact)
    if kinematics.n_u < 0 and has_no_free_slip(kinematics, first):
        return None
    exact_contact = exact_contact._replace(friction=lambda v: friction_at_speed(v, contact))
    settings = Settings(*map(as_fraction, plan.settings))
    answer, bound = _answer_and_bound(bodies, exact_contact, model.law, settings)
    if answer.flags.unfinished:
        raise library.refusal(StatusCode.PATH_TOO_LONG)
    if bound > plan.target_bound:
        finest = settings._replace(tolerance=FINEST)
        finer = _answer_and_bound(bodies, exact_contact, model.law, finest)
        answer, bound = min((answer, bound), finer, key=itemgetter(1))
    try:
        answer = answer.as_floats()
    except OverflowError:
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None
    used = model._replace(geometry=geometry, precision=Precision.DOUBLE)
    return make_impact(bodies, answer, contact._replace(friction=first), used, bound, plan.bound_limit)


def _answer_and_bound(
    bodies: tuple[Body, Body], contact: Contact, law: Law, settings: Settings
) -> tuple[ImpactNumbers, float]:
    """Compute the answer and its error bound, in the norms of ``Impact.error_bound``; infinite if unknown."""
    answer = impact(*bodies, contact, law, settings)
    if answer.flags.separating:
        return answer, 0.0
    if answer.estimated_error is None:
        return answer, math.inf
    worst = 0.0
    changes, errors = (bounded_vectors(bodies, x) for x in (answer.changes, answer.estimated_error))
    for pair in zip(changes, errors, strict=True):
        size, error = (sum((weight * x) ** 2 for x, weight in components) for components in pair)
        if error > 0 and SAFETY**2 * error >= size:  # both are squares
            return answer, math.inf
        worst = max(worst, math.sqrt(error / size) if size else 0.0)
    return answer, SAFETY * worst + ADDED_TOLERANCES * path_tolerance(settings.tolerance)
