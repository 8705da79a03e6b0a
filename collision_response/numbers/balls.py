"""Ball arithmetic: a ball, "midpoint +- radius", encloses a real number, with any number of digits.

FLINT's ``arb`` computes with balls rigorously, and with practically unlimited exponents. A :class:`Ball` adds
comparisons that may be undecided.

Source: Johansson, "Arb: Efficient Arbitrary-Precision Midpoint-Radius Interval Arithmetic", IEEE
Trans. Comput. 66 (2017).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any

try:
    from flint import arb, ctx
except ImportError:
    AVAILABLE = False
else:
    AVAILABLE = hasattr(ctx, "workprec")  # since python-flint 0.7


def _operator(apply: Callable[[Any, Any], Any]) -> Callable[[Ball, Any], Ball]:
    """Return the method of a ball that applies an operator of ``arb``."""

    def method(self: Ball, other: Any) -> Ball:
        return NotImplemented if isinstance(other, tuple) else Ball(apply(self.arb, _arb(other)))

    return method


def _comparison(
    holds: Callable[[Any, Any], bool], fails: Callable[[Any, Any], bool]
) -> Callable[[Ball, Any], bool | Undecided]:
    """Return the method of a ball that compares, by two comparisons of ``arb``.

    Each is true only if it is true for all numbers in the two balls.
    """

    def method(self: Ball, other: Any) -> bool | Undecided:
        x, y = self.arb, _arb(other)
        return True if holds(x, y) else False if fails(x, y) else Undecided(holds(x.mid(), y.mid()))

    return method


class Ball:
    """A real number that lies in a ball."""

    __slots__ = ("arb",)
    __hash__ = None  # type: ignore[assignment]
    __add__ = __radd__ = _operator(operator.add)
    __sub__, __rsub__ = _operator(operator.sub), _operator(lambda x, y: y - x)
    __mul__ = __rmul__ = _operator(operator.mul)
    __truediv__, __rtruediv__ = _operator(operator.truediv), _operator(lambda x, y: y / x)
    __lt__, __ge__ = _comparison(operator.lt, operator.ge), _comparison(operator.ge, operator.lt)
    __le__, __gt__ = _comparison(operator.le, operator.gt), _comparison(operator.gt, operator.le)
    __eq__ = _comparison(operator.eq, operator.ne)  # type: ignore[assignment]

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

    def __neg__(self) -> Ball:
        return Ball(-self.arb)

    def __abs__(self) -> Ball:
        return Ball(abs(self.arb))

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
        return False if other is False else Undecided(self.of_values and getattr(other, "of_values", True))

    __rand__ = __and__

    def __or__(self, other: Any) -> bool | Undecided:
        return True if other is True else Undecided(self.of_values or getattr(other, "of_values", False))

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
