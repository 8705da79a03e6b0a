"""One impact in ball arithmetic, with as many digits as it takes.

If the balls of the answer are too large, the precision is doubled (Ziv's strategy). So the number of digits
is the one that the conditioning of the impact requires.

Source: Ziv, "Fast Evaluation of Elementary Mathematical Functions with Correctly Rounded Last Bit", ACM
Trans. Math. Softw. 17 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, NamedTuple

from ..answer import Impact, bounded_vectors, make_impact
from ..geometry import geometry_for
from ..impact import ImpactNumbers, impact
from ..model import ImpactModel, ModelPlan, Precision, integrates_in_steps, plan_model
from ..numbers import balls
from ..numbers.balls import Ball, Undecided
from ..numbers.operations import numbers_in
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law, Regime, Settings
from .request_numbers import body_as_fractions, contact_as_fractions, read_request

BITS = tuple(2**k for k in range(7, 15))
"""The precisions to try. With the last, a product of three float64 numbers of any magnitude is exact."""

LEAST_FLOAT = 2.0**-1074
"""The smallest positive float."""

SMALL_ENOUGH = 2.0**-60
"""A ball of this relative radius rounds to the same float64 as the number in it, except for one ball in 128:
there, the float64 is within 0.51 units in the last place of the number instead of 0.5."""


class Attempt(NamedTuple):
    """The result of a computation with some number of digits.

    Attributes:
        answer: rounded to floats; ``None`` if it cannot be.
        bound: on the error of the balls; infinite if more digits may help.
        rounded_bound: on the error of ``answer``.
    """

    answer: ImpactNumbers | None
    bound: float
    rounded_bound: float = math.inf


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """Answer a valid request to within one unit in the last place of float64, if any number of digits can.

    Returns:
        The answer; or ``None`` if a number of it is beyond float64, or, unless the bodies separate, if
        python-flint is not installed or the law integrates a path in steps. More digits do not make such a
        path more exact, but they still decide whether there is one.
    """
    request = body_a, body_b, contact
    a, b, plain_contact = read_request(*request)
    plan = plan_model(model)
    law = plan.law_with_friction if plain_contact.friction > 0 else plan.law_without_friction
    frictionless = law is Law.FRICTIONLESS
    geometry = geometry_for(model.geometry, a, b, plain_contact, frictionless=frictionless)
    used_model = model._replace(law=law, geometry=geometry, precision=Precision.EXTENDED)
    best, is_stuck = Attempt(None, math.inf), False
    for bits in BITS if balls.AVAILABLE else ():
        attempt = _attempt(request, used_model, plan, bits)
        if attempt.answer is None:
            if attempt.bound < math.inf:
                return None
            continue
        if best.answer is None or attempt.bound < best.bound:
            is_stuck = attempt.bound > best.bound / 2
            best = attempt
        if attempt.bound <= SMALL_ENOUGH or (attempt.bound < math.inf and is_stuck):
            break
    if not best.bound < math.inf:
        best = _exact_if_separating(request) or best
    if best.answer is None:
        return None
    used_contact = contact._replace(friction=0.0) if frictionless else contact
    return make_impact((a, b), best.answer, used_contact, used_model, best.rounded_bound, plan.bound_limit)


def _attempt(request: tuple[Body, Body, Contact], model: ImpactModel, plan: ModelPlan, bits: int) -> Attempt:
    """Compute a request in balls of this precision, by a model without AUTO and the numbers of a plan."""
    has_steps = integrates_in_steps(model)
    with balls.working_precision(bits):
        a, b, contact = read_request(*request, _ball)
        settings = Settings(*map(Ball, plan.settings, plan.settings_errors))
        answer = impact(a, b, contact, Law.FRICTIONLESS if has_steps else model.law, settings)
        separating = answer.flags.separating
        if has_steps and separating is not True:
            return Attempt(None, 0.0 if separating is False else math.inf)
        bound = _error_bound((a, b), answer, Ball.radius)
        rounded = answer.as_floats()
        if not all(map(math.isfinite, numbers_in(rounded[:2]))):
            return Attempt(None, bound)
        rounded_bound = _error_bound((a, b), answer, _error_as_float)
    is_open = not math.isfinite(rounded_bound) and isinstance(separating, Undecided)
    # If two regimes are possible, their mean may be a third one.
    regime = Regime.SEPARATING if is_open else float(Ball(answer.report.regime).arb.lower())
    rounded = rounded._replace(report=rounded.report._replace(regime=regime))
    return Attempt(rounded, bound, rounded_bound)


def _exact_if_separating(request: tuple[Body, Body, Contact]) -> Attempt | None:
    """Return the answer if the bodies do not approach, and ``None`` if they do, or if it is beyond float64.

    No number of digits shows that they touch exactly; fractions do.
    """
    body_a, body_b, contact = request
    bodies = body_as_fractions(body_a), body_as_fractions(body_b)
    settings = Settings(restitution_threshold=Fraction(0))  # a float would round numbers beyond float64
    answer = impact(*bodies, contact_as_fractions(contact), Law.FRICTIONLESS, settings)
    try:
        return Attempt(answer.as_floats(), 0.0, 0.0) if answer.flags.separating else None
    except OverflowError:
        return None


def _ball(x: float, error: float) -> Any:
    return Ball(x, error) if math.isfinite(x) else x


def _error_bound(bodies: tuple[Body, Body], answer: ImpactNumbers, error: Callable[[Ball], Any]) -> float:
    """Bound the relative errors of the impulse and of the twist changes, in the norms of ``error_bound``.

    Args:
        bodies, answer: the bodies and the answer, in balls.
        error: gives the error of a number: the radius of its ball, or the error of rounding it to a float.
    """
    return max(_relative_error(vector, error) for vector in bounded_vectors(bodies, answer.changes))


def _relative_error(vector: Iterable[tuple[Any, Any]], error: Callable[[Ball], Any]) -> float:
    """Bound the error of a vector of :func:`bounded_vectors`, relative to its length."""
    pairs = [(Ball(value), Ball(weight)) for value, weight in vector]
    radius = sum(((w.midpoint() * error(x)) ** 2 for x, w in pairs), start=Ball(0).arb).sqrt()
    if radius == 0:
        return 0.0
    if not radius.is_finite():
        return math.inf
    length = sum(((w.midpoint() * x.midpoint()) ** 2 for x, w in pairs), start=Ball(0).arb).sqrt()
    if not length > radius:
        return math.inf
    return float((radius / (length - radius)).upper()) * (1 + 2.0**-50)


def _error_as_float(x: Ball) -> Any:
    """Bound the error of rounding the number in a ball to a float. One below the least float counts as 0."""
    error = abs(x.arb - float(x)).upper()
    return error if error > LEAST_FLOAT else Ball(0).arb
