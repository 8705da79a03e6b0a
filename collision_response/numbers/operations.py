"""What a formula may do with numbers of any make.

A formula is written once and runs on whatever numbers it is given: Python floats, ``fractions.Fraction``
(a rational law is then exact), mpmath, balls that enclose what they stand for
(:mod:`~collision_response.numbers.balls`), arrays of one shape (one contact an element), or symbols that
write the formula down (:mod:`~collision_response.kernels.symbol`). Arithmetic and comparisons are
Python's own. The rest is here: a branch, a root, a loop, and three words about the error that a number
may carry.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from functools import reduce
from importlib import import_module
from typing import Any, TypeAlias, TypeVar

Scalar: TypeAlias = Any
"""A real number of any make, or an array of them."""

Condition: TypeAlias = Any
"""A truth value, an array or symbol of them, or one that may be undecided."""

T = TypeVar("T")


def choose(condition: Condition, if_true: Callable[[], T], if_false: Callable[[], T]) -> T:
    """``if_true()`` where ``condition`` holds, else ``if_false()``.

    A plain truth value evaluates one branch. Any other evaluates both and picks number by number, through
    named tuples. Where it is undecided the result covers both.
    """
    if _is_plain(condition):
        return if_true() if condition else if_false()
    pick = getattr(condition, "pick", None) or _where_of(condition)
    return _merge(pick, condition, if_true(), if_false())


def square_root(x: Scalar) -> Scalar:
    """The square root of ``x >= 0``, in the arithmetic of ``x``; of a fraction, exact where that is one."""
    if isinstance(x, float):
        return math.sqrt(x)
    if isinstance(x, Fraction):
        return _rational_root(x)
    if hasattr(x, "shape"):
        # Arrays are differentiated in both branches of a choice: slopes that do not count must be finite.
        is_zero = x == 0
        return choose(is_zero, lambda: x, lambda: _root(choose(is_zero, lambda: x + 1, lambda: x)))
    return _root(x)


def _root(x: Scalar) -> Scalar:
    own = getattr(x, "sqrt", None)
    if own is not None:
        return own()
    namespace = getattr(x, "__array_namespace__", None)
    return x**0.5 if namespace is None else namespace().sqrt(x)


def _rational_root(x: Fraction) -> Fraction:
    """Exact if it is rational, else within a part of 2^-62."""
    scale = 0 if x == 0 else max(0, 128 - x.numerator.bit_length() + x.denominator.bit_length()) // 2 + 1
    top, bottom = math.isqrt(x.numerator), math.isqrt(x.denominator)
    if top * top == x.numerator and bottom * bottom == x.denominator:
        return Fraction(top, bottom)
    return Fraction(math.isqrt((x.numerator << 2 * scale) // x.denominator), 1 << scale)


def iterate(state: T, going: Callable[[T], Condition], step: Callable[[T], T], budget: int) -> T:
    """Repeat ``state = step(state)`` while ``going(state)`` holds, at most ``budget`` times.

    ``state`` is a named tuple of numbers. A loop carries values, no errors: how far its result is from
    what it approximates is for the formula to say, with :func:`widened`.
    """
    for _ in range(budget):
        state = values(state)
        condition = going(state)
        go_on: Any = getattr(condition, "of_values", condition)
        if _is_plain(go_on):
            if not go_on:
                break
            state = step(state)
            continue
        loop = getattr(go_on, "loop", None)
        if loop is not None:
            return loop(state, going, step, budget)
        if not _any(go_on):
            break
        state = _where_going(go_on, step(state), state)
    return state


def _where_going(go_on: Condition, after: T, before: T) -> T:
    return choose(go_on, lambda: after, lambda: before)


def certain(x: Scalar) -> Scalar:
    """``x`` as the exact number that it is written as: without the error that it carries."""
    own = getattr(x, "certain", None)
    return x if own is None else own()


def values(state: T) -> T:
    """The numbers of nested named tuples without their errors."""
    return type(state)(*map(values, state)) if isinstance(state, tuple) else certain(state)


def error_of(x: Scalar) -> Scalar:
    """An upper bound of the error that ``x`` carries; 0 if numbers of its make carry none."""
    own = getattr(x, "error_of", None)
    return x * 0 if own is None else own()


def widened(x: Scalar, by: Scalar) -> Scalar:
    """``x`` with a further error of at most ``by >= 0``. Numbers that carry no error stay as they are."""
    own = getattr(x, "widened", None)
    return x if own is None else own(by)


def varying_as(x: Scalar, other: Callable[[], Scalar]) -> Scalar:
    """``x``, which varies as ``other()`` does. Numbers that carry no derivatives stay as they are.

    For a number that its formula gives where it is, but not next to it: a root that a loop found, a branch
    that holds at one point alone.
    """
    own = getattr(x, "varying_as", None)
    return x if own is None else own(other)


def fixed(x: Scalar) -> Scalar:
    """``x``, which does not vary."""
    return varying_as(x, lambda: 0.0)


def for_derivatives(x: Scalar, other: Callable[[], Scalar]) -> Scalar:
    """``x``; or ``other()``, a value that serves derivatives better, of numbers that carry them."""
    own = getattr(x, "for_derivatives", None)
    return x if own is None else own(other)


def relative_logarithm(x: Scalar) -> Scalar:
    """``log(1 + x) / x``: a value, of numbers that carry derivatives."""
    return x.value_of("log1p_over")


def relative_exponential(x: Scalar) -> Scalar:
    """``(exp(x) - 1) / x``: a value, of numbers that carry derivatives."""
    return x.value_of("expm1_over")


def called(formula: Callable[..., T], *arguments: Any) -> T:
    """``formula(*arguments)``, which is rarely needed: where formulas are compiled, by a call.

    The arguments are named tuples of numbers, and so is the result.
    """
    first = arguments[0]
    while isinstance(first, tuple):
        first = first[0]
    own = getattr(first, "called", None)
    return formula(*arguments) if own is None else own(formula, arguments)


def given_roundoff(x: Scalar) -> Scalar:
    """Half the spacing of the floats that numbers are given in, relative: 2^-53, of float32 2^-24."""
    own = getattr(x, "given_roundoff", None)
    if own is not None:
        return own()
    return 2.0**-24 if str(getattr(x, "dtype", "")).endswith("float32") else 2.0**-53


def is_out_of_range(*numbers: Scalar) -> Condition:
    """Whether one of these, none of them negative, is infinite, or so small that it may have lost digits."""
    unit, total = given_roundoff(numbers[0]), sum(numbers[1:], start=numbers[0])
    least = unit * unit * unit * unit * unit
    return reduce(operator.or_, (x < least for x in numbers)) | negation(total - total == 0)


def maximum(x: Scalar, y: Scalar) -> Scalar:
    """The greater of two numbers."""
    return choose(x < y, lambda: y, lambda: x)


def minimum(x: Scalar, y: Scalar) -> Scalar:
    """The lesser of two numbers."""
    return choose(y < x, lambda: y, lambda: x)


def all_of(conditions: Iterable[Condition]) -> Condition:
    """Whether all conditions hold."""
    return reduce(operator.and_, conditions)


def all_zero(numbers: Iterable[Scalar]) -> Condition:
    """Whether all numbers are 0; NaN is not."""
    return all_of(number == 0 for number in numbers)


def negation(condition: Condition) -> Condition:
    """Whether ``condition`` does not hold."""
    return not condition if isinstance(condition, bool) else ~condition


def _is_plain(condition: Condition) -> bool:
    """Whether a condition is a truth value of Python's, or NumPy's scalar."""
    return isinstance(condition, bool) or type(condition).__name__ in ("bool_", "bool")


def _any(condition: Any) -> bool:
    namespace = getattr(condition, "__array_namespace__", None)
    return bool(condition.any() if namespace is None else namespace().any(condition))


def _where_of(condition: Any) -> Callable[..., Any]:
    """``where`` of the arrays that ``condition`` is made of.

    PyTorch's have no namespace, but its module; Dask's have neither, but NumPy's function passes on to
    theirs. By the standard ``where`` takes numbers only beside an array.
    """
    namespace = getattr(condition, "__array_namespace__", None)
    if namespace is None:
        module = sys.modules[type(condition).__module__.partition(".")[0]]
        own: Callable[..., Any] = getattr(module, "where", None) or import_module("numpy").where
        return own
    xp = namespace()

    def where(condition: Any, *values: Any) -> Any:
        return xp.where(
            condition, *(xp.asarray(float(x)) if isinstance(x, (int, float)) else x for x in values)
        )

    return where


def _merge(pick: Callable[..., Any], condition: Any, if_true: Any, if_false: Any) -> Any:
    if isinstance(if_true, tuple):
        parts = zip(if_true, if_false, strict=True)
        merged = (_merge(pick, condition, t, f) for t, f in parts)
        return type(if_true)(*merged) if hasattr(if_true, "_fields") else tuple(merged)
    return pick(condition, if_true, if_false)


def numbers_in(value: Any) -> Iterator[Any]:
    """Every number in nested named tuples."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers_in(part)
    else:
        yield value
