"""Reverse-mode differentiation the way array libraries do it: through both branches of a choice.

The branch that is not taken adds its slope times 0, which is NaN where the slope is infinite.
"""

from __future__ import annotations

import math
from typing import Any


class Reverse:
    """A number that can pass a slope back to the numbers it was computed from."""

    shape = ()

    def __init__(self, value: float, parents: tuple[tuple[Reverse, float], ...] = ()) -> None:
        self.value, self.parents, self.slope = value, parents, 0.0

    def gradient(self, *of: Reverse) -> list[float]:
        order: list[Reverse] = []
        seen: set[int] = set()
        stack: list[tuple[Reverse, bool]] = [(self, False)]
        while stack:
            node, done = stack.pop()
            if done:
                order.append(node)
            elif id(node) not in seen:
                seen.add(id(node))
                stack += [(node, True), *((parent, False) for parent, _ in node.parents)]
        for node in order:
            node.slope = 0.0
        self.slope = 1.0
        for node in reversed(order):
            for parent, by in node.parents:
                parent.slope += node.slope * by
        return [x.slope for x in of]

    def sqrt(self) -> Reverse:
        root = math.sqrt(self.value) if self.value >= 0 else math.nan
        return Reverse(root, ((self, _quotient(0.5, root)),))

    def __add__(self, other: Any) -> Reverse:
        other = _number(other)
        return Reverse(self.value + other.value, ((self, 1.0), (other, 1.0)))

    def __neg__(self) -> Reverse:
        return Reverse(-self.value, ((self, -1.0),))

    def __sub__(self, other: Any) -> Reverse:
        return self + -_number(other)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, tuple):
            return NotImplemented
        other = _number(other)
        return Reverse(self.value * other.value, ((self, other.value), (other, self.value)))

    def __truediv__(self, other: Any) -> Reverse:
        other = _number(other)
        q = _quotient(self.value, other.value)
        return Reverse(q, ((self, _quotient(1.0, other.value)), (other, _quotient(-q, other.value))))

    def __radd__(self, other: Any) -> Reverse:
        return _number(other) + self

    def __rsub__(self, other: Any) -> Reverse:
        return _number(other) - self

    __rmul__ = __mul__

    def __rtruediv__(self, other: Any) -> Reverse:
        return _number(other) / self

    def __abs__(self) -> Reverse:
        return -self if self.value < 0 else self

    def __lt__(self, other: Any) -> Truth:
        return Truth(self.value < _number(other).value)

    def __le__(self, other: Any) -> Truth:
        return Truth(self.value <= _number(other).value)

    def __gt__(self, other: Any) -> Truth:
        return Truth(self.value > _number(other).value)

    def __ge__(self, other: Any) -> Truth:
        return Truth(self.value >= _number(other).value)

    def __eq__(self, other: Any) -> Truth:  # type: ignore[override]
        return Truth(self.value == _number(other).value)

    __hash__ = None  # type: ignore[assignment]


class Truth:
    """The result of comparing such numbers."""

    def __init__(self, value: bool) -> None:
        self.value = bool(value)

    @staticmethod
    def pick(condition: Truth, if_true: Any, if_false: Any) -> Any:
        if isinstance(if_true, (Truth, bool)):
            return _truth(if_true) if condition.value else _truth(if_false)
        a, b = _number(if_true), _number(if_false)
        weight = float(condition.value)
        return Reverse(a.value if condition.value else b.value, ((a, weight), (b, 1 - weight)))

    def any(self) -> bool:
        return self.value

    def __and__(self, other: Any) -> Truth:
        return Truth(self.value and _truth(other).value)

    def __or__(self, other: Any) -> Truth:
        return Truth(self.value or _truth(other).value)

    __rand__, __ror__ = __and__, __or__

    def __invert__(self) -> Truth:
        return Truth(not self.value)


def _number(x: Any) -> Reverse:
    return x if isinstance(x, Reverse) else Reverse(float(x))


def _truth(x: Any) -> Truth:
    return x if isinstance(x, Truth) else Truth(x)


def _quotient(a: float, b: float) -> float:
    if b == 0:
        return math.nan if a == 0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b
