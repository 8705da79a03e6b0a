"""The inputs of a kernel as symbols."""

from __future__ import annotations

from typing import Any, NamedTuple

from ...physics.body import Body
from ...physics.contact import Contact
from ...physics.inverse_inertia import InverseInertia
from ...physics.laws import Settings
from ...physics.orientation import Quaternion
from ...physics.tensor import Symmetric3
from ...physics.vector import Vec3
from ..layout import Layout, names_of_inputs
from .symbol import Tape


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


def kernel_inputs(layout: Layout, tape: Tape) -> KernelInputs:
    """Add the inputs of a layout to a tape."""
    names = names_of_inputs(layout)
    symbols = {name: tape.input(name) for name in names}

    def read(owner: str, field: str, axes: str | tuple[str, ...]) -> list[Any]:
        return [symbols.get(f"{owner}.{field}.{axis}", 0.0) for axis in axes]

    def vector(owner: str, field: str) -> Vec3:
        return Vec3(*read(owner, field, "xyz"))

    def body(owner: str) -> Body:
        has = layout.body_fields
        inertia = Symmetric3(*read(owner, "inertia", Symmetric3._fields))
        if has.get("inertia") == ["zz"]:  # the only moment that a planar impact depends on
            inertia = inertia._replace(xx=inertia.zz, yy=inertia.zz)
        return Body(
            symbols[f"{owner}.mass."],
            inertia,
            vector(owner, "position"),
            Quaternion(*read(owner, "orientation", "xyzw")) if "orientation" in has else None,
            vector(owner, "velocity"),
            vector(owner, "angular_velocity"),
            vector(owner, "com"),
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
    settings = Settings(*(symbols[f"model.{name}"] for name in Settings._fields))
    return KernelInputs(names, body("body_a"), body("body_b"), contact, settings)
