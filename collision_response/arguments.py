"""Numbers that a caller gives: checked here, and refused by the name of the argument."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

from .numbers.operations import of_python
from .status import ImpactError, StatusCode, format_range, format_value


def is_real(value: Any) -> bool:
    """Whether a value is a real number of any type, or an array of them; truth values and dates are not."""
    number = of_python(value)
    if isinstance(number, (bool, complex, str)) or type(number).__name__.startswith("Masked"):
        return False
    kind = getattr(getattr(value, "dtype", None), "kind", "f")
    return (hasattr(number, "__float__") or hasattr(number, "__index__")) and kind not in "bcmMSU"


def real_number(field: str, value: Any) -> Any:
    """Return a real number; one of NumPy as one of Python.

    Raises:
        TypeError: if ``value`` is not a real number, or is an array.
    """
    if type(value) in (float, int):  # nearly always
        return value
    number = of_python(value)
    try:
        if not is_real(value) or getattr(number, "shape", None):
            raise TypeError
        float(number)
    except OverflowError:  # an integer or a fraction beyond float64
        return number
    except (TypeError, ValueError):  # a decimal that signals has no float
        raise TypeError(f"{field}: must be a real number, is {format_value(value)}") from None
    return number


def number_in(text: str) -> float:
    """Return the number that a text says.

    Raises:
        ValueError: if it is no number as files of data have it. Python's own ``1_0`` is none.
    """
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def is_finite(number: Any) -> bool:
    """Whether a real number is finite, and within the range of float64."""
    try:
        return math.isfinite(number)
    except OverflowError:  # an integer or a fraction
        return False


def check_number(
    field: str,
    value: Any,
    least: float,
    most: float,
    code: StatusCode,
    not_finite: StatusCode = StatusCode.NOT_FINITE,
) -> float:
    """Check that a value is a finite real number in ``[least, most]``, and return it as a float.

    Args:
        field: the name of the value, for the error.
        value: the value to check.
        least, most: the range.
        code: the code of the error if the value is out of range.
        not_finite: the code of the error if the value is infinite or NaN.

    Raises:
        ImpactError: ``code`` or ``not_finite``.
        TypeError: if ``value`` is not a real number: a boolean, a complex number, text or an array.
    """
    number = real_number(field, value)
    if not is_finite(number):
        raise ImpactError(not_finite, field, f"must be finite; is {format_value(number, str)}")
    try:
        is_in_range = least <= number <= most
    except TypeError:  # it can be converted, but not compared
        is_in_range = least <= float(number) <= most
    if not is_in_range:
        reason = f"must be {format_range(least, most)}; is {format_value(number, str)}"
        raise ImpactError(code, field, reason)
    return float(number)


def finite_number(field: str, value: Any) -> float:
    """Return a finite real number as a float.

    Raises:
        ImpactError: NOT_FINITE.
        TypeError: as :func:`check_number`.
    """
    return check_number(field, value, -math.inf, math.inf, StatusCode.NOT_FINITE)


def of_one_type(given: Mapping[str, Any]) -> list[Any]:
    """Return finite numbers, given by name, as floats; or as fractions if all are fractions or integers.

    Numbers of different types cannot always be added.

    Raises:
        ImpactError, TypeError: as :func:`check_number`.
    """
    numbers = [real_number(name, x) for name, x in given.items()]
    if any(isinstance(x, Fraction) for x in numbers) and all(isinstance(x, (Fraction, int)) for x in numbers):
        return list(map(Fraction, numbers))
    return [finite_number(name, x) for name, x in given.items()]


def check_count(field: str, value: Any, least: int, most: float) -> int:
    """Check that a value is a whole number in ``[least, most]``, and return it as an ``int``.

    Raises:
        ImpactError: INVALID_MODEL, if it is out of range.
        TypeError: if it is not a whole number of Python or NumPy.
    """
    number = of_python(value)
    if not (is_real(value) and isinstance(number, int)):
        raise TypeError(f"{field}: must be a whole number, is {format_value(value)}")
    if not least <= number <= most:
        reason = f"must be {format_range(least, most)}; is {format_value(number, str)}"
        raise ImpactError(StatusCode.INVALID_MODEL, field, reason)
    return number


def as_list(field: str, values: Iterable[Any]) -> list[Any]:
    """Return a list of values. Raises: TypeError: if they are not iterable, or are text."""
    try:
        if isinstance(values, str):
            raise TypeError
        return list(values)
    except TypeError:
        raise TypeError(f"{field}: must be a sequence, is {format_value(values)}") from None


def check_mapping(field: str, values: Any) -> None:
    """Raises: TypeError: if ``values`` are no mapping."""
    if not isinstance(values, Mapping):
        raise TypeError(f"{field}: must be a mapping, is {format_value(values)}")
