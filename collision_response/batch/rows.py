"""The rows of a batch's tables: which quantity lies where, for each geometry.

Only what a geometry and a law need is there. Write ``bodies[rows.velocity] = ...``.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from ..kernels.layout import Layout
from ..model import Geometry

NOWHERE = slice(0, 0)


class BodyRows(NamedTuple):
    """Where the quantities of the bodies lie in ``bodies``.

    That is a table of bodies, shape ``(height, B)``; or without ``pairs``, of them, ``(height, 2, N)``.

    Attributes:
        mass: [kg]; ``inf``: the body is immovable.
        inertia: about the centre of mass [kg m^2]: ``(xx, xy, xz, yy, yz, zz)`` in body axes, or
            ``zz`` alone. 0 for an immovable body, or one that does not turn.
        position: of the centre of mass [m].
        velocity: of the centre of mass [m/s].
        angular_velocity: [rad/s], in world axes, or about z alone.
        orientation: ``(x, y, z, w)`` from body axes to world axes. Left out, the two are parallel.
        height: how many rows there are.
    """

    mass: slice
    inertia: slice
    position: slice
    velocity: slice
    angular_velocity: slice
    orientation: slice
    height: int


class ContactRows(NamedTuple):
    """Where the quantities of the contacts lie in ``contacts``, an array of shape ``(height, N)``.

    Attributes:
        position: of the contact point [m].
        normal: from body_b to body_a, of any length but 0.
        restitution: in [0, 1].
        friction: >= 0. May be left out, with what follows it, for the law FRICTIONLESS.
        tangential_restitution: in [-1, 1]. May be left out: then it is that of the model.
        height: how many rows there are with friction, without tangential restitution.
    """

    position: slice
    normal: slice
    restitution: slice
    friction: slice
    tangential_restitution: slice
    height: int


def layout_of(geometry: Geometry, *, oriented: bool = False) -> Layout:
    """The layout of the tables of a geometry; only SPATIAL bodies may be oriented."""
    if oriented and geometry is not Geometry.SPATIAL:
        raise ValueError(f"orientation has no effect in {geometry.name}: leave it out")
    return Layout.SPATIAL_ORIENTED if oriented else Layout[geometry.name]


def _one_after_the_other(widths: dict[str, int]) -> tuple[dict[str, slice], int]:
    places, height = {}, 0
    for field, width in widths.items():
        places[field] = slice(height, height + width)
        height += width
    return places, height


@cache
def body_rows(geometry: Geometry, *, oriented: bool = False) -> BodyRows:
    """The rows of ``bodies``; only SPATIAL bodies may be oriented."""
    fields = layout_of(geometry, oriented=oriented).fields(0)
    places, height = _one_after_the_other({name: len(axes) for name, axes in fields.items()})
    return BodyRows._make([*(places.get(field, NOWHERE) for field in BodyRows._fields[:-1]), height])


TABLES = {
    body_rows(geometry, oriented=oriented).height: (geometry, oriented)
    for geometry, oriented in (
        (Geometry.POINT, False),
        (Geometry.PLANAR, False),
        (Geometry.SPATIAL, False),
        (Geometry.SPATIAL, True),
    )
}
"""What a table of bodies with so many rows describes: the geometry, and whether bodies are oriented."""


def rows_of(height: int) -> BodyRows:
    """The rows of a table of bodies with so many. Raises: ValueError: there is no such table."""
    if height not in TABLES:
        raise ValueError(f"bodies: must have {' or '.join(map(str, TABLES))} rows, has {height}")
    geometry, oriented = TABLES[height]
    return body_rows(geometry, oriented=oriented)


@cache
def contact_rows(geometry: Geometry) -> ContactRows:
    """The rows of ``contacts``."""
    widths = {name: len(axes) for name, axes in layout_of(geometry).fields(1).items()}
    places, height = _one_after_the_other({**widths, "restitution": 1, "friction": 1})
    places["tangential_restitution"] = slice(height, height + 1)
    return ContactRows._make([*(places.get(field, NOWHERE) for field in ContactRows._fields[:-1]), height])
