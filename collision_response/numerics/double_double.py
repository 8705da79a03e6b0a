"""Numbers of twice the digits: unevaluated sums of two, of which the second is what rounding left out.

A :class:`DoubleDouble` works over any kind of number that rounds to the nearest: floats, arrays, symbols
of a tape. It is made of transforms that lose nothing, Knuth's of a sum and Dekker's of a product: a
rounded result and, exactly, its error. So all backends round alike, whether they have a fused
multiply-add for it or not. Nothing branches.

With ``u = 2^-53`` the relative error of every operation is below ``ROUNDOFF``, that is 16 u^2:

    x + y      3 u^2 / (1 - 4 u)      algorithm 6; with a single number 2 u^2, algorithm 4
    x * y      7 u^2                  algorithm 10; with a single number 3 u^2, algorithm 8
    x / y      14 u^2 + O(u^3)        algorithm 17 with the product by algorithm 8; of which are
                                      3 its error, 2 + 3 + 3 of rounding the low part of the remainder,
                                      it and its quotient, 3 of dividing it by the high part alone
    sqrt(x)    25/8 u^2               algorithm 8 of Lefevre et al.

provided that nothing overflows, no error of a product underflows, and no factor exceeds 2^996.

Sources: Joldes, Muller & Popescu, "Tight and rigorous error bounds for basic building blocks of
double-word arithmetic", ACM Trans. Math. Softw. 44 (2017); Lefevre, Louvet, Muller, Picot & Rideau,
"Accurate calculation of Euclidean norms using double-word arithmetic", ACM Trans. Math. Softw. 49
(2023).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..physics.number import Scalar, choose, square_root

ROUNDOFF = 2.0**-102
"""More than the relative error of any operation, by enough for a count of them to be rounded itself."""

_SPLITTER = 2.0**27 + 1


class DoubleDouble(NamedTuple):
    """``high + low``; ``high`` is that sum rounded. A ``low`` known to be 0 costs nothing."""

    high: Scalar
    low: Scalar = 0.0

    def __add__(self, other: Any) -> DoubleDouble:
        other = double_double(other)
        total, errors = two_sum(self.high, other.high), two_sum(self.low, other.low)
        if is_zero(errors.high):
            return total
        total = _sum_in_order(total.high, total.low + errors.high)
        return total if is_zero(errors.low) else _sum_in_order(total.high, total.low + errors.low)

    def __radd__(self, other: Any) -> DoubleDouble:
        return self + other

    def __sub__(self, other: Any) -> DoubleDouble:
        return self + -double_double(other)

    def __rsub__(self, other: Any) -> DoubleDouble:
        return -self + other

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def __mul__(self, other: Any) -> DoubleDouble:
        if _only_scales(other):
            return DoubleDouble(self.high * other, self.low * other)
        other = double_double(other)
        product = two_product(self.high, other.high)
        if is_zero(self.low) and is_zero(other.low):
            return product
        return _sum_in_order(product.high, product.low + (self.high * other.low + self.low * other.high))

    def __rmul__(self, other: Any) -> DoubleDouble:
        return self * other

    def __truediv__(self, other: Any) -> DoubleDouble:
        if _only_scales(other):
            return self * (1 / other)
        other = double_double(other)
        quotient = self.high / other.high
        product = other * DoubleDouble(quotient)
        remainder = (self.high - product.high) + (self.low - product.low)
        return _sum_in_order(quotient, remainder / other.high)

    def __rtruediv__(self, other: Any) -> DoubleDouble:
        return double_double(other) / self

    def sqrt(self) -> DoubleDouble:
        """The square root; of 0, 0."""

        def root() -> DoubleDouble:
            high = square_root(self.high)
            square = two_product(high, high)
            remainder = (self.high - square.high) - square.low + self.low
            return _sum_in_order(high, remainder / (high * 2))

        return choose(self.high > 0, root, lambda: DoubleDouble(0.0))

    def __lt__(self, other: Any) -> Any:
        other = double_double(other)
        return (self.high < other.high) | ((self.high == other.high) & (self.low < other.low))

    def __le__(self, other: Any) -> Any:
        other = double_double(other)
        return (self.high < other.high) | ((self.high == other.high) & (self.low <= other.low))

    def __gt__(self, other: Any) -> Any:
        return double_double(other) < self

    def __ge__(self, other: Any) -> Any:
        return double_double(other) <= self

    def __eq__(self, other: Any) -> Any:
        other = double_double(other)
        return (self.high == other.high) & (self.low == other.low)

    def __ne__(self, other: Any) -> Any:
        other = double_double(other)
        return (self.high != other.high) | (self.low != other.low)


def double_double(number: Any) -> DoubleDouble:
    """A number with nothing after it; a double-double as it is."""
    return number if isinstance(number, DoubleDouble) else DoubleDouble(number)


def lift(value: Any) -> Any:
    """Numbers as double-doubles, through nested named tuples."""
    if isinstance(value, tuple) and not isinstance(value, DoubleDouble):
        return type(value)(*map(lift, value))
    return None if value is None else double_double(value)


def lower(value: Any) -> Any:
    """Double-doubles as they are rounded, through nested named tuples."""
    if isinstance(value, DoubleDouble):
        return value.high
    return type(value)(*map(lower, value)) if isinstance(value, tuple) else value


def two_sum(a: Scalar, b: Scalar) -> DoubleDouble:
    """The rounded sum and its error: Knuth's algorithm."""
    if is_zero(a) or is_zero(b):
        return DoubleDouble(b if is_zero(a) else a)
    total = a + b
    part = total - a
    return DoubleDouble(total, (a - (total - part)) + (b - part))


def two_product(a: Scalar, b: Scalar) -> DoubleDouble:
    """The rounded product and its error: one operation where there is one for it, or Dekker's algorithm."""
    product = a * b
    own = getattr(a, "product_error", None)
    error = own(b, product) if own else None
    if error is None:
        (a_1, a_2), (b_1, b_2) = _split(a), _split(b)
        error = ((a_1 * b_1 - product) + a_1 * b_2 + a_2 * b_1) + a_2 * b_2
    return DoubleDouble(product, error)


def is_zero(number: Any) -> bool:
    """Whether a number is known to be 0, whatever the inputs of the formula are."""
    is_value = getattr(number, "is_value", None)
    return is_value(0) if is_value else isinstance(number, float) and number == 0


def _split(a: Scalar) -> tuple[Scalar, Scalar]:
    """Two halves of at most 26 bits."""
    scaled = a * _SPLITTER
    high = scaled - (scaled - a)
    return high, a - high


def _sum_in_order(a: Scalar, b: Scalar) -> DoubleDouble:
    """The sum of two numbers of which the first is not the smaller: Dekker's algorithm."""
    total = a + b
    return DoubleDouble(total, b - (total - a))


def _only_scales(number: Any) -> bool:
    """Whether to multiply by a number is exact."""
    return isinstance(number, int | float) and abs(math.frexp(number)[0]) == 0.5
