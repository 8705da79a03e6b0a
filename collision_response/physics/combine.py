"""Combine the coefficients of two materials into the coefficient of their contact."""

from __future__ import annotations

import math
from enum import Enum
from typing import Any

from ..arguments import check_number, is_real, of_one_type
from ..numbers.operations import Scalar, any_of, choose, maximum, minimum, or_one, square_root
from ..status import POSITIVE, ImpactError, StatusCode, format_range, format_value


class CombineRule(Enum):
    """How two coefficients ``a`` and ``b`` are combined into one.

    Every rule is symmetric, and its result lies between ``a`` and ``b``; that of MULTIPLY is at most the
    lesser of the two, for coefficients in [0, 1]. So two restitutions in [0, 1] give one in [0, 1].
    """

    AVERAGE = "average"
    MULTIPLY = "multiply"
    MINIMUM = "minimum"
    MAXIMUM = "maximum"
    GEOMETRIC_MEAN = "geometric_mean"
    HARMONIC_MEAN = "harmonic_mean"
    """``2 a b / (a + b)``, as Drake combines friction."""
    ENERGETIC = "energetic"
    """For restitution: each body returns the part ``e^2`` of the energy that it stores.

    Both bodies are compressed by the same force, so each stores energy in proportion to its compliance
    ``1/k``, with the stiffness ``k``:

        e^2 = (e_a^2 / k_a + e_b^2 / k_b) / (1 / k_a + 1 / k_b)

    Source: Coaplen, Stronge & Ravani, "Work equivalent composite coefficient of restitution", Int. J.
    Impact Eng. 30 (2004) 581-591.
    """


def combine(
    rule: CombineRule, a: Scalar, b: Scalar, stiffness_a: Scalar = 1, stiffness_b: Scalar = 1
) -> Scalar:
    """Return the coefficient of a contact between materials with the coefficients ``a`` and ``b``.

    With floats, only the product of MULTIPLY can underflow or overflow.

    Args:
        rule: how to combine them.
        a, b: the coefficients, >= 0. If all numbers are fractions, so is the result; arrays are combined
            element by element.
        stiffness_a, stiffness_b: stiffnesses of the two bodies, > 0, used by ENERGETIC; only their ratio
            matters.

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE, if a number is out of range.
        TypeError: if ``rule`` is not a :class:`CombineRule`, or another argument is neither a real number nor
            an array of them.
    """
    check_rule(rule)
    given = {"a": a, "b": b, "stiffness_a": stiffness_a, "stiffness_b": stiffness_b}
    numbers = [_checked(name, x, 0 if name in ("a", "b") else POSITIVE) for name, x in given.items()]
    has_arrays = any(hasattr(x, "shape") for x in numbers)
    a, b, stiffness_a, stiffness_b = numbers if has_arrays else of_one_type(given)
    if rule is CombineRule.MULTIPLY:
        return a * b
    low, high = minimum(a, b), maximum(a, b)
    if rule is CombineRule.AVERAGE:
        return maximum(low, minimum(high, a / 2 + b / 2))  # the halves of the least floats are rounded
    if rule is CombineRule.MINIMUM:
        return low
    if rule is CombineRule.MAXIMUM:
        return high
    size = or_one(high)
    ratio = low / size
    if rule is CombineRule.HARMONIC_MEAN:
        return low * (2 / (1 + ratio))
    if rule is CombineRule.GEOMETRIC_MEAN:
        return choose(
            ratio >= TINY, lambda: high * square_root(ratio), lambda: square_root(low) * square_root(high)
        )
    one = size / size
    least, most = one * minimum(stiffness_a, stiffness_b), one * maximum(stiffness_a, stiffness_b)
    softer = least / most
    a_is_softer = stiffness_a < stiffness_b
    soft = choose(a_is_softer, lambda: a, lambda: b) / size
    stiff = choose(a_is_softer, lambda: b, lambda: a) / size
    energy = soft * soft + stiff * stiff * softer
    root_of_softer = square_root(least) / square_root(most)
    part = choose(
        energy >= TINY,
        lambda: square_root(energy / (1 + softer)),
        lambda: _hypotenuse(soft, stiff * root_of_softer),
    )
    return maximum(low, high * minimum(one, part))  # rounding may lead beyond either


def _checked(field: str, x: Any, least: float) -> Scalar:
    """Return a number as a float, or an array of numbers."""
    if not getattr(x, "shape", None):
        return check_number(field, x, least, math.inf, StatusCode.INVALID_COEFFICIENT)
    if not is_real(x) or getattr(x.dtype, "kind", "f") == "O":
        raise TypeError(f"{field}: must be real numbers, is {format_value(x)}")
    if any_of(~((x >= least) & (x < math.inf))):
        reason = f"must be finite and {format_range(least, math.inf)}, is {format_value(x)}"
        raise ImpactError(StatusCode.INVALID_COEFFICIENT, field, reason)
    return x + 0.0  # integers of NumPy overflow


def _hypotenuse(x: Scalar, y: Scalar) -> Scalar:
    """Return the root of ``x^2 + y^2`` for numbers >= 0 whose squares underflow."""
    greater = maximum(x, y)
    ratio = minimum(x, y) / or_one(greater)
    return greater * square_root(1 + ratio * ratio)


def check_rule(rule: Any) -> None:
    """Check that ``rule`` is a :class:`CombineRule`.

    Raises:
        TypeError: if it is not.
    """
    if not isinstance(rule, CombineRule):
        known = ", ".join(map(str, CombineRule))
        raise TypeError(f"rule: must be one of {known}, is {format_value(rule)}")


TINY = 2.0**-1000
"""A quotient below this may have lost digits to underflow."""
