"""Find what a whole scene requires: the smallest geometry, law and precision, and which contact requires it.

    >>> from collision_response import Body, Contact
    >>> bodies = {"ball": Body.dynamic(1.0, velocity=(0, 0, -2)), "floor": Body.static()}
    >>> contact = SceneContact("ball", "floor", Contact.of((0, 0, 0), normal=(0, 0, 1), friction=0.3))
    >>> required = scene_requirements(bodies, [contact], tolerance=1e-5)
    >>> [need.least.name for need in required[:3]]
    ['POINT', 'FRICTIONLESS', 'SINGLE']
    >>> required.law.reason
    'friction changes no impact by more than the tolerance'

One law serves all contacts. The geometry is the smallest one that answers all of them by this law, and the
precision is the lowest one in this geometry. With these, each contact ends with its right status, also one
that separates.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from typing import Any, NamedTuple

from .answer import Impact, relative_difference
from .arguments import as_list, check_mapping, check_number
from .in_python.request_numbers import read_request
from .model import ULP, Geometry, ImpactModel, Precision
from .physics.body import Body
from .physics.contact import Contact
from .physics.laws import Law
from .resolve import resolve
from .status import POSITIVE, ImpactError, StatusCode, format_value, raise_renamed


class SceneContact(NamedTuple):
    """A contact between two bodies, given by their names."""

    body_a: str
    body_b: str
    contact: Contact


class Requirement(NamedTuple):
    """The least geometry, law or precision that a scene requires, and the reason."""

    least: Any
    reason: str


class SceneRequirements(NamedTuple):
    """The answer of :func:`scene_requirements`.

    Attributes:
        geometry, law, precision: the least of each, and the reason: ``least`` and ``reason``.
        tolerance: relative error that they keep in each impact, see ``error_bound`` of
            :class:`~collision_response.Impact`. Leaving out friction may add an error of the same size.
    """

    geometry: Requirement
    law: Requirement
    precision: Requirement
    tolerance: float

    def __str__(self) -> str:
        needs = (self.geometry, self.law, self.precision)
        return "; ".join(f"{need.least.name}: {need.reason}" for need in needs)


WHY_GEOMETRY = {
    Geometry.POINT: "no rotation changes an impact by more than the tolerance",
    Geometry.PLANAR: "turns a body, within the x-y plane",
    Geometry.SPATIAL: "turns a body, out of the x-y plane",
}
WHY_PRECISION = {
    Precision.SINGLE: "is well-conditioned",
    Precision.DOUBLE: "asks for more digits than float32 keeps",
    Precision.EXTENDED: "is ill-conditioned beyond float64, or asks for its last digits",
}
UNMET = "meets the tolerance in no model"
GEOMETRIES = tuple(WHY_GEOMETRY)


class _Needs(NamedTuple):
    """What the contacts so far need with one law.

    Attributes:
        geometry: the greatest of those that each contact needs by itself.
        out_of_plane: the first contact that PLANAR does not serve; empty: it serves all.
        precisions: the greatest that a contact needs, in each geometry.
    """

    geometry: Requirement
    out_of_plane: str
    precisions: Mapping[Geometry, Requirement]

    def with_contact(self, name: str, least: Mapping[Geometry, Precision]) -> _Needs:
        """Add a contact. ``least`` maps each geometry that serves it to the lowest precision there."""

        def why(reasons: Mapping[Any, str], need: Geometry | Precision) -> str:
            return f"{name} {reasons[need] if least else UNMET}"

        own = min(least, default=Geometry.SPATIAL)
        return _Needs(
            _greater(self.geometry, own, why(WHY_GEOMETRY, own)),
            self.out_of_plane or ("" if Geometry.PLANAR in least else name),
            {
                geometry: _greater(self.precisions[geometry], enough, why(WHY_PRECISION, enough))
                for geometry, enough in ((g, least.get(g, Precision.EXTENDED)) for g in GEOMETRIES)
            },
        )

    def common_geometry(self) -> Requirement:
        """Return the smallest geometry that serves all contacts.

        It may have to be SPATIAL if one contact requires PLANAR and another lies outside the x-y plane.
        """
        if self.geometry.least is Geometry.PLANAR and self.out_of_plane:
            return Requirement(
                Geometry.SPATIAL, f"{self.geometry.reason}, and {self.out_of_plane} is not in it"
            )
        return self.geometry


NO_NEEDS = _Needs(
    Requirement(Geometry.POINT, WHY_GEOMETRY[Geometry.POINT]),
    "",
    dict.fromkeys(GEOMETRIES, Requirement(Precision.SINGLE, "the tolerance is met")),
)
SIMPLE_LAWS = Law.FRICTIONLESS, Law.COULOMB
LEAVES_OUT_NOTHING = Geometry.SPATIAL, Precision.EXTENDED


class SceneSurvey:
    """Collects the requirements of a scene's contacts one by one, for :func:`scene_requirements`."""

    def __init__(self, tolerance: float) -> None:
        """Start without contacts.

        Args:
            tolerance: largest relative error of each impact, > 0 and finite.

        Raises:
            ImpactError: INVALID_MODEL, if ``tolerance`` is not positive and finite.
            TypeError: if ``tolerance`` is not a number.
        """
        invalid = StatusCode.INVALID_MODEL
        self._tolerance = check_number("tolerance", tolerance, POSITIVE, math.inf, invalid, invalid)
        self._law = Requirement(Law.FRICTIONLESS, "friction changes no impact by more than the tolerance")
        self._needs = dict.fromkeys(SIMPLE_LAWS, NO_NEEDS)

    def add(self, name: str, body_a: Body, body_b: Body, contact: Contact) -> None:
        """Add a contact.

        Raises:
            ImpactError: if the contact cannot be resolved. The survey then stays as it was.
        """
        request = body_a, body_b, contact
        impacts = {law: resolve(*request, ImpactModel(law, *LEAVES_OUT_NOTHING)) for law in SIMPLE_LAWS}
        needs = {
            law: self._needs[law].with_contact(name, self._least(request, impact))
            for law, impact in impacts.items()
        }
        smooth, rough = impacts.values()
        difference = _difference(smooth, rough, *read_request(*request)[:2])
        if rough.contact.friction > 0 and difference > self._tolerance:
            reason = f"friction changes the impact of {name} by {difference:.2g} of it"
            self._law = _greater(self._law, Law.COULOMB, reason)
        self._needs = needs

    def requirements(self) -> SceneRequirements:
        """Return what the contacts added so far require."""
        needs = self._needs[self._law.least]
        geometry = needs.common_geometry()
        return SceneRequirements(geometry, self._law, needs.precisions[geometry.least], self._tolerance)

    def _least(self, request: tuple[Body, Body, Contact], impact: Impact) -> dict[Geometry, Precision]:
        """Return the geometries that serve a contact, if any, with the lowest precision in each."""
        found: dict[Geometry, Precision] = {}
        if impact.status is StatusCode.TOLERANCE_NOT_MET:  # numbers that are not floats may leave it open
            return found
        for geometry in GEOMETRIES:
            for precision in (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED):
                model = ImpactModel(impact.model.law, geometry, precision, self._tolerance)
                if _status(request, model) is impact.status:
                    found[geometry] = precision
                    break
        return found


def scene_requirements(
    bodies: Mapping[str, Body], contacts: Iterable[SceneContact], tolerance: float
) -> SceneRequirements:
    """Find the smallest law, geometry and precision with which every contact of a scene meets a tolerance.

    The law, FRICTIONLESS or COULOMB, is found first, then the geometry, then the precision. Contacts that
    separate also separate in the model that is found. If no precision meets the tolerance, as for one below
    2.2e-16, the precision is EXTENDED. If a contact gets no answer that meets it, the geometry is SPATIAL.

    Args:
        bodies: the bodies by name.
        contacts: the contacts, with the names of their bodies.
        tolerance: largest relative error of each impact, > 0 and finite.

    Raises:
        ImpactError: if a contact cannot be resolved; ``field`` names the contact or the body. UNKNOWN_BODY,
            if a contact names a body that is not there; SAME_BODY, if it names one twice; NO_DYNAMIC_BODY.
            INVALID_MODEL, if ``tolerance`` is not positive and finite.
        TypeError: if something has the wrong type.
    """
    survey = SceneSurvey(tolerance)
    check_mapping("bodies", bodies)
    for i, given in enumerate(as_list("contacts", contacts)):
        try:
            a, b, contact = given
        except (TypeError, ValueError):
            raise TypeError(f"contacts[{i}]: must be a SceneContact, is {format_value(given)}") from None
        for side, name in (("body_a", a), ("body_b", b)):
            if not isinstance(name, Hashable) or name not in bodies:
                reason = f"must be the name of one of the bodies; is {format_value(name)}"
                raise ImpactError(StatusCode.UNKNOWN_BODY, f"contacts[{i}].{side}", reason)
        if a == b:
            reason = f"a body cannot strike itself; is {format_value((a, b))}"
            raise ImpactError(StatusCode.SAME_BODY, f"contacts[{i}]", reason)
        names = {"body_a": f"bodies[{a!r}]", "body_b": f"bodies[{b!r}]", "contact": f"contacts[{i}].contact"}
        try:
            survey.add(f"{a} - {b}", bodies[a], bodies[b], contact)
        except (ImpactError, TypeError) as error:
            if isinstance(error, ImpactError) and error.code is StatusCode.NO_DYNAMIC_BODY:
                reason = f"one body must be dynamic; is {format_value((a, b))}"
                raise ImpactError(error.code, f"contacts[{i}]", reason) from None
            raise_renamed(error, names)
    return survey.requirements()


def _greater(need: Requirement, candidate: Any, reason: str) -> Requirement:
    return Requirement(candidate, reason) if candidate > need.least else need


def _status(request: tuple[Body, Body, Contact], model: ImpactModel) -> StatusCode | None:
    """Return the status of an impact in a model, or ``None`` if this model cannot answer it."""
    if model.precision is Precision.EXTENDED:
        model = model._replace(tolerance=max(model.tolerance, ULP))  # that is all it promises
    try:
        return resolve(*request, model).status
    except ImpactError:  # of the model: the request is sound
        return None


def _difference(one: Impact, other: Impact, body_a: Body, body_b: Body) -> float:
    """A bound on the relative difference of two answers, in the norms of ``error_bound``."""
    return relative_difference(one, other, body_a, body_b) + one.error_bound + other.error_bound
