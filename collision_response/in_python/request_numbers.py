"""The numbers of a request, converted to another type of number: floats, balls or fractions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from decimal import Decimal
from fractions import Fraction
from itertools import islice
from numbers import Rational
from typing import Any

from ..kernels import library
from ..numbers.operations import of_python
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.inverse_inertia import InverseInertia
from ..physics.orientation import Quaternion
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode, format_value

RIGID_FIELDS = (Symmetric3, Vec3, Quaternion, Vec3, Vec3, Vec3)
"""The types of the fields of a :class:`Body` from ``inertia`` to ``com``."""

MOST_PLACES = 10_000
"""The most decimal places of a number that becomes a fraction: 1e-99999999 would take minutes."""


def read_request(
    body_a: Body, body_b: Body, contact: Contact, convert: Callable[[float, float], Any] = lambda x, _: x
) -> tuple[Body, Body, Contact]:
    """Convert all numbers of a request, as the kernels read them.

    Args:
        body_a, body_b, contact: the request.
        convert: makes a number from a float and the error of the conversion to that float.
    """
    doubles = (memoryview(part).cast("d") for part in library.numbers_with_errors(body_a, body_b, contact))
    converted = list(map(convert, *doubles))
    count = len(InverseInertia._fields)
    numbers, inverse_inertias = iter(converted), (converted[-2 * count : -count], converted[-count:])

    def take(kind: type[Any]) -> Any:
        return kind(*islice(numbers, len(kind._fields)))

    bodies = [Body(next(numbers), *map(take, RIGID_FIELDS)) for _ in inverse_inertias]
    a, b = (
        body if given.inverse_inertia is None else body._replace(inverse_inertia=InverseInertia(*entries))
        for body, given, entries in zip(bodies, (body_a, body_b), inverse_inertias, strict=True)
    )
    numeric_contact = Contact(take(Vec3), take(Vec3), next(numbers), next(numbers))
    return a, b, numeric_contact._replace(tangential_restitution=contact.tangential_restitution)


def body_as_fractions(body: Body) -> Body:
    """Convert the numbers of a body to fractions, exactly. An infinite mass stays a float."""
    fields = zip((*RIGID_FIELDS, InverseInertia), body[1:], strict=True)
    converted = (None if given is None else _fractions(kind, given) for kind, given in fields)
    return Body._make([as_fraction(body.mass), *converted])


def contact_as_fractions(contact: Contact) -> Contact:
    """Convert the numbers of a contact to fractions, exactly.

    A restitution that is a function stays one; a friction that is a function becomes 0.
    """
    e, mu = contact.restitution, contact.friction
    return Contact(
        _fractions(Vec3, contact.position),
        _fractions(Vec3, contact.normal),
        e if callable(e) else as_fraction(e),
        Fraction(0) if callable(mu) else as_fraction(mu),
        contact.tangential_restitution,
    )


def _fractions(kind: type[Any], numbers: Iterable[Any]) -> Any:
    return kind(*map(as_fraction, numbers))


def as_fraction(x: Any) -> Any:
    """Convert a number to a fraction, exactly. Infinity and NaN stay floats; beyond float64 it is NaN.

    Raises:
        ImpactError: OUT_OF_RANGE, for a decimal of more than ``MOST_PLACES`` places.
    """
    number = of_python(x)
    if isinstance(number, Decimal) and number and isinstance(exponent := number.as_tuple().exponent, int):
        if exponent > MOST_PLACES:  # this takes as long
            return math.nan
        if exponent < -MOST_PLACES:
            limit = f"must have at most {MOST_PLACES:,} places to be computed exactly"
            raise ImpactError(StatusCode.OUT_OF_RANGE, "decimal", f"{limit}; is {format_value(number, str)}")
    try:
        if isinstance(number, Rational):  # its parts may be NumPy's integers, which overflow
            exact = Fraction(int(number.numerator), int(number.denominator))
        else:
            number = number if hasattr(number, "as_integer_ratio") else float(number)
            exact = Fraction(*number.as_integer_ratio())
    except (OverflowError, ValueError):  # infinite, or NaN
        return float(number)
    try:
        float(exact)
    except OverflowError:
        return math.nan
    return exact
