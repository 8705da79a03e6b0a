"""What a whole scene requires: the least geometry, law and precision, and which contact asks for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from .model import Geometry, ImpactModel, Law, Precision
from .physics.body import Body
from .physics.contact import Contact
from .resolve import resolve
from .status import StatusCode


class SceneContact(NamedTuple):
    """A contact between two named bodies."""

    body_a: str
    body_b: str
    contact: Contact


class Need(NamedTuple):
    """The least that a scene requires in one respect, and why it is not less."""

    least: Any
    reason: str


class SceneRequirements(NamedTuple):
    """The least that a scene requires; grows as contacts are added.

    Attributes:
        geometry, law, precision: a :class:`Need` each.
        tolerance: relative error of each impulse that they meet.
    """

    geometry: Need
    law: Need
    precision: Need
    tolerance: float

    def including(self, name: str, body_a: Body, body_b: Body, contact: Contact) -> SceneRequirements:
        """What it takes to resolve one more contact.

        Raises:
            ImpactError: it cannot be resolved.
        """
        model = ImpactModel(tolerance=self.tolerance)
        impact = resolve(body_a, body_b, contact, model)
        if impact.status is StatusCode.SEPARATING:
            return self
        frictionless = resolve(body_a, body_b, contact._replace(friction=0.0), model)
        rubs = (impact.impulse - frictionless.impulse).norm() / (impact.impulse.norm() or 1.0)
        law = impact.model.law if rubs > self.tolerance else Law.FRICTIONLESS
        needed = impact if law is impact.model.law else frictionless
        geometry, precision = needed.model.geometry, needed.model.precision
        return self._replace(
            geometry=_greater(self.geometry, geometry, f"{name} {WHY_GEOMETRY[geometry]}"),
            law=_greater(self.law, law, f"friction changes the impulse of {name} by {rubs:.2g} of it"),
            precision=_greater(self.precision, precision, f"{name} {WHY_PRECISION[precision]}"),
        )

    def __str__(self) -> str:
        needs = (self.geometry, self.law, self.precision)
        return "; ".join(f"{need.least.name}: {need.reason}" for need in needs)


WHY_GEOMETRY = {
    Geometry.POINT: "turns no body",
    Geometry.PLANAR: "turns a body, within the x-y plane",
    Geometry.SPATIAL: "turns a body, out of the x-y plane",
}
WHY_PRECISION = {
    Precision.SINGLE: "is well-conditioned",
    Precision.DOUBLE: "grazes: its approach speed cancels",
    Precision.EXTENDED: "is ill-conditioned beyond float64, or asks for its last digits",
}


def nothing_required(tolerance: float) -> SceneRequirements:
    """The requirements of a scene without contacts."""
    return SceneRequirements(
        Need(Geometry.POINT, "no impulse turns a body"),
        Need(Law.FRICTIONLESS, "friction changes no impulse by more than the tolerance"),
        Need(Precision.SINGLE, "the tolerance is met"),
        tolerance,
    )


def scene_requirements(
    bodies: Mapping[str, Body], contacts: Iterable[SceneContact], tolerance: float
) -> SceneRequirements:
    """The least geometry, law and precision with which every contact of a scene meets ``tolerance``.

    Args:
        bodies: by name.
        contacts: the contacts, of bodies by name.
        tolerance: greatest relative error of each impulse, > 0.

    Raises:
        ImpactError: a contact cannot be resolved, or no tolerance is given.
        KeyError: a contact names an unknown body.
    """
    required = nothing_required(tolerance)
    for a, b, contact in contacts:
        required = required.including(f"{a} - {b}", bodies[a], bodies[b], contact)
    return required


def _greater(need: Need, candidate: Any, reason: str) -> Need:
    return Need(candidate, reason) if candidate > need.least else need
