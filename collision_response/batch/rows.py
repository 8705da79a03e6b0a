"""The tables of a batch: which rows hold which quantity, for each geometry.

A table has rows only for what the geometry and the law need. Use them as in ``bodies[rows.velocity] = ...``.
"""

from __future__ import annotations

from functools import cache
from itertools import accumulate
from typing import NamedTuple

from ..kernels.layout import Layout
from ..model import Geometry

NO_ROWS = slice(0, 0)


class BodyRows(NamedTuple):
    """The rows of ``bodies`` that hold each quantity.

    ``bodies`` is an array of shape ``(height, B)``, with a column for each body. Without ``pairs`` its shape
    is ``(height, 2, N)``, with body_a and body_b of each contact.

    Attributes:
        mass: [kg]; ``inf`` for an immovable body.
        inertia: about the centre of mass [kg m^2]: ``(xx, xy, xz, yy, yz, zz)`` in body axes; in PLANAR only
            ``zz``. 0 for an immovable body, or one that does not turn.
        position: of the centre of mass [m].
        velocity: of the centre of mass [m/s].
        angular_velocity: in world axes [rad/s]; in PLANAR only about z.
        orientation: ``(x, y, z, w)`` from body axes to world axes. Without it, the axes are parallel.
        height: number of rows.
    """

    mass: slice
    inertia: slice
    position: slice
    velocity: slice
    angular_velocity: slice
    orientation: slice
    height: int


class ContactRows(NamedTuple):
    """The rows of ``contacts`` that hold each quantity, in an array of shape ``(height, N)``.

    Attributes:
        position: of the contact point [m].
        normal: from body_b to body_a, of any length but 0.
        restitution: in [0, 1].
        friction: >= 0. For the law FRICTIONLESS this row and all after it may be left out.
        tangential_restitution: in [-1, 1]. If left out, the one of the model is used.
        height: number of rows with friction and without tangential restitution.
    """

    position: slice
    normal: slice
    restitution: slice
    friction: slice
    tangential_restitution: slice
    height: int


def layout_of(geometry: Geometry, *, oriented: bool = False) -> Layout:
    """Return the layout for a geometry. Raises: ValueError: if ``oriented``, but not SPATIAL."""
    if oriented and geometry is not Geometry.SPATIAL:
        raise ValueError(f"orientation has no effect in {geometry.name}: leave it out")
    return Layout.SPATIAL_ORIENTED if oriented else Layout[geometry.name]


def slices_of(widths: dict[str, int]) -> dict[str, slice]:
    """Return the slices that quantities of these widths occupy, one after the other."""
    ends = accumulate(widths.values())
    return {name: slice(end - width, end) for (name, width), end in zip(widths.items(), ends, strict=True)}


@cache
def body_rows(geometry: Geometry, *, oriented: bool = False) -> BodyRows:
    """Return the rows of ``bodies``. Only SPATIAL bodies may be ``oriented``."""
    fields = layout_of(geometry, oriented=oriented).body_fields
    widths = {name: len(axes) for name, axes in fields.items()}
    slices = slices_of(widths)
    height = sum(widths.values())
    return BodyRows._make([*(slices.get(field, NO_ROWS) for field in BodyRows._fields[:-1]), height])


@cache
def contact_rows(geometry: Geometry) -> ContactRows:
    """Return the rows of ``contacts``."""
    widths = {name: len(axes) for name, axes in layout_of(geometry).contact_fields.items()}
    slices = slices_of({**widths, "restitution": 1, "friction": 1, "tangential_restitution": 1})
    height = slices["friction"].stop
    return ContactRows._make([*(slices.get(field, NO_ROWS) for field in ContactRows._fields[:-1]), height])


class TableLayout(NamedTuple):
    """How the tables of a batch are laid out.

    Attributes:
        geometry: POINT, PLANAR or SPATIAL.
        oriented: whether the bodies have orientations.
    """

    geometry: Geometry
    oriented: bool = False

    @property
    def name(self) -> str:
        """Name of the layout in the kernels and in messages."""
        return layout_of(self.geometry, oriented=self.oriented).name

    @property
    def bodies(self) -> BodyRows:
        """The rows of ``bodies``."""
        return body_rows(self.geometry, oriented=self.oriented)

    @property
    def contacts(self) -> ContactRows:
        """The rows of ``contacts``."""
        return contact_rows(self.geometry)


TABLE_LAYOUTS = {
    layout.bodies.height: layout
    for layout in (
        *map(TableLayout, (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL)),
        TableLayout(Geometry.SPATIAL, oriented=True),
    )
}
"""The layouts by the number of rows of ``bodies``."""


def rows_of(height: int) -> BodyRows:
    """Return the rows of a table of bodies by their number. Raises: ValueError: if no table has so many."""
    if height not in TABLE_LAYOUTS:
        raise ValueError(f"bodies: must have {' or '.join(map(str, TABLE_LAYOUTS))} rows, has {height}")
    return TABLE_LAYOUTS[height].bodies
