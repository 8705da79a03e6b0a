"""The tables of a batch: which rows hold which quantity, for each geometry.

A table has rows only for what the geometry and the law need. Use them as in ``bodies[rows.velocity] = ...``.
"""

from __future__ import annotations

from ..kernels.layout import BodyRows as BodyRows
from ..kernels.layout import ContactRows as ContactRows
from ..kernels.layout import Layout as Layout
from ..model import Geometry
from ..status import format_value

TABLE_LAYOUTS = {
    layout.bodies.height: layout
    for layout in (Layout.POINT, Layout.PLANAR, Layout.SPATIAL, Layout.SPATIAL_ORIENTED)
}
"""The layouts by the number of rows of ``bodies``."""


def body_rows(geometry: Geometry, *, oriented: bool = False) -> BodyRows:
    """Return the rows of ``bodies`` for POINT, PLANAR or SPATIAL. Only SPATIAL bodies may be ``oriented``.

    Raises:
        ValueError: for another geometry.
    """
    return layout_of(geometry, oriented=oriented).bodies


def contact_rows(geometry: Geometry) -> ContactRows:
    """Return the rows of ``contacts`` for POINT, PLANAR or SPATIAL. Raises: as :func:`body_rows`."""
    return layout_of(geometry).contacts


def layout_of(geometry: Geometry, *, oriented: bool = False) -> Layout:
    """Return the layout for a geometry.

    Raises:
        ValueError: if it is not POINT, PLANAR or SPATIAL; or if it is ``oriented``, but not SPATIAL.
    """
    if not isinstance(geometry, Geometry) or geometry is Geometry.AUTO:
        raise ValueError(f"geometry: must be POINT, PLANAR or SPATIAL, is {format_value(geometry)}")
    if oriented and geometry is not Geometry.SPATIAL:
        raise ValueError(f"oriented: must be False for the geometry {geometry.name}, is {oriented!r}")
    return Layout.SPATIAL_ORIENTED if oriented else Layout[geometry.name]


def rows_of(height: int) -> BodyRows:
    """Return the rows of a table of bodies by their number. Raises: ValueError: if no table has so many."""
    if height not in TABLE_LAYOUTS:
        raise ValueError(f"bodies: must have {' or '.join(map(str, TABLE_LAYOUTS))} rows, has {height}")
    return TABLE_LAYOUTS[height].bodies
