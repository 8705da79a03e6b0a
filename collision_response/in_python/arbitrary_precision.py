"""One impact in ball arithmetic, with as many digits as it takes.

If the balls of the answer are too large, the precision is doubled (Ziv's strategy). So the number of digits
is the one that the conditioning of the impact requires.

Source: Ziv, "Fast Evaluation of Elementary Mathematical Functions with Correctly Rounded Last Bit", ACM
Trans. Math. Softw. 17 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ..answer import Impact, make_impact
from ..geometry import geometry_for
from ..impact import Changes, ImpactNumbers, impact
from ..model import Geometry, ImpactModel, Law, Precision, plan_model
from ..numbers import balls
from ..numbers.balls import Ball, Undecided
from ..numbers.operations import numbers_in
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import PATHS, STEPPED, Regime, Settings
from .request_numbers import read_request

BITS = tuple(2**k for k in range(7, 15))
"""The precisions to try. With the last, a product of three float64 numbers of any magnitude is exact."""

LEAST_FLOAT = 2.0**-1074
"""The smallest positive float."""

SMALL_ENOUGH = 2.0**-60
"""A ball of this relative radius rounds to the same float64 as the number in it, except for one ball in 128:
there, the float64 is within 0.51 units in the last place of the number instead of 0.5."""


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """Answer a valid request to within one unit in the last place of float64, if any number of digits can.

    Returns:
        The answer; or ``None`` if python-flint is not installed, if a number of the answer is beyond float64,
        or if the law integrates a path in steps. More digits do not make such a path more exact, but they
        still decide whether the bodies separate, in which case there is no path.
    """
    if not balls.AVAILABLE:
        return None
    plan = plan_model(model)
    plain = read_request(body_a, body_b, contact)
    law = plan.law_with_friction if plain[2].friction > 0 else plan.law_without_friction
    frictionless = law is Law.FRICTIONLESS
    geometry = geometry_for(model.geometry, *plain, frictionless=frictionless)
    has_path = law in STEPPED or (law in PATHS and geometry is Geometry.SPATIAL)
    best, best_bound, least_bound = None, math.inf, math.inf
    for bits in BITS:
        with balls.working_precision(bits):
            a, b, ball_contact = read_request(body_a, body_b, contact, _ball)
            settings = Settings(*map(Ball, plan.settings, plan.settings_errors))
            answer = impact(a, b, ball_contact, Law.FRICTIONLESS if has_path else law, settings)
            if has_path and answer.flags.separating is not True:
                if answer.flags.separating is False:
                    return None
                continue
            bound = _error_bound((a, b), answer, Ball.radius)
            rounded = answer.as_floats()
            if not all(map(math.isfinite, numbers_in(rounded[:2]))):
                if bound < math.inf:  # a number is beyond float64
                    return None
                continue
            rounded_bound = _error_bound((a, b), answer, _error_as_float)
        if best is None or bound < least_bound:
            is_stuck = bound > least_bound / 2
            best, best_bound, least_bound = rounded, rounded_bound, bound
        if bound <= SMALL_ENOUGH or (bound < math.inf and is_stuck):
            break
    if best is None:
        return None
    if not math.isfinite(best_bound) and isinstance(best.flags.separating, Undecided):
        best = best._replace(report=best.report._replace(regime=Regime.SEPARATING))
    used_contact = contact._replace(friction=0.0) if frictionless else contact
    used_model = model._replace(law=law, geometry=geometry, precision=Precision.EXTENDED)
    return make_impact(plain[:2], best, used_contact, used_model, best_bound, plan.bound_limit)


def _ball(x: float, error: float) -> Any:
    return Ball(x, error) if math.isfinite(x) else x


def _error_bound(bodies: tuple[Body, Body], answer: ImpactNumbers, error: Callable[[Ball], Any]) -> float:
    """Bound the relative errors of the impulse and of the twist changes, in the norms of ``error_bound``.

    Args:
        bodies, answer: the bodies and the answer, in balls.
        error: gives the error of a number: the radius of its ball, or the error of rounding it to a float.
    """
    return max(_relative_error(vector, error) for vector in weighted_components(bodies, answer.changes))


def weighted_components(bodies: tuple[Body, Body], changes: Changes) -> Iterator[list[tuple[Any, Any]]]:
    """Yield the vectors that ``error_bound`` is about: the impulse, and each movable body's twist change.

    Each vector is a list of pairs: a component, and the weight of its square in the norm of the vector.
    """
    yield [(x, 1) for x in changes.impulse]
    for body, change in zip(bodies, (changes.change_a, changes.change_b), strict=True):
        if body.inverse_inertia is not None:
            L, _, W = body.inverse_inertia.blocks()
            parts = [(change.linear, L.trace()), (change.angular, W.trace())]
            yield [(x, 1 / part) for vector, part in parts if (part > 0) is True for x in vector]
        elif body.has_mass() is True:
            moment = body.inertia.trace() / 3
            yield [*((x, body.mass) for x in change.linear), *((x, moment) for x in change.angular)]


def _relative_error(vector: Iterable[tuple[Any, Any]], error: Callable[[Ball], Any]) -> float:
    """Bound the error of a vector of :func:`weighted_components`, relative to its length."""
    pairs = [(Ball(value), Ball(weight)) for value, weight in vector]
    radius = sum((w.midpoint() * error(x) ** 2 for x, w in pairs), start=Ball(0).arb).sqrt()
    if radius == 0:
        return 0.0
    if not radius.is_finite():
        return math.inf
    length = sum((w.midpoint() * x.midpoint() ** 2 for x, w in pairs), start=Ball(0).arb).sqrt()
    if not length > radius:
        return math.inf
    return float((radius / (length - radius)).upper()) * (1 + 2.0**-50)


def _error_as_float(x: Ball) -> Any:
    """Bound the error of rounding the number in a ball to a float. One below the least float counts as 0."""
    error = abs(x.arb - float(x)).upper()
    return error if error > LEAST_FLOAT else Ball(0).arb
