"""One coefficient of a contact from those of the two materials."""

from __future__ import annotations

from enum import Enum
from typing import Any

from ..numbers.operations import Scalar, choose, greater, lesser, square_root
from ..status import shown


class CombineRule(Enum):
    """How two coefficients become one.

    Every rule is symmetric, and its result lies between the two (MULTIPLY: at or below both, for
    coefficients in [0, 1]), so two restitutions in [0, 1] give one in [0, 1].
    """

    AVERAGE = "average"
    MULTIPLY = "multiply"
    MINIMUM = "minimum"
    MAXIMUM = "maximum"
    GEOMETRIC_MEAN = "geometric_mean"
    HARMONIC_MEAN = "harmonic_mean"
    """``2 a b / (a + b)``, as Drake combines friction."""
    ENERGETIC = "energetic"
    """Of restitution: what the two lose together, each of the part of the energy that it takes up.

    In a compression common to both, a body takes up energy as its compliance ``1/k``:

        e^2 = (e_a^2 / k_a + e_b^2 / k_b) / (1 / k_a + 1 / k_b)

    Source: Coaplen, Stronge & Ravani, "Work equivalent composite coefficient of restitution", Int. J.
    Impact Eng. 30 (2004) 581-591.
    """


def combine(
    rule: CombineRule, a: Scalar, b: Scalar, stiffness_a: Scalar = 1, stiffness_b: Scalar = 1
) -> Scalar:
    """The coefficient of a contact between materials with coefficients ``a`` and ``b``, both >= 0.

    The stiffnesses, both > 0, are for ENERGETIC; only their ratio counts. Of floats no step leaves their
    range, but for the product of MULTIPLY, which may.

    Raises:
        TypeError: that is no rule.
    """
    check_rule(rule)
    if rule is CombineRule.AVERAGE:
        return a / 2 + b / 2
    if rule is CombineRule.MULTIPLY:
        return a * b
    low, high = lesser(a, b), greater(a, b)
    if rule is CombineRule.MINIMUM:
        return low
    if rule is CombineRule.MAXIMUM:
        return high
    size = choose(high > 0, lambda: high, lambda: 1 + high)
    ratio = low / size
    if rule is CombineRule.HARMONIC_MEAN:
        return low * (2 / (1 + ratio))
    if rule is CombineRule.GEOMETRIC_MEAN:
        return choose(
            ratio >= TINY, lambda: high * square_root(ratio), lambda: square_root(low) * square_root(high)
        )
    softer = size / size * lesser(stiffness_a, stiffness_b) / greater(stiffness_a, stiffness_b)
    a_is_softer = stiffness_a < stiffness_b
    soft = choose(a_is_softer, lambda: a, lambda: b) / size
    stiff = choose(a_is_softer, lambda: b, lambda: a) / size
    return high * square_root((soft * soft + stiff * stiff * softer) / (1 + softer))


def check_rule(rule: Any) -> None:
    """Raises: TypeError: that is no rule."""
    if not isinstance(rule, CombineRule):
        known = ", ".join(map(str, CombineRule))
        raise TypeError(f"rule: must be one of {known}, is {shown(rule)}")


TINY = 2.0**-1000
"""A quotient that has hardly underflown."""
