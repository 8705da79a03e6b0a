"""One impact by a law that follows slip, where friction is a function of the slip speed.

The request is read as fractions. All but the path is exact, up to the rounding of roots; the path is
followed in floats. How far it may be off is estimated: a function that is only asked for values allows no
bound.
"""

from __future__ import annotations

import math
from operator import itemgetter

from .. import validity
from ..answer import Impact, make_impact
from ..geometry import required_geometry
from ..impact import ImpactNumbers, impact
from ..kernels import library
from ..model import Geometry, ImpactModel, Precision, plan_model
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law, Settings
from ..physics.laws.routh_by_speed import FINEST, path_tolerance
from ..status import StatusCode
from .arbitrary_precision import as_floats, weighted_components
from .coefficients_at_speed import friction_at_speed, initial_slip_speed
from .exact_fractions import as_fraction, body_as_fractions, contact_as_fractions

SAFETY = 4.0
"""The bound is this times the estimate, and more."""

STEPS = 8.0
"""So many errors of whole steps are added: an estimate may be small by chance."""


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """The answer of a law of ``BY_SPEED``; ``None`` if the geometry leaves out what matters.

    Args:
        body_a, body_b: of one impact.
        contact: its friction is a function of the slip speed, its restitution a number.
        model: its law is one of ``BY_SPEED``.

    Raises:
        ImpactError: the request cannot be answered; of a value that is no coefficient, the field is
            ``contact.friction(slip_speed)``.
    """
    validity.check_distinct(body_a, body_b)
    a, b, touch = body_as_fractions(body_a), body_as_fractions(body_b), contact_as_fractions(contact)
    chosen = plan_model(model)
    validity.check(a, b, touch, chosen.settings.tangential_restitution)
    geometry = required_geometry(a, b, touch, frictionless=False)
    if model.geometry is not Geometry.AUTO:
        if model.geometry < geometry:
            return None
        geometry = model.geometry
    first = friction_at_speed(initial_slip_speed(body_a, body_b, contact), contact)
    # Friction that begins with 0 need not stay so.
    validity.check(a, b, touch._replace(friction=first or 1), chosen.settings.tangential_restitution)
    touch = touch._replace(friction=lambda v: friction_at_speed(v, contact))
    settings = Settings(*map(as_fraction, chosen.settings))
    answer, bound = _followed(a, b, touch, model.law, settings)
    if answer.flags.unfinished:
        raise library.refusal(StatusCode.PATH_TOO_LONG)
    if bound > chosen.target_bound:
        finer = _followed(a, b, touch, model.law, settings._replace(tolerance=FINEST))
        answer, bound = min((answer, bound), finer, key=itemgetter(1))
    try:
        found = as_floats(answer.changes), as_floats(answer.report), answer.flags
    except OverflowError:
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None
    return make_impact(
        (a, b),
        found,
        contact._replace(friction=first),
        model._replace(geometry=geometry, precision=Precision.DOUBLE),
        bound,
        chosen.bound_limit,
        normalised=any(map(validity.is_not_normalised, (a, b))),
    )


def _followed(a: Body, b: Body, touch: Contact, law: Law, settings: Settings) -> tuple[ImpactNumbers, float]:
    """The answer, and its bound in the norms of ``Impact.error_bound``: infinite where nothing is known."""
    answer = impact(a, b, touch, law, settings)
    if answer.flags.separating:
        return answer, 0.0
    if answer.estimated_error is None:
        return answer, math.inf
    worst = 0.0
    parts = zip(
        weighted_components((a, b), answer.changes),
        weighted_components((a, b), answer.estimated_error),
        strict=True,
    )
    for values, doubts in parts:
        size, estimated_error = (sum(weight * x * x for x, weight in part) for part in (values, doubts))
        if estimated_error > 0 and estimated_error * 16 >= size:
            return answer, math.inf
        worst = max(worst, math.sqrt(estimated_error / size) if size else 0.0)
    return answer, SAFETY * worst + STEPS * path_tolerance(settings.tolerance)
