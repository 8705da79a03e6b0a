"""Layouts: which numbers a kernel reads, and in which rows of a table it finds them.

Numbers that a layout lacks are 0, which simplifies the formulas.
"""

from __future__ import annotations

from enum import Enum
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

from ..model import Geometry
from ..physics.inverse_inertia import InverseInertia
from ..physics.laws import Settings
from ..physics.tensor import Symmetric3

ALL_ZERO, ALL_ONE = -1, -2
"""In place of the index of a row that a table lacks: all its numbers would be 0, or 1."""

NO_ROWS = slice(0, 0)

BODIES = ("body_a", "body_b")


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
        tangential_restitution: in [-1, 1]: the number of the one row after ``height``, not a slice, so that
            writing it to a table without this row is an error. If left out, the one of the model is used.
        height: number of rows with friction and without tangential restitution.
    """

    position: slice
    normal: slice
    restitution: slice
    friction: slice
    tangential_restitution: int
    height: int

    @property
    def heights(self) -> range:
        """The numbers of rows that a table may have."""
        return range(self.friction.start, self.height + 2)


def widths_of(fields: dict[str, list[str]]) -> dict[str, int]:
    """Return the number of components of each field."""
    return {name: len(axes) for name, axes in fields.items()}


def slices_of(widths: dict[str, int]) -> dict[str, slice]:
    """Return the slices that quantities of these widths occupy, one after the other."""
    ends = accumulate(widths.values())
    return {name: slice(end - width, end) for (name, width), end in zip(widths.items(), ends, strict=True)}


class Layout(Enum):
    """What kernels read: POINT to SPATIAL_ORIENTED are the tables of batches, the others serve one impact.

    The value lists the fields of a body, then those of a contact, each with its components.
    """

    POINT = ("mass velocity=xyz", "normal=xyz restitution friction")
    PLANAR = (
        "mass inertia=zz position=xy velocity=xy angular_velocity=z",
        "position=xy normal=xy restitution friction",
    )
    SPATIAL = (
        "mass inertia=all position=xyz velocity=xyz angular_velocity=xyz",
        "position=xyz normal=xyz restitution friction",
    )
    SPATIAL_ORIENTED = (f"{SPATIAL[0]} orientation=xyzw", SPATIAL[1])
    EVERYTHING = (
        "mass inertia=all position=xyz orientation=xyzw velocity=xyz angular_velocity=xyz com=xyz",
        SPATIAL[1],
    )
    ARTICULATED = (*EVERYTHING, "inverse_inertia")
    """EVERYTHING, followed by the inverse inertia of both bodies, which is 0 for a rigid body."""

    @property
    def body_fields(self) -> dict[str, list[str]]:
        """The fields of a body, each with its components."""
        return _parsed_fields(self.value[0])

    @property
    def contact_fields(self) -> dict[str, list[str]]:
        """The fields of a contact, each with its components."""
        return _parsed_fields(self.value[1])

    @cached_property
    def number(self) -> int:
        """What the kernels call the layout."""
        return [*Layout].index(self)

    @cached_property
    def geometry(self) -> Geometry:
        """POINT, PLANAR or SPATIAL, for the layouts of tables."""
        return Geometry[self.name.removesuffix("_ORIENTED")]

    @cached_property
    def oriented(self) -> bool:
        """Whether bodies have orientations."""
        return "orientation" in self.body_fields

    @cached_property
    def bodies(self) -> BodyRows:
        """The rows of a table of bodies."""
        slices = slices_of(widths_of(self.body_fields))
        rows = (slices.get(field, NO_ROWS) for field in BodyRows._fields[:-1])
        return BodyRows._make([*rows, len(names_of_body(self))])

    @cached_property
    def contacts(self) -> ContactRows:
        """The rows of a table of contacts."""
        slices = slices_of(widths_of(self.contact_fields))
        rows = (slices.get(field, NO_ROWS) for field in ContactRows._fields[:-2])
        return ContactRows._make([*rows, *[len(names_of_contact(self))] * 2])


def _parsed_fields(text: str) -> dict[str, list[str]]:
    named = {"all": list(Symmetric3._fields), "zz": ["zz"], "": [""]}
    fields = (field.partition("=") for field in text.split())
    return {name: named.get(axes) or list(axes) for name, _, axes in fields}


def names_of_body(layout: Layout) -> list[str]:
    """Names of the numbers of one body, in order: field and component, as in ``position.x`` and ``mass.``."""
    return [f"{name}.{axis}" for name, axes in layout.body_fields.items() for axis in axes]


def names_of_contact(layout: Layout) -> list[str]:
    """Names of the numbers of a contact, in order."""
    return [f"{name}.{axis}" for name, axes in layout.contact_fields.items() for axis in axes]


def rows_in_everything(layout: Layout) -> tuple[list[int], list[int]]:
    """Return, for each row of bodies and of contacts in the layout EVERYTHING, the row of ``layout``.

    For a row that ``layout`` lacks it is ``ALL_ZERO`` or ``ALL_ONE``.
    """

    def row(name: str, names: list[str]) -> int:
        if name in names:
            return names.index(name)
        if name in ("inertia.xx", "inertia.yy") and "inertia.zz" in names:
            return names.index("inertia.zz")
        return ALL_ONE if name == "orientation.w" else ALL_ZERO

    body, contact = names_of_body(layout), names_of_contact(layout)
    return (
        [row(name, body) for name in names_of_body(Layout.EVERYTHING)],
        [row(name, contact) for name in names_of_contact(Layout.EVERYTHING)],
    )


def names_of_inputs(layout: Layout) -> list[str]:
    """Names of the numbers that a kernel reads, in order: those of body_a, body_b, contact and model."""
    names = [f"{body}.{name}" for body in BODIES for name in names_of_body(layout)]
    names += [f"contact.{name}" for name in names_of_contact(layout)]
    names += [f"model.{name}" for name in Settings._fields]
    if layout is Layout.ARTICULATED:
        names += [f"{body}.inverse_inertia.{entry}" for body in BODIES for entry in InverseInertia._fields]
    return names
