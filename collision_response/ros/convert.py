"""Conversion of messages to bodies, contacts and models, and of answers to messages.

The tables of batches and scenes are converted in ``batches.py`` and ``scenes.py``.

The numeric core takes a body as a message describes it: pose and twist of the origin of the body frame, and
the position of the centre of mass in that frame. So no mechanics is computed here.

Errors name fields as the messages do: ``body_a.inertia.m``, not ``body_a.mass`` as in the core.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import Vector3
from std_msgs.msg import Header

from ..answer import NUMBERS, Impact
from ..arguments import check_number
from ..body_numbers import ROWS, body_to_numbers, none_if_parallel
from ..in_python.request_numbers import read_request
from ..materials import NO_MATERIALS, RANGES, Pair, combined_coefficient
from ..model import ENUMERATIONS, Adjustment, ImpactModel, Precision, check_model
from ..msg import BodyState, CollisionResult, SceneResult
from ..msg import Contact as ContactMessage
from ..msg import ImpactModel as ImpactModelMessage
from ..named_enum import NamedEnum
from ..physics.body import Body, Twist
from ..physics.combine import CombineRule
from ..physics.contact import Contact
from ..physics.laws import BY_SPEED, Law
from ..physics.orientation import Quaternion
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3
from ..resolve import resolve
from ..scene import SceneImpact
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode, raise_renamed
from .parameters import Parameters

CORE_TO_MESSAGE = {
    "mass": "inertia.m",
    "position": "pose.position",
    "orientation": "pose.orientation",
    "velocity": "twist.linear",
    "angular_velocity": "twist.angular",
    "com": "inertia.com",
}
"""Names in ``BodyState`` of those fields that have another name in the core's ``Body``."""

ADJUSTMENT_NOTES = {
    Adjustment.NORMALISED_ORIENTATION: "a pose.orientation was not of unit length and was normalised",
    Adjustment.RESTITUTION_THRESHOLD: "slower than restitution_threshold: restitution was the law's least",
    Adjustment.LAW_FALLBACK: "the law has no solution here, or would create energy: model.law was used",
    Adjustment.ENERGY_CHANGE_ONLY: "a body is articulated: kinetic energies include only its change",
    Adjustment.NO_REBOUND: "bodies would rebound without end: restitution was 0",
    Adjustment.MASSLESS_SPIN: "a body rotated about an axis without inertia: that rotation was ignored",
}
"""What the message of an answer says about each adjustment."""

NOT_GIVEN = -1.0
"""Value of a coefficient that a message does not give."""


class Coefficient(NamedTuple):
    """A coefficient of a contact.

    Attributes:
        value: a number, or for a pair of materials possibly a function of the approach or slip speed.
        source: where it came from: a constant ``FROM_...`` of ``CollisionResult``.
        rule: the rule that combined two coefficients, or the source that a pair of materials names.
    """

    value: Any
    source: int
    rule: str


class ContactCoefficients(NamedTuple):
    """The coefficients of a contact, and what the materials file says about its pair of materials."""

    restitution: Coefficient
    friction: Coefficient
    pair: Pair


ImpactProblem = tuple[Body, Body, Contact, ImpactModel]
"""A request as the numeric core takes it: the arguments of :func:`~collision_response.resolve`."""


def problem_of(
    request: ResolveCollision.Request, parameters: Parameters
) -> tuple[ImpactProblem, ContactCoefficients]:
    """Convert a request in which both bodies are given in full. The coefficients come with their sources.

    Raises:
        ImpactError: as ``body_of``, ``coefficients_of`` and ``contact_of``.
    """
    bodies = body_of("body_a", request.body_a), body_of("body_b", request.body_b)
    coefficients = coefficients_of(request.contact, request.body_a, request.body_b, parameters)
    model = model_of(request.model, _with_pair(parameters.model, coefficients.pair))
    return (*bodies, contact_of(request.contact, coefficients, model.law), model), coefficients


def body_of(owner: str, state: BodyState) -> Body:
    """Convert a body, which errors call ``owner``. The numeric core checks its numbers later.

    Raises:
        ImpactError: INVALID_MOTION_TYPE if there is no such type, or a STATIC body moves; NOT_FINITE for the
            mass; as :meth:`Body.articulated`.
    """
    position, q = vector_of(state.pose.position), state.pose.orientation
    velocity, angular_velocity = vector_of(state.twist.linear), vector_of(state.twist.angular)
    orientation = none_if_parallel(Quaternion(q.x, q.y, q.z, q.w))
    if state.motion_type != BodyState.DYNAMIC:
        _check_immovable(owner, state.motion_type, (*velocity, *angular_velocity))
        return Body.kinematic(position, velocity, angular_velocity)._replace(orientation=orientation)
    if state.inverse_inertia:
        try:
            return Body.articulated(state.inverse_inertia, position, velocity, angular_velocity)
        except ImpactError as error:
            raise error.within(owner) from None
    i = state.inertia
    check_mass(owner, i.m)
    inertia = Symmetric3(i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz)
    return Body(i.m, inertia, position, orientation, velocity, angular_velocity, vector_of(i.com))


def check_mass(owner: str, mass: float) -> None:
    """Refuse an infinite or NaN mass (NOT_FINITE): in the core, an infinite mass cannot be moved."""
    if not math.isfinite(mass):
        raise ImpactError(StatusCode.NOT_FINITE, f"{owner}.inertia.m", f"must be finite; is {mass}")


VALID_REST = (
    Body.dynamic(1.0),
    Contact.of((0, 0, 0), normal=(1, 0, 0)),
    ImpactModel(precision=Precision.SINGLE),
)
"""A valid body_b, contact and model: with them, only body_a can be invalid."""


def check_body(owner: str, body: Body) -> None:
    """Refuse a body that the numeric core refuses (with its code)."""
    try:
        resolve(body, *VALID_REST)
    except ImpactError as error:
        if error.field.startswith("body_a."):
            raise error.renamed({"body_a": owner}) from None


def _check_immovable(owner: str, motion_type: int, twist: tuple[float, ...]) -> None:
    field = f"{owner}.motion_type"
    if motion_type not in (BodyState.KINEMATIC, BodyState.STATIC):
        reason = f"must be DYNAMIC (0), KINEMATIC (1) or STATIC (2); is {motion_type}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)
    if motion_type == BodyState.STATIC and any(x > 0 or x < 0 for x in twist):  # the core refuses NaN
        reason = f"is STATIC, but the twist is not 0: {twist}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)


def contact_of(
    message: ContactMessage,
    coefficients: ContactCoefficients,
    law: Law,
    tangential_restitution: float | None = None,
) -> Contact:
    """Convert a contact.

    Friction that depends on slip speed is refused for a law that follows it along its path (INVALID_MODEL):
    the answer reports friction as one number, with which the impact could not be reproduced.
    """
    restitution, friction = coefficients.restitution.value, coefficients.friction.value
    if callable(friction) and law in BY_SPEED:
        reason = f"depends on slip speed, which {law.name} follows only in the Python library"
        raise ImpactError(
            StatusCode.INVALID_MODEL, "contact.friction", f"{reason}: give a number, or use COULOMB"
        )
    return Contact(
        vector_of(message.position), vector_of(message.normal), restitution, friction, tangential_restitution
    )


def coefficients_of(
    contact: ContactMessage, body_a: BodyState, body_b: BodyState, parameters: Parameters
) -> ContactCoefficients:
    """Find the coefficients of a contact.

    Each comes from the first of these that gives it: the contact, the entry of the pair of materials, both
    materials, both bodies, the node's parameter.

    Raises:
        ImpactError: UNKNOWN_MATERIAL; INVALID_COEFFICIENT if that of a body is out of range; as
            :func:`~collision_response.materials.combined_coefficient`.
    """
    for owner, body in (("body_a", body_a), ("body_b", body_b)):
        if body.material and parameters.materials is NO_MATERIALS:
            reason = f"is {reprlib.repr(body.material)}, but the parameter materials_file names no file"
            raise ImpactError(StatusCode.UNKNOWN_MATERIAL, f"{owner}.material", reason)
        if body.material:
            parameters.materials.check(f"{owner}.material", body.material)
    return ContactCoefficients(
        _coefficient("restitution", contact, body_a, body_b, parameters),
        _coefficient("friction", contact, body_a, body_b, parameters),
        parameters.materials.between(body_a.material, body_b.material),
    )


def _coefficient(
    field: str, contact: ContactMessage, body_a: BodyState, body_b: BodyState, parameters: Parameters
) -> Coefficient:
    of_contact, of_a, of_b = (getattr(message, field) for message in (contact, body_a, body_b))
    for owner, value in (("body_a", of_a), ("body_b", of_b)):
        if value != NOT_GIVEN:
            check_number(f"{owner}.{field}", value, *RANGES[field], StatusCode.INVALID_COEFFICIENT)
    if of_contact != NOT_GIVEN:
        return Coefficient(of_contact, CollisionResult.FROM_CONTACT, "")  # checked by the core
    rule: CombineRule = getattr(parameters, f"combine_{field}")
    a, b = body_a.material, body_b.material
    found = parameters.materials.find(field, a, b, rule) if a and b else None
    if found is not None:
        source = CollisionResult.FROM_PAIR if found.is_of_pair else CollisionResult.FROM_MATERIALS
        return Coefficient(found.value, source, found.how)
    if of_a != NOT_GIVEN and of_b != NOT_GIVEN:
        combined = combined_coefficient(field, rule, ("body_a", "body_b"), (of_a, of_b))
        return Coefficient(combined, CollisionResult.FROM_BODIES, rule.value)
    return Coefficient(getattr(parameters, field), CollisionResult.FROM_PARAMETER, "")


def _with_pair(model: ImpactModel, pair: Pair) -> ImpactModel:
    """Set what a pair of materials says about the model."""
    of_pair = {name: x for name, x in pair._asdict().items() if name in ImpactModel._fields and x is not None}
    return model._replace(**of_pair)


def model_of(message: ImpactModelMessage, defaults: ImpactModel) -> ImpactModel:
    """Convert a model; what is 0 in the message comes from ``defaults``.

    An unknown law, geometry or precision stays a number, which the core refuses with its field's name.
    """
    return _model(tuple(getattr(message, field) for field in ImpactModel._fields), defaults)


@lru_cache(maxsize=64)
def _model(fields: tuple[Any, ...], defaults: ImpactModel) -> ImpactModel:
    """Return the model of these fields. Cached, because most requests have the same."""
    given = dict(zip(ImpactModel._fields, fields, strict=True))
    for field, kind in ENUMERATIONS.items():
        with suppress(ValueError):
            given[field] = kind(given[field])
    return defaults._replace(**{field: value for field, value in given.items() if value})


def model_message(model: ImpactModel | None) -> ImpactModelMessage:
    """Return the model of a request. ``None`` makes all fields 0: the node's parameters then decide.

    Raises:
        ImpactError: if the model is invalid.
        TypeError: if it is not an :class:`ImpactModel`.
    """
    message = ImpactModelMessage()
    if model is not None:
        check_model(model)
        write_model(message, model)
    return message


def write_model(message: ImpactModelMessage, model: ImpactModel) -> None:
    """Write a model into a message."""
    for field, value in model._asdict().items():
        setattr(message, field, int(value) if isinstance(value, NamedEnum) else float(value))


def write_answer(
    result: CollisionResult,
    request: ResolveCollision.Request,
    impact: Impact,
    coefficients: ContactCoefficients,
) -> None:
    """Write the answer of the core into a result."""
    echo_contact(result, request)
    result.status.code = int(impact.status)
    result.status.message = "; ".join(notes_of(impact))
    _, result.restitution_from, result.restitution_rule = coefficients.restitution
    _, result.friction_from, result.friction_rule = coefficients.friction
    result.contact.restitution = impact.contact.restitution
    result.contact.friction = impact.contact.friction
    write_model(result.model, impact.model)
    _write_twist(result.twist_a, impact.twist_a)
    _write_twist(result.twist_b, impact.twist_b)
    write_vector(result.impulse, impact.impulse)
    for field in NUMBERS:
        setattr(result, field, getattr(impact, field))
    result.regime = int(impact.regime)
    result.adjustments = int(impact.adjustments)


def notes_of(impact: Impact | SceneImpact) -> Iterator[str]:
    """What a person should know about an answer."""
    yield from (note for flag, note in ADJUSTMENT_NOTES.items() if flag in impact.adjustments)
    if impact.status is StatusCode.TOLERANCE_NOT_MET:
        tolerance = impact.model.tolerance
        above = f", above the tolerance of {tolerance:.3g}" if tolerance else ""
        yield f"error_bound is {impact.error_bound:.3g}{above}"


def write_refusal(
    result: CollisionResult | SceneResult, model: ImpactModelMessage, error: ImpactError
) -> None:
    """Write the reason of a refusal into a result, with the model of the request."""
    result.model, result.error_bound = model, -1.0
    result.status.code, result.status.message = int(error.code), error_text(error)


def error_text(error: ImpactError) -> str:
    """Text of an error, with the field named as in the messages."""
    owner, _, field = error.field.partition(".")
    head, dot, component = field.partition(".")
    if owner.startswith(("body_a", "body_b", "bodies[", "names[")) and head in CORE_TO_MESSAGE:
        return f"{owner}.{CORE_TO_MESSAGE[head]}{dot}{component}: {error.reason}"
    return str(error)


def error_from(code: int, text: str) -> ImpactError:
    """Return the error that a response describes by its code and text.

    Raises:
        ValueError: if this version does not know the code.
    """
    status = StatusCode(code)
    field, separator, reason = text.partition(": ")
    return ImpactError(status, *((field, reason) if separator else ("response", text or f"has {status}")))


def echo_contact(result: CollisionResult, request: ResolveCollision.Request) -> None:
    """Write the contact of a request into its result, with the names of both bodies."""
    result.header = request.contact.header
    result.contact = request.contact
    result.contact.body_a = request.contact.body_a or request.body_a.name
    result.contact.body_b = request.contact.body_b or request.body_b.name


def nanoseconds(stamp: Time) -> int:
    """Convert a stamp to nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def vector_of(message: Any) -> Vec3:
    """Convert a vector or a point."""
    return Vec3(message.x, message.y, message.z)


def twist_of(message: TwistMessage) -> Twist:
    """Convert a twist."""
    return Twist(vector_of(message.linear), vector_of(message.angular))


def state_message(name: str, body: Body, header: Header, field: str = "body") -> BodyState:
    """Make a message of a body. An immovable one is KINEMATIC if it moves, else STATIC.

    Raises:
        ImpactError, TypeError: as :func:`body_in_floats`.
    """
    body = body_in_floats(field, body)
    state = BodyState(name=name, header=header)
    if body.inverse_inertia is not None:
        state.inverse_inertia = body.inverse_inertia.matrix()
    elif body.mass == math.inf:
        moves = any((*body.velocity, *body.angular_velocity))
        state.motion_type = BodyState.KINEMATIC if moves else BodyState.STATIC
    return state_from(body_to_numbers(body._replace(mass=0.0) if body.mass == math.inf else body), state)


def body_in_floats(field: str, body: Body) -> Body:
    """Return a body with the numbers that ``resolve`` reads.

    Raises:
        ImpactError, TypeError: as ``resolve``, if something is no number or no vector; ``field`` names the
            body.
    """
    with suppress(TypeError):
        numbers = body_to_numbers(body)
        if body.inverse_inertia is None and len(numbers) == ROWS and all(type(x) is float for x in numbers):
            return body  # nearly always
    try:
        return read_request(body, *VALID_REST[:2])[0]
    except (ImpactError, TypeError) as error:
        raise_renamed(error, {"body_a": field})


def contact_in_floats(field: str, contact: Contact) -> Contact:
    """Return a contact with the numbers that ``resolve`` reads.

    Raises:
        ImpactError, TypeError: as ``resolve``, if something is no number or no vector; ``field`` names the
            contact.
        ValueError: if the request has no place for something: the tangential restitution of a contact, or a
            coefficient that is a function.
    """
    if contact.tangential_restitution is not None:
        raise ValueError(f"{field}.tangential_restitution: set that of the model")
    for name in ("restitution", "friction"):
        if callable(getattr(contact, name)):
            raise ValueError(f"{field}.{name}: must be a number: requests hold no functions")
    try:
        return read_request(Body.static(), Body.static(), contact)[2]
    except (ImpactError, TypeError) as error:
        raise_renamed(error, {"contact": field})


def state_from(numbers: Iterable[float], state: BodyState) -> BodyState:
    """Write the numbers of a column of a table into a state, and return it."""
    rest = iter(numbers)
    inertia, pose, twist = state.inertia, state.pose, state.twist
    inertia.m = next(rest)
    for field in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        setattr(inertia, field, next(rest))
    for part, axes in (
        (inertia.com, "xyz"),
        (pose.position, "xyz"),
        (pose.orientation, "xyzw"),
        (twist.linear, "xyz"),
        (twist.angular, "xyz"),
    ):
        for axis in axes:
            setattr(part, axis, next(rest))
    return state


def contact_message(contact: Contact, header: Header) -> ContactMessage:
    """Make a message of a contact, without the names of the bodies.

    Raises:
        ImpactError, TypeError, ValueError: as :func:`contact_in_floats`.
    """
    contact, message = contact_in_floats("contact", contact), ContactMessage(header=header)
    message.restitution, message.friction = contact.restitution, contact.friction
    write_vector(message.position, contact.position)
    write_vector(message.normal, contact.normal)
    return message


def twist_message(twist: Twist) -> TwistMessage:
    """Make a message of a twist."""
    message = TwistMessage()
    _write_twist(message, twist)
    return message


def vector_message(vector: Vec3) -> Vector3:
    """Make a message of a vector."""
    message = Vector3()
    write_vector(message, vector)
    return message


def _write_twist(message: TwistMessage, twist: Twist) -> None:
    write_vector(message.linear, twist.linear)
    write_vector(message.angular, twist.angular)


def write_vector(message: Any, vector: Iterable[float]) -> None:
    """Write a vector into a message of a vector or a point."""
    message.x, message.y, message.z = vector
