"""The front door: validate, choose what the scene requires, compute, report."""

from __future__ import annotations

import math
from collections.abc import Iterator

from .model import EXACT_LAWS, ImpactModel, Precision
from .numerics import extended
from .numerics.error_bound import NOTHING
from .physics.body import Body
from .physics.contact import Contact
from .report import Impact
from .requirements import Plan, plan
from .status import ImpactError, StatusCode
from .straight_line import usual_answer, usual_attempt
from .tiers import TIERS
from .validate import check_request

DEFAULT = ImpactModel()
LARGEST = math.nextafter(math.inf, 0.0)
"""The greatest error bound that says anything."""


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel = DEFAULT) -> Impact:
    """The twists of two bodies after they collide.

    Args:
        body_a: one body; the contact's normal points to it.
        body_b: the other body.
        contact: where they touch, and the coefficients.
        model: what to model, and how exactly.

    Returns:
        The twists, how they were computed and how exactly, and the books of energy.

    Raises:
        ImpactError: the request cannot be answered; its ``code``, ``field`` and ``reason`` say why.
    """
    usual = usual_answer(body_a, body_b, contact, model)
    if usual is not None:
        return usual
    check_request(body_a, body_b, contact, model)
    best = None
    for attempt in _attempts(body_a, body_b, contact, model):
        impact = usual_attempt(body_a, body_b, contact, attempt)
        impact = impact or TIERS[attempt.model.precision](body_a, body_b, contact, attempt)
        if impact is None:
            continue
        if impact.error_bound <= (model.tolerance or LARGEST):
            return impact
        best = impact
    if best is None:
        raise ImpactError(StatusCode.OUT_OF_RANGE, "result", "a number of the answer is beyond float64")
    return best._replace(status=StatusCode.TOLERANCE_NOT_MET)  # without one: the bound is infinite


def _attempts(body_a: Body, body_b: Body, contact: Contact, asked: ImpactModel) -> Iterator[Plan]:
    """The computations to try, cheapest first, until the error bound of one meets the tolerance."""
    first = plan(body_a, body_b, contact, asked)
    if asked.precision is not Precision.AUTO:
        precisions = [asked.precision]
    else:
        precisions = [Precision.SINGLE, Precision.DOUBLE] if asked.tolerance else [Precision.DOUBLE]
        if extended.AVAILABLE and first.model.law in EXACT_LAWS:
            precisions.append(Precision.EXTENDED)
    if first.dropped != NOTHING:
        yield first.at(precisions[0])
        first = first.modelling_all(body_a, body_b, contact)
    for precision in precisions:
        yield first.at(precision)
