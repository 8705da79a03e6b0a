"""EXTENDED: the laws on real balls, with as many digits as the answer needs.

FLINT's ``arb`` computes with intervals "midpoint +- radius" of any precision and practically
unlimited exponents, and its radii are rigorous. A law runs on it unchanged; what comes out carries
its own error. If that is not small enough, the precision is doubled (Ziv's strategy), so the digits
spent are those that the conditioning of the very impact requires.

Source: Johansson, "Arb: Efficient Arbitrary-Precision Midpoint-Radius Interval Arithmetic", IEEE
Trans. Comput. 66 (2017); Ziv, "Fast Evaluation of Elementary Mathematical Functions with Correctly
Rounded Last Bit", ACM Trans. Math. Softw. 17 (1991).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from ..physics.body import Body
from ..physics.contact import Contact

try:
    from flint import arb, ctx
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True

T = TypeVar("T")

BITS = tuple(2**k for k in range(7, 15))
"""Precisions to try. Products of three numbers of the whole float64 range are exact at the last."""

ENOUGH = 2.0**-60
"""Relative radius at which a ball rounds to float64 as its exact content does, but for 1 in 128 of them,
which end within 0.51 units in the last place instead of 0.5."""


def to_enough_digits(compute: Callable[[], T], error_of: Callable[[T], float]) -> tuple[T, float]:
    """``compute()`` at the least precision that makes its error small enough, and that error."""
    for bits in BITS:
        with ctx.workprec(bits):
            value = compute()
            error = error_of(value)
        if error <= ENOUGH:
            break
    return value, error


def with_inverse_mass(body: Body) -> Body:
    """A lifted body with its inverse mass to the present precision."""
    return body._replace(inverse_mass=1 / body.mass) if body.inverse_mass != 0 else body


def lift(value: Any) -> Any:
    """Numbers as exact balls, through nested named tuples, and what functions of floats return."""
    if isinstance(value, tuple):
        return type(value)(*(lift(part) for part in value))
    if callable(value):
        return lambda *arguments: lift(value(*arguments))
    return arb(value) if isinstance(value, float) or type(value) is int else value


def lower(value: Any) -> Any:
    """Balls as the nearest float64, through nested named tuples."""
    if isinstance(value, tuple):
        return type(value)(*(lower(part) for part in value))
    return float(value) if isinstance(value, arb) else value


def relative_radius(*weighted: tuple[Any, Any]) -> float:
    """The radius of a vector over its length, from pairs of a component and the weight of its square.

    0 if it is exact, infinite if only its radius is known.
    """
    balls = [(arb(value), weight) for value, weight in weighted]
    radius = sum((weight * ball.rad() ** 2 for ball, weight in balls), arb(0)).sqrt()
    if radius == 0:
        return 0.0
    length = sum((weight * ball.mid() ** 2 for ball, weight in balls), arb(0)).sqrt()
    return float((radius / length).mid()) if length > 0 else math.inf


def exact_normal_velocity(prepare: Callable[..., Any], body_a: Body, body_b: Body, contact: Contact) -> float:
    """``n.u`` of an approach, rounded once, however much cancels."""

    def compute() -> Any:
        lifted = contact._replace(position=lift(contact.position), normal=lift(contact.normal))
        return prepare(lift(body_a), lift(body_b), lifted).n_u

    n_u, _ = to_enough_digits(compute, lambda n_u: relative_radius((n_u, 1)))
    return float(n_u)
