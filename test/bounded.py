"""A float with a bound of its error: the number type of the kernels, implemented independently in Python.

The formulas run on it as on any number, so that a law's claims about its own error can be tested without the
kernels.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

ROUNDING = 2.0**-53
SLACK = 1 + 2.0**-48
"""Factor for the rounding of the errors themselves."""
LEAST = 5e-324
"""The most that an operation loses by underflow."""


class Truth(NamedTuple):
    """A truth value, and whether it is certain in spite of the errors.

    Attributes:
        of_values: the comparison of the values alone, for loops.
        known: whether the errors cannot change it.
    """

    of_values: bool
    known: bool

    def __and__(self, other: Any) -> Truth:
        other = _truth(other)
        for one in (self, other):
            if one.known and not one.of_values:
                return Truth(False, True)
        return Truth(self.of_values and other.of_values, self.known and other.known)

    __rand__ = __and__

    def __or__(self, other: Any) -> Truth:
        return ~(~self & ~_truth(other))

    __ror__ = __or__

    def __invert__(self) -> Truth:
        return Truth(not self.of_values, self.known)

    def __bool__(self) -> bool:
        raise TypeError("a truth value in doubt: branch with choose()")

    @staticmethod
    def pick(condition: Truth, if_true: Any, if_false: Any) -> Any:
        """The branch that the values take, with an error that covers the other branch if there is doubt."""
        if isinstance(if_true, (bool, Truth)):
            one, other = _truth(if_true), _truth(if_false)
            taken = one if condition.of_values else other
            agree = one.known and other.known and one.of_values == other.of_values
            return Truth(taken.of_values, (condition.known and taken.known) or agree)
        one, other = _bounded(if_true), _bounded(if_false)
        taken = one if condition.of_values else other
        if condition.known:
            return taken
        apart = 0.0 if one.value == other.value else abs(one.value - other.value)
        return Bounded(taken.value, (apart + max(one.error, other.error)) * SLACK)


class Bounded:
    """A value and a bound of its error, infinite if nothing is known."""

    __slots__ = ("error", "value")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: float, error: float = 0.0) -> None:
        self.value = float(value)
        self.error = error if error == error else math.inf

    def __repr__(self) -> str:
        return f"{self.value} +- {self.error:.2g}"

    def covers(self, exact: Any, forgiven: Any = 0) -> bool:
        """Whether ``exact``, of any precision, is within the error plus ``forgiven``."""
        return bool(abs(self.value - exact) <= self.error + forgiven)

    def certain(self) -> Bounded:
        return Bounded(self.value)

    def error_of(self) -> Bounded:
        return Bounded(self.error)

    def widened(self, by: Any) -> Bounded:
        by = _bounded(by)
        return Bounded(self.value, (self.error + abs(by.value) + by.error) * SLACK)

    def __neg__(self) -> Bounded:
        return Bounded(-self.value, self.error)

    def __abs__(self) -> Bounded:
        return Bounded(abs(self.value), self.error)

    def __add__(self, other: Any) -> Bounded:
        other = _bounded(other)
        return _rounded(self.value + other.value, self.error + other.error)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Bounded:
        return self + -_bounded(other)

    def __rsub__(self, other: Any) -> Bounded:
        return _bounded(other) + -self

    def __mul__(self, other: Any) -> Bounded:
        if isinstance(other, tuple):
            return NotImplemented
        other = _bounded(other)
        x, y = abs(self.value), abs(other.value)
        spread = _product(x, other.error) + _product(y, self.error) + _product(self.error, other.error)
        lost = LEAST if x and y else 0.0
        return _rounded(self.value * other.value, spread + lost)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Bounded:
        other = _bounded(other)
        if other.value == 0:
            return Bounded(math.nan, math.inf)
        quotient, least = self.value / other.value, abs(other.value) - other.error * SLACK
        if not least > 0:
            return Bounded(quotient, math.inf)
        lost = LEAST if self.value else 0.0
        return _rounded(quotient, (self.error + _product(abs(quotient), other.error)) / least + lost)

    def __rtruediv__(self, other: Any) -> Bounded:
        return _bounded(other) / self

    def sqrt(self) -> Bounded:
        if not self.value >= 0:
            return Bounded(math.nan, math.inf)
        root = math.sqrt(self.value)
        far = self.error / root if root else math.inf
        return _rounded(root, min(far, math.sqrt(self.error)))

    def __lt__(self, other: Any) -> Truth:
        return self._compared(other, self.value < _bounded(other).value)

    def __le__(self, other: Any) -> Truth:
        return self._compared(other, self.value <= _bounded(other).value)

    def __gt__(self, other: Any) -> Truth:
        return self._compared(other, self.value > _bounded(other).value)

    def __ge__(self, other: Any) -> Truth:
        return self._compared(other, self.value >= _bounded(other).value)

    def __eq__(self, other: object) -> Truth:  # type: ignore[override]
        return self._compared(other, self.value == _bounded(other).value)

    def _compared(self, other: Any, of_values: bool) -> Truth:
        other = _bounded(other)
        doubt = (self.error + other.error) * SLACK
        return Truth(of_values, doubt == 0 or abs(self.value - other.value) > doubt)


def _bounded(x: Any) -> Bounded:
    return x if isinstance(x, Bounded) else Bounded(x)


def _truth(x: Any) -> Truth:
    return x if isinstance(x, Truth) else Truth(bool(x), True)


def _product(size: float, error: float) -> float:
    return size * error if size and error else 0.0


def _rounded(value: float, error: float) -> Bounded:
    return Bounded(value, (error + abs(value) * ROUNDING) * SLACK)
