"""Operations on numbers of any type, beyond Python's arithmetic and comparisons.

A formula is written once, with these operations, and runs on every number type: Python floats; fractions,
with which a rational law is exact; balls, which enclose a real number
(:mod:`~collision_response.numbers.balls`); arrays of one shape, with one contact per element; and symbols,
which record the formula for the compiler (:mod:`~collision_response.kernels.tracer.symbol`). The operations
are a branch (:func:`choose`), a square root, a loop (:func:`iterate`), and some that concern the error or the
derivatives that a number may carry. A number type takes part in these by a method of the same name.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from functools import reduce
from importlib import import_module
from typing import Any, TypeAlias, TypeVar, cast

Scalar: TypeAlias = Any
"""A real number of any type, or an array of them."""

Condition: TypeAlias = Any
"""A truth value, an array or a symbol of truth values, or an undecided one (``balls.Undecided``)."""

T = TypeVar("T")

ROUNDOFF = 2.0**-53
"""Unit roundoff of float64."""


def choose(condition: Condition, if_true: Callable[[], T], if_false: Callable[[], T]) -> T:
    """Return ``if_true()`` where ``condition`` holds, else ``if_false()``.

    For a plain truth value one branch is evaluated. For any other condition both are, and the result takes
    each number from one of them, also within named tuples. If the condition is undecided, the result covers
    both branches.
    """
    if _is_plain(condition):
        return if_true() if condition else if_false()
    pick = getattr(condition, "pick", None) or _where_of(condition)
    first, second = if_true(), if_false()
    pairs = zip(numbers_in(first), numbers_in(second), strict=True)
    return cast("T", rebuilt(first, (pick(condition, *pair) for pair in pairs)))


def square_root(x: Scalar) -> Scalar:
    """Return the square root of ``x >= 0``, in the arithmetic of ``x``.

    The root of a fraction is a fraction, exact if the root is rational and else right to 2^-62.
    """
    if isinstance(x, float):
        return math.sqrt(x)
    if isinstance(x, Fraction):
        return _rational_root(x)
    if hasattr(x, "shape"):
        # Reverse-mode gradients of arrays run through both branches, so both need finite slopes.
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
    scale = 0 if x == 0 else max(0, 128 - x.numerator.bit_length() + x.denominator.bit_length()) // 2 + 1
    top, bottom = math.isqrt(x.numerator), math.isqrt(x.denominator)
    if top * top == x.numerator and bottom * bottom == x.denominator:
        return Fraction(top, bottom)
    return Fraction(math.isqrt((x.numerator << 2 * scale) // x.denominator), 1 << scale)


def iterate(
    state: T, going: Callable[[T], Condition], step: Callable[[T], T], budget: int, *, rounded: bool = False
) -> T:
    """Repeat ``state = step(state)`` while ``going(state)`` holds, at most ``budget`` times.

    Args:
        state: a named tuple of numbers.
        going: whether to go on from a state.
        step: computes the next state.
        budget: the largest number of steps.
        rounded: whether pairs of floats may be rounded to floats in the loop. The formula then counts that.

    A loop drops the errors that numbers carry. A formula that uses a loop must add the error of its result
    with :func:`widened`.
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
            return loop(state, going, step, budget, rounded)
        if not any_of(go_on):
            break
        state = _where_going(go_on, step(state), state)
    return state


def _where_going(go_on: Condition, after: T, before: T) -> T:
    return choose(go_on, lambda: after, lambda: before)


def certain(x: Scalar) -> Scalar:
    """Return ``x`` without the error that it carries, as if its value were exact."""
    own = getattr(x, "certain", None)
    return x if own is None else own()


def values(state: Any) -> Any:
    """Return nested named tuples with :func:`certain` applied to every number."""
    return map_numbers(certain, state)


def error_of(x: Scalar) -> Scalar:
    """Return an upper bound on the error that ``x`` carries; 0 if its type carries no error."""
    own = getattr(x, "error_of", None)
    return x * 0 if own is None else own()


def widened(x: Scalar, by: Scalar) -> Scalar:
    """Return ``x`` with a further error of at most ``by >= 0``; ``x`` as it is if its type carries none."""
    own = getattr(x, "widened", None)
    return x if own is None else own(by)


def varying_as(x: Scalar, other: Callable[[], Scalar]) -> Scalar:
    """Return the value of ``x`` with the derivatives of ``other()``; ``x`` itself if its type carries none.

    Use it where the derivatives of a formula are not those of the number that it computes: for a root that a
    loop finds, and for a branch that holds at a single point.
    """
    own = getattr(x, "varying_as", None)
    return x if own is None else own(other)


def fixed(x: Scalar) -> Scalar:
    """Return the value of ``x`` with derivatives 0; ``x`` itself if its type carries no derivatives."""
    return varying_as(x, lambda: 0.0)


def for_derivatives(x: Scalar, other: Callable[[], Scalar]) -> Scalar:
    """Return ``x``, or ``other()`` if the type of ``x`` carries derivatives.

    ``other()`` has the same value, by a formula with better derivatives.
    """
    own = getattr(x, "for_derivatives", None)
    return x if own is None else own(other)


def relative_logarithm(x: Scalar) -> Scalar:
    """Return ``log(1 + x) / x``, without derivatives. Only for number types that carry derivatives."""
    return x.value_of("log1p_over")


def relative_exponential(x: Scalar) -> Scalar:
    """Return ``(exp(x) - 1) / x``, without derivatives. Only for number types that carry derivatives."""
    return x.value_of("expm1_over")


def called(formula: Callable[..., T], *arguments: Any) -> T:
    """Return ``formula(*arguments)``. Compiled code calls the formula instead of inlining it.

    Use it for a formula that is large and rarely needed. The arguments and the result are named tuples of
    numbers.
    """
    own = getattr(next(numbers_in(arguments)), "called", None)
    return formula(*arguments) if own is None else own(formula, arguments)


def given_roundoff(x: Scalar) -> Scalar:
    """Return the unit roundoff of the input numbers: 2^-24 for float32, else that of float64."""
    own = getattr(x, "given_roundoff", None)
    if own is not None:
        return own()
    if isinstance(x, Fraction):
        return Fraction(ROUNDOFF)
    return 2.0**-24 if str(getattr(x, "dtype", "")).endswith("float32") else ROUNDOFF


def is_out_of_range(*numbers: Scalar) -> Condition:
    """Whether one of these non-negative numbers is infinite or NaN, or so small that it may lose digits."""
    unit, total = given_roundoff(numbers[0]), add_up(numbers)
    least = unit * unit * unit * unit * unit
    return reduce(operator.or_, (x < least for x in numbers)) | negation(total - total == 0)


def add_up(numbers: Iterable[Scalar]) -> Scalar:
    """Return the sum, from left to right. Since Python 3.12, ``sum`` rounds sums of floats differently."""
    return reduce(operator.add, numbers)


def maximum(x: Scalar, y: Scalar) -> Scalar:
    """Return the larger of two numbers."""
    return choose(x < y, lambda: y, lambda: x)


def minimum(x: Scalar, y: Scalar) -> Scalar:
    """Return the smaller of two numbers."""
    return choose(y < x, lambda: y, lambda: x)


def positive_part(x: Scalar) -> Scalar:
    """Return ``x`` where it is positive, else 0."""
    return maximum(x, 0 * x)


def or_one(x: Scalar) -> Scalar:
    """Return ``x`` where it is positive, else 1: the divisor of a quotient that is then not used."""
    return choose(x > 0, lambda: x, lambda: x * 0 + 1)


def of_python(x: Any) -> Any:
    """Return a number of NumPy as one of Python, and anything else as it is.

    NumPy's integers overflow, and a comparison with one of its numbers first rounds the other side.
    """
    is_number = getattr(x, "shape", None) == () and not type(x).__name__.startswith("Masked")
    return x.item() if is_number else x


def all_of(conditions: Iterable[Condition]) -> Condition:
    """Whether all conditions hold."""
    return reduce(operator.and_, conditions)


def all_zero(numbers: Iterable[Scalar]) -> Condition:
    """Whether all numbers are 0. NaN is not 0."""
    return all_of(number == 0 for number in numbers)


def may_have_effect(numbers: Iterable[Scalar]) -> Condition:
    """Whether a term with these factors counts: not if all are 0, unless they are arrays.

    Those may carry derivatives, which are not 0 with them.
    """
    numbers = list(numbers)
    return any(hasattr(number, "shape") for number in numbers) or negation(all_zero(numbers))


def negation(condition: Condition) -> Condition:
    """Whether ``condition`` does not hold."""
    return not condition if isinstance(condition, bool) else ~condition


def _is_plain(condition: Condition) -> bool:
    """Whether a condition is a ``bool`` of Python or a scalar one of NumPy."""
    return isinstance(condition, bool) or type(condition).__name__ in ("bool_", "bool")


def any_of(condition: Any) -> bool:
    """Whether a truth value, or one of an array of them, is true."""
    namespace = getattr(condition, "__array_namespace__", None)
    return bool(condition.any() if namespace is None else namespace().any(condition))


def _where_of(condition: Any) -> Callable[..., Any]:
    """Return the function ``where`` for the kind of array that ``condition`` is.

    PyTorch's arrays have no ``__array_namespace__``, so it is looked up in their module. Dask's have neither,
    but NumPy's ``where`` dispatches to theirs. By the array standard, ``where`` takes a number only together
    with an array on the same device, so numbers are converted.
    """
    namespace = getattr(condition, "__array_namespace__", None)
    if namespace is None:
        module = sys.modules[type(condition).__module__.partition(".")[0]]
        return getattr(module, "where", None) or import_module("numpy").where
    xp = namespace()
    device = getattr(condition, "device", None)  # JAX compiles without devices

    def array(x: Any) -> Any:
        return xp.asarray(float(x), device=device) if isinstance(x, (int, float)) else x

    def where(condition: Any, *values: Any) -> Any:
        return xp.where(condition, *map(array, values))

    return where


def map_numbers(function: Callable[[Any], Any], value: Any) -> Any:
    """Return nested tuples with ``function`` applied to every number."""
    return rebuilt(value, map(function, numbers_in(value)))


def rebuilt(value: Any, numbers: Iterator[Any]) -> Any:
    """Return nested tuples of the structure of ``value``, filled with other numbers in order."""
    if isinstance(value, tuple):
        parts = [rebuilt(part, numbers) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return next(numbers)


def numbers_in(value: Any) -> Iterator[Any]:
    """Yield every number of nested tuples."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers_in(part)
    else:
        yield value
