"""The usual answer as one function of plain floats: the same bits as the tiers give, several times as fast.

For each geometry and law the formulas of :mod:`~collision_response.physics`, the report and the error
bound are traced once, together with the checks, and written out as straight-line code. It serves sound
bodies that approach each other, with a law in closed form. What it does not serve it leaves to
:mod:`~collision_response.resolve`, which knows what is wrong, or how to go on.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from functools import cache, lru_cache, reduce
from typing import Any

from .model import EXACT_LAWS, Adjustment, Geometry, ImpactModel, Law, Precision
from .numerics import extended
from .numerics.emit_nested import Formula
from .numerics.error_bound import NOTHING, survey
from .physics.body import Body
from .physics.contact import Contact
from .physics.laws import Parameters, Regime
from .physics.orientation import Quaternion
from .physics.vector import ZERO
from .report import NUMBERS, Impact, is_off_unit, report
from .requirements import Plan, is_planar, is_point
from .soundness import Scene, are_coefficients, is_tensor
from .status import StatusCode
from .tiers import GEOMETRIES, LAWS, bound_of_collision, is_grazing
from .validate import check_model

REGIMES = {float(regime): regime for regime in Regime}
TURNED = Quaternion(0.0, 0.0, 0.0, 1.0)
COMPUTED = slice(Impact._fields.index("twist_a"), Impact._fields.index("adjustments"))


def usual_answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """The answer to a request that need not have been checked, if it is a usual one without a tolerance.

    Raises:
        ImpactError: the model is wrong.
    """
    precision = _precision(model)
    if precision is None or body_a is body_b:
        return None
    law, geometry = model.law, model.geometry
    if law is Law.AUTO:
        law = Law.COULOMB if contact.friction else Law.FRICTIONLESS
    if geometry is Geometry.AUTO:
        tell = _least_geometry(law, body_a.orientation is None, body_b.orientation is None)
        point, planar = tell(body_a, body_b, contact)
        geometry = Geometry.POINT if point else Geometry.PLANAR if planar else Geometry.SPATIAL
    decided = tuple.__new__(ImpactModel, (law, geometry, precision, *model[3:]))
    return _answer(body_a, body_b, contact, decided)


def usual_attempt(body_a: Body, body_b: Body, contact: Contact, plan: Plan) -> Impact | None:
    """The answer in this model, if the request, which has been checked, is a usual one."""
    model = plan.model
    if plan.dropped != NOTHING or model.law not in EXACT_LAWS or model.precision is Precision.EXTENDED:
        return None
    return _answer(body_a, body_b, contact, model)


@lru_cache
def _precision(model: ImpactModel) -> Precision | None:
    """The precision to compute with, if a model is one of those served."""
    check_model(model)
    if model.tolerance or model.law not in (Law.AUTO, *EXACT_LAWS) or model.precision is Precision.EXTENDED:
        return None
    return Precision.DOUBLE if model.precision is Precision.AUTO else model.precision


def _answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    law, geometry, precision, _, e_t, threshold = model
    if callable(contact.restitution):
        return None
    compute = computation(geometry, law, precision, body_a.orientation is None, body_b.orientation is None)
    try:
        computed = compute(body_a, body_b, contact, e_t, threshold)
    except (ArithmeticError, ValueError):  # a quotient by 0, the root of what is negative
        return None
    if computed is None:
        return None
    if law is Law.FRICTIONLESS and contact.friction:
        contact = contact._replace(friction=0.0)
    *most, regime, bound, is_normalised = computed
    adjustments = Adjustment.NORMALISED_ORIENTATION if is_normalised else Adjustment.NONE
    return tuple.__new__(Impact, (StatusCode.OK, contact, model, *most, REGIMES[regime], bound, adjustments))


@cache
def _least_geometry(law: Law, *aligned: bool) -> Callable[..., tuple[bool, bool]]:
    """Whether POINT and PLANAR serve."""
    formula = Formula()
    body_a, body_b, contact = _scene(formula, aligned)
    frictionless = law is Law.FRICTIONLESS
    return formula.function(
        (
            is_point(body_a, body_b, contact, frictionless=frictionless),
            is_planar(body_a, body_b, contact, frictionless=frictionless),
        )
    )


@cache
def computation(
    geometry: Geometry, law: Law, precision: Precision, *aligned: bool
) -> Callable[..., tuple[Any, ...] | None]:
    """What is computed of an :class:`Impact`, or ``None`` if the impact is not a usual one."""
    formula = Formula()
    body_a, body_b, contact = _scene(formula, aligned)
    e_t, threshold = (formula.argument(name, 0.0) for name in ("e_t", "threshold"))
    friction = 0.0 if law is Law.FRICTIONLESS else contact.friction
    approach = GEOMETRIES[geometry].prepare(body_a, body_b, contact)
    sizes = survey(approach)
    parameters = Parameters(contact.restitution, friction, e_t)
    outcome = LAWS[law](approach, parameters)
    model = ImpactModel(law, geometry, precision)
    impact = report(body_a, body_b, contact, model, approach, outcome, Adjustment.NONE)
    impact = impact._replace(error_bound=bound_of_collision(impact, approach, sizes, outcome, parameters))
    orientations = [body.orientation for body in (body_a, body_b) if body.orientation is not None]
    is_normalised = reduce(operator.or_, map(is_off_unit, orientations), False)
    computed = (*impact[COMPUTED], is_normalised)

    def conditions() -> Iterator[Any]:
        yield approach.n_u < 0
        yield threshold <= -(approach.n_u / approach.n.norm())
        if precision is Precision.DOUBLE and extended.AVAILABLE:
            yield ~is_grazing(sizes)
        for body in (body_a, body_b):
            yield ((body.mass > 0) & (body.inverse_mass > 0)) | ((body.mass == 0) & (body.inverse_mass == 0))
            yield is_tensor(body.inertia)
            if body.orientation is not None:
                yield body.orientation.squared_length() > 0
        yield (body_a.inverse_mass > 0) | (body_b.inverse_mass > 0)
        yield from are_coefficients(Scene(body_a, body_b, contact, e_t))
        unchecked = body_a.position, body_a.orientation, body_b.position, body_b.orientation, contact[:2]
        answered = impact.twist_a, impact.twist_b, impact.impulse, impact[NUMBERS], impact.error_bound
        total = sum(formula.numbers(*unchecked, *answered))
        yield total - total == 0

    return formula.function(computed, reduce(operator.and_, conditions()))


def _scene(formula: Formula, aligned: tuple[bool, ...]) -> tuple[Body, Body, Contact]:
    body_a, body_b = (
        formula.argument(name, Body.static()._replace(orientation=None if is_aligned else TURNED))
        for name, is_aligned in zip(("body_a", "body_b"), aligned, strict=True)
    )
    return body_a, body_b, formula.argument("contact", Contact.of(ZERO, ZERO))
