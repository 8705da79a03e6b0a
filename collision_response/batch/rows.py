"""The rows of a batch's tables: which quantity lies where, for each geometry.

Only what a geometry and a law need is there. Write ``bodies[rows.velocity] = ...``.
"""

from __future__ import annotations

from functools import cache
from itertools import accumulate
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


def places_of(widths: dict[str, int]) -> dict[str, slice]:
    """Where quantities of these widths lie, one after the other."""
    ends = accumulate(widths.values())
    return {name: slice(end - width, end) for (name, width), end in zip(widths.items(), ends, strict=True)}


@cache
def body_rows(geometry: Geometry, *, oriented: bool = False) -> BodyRows:
    """The rows of ``bodies``; only SPATIAL bodies may be oriented."""
    fields = layout_of(geometry, oriented=oriented).fields(0)
    widths = {name: len(axes) for name, axes in fields.items()}
    places = places_of(widths)
    height = sum(widths.values())
    return BodyRows._make([*(places.get(field, NOWHERE) for field in BodyRows._fields[:-1]), height])


@cache
def contact_rows(geometry: Geometry) -> ContactRows:
    """The rows of ``contacts``."""
    widths = {name: len(axes) for name, axes in layout_of(geometry).fields(1).items()}
    places = places_of({**widths, "restitution": 1, "friction": 1, "tangential_restitution": 1})
    height = places["friction"].stop
    return ContactRows._make([*(places.get(field, NOWHERE) for field in ContactRows._fields[:-1]), height])


class Tables(NamedTuple):
    """What the tables of a batch describe.

    Attributes:
        geometry: POINT, PLANAR or SPATIAL.
        oriented: whether the bodies have orientations.
    """

    geometry: Geometry
    oriented: bool = False

    @property
    def name(self) -> str:
        """Of the layout."""
        return layout_of(self.geometry, oriented=self.oriented).name

    @property
    def bodies(self) -> BodyRows:
        """The rows of ``bodies``."""
        return body_rows(self.geometry, oriented=self.oriented)

    @property
    def contacts(self) -> ContactRows:
        """The rows of ``contacts``."""
        return contact_rows(self.geometry)


TABLES = {
    tables.bodies.height: tables
    for tables in (
        *map(Tables, (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL)),
        Tables(Geometry.SPATIAL, oriented=True),
    )
}
"""By the number of rows of ``bodies``."""


def rows_of(height: int) -> BodyRows:
    """The rows of a table of bodies with so many. Raises: ValueError: there is no such table."""
    if height not in TABLES:
        raise ValueError(f"bodies: must have {' or '.join(map(str, TABLES))} rows, has {height}")
    return TABLES[height].bodies
