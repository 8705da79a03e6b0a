"""Layouts: which numbers a kernel reads. Those that a layout lacks are 0, which simplifies the formulas."""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.inverse_inertia import InverseInertia
from ..physics.laws import Settings
from ..physics.orientation import Quaternion
from ..physics.tensor import ZERO_TENSOR, Symmetric3
from ..physics.vector import ZERO, Vec3
from .symbol import Tape


class Layout(Enum):
    """What kernels read: POINT to SPATIAL_ORIENTED are the tables of batches, the others serve one impact.

    The value lists the fields of a body, then those of a contact, each with its components.
    """

    POINT = ("mass velocity=xyz", "normal=xyz")
    PLANAR = ("mass inertia=zz position=xy velocity=xy angular_velocity=z", "position=xy normal=xy")
    SPATIAL = ("mass inertia=all position=xyz velocity=xyz angular_velocity=xyz", "position=xyz normal=xyz")
    SPATIAL_ORIENTED = (
        "mass inertia=all position=xyz velocity=xyz angular_velocity=xyz orientation=xyzw",
        "position=xyz normal=xyz",
    )
    EVERYTHING = (
        "mass inertia=all position=xyz orientation=xyzw velocity=xyz angular_velocity=xyz com=xyz",
        "position=xyz normal=xyz",
    )
    ARTICULATED = (EVERYTHING[0], EVERYTHING[1], "inverse_inertia")
    """EVERYTHING, followed by the inverse inertia of both bodies, which is 0 for a rigid body."""

    @property
    def body_fields(self) -> dict[str, list[str]]:
        """The fields of a body, each with its components."""
        return _parsed_fields(self.value[0])

    @property
    def contact_fields(self) -> dict[str, list[str]]:
        """The fields of a contact, each with its components."""
        return _parsed_fields(self.value[1])


def _parsed_fields(text: str) -> dict[str, list[str]]:
    named = {"all": list(Symmetric3._fields), "zz": ["zz"], "": [""]}
    fields = (field.partition("=") for field in text.split())
    return {name: named.get(axes) or list(axes) for name, _, axes in fields}


class KernelInputs(NamedTuple):
    """Two bodies, a contact and settings, made of the symbols that a kernel reads.

    Attributes:
        names: the names of the inputs, in the order of the kernel: body_a, body_b, contact, model.
        body_a, body_b, contact: symbols, and 0 for each number that the layout lacks.
        settings: symbols for the numbers of the model.
    """

    names: list[str]
    body_a: Body
    body_b: Body
    contact: Contact
    settings: Settings


def names_of_body(layout: Layout) -> list[str]:
    """Names of the numbers of one body, in order: field and component, such as ``position.x``."""
    return [f"{name}.{axis}" for name, axes in layout.body_fields.items() for axis in axes]


def names_of_contact(layout: Layout) -> list[str]:
    """Names of the numbers of a contact, in order."""
    names = [f"{name}.{axis}" for name, axes in layout.contact_fields.items() for axis in axes]
    return [*names, "restitution.", "friction."]


def names_of_model() -> list[str]:
    """Names of the numbers of a model, in order."""
    return [f"model.{name}" for name in Settings._fields]


def names_of_inverse_inertia() -> list[str]:
    """Names of the numbers that the layout ARTICULATED adds."""
    owners = ("body_a", "body_b")
    return [f"{body}.inverse_inertia.{entry}" for body in owners for entry in InverseInertia._fields]


def kernel_inputs(layout: Layout, tape: Tape) -> KernelInputs:
    """Add the inputs of a layout to a tape."""
    names = [f"{body}.{name}" for body in ("body_a", "body_b") for name in names_of_body(layout)]
    names += [f"contact.{name}" for name in names_of_contact(layout)] + names_of_model()
    if layout is Layout.ARTICULATED:
        names += names_of_inverse_inertia()
    symbols = {name: tape.input(name) for name in names}

    def read(owner: str, field: str, axes: str | tuple[str, ...]) -> list[Any]:
        return [symbols.get(f"{owner}.{field}.{axis}", 0.0) for axis in axes]

    def vector(owner: str, field: str) -> Vec3:
        return Vec3(*read(owner, field, "xyz"))

    def body(owner: str) -> Body:
        has = layout.body_fields
        inertia = Symmetric3(*read(owner, "inertia", Symmetric3._fields)) if "inertia" in has else ZERO_TENSOR
        if has.get("inertia") == ["zz"]:  # the only moment that a planar impact depends on
            inertia = inertia._replace(xx=inertia.zz, yy=inertia.zz)
        return Body(
            symbols[f"{owner}.mass."],
            inertia,
            vector(owner, "position"),
            Quaternion(*read(owner, "orientation", "xyzw")) if "orientation" in has else None,
            vector(owner, "velocity"),
            vector(owner, "angular_velocity"),
            vector(owner, "com") if "com" in has else ZERO,
            InverseInertia(*read(owner, "inverse_inertia", InverseInertia._fields))
            if layout is Layout.ARTICULATED
            else None,
        )

    contact = Contact(
        vector("contact", "position"),
        vector("contact", "normal"),
        symbols["contact.restitution."],
        symbols["contact.friction."],
    )
    settings = Settings(*(symbols[name] for name in names_of_model()))
    return KernelInputs(names, body("body_a"), body("body_b"), contact, settings)


DIMENSIONS = {
    "mass": (1, 0, 0),
    "inertia": (1, 2, 0),
    "position": (0, 1, 0),
    "com": (0, 1, 0),
    "velocity": (0, 1, -1),
    "angular_velocity": (0, 0, -1),
    "restitution_threshold": (0, 1, -1),
    "impulse": (1, 1, -1),
    "linear": (0, 1, -1),
    "angular": (0, 0, -1),
    "normal_impulse": (1, 1, -1),
    "tangential_impulse": (1, 1, -1),
    "normal_velocity_before": (0, 1, -1),
    "normal_velocity_after": (0, 1, -1),
    "effective_mass": (1, 0, 0),
    "kinetic_energy_before": (1, 2, -2),
    "kinetic_energy_after": (1, 2, -2),
    "energy_lost_restitution": (1, 2, -2),
    "energy_lost_friction": (1, 2, -2),
}
"""Exponents of mass, length and time for each field. A field that is not listed is dimensionless."""


def units(name: str) -> tuple[int, int, int, int, int, int]:
    """Return the unit of a quantity, as exponents.

    The base units are those of mass, length and time, then the lengths of the two quaternions and of the
    normal, on which no answer depends.
    """
    owner, field, *_ = [*name.split("."), ""]
    lengths = {
        ("body_a", "orientation"): (1, 0, 0),
        ("body_b", "orientation"): (0, 1, 0),
        ("contact", "normal"): (0, 0, 1),
    }
    dimensions = DIMENSIONS.get(field, (0, 0, 0))
    if field == "inverse_inertia":  # the angular components are named a, b and c
        dimensions = (-1, -sum(axis in "abc" for axis in name.rpartition(".")[2]), 0)
    return (*dimensions, *lengths.get((owner, field), (0, 0, 0)))
