"""Ball arithmetic: a ball, "midpoint +- radius", encloses a real number, with any number of digits.

FLINT's ``arb`` computes with balls rigorously, and with practically unlimited exponents. A :class:`Ball` adds
comparisons that may be undecided.

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
    """A real number that lies in a ball."""

    __slots__ = ("arb",)
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: Any, error: float = 0.0) -> None:
        self.arb: Any = value.arb if isinstance(value, Ball) else arb(value, error) if error else arb(value)

    def radius(self) -> Any:
        """Return the largest distance of the number from the midpoint."""
        return self.arb.rad()

    def midpoint(self) -> Any:
        """Return the midpoint."""
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
        """Return the square root. The number must not be negative, but its ball may reach below 0."""
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
    """The result of a comparison of balls that overlap.

    ``true & undecided`` is undecided; ``false & undecided`` is false.

    Attributes:
        of_values: the result for the midpoints. Loops use it, because they drop errors.
    """

    __slots__ = ("of_values",)

    def __init__(self, of_values: bool) -> None:
        self.of_values = of_values

    @staticmethod
    def pick(_: Undecided, if_true: Any, if_false: Any) -> Any:
        """Return a ball that covers both branches of a ``choose``."""
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


_PRECISION_LOCK = RLock()


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Return a context in which ball arithmetic has this many bits.

    FLINT has one precision per process, so other threads wait until they can set theirs.
    """
    with _PRECISION_LOCK, ctx.workprec(bits):
        yield


def _arb(value: Any) -> Any:
    return value.arb if isinstance(value, Ball) else arb(value)


def _truth(holds: bool, fails: bool, of_values: bool) -> bool | Undecided:
    return True if holds else False if fails else Undecided(of_values)
