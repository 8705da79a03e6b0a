"""The fields of ``srv/ResolveCollisionBatch.srv`` as arrays.

Array fields of a message are ``array.array``. NumPy arrays share their memory, so tables are not copied.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np

from ..batch import BatchResult
from ..batch.rows import TABLE_LAYOUTS, body_rows
from ..model import Geometry, ImpactModel
from ..msg import ImpactModel as ImpactModelMessage
from ..named_enum import NamedEnum
from ..srv import ResolveCollisionBatch
from ..status import ImpactError, StatusCode

Array = np.ndarray[Any, Any]
Request, Response = ResolveCollisionBatch.Request, ResolveCollisionBatch.Response

LAYOUTS = {getattr(Request, tables.name): tables for tables in TABLE_LAYOUTS.values()}
"""The layouts of the tables, by their numbers in a request."""

ENERGIES = BatchResult._fields[-4:]
"""Names of the energies, which are the same in a :class:`BatchResult` and in a response."""


def result_shapes(geometry: Geometry, n: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the tables of a response with ``n`` contacts, by their names."""
    rows = body_rows(geometry)
    linear, angular = (part.stop - part.start for part in (rows.velocity, rows.angular_velocity))
    return {"velocity": (linear, 2, n), "angular_velocity": (angular, 2, n), "impulse": (linear, n)}


def names_in(request: Any) -> list[str]:
    """Names in the field ``names`` of a request."""
    return request.names.split("\n") if request.names else []


def table_in(field: str, numbers: array[Any], rows: int, of_layout: str = "") -> Array:
    """Return the numbers of a field as a table, which shares their memory.

    Args:
        field: the name of the field, for the error.
        numbers: the numbers, row by row.
        rows: the number of rows.
        of_layout: follows the number of rows in the error.

    Raises:
        ImpactError: INVALID_TABLE if the rows do not all have the same length.
    """
    table = np.asarray(numbers)
    if table.size % rows:
        reason = f"must hold {rows} rows of equal length{of_layout}; holds {table.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, field, reason)
    return table.reshape(rows, -1)


def append(field: array[Any], numbers: Array) -> None:
    """Append the numbers of an array, row by row, to a field."""
    field.frombytes(np.ascontiguousarray(numbers, field.typecode).ravel().view(np.uint8).data)


def zeros_in(field: array[Any], shape: tuple[int, ...]) -> Array:
    """Fill an empty field with zeros, and return a view of it with a shape."""
    field.append(0)
    field *= math.prod(shape)
    return np.asarray(field).reshape(shape)


def write_model(message: ImpactModelMessage, model: ImpactModel) -> None:
    """Write a model into a message."""
    for field, value in model._asdict().items():
        setattr(message, field, int(value) if isinstance(value, NamedEnum) else float(value))
