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
from ..geometry import required_geometry
from ..impact import Changes, ImpactNumbers, impact
from ..kernels import library
from ..model import Geometry, ImpactModel, Law, Precision, plan_model
from ..numbers import balls
from ..numbers.balls import Ball, Undecided
from ..numbers.operations import numbers_in
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.inverse_inertia import InverseInertia
from ..physics.laws import PATHS, Regime, Settings
from ..physics.orientation import Quaternion
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3
from ..validity import is_not_normalised

BITS = tuple(2**k for k in range(7, 15))
"""The precisions to try. With the last, a product of three float64 numbers of any magnitude is exact."""

LEAST_FLOAT = 2.0**-1074
"""The smallest positive float."""

SMALL_ENOUGH = 2.0**-60
"""A ball of this relative radius rounds to the same float64 as the number in it, except for one ball in 128:
there, the float64 is within 0.51 units in the last place of the number instead of 0.5."""


def read_request(
    body_a: Body, body_b: Body, contact: Contact, convert: Callable[[float, float], Any] = lambda x, _: x
) -> tuple[Body, Body, Contact]:
    """Convert all numbers of a request.

    Args:
        body_a, body_b, contact: the request.
        convert: makes a number from a float and the error of the conversion to that float.
    """
    numbers = list(map(convert, *library.numbers_with_errors(body_a, body_b, contact)))
    inverse_inertias, rest = iter(numbers[-2 * len(InverseInertia._fields) :]), iter(numbers)

    def take(kind: Callable[..., Any], count: int) -> Any:
        return kind(*(next(rest) for _ in range(count)))

    def take_body(given: Body) -> Body:
        mass, inertia, position = next(rest), take(Symmetric3, 6), take(Vec3, 3)
        q, velocity, spin, com = take(Quaternion, 4), take(Vec3, 3), take(Vec3, 3), take(Vec3, 3)
        inverse_inertia = InverseInertia(*(next(inverse_inertias) for _ in InverseInertia._fields))
        is_rigid = given.inverse_inertia is None
        return Body(mass, inertia, position, q, velocity, spin, com, None if is_rigid else inverse_inertia)

    a, b = take_body(body_a), take_body(body_b)
    return a, b, Contact(take(Vec3, 3), take(Vec3, 3), next(rest), next(rest))


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """Answer a valid request to within one unit in the last place of float64, if any number of digits can.

    Returns:
        The answer; or ``None`` if python-flint is not installed, if a number of the answer is beyond float64,
        or if the law integrates a path in space. More digits do not make such a path more exact, but they
        still decide whether the bodies separate, in which case there is no path.
    """
    if not balls.AVAILABLE:
        return None
    plan = plan_model(model)
    plain = read_request(body_a, body_b, contact)
    law = plan.law_with_friction if plain[2].friction > 0 else plan.law_without_friction
    geometry = model.geometry
    if geometry is Geometry.AUTO:
        geometry = required_geometry(*plain, frictionless=law is Law.FRICTIONLESS)
    has_path = law in PATHS and geometry is Geometry.SPATIAL
    used = model._replace(law=law, geometry=geometry, precision=Precision.EXTENDED)
    normalised = any(map(is_not_normalised, plain[:2]))
    best, least_bound = None, math.inf
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
            rounded = _round_to_floats((a, b), answer, contact, used, plan.bound_limit, normalised)
        if rounded is None:
            if bound < math.inf:  # a number is beyond float64
                return None
            continue
        if best is None or bound < least_bound:
            best, is_stuck, least_bound = rounded, bound > least_bound / 2, bound
        if bound <= SMALL_ENOUGH or (bound < math.inf and is_stuck):
            break
    return best


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


def _round_to_floats(
    bodies: tuple[Body, Body],
    answer: ImpactNumbers,
    contact: Contact,
    model: ImpactModel,
    bound_limit: float,
    normalised: bool,
) -> Impact | None:
    """Round an answer in balls to an answer in floats, or return ``None`` if a number is not finite."""
    changes, report, flags = as_floats(answer.changes), as_floats(answer.report), answer.flags
    if not all(math.isfinite(x) for x in numbers_in((changes, report))):
        return None
    bound = _error_bound(bodies, answer, _error_as_float)
    if not math.isfinite(bound) and isinstance(flags.separating, Undecided):
        report = report._replace(regime=Regime.SEPARATING)
    used = contact._replace(friction=0.0) if model.law is Law.FRICTIONLESS else contact
    return make_impact(bodies, changes, report, flags, used, model, bound, bound_limit, normalised=normalised)


def as_floats(value: Any) -> Any:
    """Round the balls or fractions of nested named tuples to the nearest float64.

    Raises:
        OverflowError: if a fraction is beyond float64.
    """
    if isinstance(value, tuple):
        return type(value)(*map(as_floats, value))
    return float(value)
