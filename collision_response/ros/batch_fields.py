"""What the fields of ``srv/ResolveCollisionBatch.srv`` mean in terms of the numeric core.

Tables are not copied to be looked at: the fields of a message are ``array.array``, whose memory NumPy shares.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np

from ..batch import BatchResult
from ..batch.rows import TABLES, body_rows
from ..model import Geometry, ImpactModel
from ..msg import ImpactModel as ImpactModelMessage
from ..named_enum import NamedEnum
from ..srv import ResolveCollisionBatch

Array = np.ndarray[Any, Any]
Request, Response = ResolveCollisionBatch.Request, ResolveCollisionBatch.Response


LAYOUTS = {getattr(Request, tables.name): tables for tables in TABLES.values()}
"""By their number in a request."""

ENERGIES = BatchResult._fields[-4:]
"""Fields of a response, of the same names."""


def result_shapes(geometry: Geometry, n: int) -> dict[str, tuple[int, ...]]:
    """The shapes of the tables of a response to ``n`` contacts, by their names."""
    of = body_rows(geometry)
    axes, turns = (rows.stop - rows.start for rows in (of.velocity, of.angular_velocity))
    return {"velocity": (axes, 2, n), "angular_velocity": (turns, 2, n), "impulse": (axes, n)}


def names_in(request: Any) -> list[str]:
    """The bodies of a request that are given by name."""
    return request.names.split("\n") if request.names else []


def append(field: array[Any], numbers: Array) -> None:
    """Lengthen a field by the numbers of an array."""
    field.frombytes(np.ascontiguousarray(numbers, field.typecode).ravel().view(np.uint8).data)


def with_zeros(field: array[Any], shape: tuple[int, ...]) -> Array:
    """An empty field, filled with zeros and seen as an array of that shape."""
    field.append(0)
    field *= math.prod(shape)
    return np.asarray(field).reshape(shape)


def write_model(message: ImpactModelMessage, model: ImpactModel) -> None:
    """Fill in a model."""
    for field, value in model._asdict().items():
        setattr(message, field, int(value) if isinstance(value, NamedEnum) else float(value))
