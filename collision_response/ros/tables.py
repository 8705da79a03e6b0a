"""Tables, names and indices in the fields of requests, and the arrays of a response to a batch.

Array fields of a message are ``array.array``. NumPy arrays share their memory, so tables are not copied.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..arguments import as_list
from ..batch import BatchResult
from ..batch.arrays import Array
from ..batch.rows import TABLE_LAYOUTS
from ..srv import ResolveCollisionBatch
from ..status import ImpactError, StatusCode, format_value

Request, Response = ResolveCollisionBatch.Request, ResolveCollisionBatch.Response

LAYOUTS = {getattr(Request, layout.name): layout for layout in TABLE_LAYOUTS.values()}
"""The layouts of the tables, by their numbers in a request."""

NAMES = BatchResult(*BatchResult._fields)._replace(
    error_bound="error_bounds", precision="precisions", regime="regimes"
)
"""What a response calls the fields of a result."""


def result_in(
    response: Any, fields: BatchResult, view: Callable[[array[Any], tuple[int, ...]], Array]
) -> BatchResult:
    """Make a result whose arrays are the fields of a response.

    ``view``, which is :func:`view_of` or :func:`zeros_in`, makes each array of a field and a shape.
    """
    given = zip(NAMES, fields, strict=True)
    return BatchResult(*(field and view(getattr(response, name), field[0]) for name, field in given))


def number_of_names(request: Any) -> int:
    """Number of lines in the field ``names`` of a request: cheap even if there are too many to split them.

    If the last two are empty, one of them is not in ``names_in``.
    """
    names: str = request.names
    is_last_ended = names.endswith("\n") and not names.endswith("\n\n")
    return names.count("\n") + (not is_last_ended) if names else 0


def names_in(request: Any) -> list[str]:
    """Return the lines of the field ``names`` of a request. The last may end, too, as blocks of YAML do."""
    return request.names.removesuffix("\n").split("\n") if request.names else []


def table_in(field: str, numbers: array[Any], rows: int, of_layout: str = "") -> Array:
    """Return the numbers of a field as a table, which shares their memory.

    ``of_layout`` follows the number of rows in the error.

    Raises:
        ImpactError: INVALID_TABLE if the rows do not all have the same length.
    """
    table = np.asarray(numbers)
    if table.size % rows:
        reason = f"must hold {rows} rows of equal length{of_layout}; holds {table.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
    return table.reshape(rows, -1)


def as_lines(names: Iterable[str]) -> str:
    """Join names to one string, one per line.

    Raises:
        TypeError: if they are not a sequence of texts.
        ValueError: if a name has several lines, or a NUL character, at which ROS would cut it off.
    """
    text = "\n".join(as_text(f"names[{i}]", name) for i, name in enumerate(as_list("names", names)))
    return f"{text}\n" if text.endswith("\n") else text  # the last name is empty


def as_text(field: str, text: str) -> str:
    """Return a line of text.

    Raises:
        TypeError: if it is no text.
        ValueError: if it has several lines, a NUL character, at which ROS would cut it off, or half a
            character.
    """
    if not isinstance(text, str):
        raise TypeError(f"{field}: must be text, is {format_value(text)}")
    if "\n" in text or "\0" in text:
        raise ValueError(f"{field}: must be one line without a NUL character, is {text!r}")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{field}: must be text in UTF-8, is {text!r}") from None
    return text


def as_indices(pairs: Array) -> Array:
    """Convert indices of bodies to those of a request.

    Raises:
        ValueError: if one is not an index.
    """
    with np.errstate(invalid="ignore"):  # of NaN, which is no index
        indices = pairs.astype(np.uint32)
    if (indices != pairs).any():
        wrong = pairs[indices != pairs][0]
        raise ValueError(f"pairs: must be indices of bodies, counted from 0; one is {wrong}")
    return indices


def append(field: array[Any], numbers: Array) -> None:
    """Append the numbers of an array, row by row, to a field."""
    field.frombytes(np.ascontiguousarray(numbers, field.typecode).ravel().view(np.uint8).data)


def zeros_in(field: array[Any], shape: tuple[int, ...]) -> Array:
    """Fill an empty field with zeros, and return a view of it with a shape."""
    field.append(0)
    field *= math.prod(shape)
    return view_of(field, shape)


def view_of(field: array[Any], shape: tuple[int, ...]) -> Array:
    """Return a view of a field with a shape."""
    return np.asarray(field).reshape(shape)
