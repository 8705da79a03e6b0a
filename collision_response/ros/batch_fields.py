"""What the fields of ``srv/ResolveCollisionBatch.srv`` mean in terms of the numeric core.

Tables are not copied to be looked at: the fields of a message are ``array.array``, whose memory NumPy shares.
"""

from __future__ import annotations

import math
from array import array
from typing import Any, NamedTuple

import numpy as np

from ..batch import BatchResult
from ..batch.rows import BodyRows, ContactRows, body_rows, contact_rows
from ..model import Geometry, ImpactModel
from ..msg import ImpactModel as ImpactModelMessage
from ..named import Named
from ..srv import ResolveCollisionBatch

Array = np.ndarray[Any, Any]
Request, Response = ResolveCollisionBatch.Request, ResolveCollisionBatch.Response


class Layout(NamedTuple):
    """Which rows the tables have.

    Attributes:
        name: in the request.
        geometry: POINT, PLANAR or SPATIAL.
        oriented: whether the bodies have orientations.
    """

    name: str
    geometry: Geometry
    oriented: bool = False

    @property
    def bodies(self) -> BodyRows:
        """The rows of ``bodies``."""
        return body_rows(self.geometry, oriented=self.oriented)

    @property
    def contacts(self) -> ContactRows:
        """The rows of ``contacts``."""
        return contact_rows(self.geometry)


LAYOUTS = {
    Request.POINT: Layout("POINT", Geometry.POINT),
    Request.PLANAR: Layout("PLANAR", Geometry.PLANAR),
    Request.SPATIAL: Layout("SPATIAL", Geometry.SPATIAL),
    Request.SPATIAL_ORIENTED: Layout("SPATIAL_ORIENTED", Geometry.SPATIAL, oriented=True),
}


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
        setattr(message, field, int(value) if isinstance(value, Named) else float(value))
