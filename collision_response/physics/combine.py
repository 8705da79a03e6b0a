"""One coefficient of a contact from those of the two materials."""

from __future__ import annotations

from enum import Enum

from ..numbers.number import Scalar, choose, square_root


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

    The stiffnesses, both > 0, are for ENERGETIC; only their ratio counts.
    """
    if rule is CombineRule.AVERAGE:
        return a / 2 + b / 2
    if rule is CombineRule.MULTIPLY:
        return a * b
    if rule is CombineRule.GEOMETRIC_MEAN:
        return square_root(a * b)
    if rule is CombineRule.ENERGETIC:
        of_both = a * a * stiffness_b + b * b * stiffness_a
        return square_root(of_both / (stiffness_a + stiffness_b))
    if rule is CombineRule.HARMONIC_MEAN:
        low, high = combine(CombineRule.MINIMUM, a, b), combine(CombineRule.MAXIMUM, a, b)
        sum_of_both = choose(high > 0, lambda: low + high, lambda: 1 + high)
        return low * (2 * high / sum_of_both)
    a_is_less = a < b
    if rule is CombineRule.MINIMUM:
        return choose(a_is_less, lambda: a, lambda: b)
    return choose(a_is_less, lambda: b, lambda: a)
