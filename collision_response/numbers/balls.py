"""Balls, "midpoint +- radius", of as many digits as asked for: numbers that enclose what they stand for.

FLINT's ``arb`` computes with them rigorously, with practically unlimited exponents. A :class:`Ball` adds
comparisons that know when they are undecided.

Source: Johansson, "Arb: Efficient Arbitrary-Precision Midpoint-Radius Interval Arithmetic", IEEE
Trans. Comput. 66 (2017).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any

try:
    from flint import arb, ctx
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = True


class Ball:
    """A real number that is known to lie in a ball."""

    __slots__ = ("arb",)
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: Any, error: float = 0.0) -> None:
        self.arb: Any = value.arb if isinstance(value, Ball) else arb(value, error) if error else arb(value)

    def radius(self) -> Any:
        """How far from the midpoint the number may be."""
        return self.arb.rad()

    def midpoint(self) -> Any:
        """The middle."""
        return self.arb.mid()

    def __float__(self) -> float:
        return float(self.arb)

    def __add__(self, other: Any) -> Ball:
        return Ball(self.arb + _arb(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Ball:
        return Ball(self.arb - _arb(other))

    def __rsub__(self, other: Any) -> Ball:
        return Ball(_arb(other) - self.arb)

    def __mul__(self, other: Any) -> Ball:
        return NotImplemented if isinstance(other, tuple) else Ball(self.arb * _arb(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Ball:
        return Ball(self.arb / _arb(other))

    def __rtruediv__(self, other: Any) -> Ball:
        return Ball(_arb(other) / self.arb)

    def __neg__(self) -> Ball:
        return Ball(-self.arb)

    def __abs__(self) -> Ball:
        return Ball(abs(self.arb))

    def __lt__(self, other: Any) -> bool | Undecided:
        other = _arb(other)
        return _truth(self.arb < other, self.arb >= other, self.arb.mid() < other.mid())

    def __le__(self, other: Any) -> bool | Undecided:
        other = _arb(other)
        return _truth(self.arb <= other, self.arb > other, self.arb.mid() <= other.mid())

    def __gt__(self, other: Any) -> bool | Undecided:
        other = _arb(other)
        return _truth(self.arb > other, self.arb <= other, self.arb.mid() > other.mid())

    def __ge__(self, other: Any) -> bool | Undecided:
        other = _arb(other)
        return _truth(self.arb >= other, self.arb < other, self.arb.mid() >= other.mid())

    def __eq__(self, other: object) -> bool | Undecided:  # type: ignore[override]
        value = _arb(other)
        return _truth(self.arb == value, self.arb != value, self.arb.mid() == value.mid())

    def sqrt(self) -> Ball:
        """The square root of a number that is not negative, though its ball may reach below 0."""
        return Ball(self.arb.nonnegative_part().sqrt())

    def certain(self) -> Ball:
        """See :func:`~collision_response.numbers.operations.certain`."""
        return Ball(self.arb.mid())

    def error_of(self) -> Ball:
        """See :func:`~collision_response.numbers.operations.error_of`."""
        return Ball(self.arb.rad())

    def widened(self, by: Any) -> Ball:
        """See :func:`~collision_response.numbers.operations.widened`."""
        return Ball(self.arb + arb(0, abs(_arb(by)).upper()))


class Undecided:
    """A truth value that is undecided. ``true & undecided`` is undecided, ``false & undecided`` is false.

    Attributes:
        of_values: what the midpoints say, for loops, which carry no errors.
    """

    __slots__ = ("of_values",)

    def __init__(self, of_values: bool) -> None:
        self.of_values = of_values

    @staticmethod
    def pick(_: Undecided, if_true: Any, if_false: Any) -> Any:
        """A ball that covers both."""
        if isinstance(if_true, (bool, Undecided)):
            return if_true if if_true is if_false else Undecided(False)
        return Ball(_arb(if_true).union(_arb(if_false)))

    def __and__(self, other: Any) -> bool | Undecided:
        return (
            other if other is False else Undecided(self.of_values and bool(getattr(other, "of_values", True)))
        )

    __rand__ = __and__

    def __or__(self, other: Any) -> bool | Undecided:
        return (
            other if other is True else Undecided(self.of_values or bool(getattr(other, "of_values", False)))
        )

    __ror__ = __or__

    def __invert__(self) -> Undecided:
        return Undecided(not self.of_values)

    def __bool__(self) -> bool:
        raise TypeError("an undecided comparison has no truth value: branch with choose()")


_ONE_AT_A_TIME = RLock()


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """A context in which balls have that many bits.

    FLINT's precision is that of the process, so other threads that want one wait.
    """
    with _ONE_AT_A_TIME, ctx.workprec(bits):
        yield


def _arb(value: Any) -> Any:
    return value.arb if isinstance(value, Ball) else arb(value)


def _truth(holds: bool, fails: bool, of_midpoints: bool) -> bool | Undecided:
    return True if holds else False if fails else Undecided(of_midpoints)
