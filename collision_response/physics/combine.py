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


def combine(rule: CombineRule, a: Scalar, b: Scalar) -> Scalar:
    """The coefficient of a contact between materials with coefficients ``a`` and ``b``, both >= 0."""
    if rule is CombineRule.AVERAGE:
        return a / 2 + b / 2
    if rule is CombineRule.MULTIPLY:
        return a * b
    if rule is CombineRule.GEOMETRIC_MEAN:
        return square_root(a * b)
    a_is_less = a < b
    if rule is CombineRule.MINIMUM:
        return choose(a_is_less, lambda: a, lambda: b)
    return choose(a_is_less, lambda: b, lambda: a)
