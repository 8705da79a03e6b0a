"""What the tape makes of an operation: another, already known or cheaper, of the same value.

A rule takes the operands and gives the simpler result, or ``None`` where there is none. No rule changes
a rounding. For finite numbers the value is the same; the sign of a zero may differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .tape import Symbol


def _negated(x: Symbol) -> Symbol | None:
    """``y`` if ``x`` is ``-y``."""
    return x.operands()[0] if x.node.op == "neg" else None


def _add(x: Symbol, y: Symbol) -> Any:
    if x.is_value(0):
        return y
    if y.is_value(0):
        return x
    minus_x, minus_y = _negated(x), _negated(y)
    if minus_y is not None:
        return x - minus_y
    return None if minus_x is None else y - minus_x


def _sub(x: Symbol, y: Symbol) -> Any:
    if y.is_value(0):
        return x
    if x.is_value(0):
        return -y
    minus_x, minus_y = _negated(x), _negated(y)
    if minus_y is not None:
        return x + minus_y
    if minus_x is not None:
        return -(minus_x + y)
    opposite = x.tape.find("sub", (y.place, x.place))
    return None if opposite is None or x.place == y.place else -x.tape.at(opposite)


def _mul(x: Symbol, y: Symbol) -> Any:
    for factor, other in ((x, y), (y, x)):
        if factor.is_value(0):
            return 0.0
        if factor.is_value(1):
            return other
        if factor.is_value(-1):
            return -other
        minus = _negated(factor)
        if minus is not None:
            return -(minus * other)
    return None


def _div(x: Symbol, y: Symbol) -> Any:
    if y.node.op == "constant" and math.frexp(y.node.value)[0] == 0.5:
        return x * (1 / y.node.value)  # a power of two: the same number, and cheaper
    minus_x, minus_y = _negated(x), _negated(y)
    if minus_x is not None:
        return -(minus_x / y)
    return None if minus_y is None else -(x / minus_y)


def _fma(x: Symbol, y: Symbol, z: Symbol) -> Any:
    if x.is_value(0) or y.is_value(0):
        return z
    minus_x, minus_y = _negated(x), _negated(y)
    if minus_x is not None:
        return -x.tape.record("fma", minus_x, y, -z)
    return None if minus_y is None else -x.tape.record("fma", x, minus_y, -z)


def _lt(x: Symbol, y: Symbol) -> Any:
    if x.node.op == "mul" and y.place in x.node.args:
        factor = next((arg for arg in x.operands() if arg.node.op == "constant"), None)
        if factor is not None and 0 < factor.node.value < 1:
            return y.tape.record("lt", 0.0, y)  # a part of y is less than y if y is positive
    return None


def _not(x: Symbol) -> Any:
    return x.operands()[0] if x.node.op == "not" else None


def _and(x: Symbol, y: Symbol) -> Any:
    for one, other in ((x, y), (y, x)):
        if one.node.op == "truth":
            return other if one.node.value else False
    return x if x.place == y.place else None


def _or(x: Symbol, y: Symbol) -> Any:
    for one, other in ((x, y), (y, x)):
        if one.node.op == "truth":
            return True if one.node.value else other
    return x if x.place == y.place else None


def _select(condition: Symbol, x: Symbol, y: Symbol) -> Any:
    if condition.node.op == "truth":
        return x if condition.node.value else y
    if x.place == y.place:
        return x
    minus_x, minus_y = _negated(x), _negated(y)
    if minus_x is not None and minus_y is not None:
        return -condition.tape.record("select", condition, minus_x, minus_y)
    return None


SIMPLER: dict[str, Callable[..., Any]] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": _negated,
    "fma": _fma,
    "lt": _lt,
    "not": _not,
    "and": _and,
    "or": _or,
    "select": _select,
}
