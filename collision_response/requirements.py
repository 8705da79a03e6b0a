"""What a whole scene requires: the least geometry, law and precision, and which contact asks for it.

    >>> from collision_response import Body, Contact
    >>> bodies = {"ball": Body.dynamic(1.0, velocity=(0, 0, -2)), "floor": Body.static()}
    >>> contact = SceneContact("ball", "floor", Contact.of((0, 0, 0), normal=(0, 0, 1), friction=0.3))
    >>> required = scene_requirements(bodies, [contact], tolerance=1e-5)
    >>> [need.least.name for need in required[:3]]
    ['POINT', 'FRICTIONLESS', 'SINGLE']
    >>> required.law.reason
    'friction changes no impact by more than the tolerance'

The law is one for all contacts; geometry and precision are what that law needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from .answer import Impact, in_norm
from .model import Geometry, ImpactModel, Precision
from .physics.body import Body
from .physics.contact import Contact
from .physics.laws import Law
from .resolve import resolve
from .status import ImpactError, StatusCode


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
    """The least that a scene requires.

    Attributes:
        geometry, law, precision: a :class:`Need` each.
        tolerance: relative error that they meet in each impact; see ``error_bound`` of
            :class:`~collision_response.Impact`.
    """

    geometry: Need
    law: Need
    precision: Need
    tolerance: float

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
    Precision.DOUBLE: "asks for more digits than float32 keeps",
    Precision.EXTENDED: "is ill-conditioned beyond float64, or asks for its last digits",
}


class SceneSurvey:
    """The contacts of a scene, one by one. One law serves them all, and decides what else they need."""

    def __init__(self, tolerance: float) -> None:
        """No contacts yet.

        Args:
            tolerance: greatest relative error of each impact, > 0.

        Raises:
            ImpactError: INVALID_MODEL: that is no tolerance.
        """
        if not 0 < tolerance < math.inf:
            raise ImpactError(StatusCode.INVALID_MODEL, "tolerance", f"must be above 0, is {tolerance}")
        self._tolerance = tolerance
        self._law = Need(Law.FRICTIONLESS, "friction changes no impact by more than the tolerance")
        geometry = Need(Geometry.POINT, "no impulse turns a body")
        precision = Need(Precision.SINGLE, "the tolerance is met")
        self._others = {law: (geometry, precision) for law in (Law.FRICTIONLESS, Law.COULOMB)}

    def add(self, name: str, body_a: Body, body_b: Body, contact: Contact) -> None:
        """Consider one more contact.

        Raises:
            ImpactError: it cannot be resolved.
        """
        model = ImpactModel(tolerance=self._tolerance)
        rough = resolve(body_a, body_b, contact, model)
        if rough.status is StatusCode.SEPARATING:
            return
        smooth_contact = contact._replace(friction=0.0)
        smooth = resolve(body_a, body_b, smooth_contact, model)
        rubs = _difference(smooth, rough, body_a, body_b)
        if rough.model.law is not Law.FRICTIONLESS and rubs > self._tolerance:
            reason = f"friction changes the impact of {name} by {rubs:.2g} of it"
            self._law = _greater(self._law, rough.model.law, reason)
        for law, impact, touch in (
            (Law.FRICTIONLESS, smooth, smooth_contact),
            (Law.COULOMB, rough, contact),
        ):
            geometry, precision = self._others[law]
            least = impact.model.geometry
            enough = _least_precision(body_a, body_b, touch, model)
            self._others[law] = (
                _greater(geometry, least, f"{name} {WHY_GEOMETRY[least]}"),
                _greater(precision, enough, f"{name} {WHY_PRECISION[enough]}"),
            )

    def requirements(self) -> SceneRequirements:
        """What the contacts so far require."""
        geometry, precision = self._others[self._law.least]
        return SceneRequirements(geometry, self._law, precision, self._tolerance)


def scene_requirements(
    bodies: Mapping[str, Body], contacts: Iterable[SceneContact], tolerance: float
) -> SceneRequirements:
    """The least geometry, law and precision with which every contact of a scene meets ``tolerance``.

    The law is FRICTIONLESS or COULOMB.

    Args:
        bodies: by name.
        contacts: the contacts, of bodies by name.
        tolerance: greatest relative error of each impact, > 0.

    Raises:
        ImpactError: a contact cannot be resolved, or that is no tolerance.
        KeyError: a contact names an unknown body.
    """
    survey = SceneSurvey(tolerance)
    for a, b, contact in contacts:
        survey.add(f"{a} - {b}", bodies[a], bodies[b], contact)
    return survey.requirements()


def _greater(need: Need, candidate: Any, reason: str) -> Need:
    return Need(candidate, reason) if candidate > need.least else need


def _least_precision(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Precision:
    for precision in (Precision.SINGLE, Precision.DOUBLE):
        try:
            impact = resolve(body_a, body_b, contact, model._replace(precision=precision))
        except ImpactError:  # of range: the request is sound
            continue
        if impact.status is not StatusCode.TOLERANCE_NOT_MET:
            return precision
    return Precision.EXTENDED


def _difference(one: Impact, other: Impact, body_a: Body, body_b: Body) -> float:
    """A bound on the relative difference of two answers, in the norms of ``error_bound``."""
    apart = max(
        _relative(one.impulse, other.impulse),
        _relative(in_norm(body_a, one.change_a), in_norm(body_a, other.change_a)),
        _relative(in_norm(body_b, one.change_b), in_norm(body_b, other.change_b)),
    )
    return apart + one.error_bound + other.error_bound


def _relative(v: tuple[float, ...], w: tuple[float, ...]) -> float:
    return math.dist(v, w) / (math.hypot(*w) or 1.0)
