"""What a law may compute with.

A law is written once and runs on whatever numbers its inputs are made of: Python floats,
``fractions.Fraction`` (a rational law is then exact), mpmath or FLINT numbers (more digits), or
arrays of one shape (then it resolves one contact per element). Only two things need help to be
written once: a branch, and a square root.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Iterable
from enum import Enum
from functools import reduce
from typing import Any, TypeAlias, TypeVar

import numpy as np

Scalar: TypeAlias = Any
"""A real number of any make, or an array of them."""

T = TypeVar("T")

_SCALAR_TRUTHS = (bool, np.bool_)


def choose(condition: Any, if_true: Callable[[], T], if_false: Callable[[], T]) -> T:
    """``if_true()`` where ``condition`` holds, else ``if_false()``.

    A single truth value evaluates one branch. An array of them evaluates both and picks element by
    element, through the components of named tuples.
    """
    if isinstance(condition, _SCALAR_TRUTHS):
        return if_true() if condition else if_false()
    merged: T = _merge(_where_of(condition), condition, if_true(), if_false())
    return merged


def square_root(x: Scalar) -> Scalar:
    """The square root of ``x >= 0``, in the arithmetic of ``x``.

    A ball is that of what cannot be negative: of 0, it may reach below by its radius.
    """
    if isinstance(x, float):
        return math.sqrt(x)
    part = getattr(x, "nonnegative_part", None)
    if part is not None:
        return part().sqrt()
    own = getattr(x, "sqrt", None)
    if own is not None:
        return own()
    namespace = getattr(x, "__array_namespace__", None)
    return x**0.5 if namespace is None else namespace().sqrt(x)


def are_zero(numbers: Iterable[Scalar]) -> Any:
    """Whether all numbers are 0; NaN is not."""
    return reduce(operator.and_, (number == 0 for number in numbers))


def _where_of(condition: Any) -> Callable[..., Any]:
    """``where`` of the arrays that ``condition`` is made of.

    PyTorch's have no namespace, but its module; Dask's have neither, but NumPy's function passes on to
    theirs. By the standard ``where`` takes numbers only beside an array, and enumerations not at all.
    """
    namespace = getattr(condition, "__array_namespace__", None)
    if namespace is None:
        module = sys.modules[type(condition).__module__.partition(".")[0]]
        return getattr(module, "where", np.where)
    xp = namespace()

    def where(condition: Any, *values: Any) -> Any:
        return xp.where(condition, *(xp.asarray(x.value) if isinstance(x, Enum) else x for x in values))

    return where


def _merge(where: Callable[..., Any], condition: Any, if_true: Any, if_false: Any) -> Any:
    values = if_true, if_false
    kind: Any = next((type(value) for value in values if isinstance(value, tuple)), None)
    if kind is None:
        return where(condition, if_true, if_false)
    # A plain number beside one of several parts becomes one.
    parts = (value if isinstance(value, tuple) else kind(value) for value in values)
    return kind(*(_merge(where, condition, t, f) for t, f in zip(*parts, strict=True)))
