"""The last resort: an impact on balls, with as many digits as it takes.

If the balls that come out are too large, the precision is doubled (Ziv's strategy), so the digits spent
are those that the conditioning of the very impact requires.

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
"""Precisions to try. Products of three numbers of the whole float64 range are exact at the last."""

LEAST = 2.0**-1074
"""The least float."""

ENOUGH = 2.0**-60
"""A ball of this relative radius rounds to float64 as the number within it does. One of 128 does not: it
ends within 0.51 units in the last place instead of 0.5."""


def read_request(
    body_a: Body, body_b: Body, contact: Contact, number: Callable[[float, float], Any] = lambda x, _: x
) -> tuple[Body, Body, Contact]:
    """The same request in other numbers, each made from a float and the error of the conversion to it."""
    numbers = list(map(number, *library.numbers_with_errors(body_a, body_b, contact)))
    own, it = iter(numbers[-2 * len(InverseInertia._fields) :]), iter(numbers)

    def take(kind: Callable[..., Any], count: int) -> Any:
        return kind(*(next(it) for _ in range(count)))

    def body(given: Body) -> Body:
        mass, inertia, position = next(it), take(Symmetric3, 6), take(Vec3, 3)
        q, velocity, spin, com = take(Quaternion, 4), take(Vec3, 3), take(Vec3, 3), take(Vec3, 3)
        matrix = InverseInertia(*(next(own) for _ in InverseInertia._fields))
        return Body(
            mass, inertia, position, q, velocity, spin, com, None if given.inverse_inertia is None else matrix
        )

    a, b = body(body_a), body(body_b)
    return a, b, Contact(take(Vec3, 3), take(Vec3, 3), next(it), next(it))


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact | None:
    """The answer to a sound request, to within a unit in the last place of float64 if anything can decide it.

    ``None`` without python-flint, for a path in space, or if a number of the answer is beyond float64. No
    arithmetic makes the integration of such a path more exact; but whether there is one no law decides.
    """
    if not balls.AVAILABLE:
        return None
    chosen = plan_model(model)
    plain = read_request(body_a, body_b, contact)
    law = chosen.law_with_friction if plain[2].friction > 0 else chosen.law_without_friction
    geometry = model.geometry
    if geometry is Geometry.AUTO:
        geometry = required_geometry(*plain, frictionless=law is Law.FRICTIONLESS)
    is_path = law in PATHS and geometry is Geometry.SPATIAL
    used = model._replace(law=law, geometry=geometry, precision=Precision.EXTENDED)
    off_unit = any(map(is_not_normalised, plain[:2]))
    best, least = None, math.inf
    for bits in BITS:
        with balls.working_precision(bits):
            a, b, touch = read_request(body_a, body_b, contact, _ball)
            settings = Settings(*map(Ball, chosen.settings, chosen.settings_errors))
            answer = impact(a, b, touch, Law.FRICTIONLESS if is_path else law, settings)
            if is_path and answer.flags.separating is not True:
                if answer.flags.separating is False:
                    return None
                continue
            bound = _bound((a, b), answer, Ball.radius)
            given = _rounded((a, b), answer, contact, used, chosen.bound_limit, off_unit)
        if given is None:  # beyond float64; or nothing is known yet
            if bound < math.inf:
                return None
            continue
        if best is None or bound < least:
            best, stuck, least = given, bound > least / 2, bound
        if bound <= ENOUGH or (bound < math.inf and stuck):
            break
    return best


def _ball(x: float, error: float) -> Any:
    return Ball(x, error) if math.isfinite(x) else x


def _bound(bodies: tuple[Body, Body], answer: ImpactNumbers, error: Callable[[Ball], Any]) -> float:
    """The greatest relative error of the impulse and of the twist changes, in the norms of the bound.

    Args:
        bodies: in balls.
        answer: in balls.
        error: of a number: the radius of its ball, or its error when it is rounded to a float.
    """
    errors = [_relative_error(pairs, error) for pairs in weighted_components(bodies, answer.changes)]
    return max(errors)


def weighted_components(bodies: tuple[Body, Body], changes: Changes) -> Iterator[list[tuple[Any, Any]]]:
    """The norms of the error bound: components of the impulse and of each body's twist change, with the
    weights of their squares.
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


def _relative_error(weighted: Iterable[tuple[Any, Any]], error: Callable[[Ball], Any]) -> float:
    """The error of a vector over its length, from pairs of a component and the weight of its square."""
    pairs = [(Ball(value), Ball(weight)) for value, weight in weighted]
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
    """How far the float that a ball rounds to may be from the number; 0 where it is that float.

    The bound does not speak of what is smaller than all floats.
    """
    error = abs(x.arb - float(x)).upper()
    return error if error > LEAST else Ball(0).arb


def _rounded(
    bodies: tuple[Body, Body],
    answer: ImpactNumbers,
    contact: Contact,
    model: ImpactModel,
    limit: float,
    off_unit: bool,
) -> Impact | None:
    changes, report, flags = as_floats(answer.changes), as_floats(answer.report), answer.flags
    if not all(math.isfinite(x) for x in numbers_in((changes, report))):
        return None
    bound = _bound(bodies, answer, _error_as_float)
    if not math.isfinite(bound) and isinstance(flags.separating, Undecided):
        report = report._replace(regime=Regime.SEPARATING)
    used = contact._replace(friction=0.0) if model.law is Law.FRICTIONLESS else contact
    return make_impact(bodies, (changes, report, flags), used, model, bound, limit, normalised=off_unit)


def as_floats(value: Any) -> Any:
    """Balls or fractions as the nearest float64, through nested named tuples.

    Raises:
        OverflowError: a fraction is beyond float64.
    """
    if isinstance(value, tuple):
        return type(value)(*map(as_floats, value))
    return float(value)
