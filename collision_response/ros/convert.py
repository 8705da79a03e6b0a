"""Messages to bodies, answers to messages: of single impacts. Of tables: ``batches.py`` and ``scenes.py``.

The core takes a body as a message describes it: pose and twist of the origin of the body frame, and where
the centre of mass is from there. So nothing is computed here.

Errors name fields as the messages do: ``body_a.inertia.m``, not the core's ``body_a.mass``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import IntEnum
from functools import lru_cache
from typing import Any, NamedTuple

from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import Vector3

from ..answer import NUMBERS, Impact
from ..body_conversions import IDENTITY_QUATERNION
from ..materials import Pair
from ..model import Adjustment, Geometry, ImpactModel, Precision, check_number
from ..msg import BodyState, CollisionResult, SceneResult
from ..msg import Contact as ContactMessage
from ..msg import ImpactModel as ImpactModelMessage
from ..physics.body import Body, Twist
from ..physics.combine import CombineRule, combine
from ..physics.contact import Contact
from ..physics.laws import BY_SPEED, Law
from ..physics.orientation import Quaternion
from ..physics.tensor import Symmetric3
from ..physics.vector import ZERO, Vec3
from ..resolve import resolve
from ..scene import SceneImpact
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from .batch_fields import write_model
from .parameters import Parameters

CORE_TO_MESSAGE = {
    "mass": "inertia.m",
    "position": "pose.position",
    "orientation": "pose.orientation",
    "velocity": "twist.linear",
    "angular_velocity": "twist.angular",
    "com": "inertia.com",
}
"""What the message calls the fields of the core's ``Body``, where the two differ."""

NOTES = {
    Adjustment.NORMALISED_ORIENTATION: "a pose.orientation was not of unit length: normalised",
    Adjustment.RESTITUTION_THRESHOLD: "approach slower than restitution_threshold: restitution taken as 0",
    Adjustment.LAW_FALLBACK: "the law has no solution here, or would create energy: COULOMB answered",
    Adjustment.ENERGY_CHANGE_ONLY: "a body is articulated: kinetic energies count its change alone",
    Adjustment.MASSLESS_SPIN: "a body turned about an axis without inertia: that rotation was left out",
}

LAWS: dict[int, Any] = {int(law): law for law in Law}
GEOMETRIES: dict[int, Any] = {int(geometry): geometry for geometry in Geometry}
PRECISIONS: dict[int, Any] = {int(precision): precision for precision in Precision}


AT_REST = Twist(ZERO, ZERO)


class Source(IntEnum):
    """Where a coefficient came from."""

    CONTACT = CollisionResult.FROM_CONTACT
    BODIES = CollisionResult.FROM_BODIES
    PARAMETER = CollisionResult.FROM_PARAMETER
    PAIR = CollisionResult.FROM_PAIR
    MATERIALS = CollisionResult.FROM_MATERIALS


UNSET = -1.0
"""What a coefficient is that a message does not give."""


class Filled(NamedTuple):
    """A coefficient of a contact.

    Attributes:
        value: a number; of a pair of materials it may be a function of the approach or slip speed.
        source: where it came from.
        rule: that combined two, or what the entry of a pair says of its source.
    """

    value: Any
    source: Source
    rule: str


class FilledIn(NamedTuple):
    """Those of a contact, and the entry of its pair of materials."""

    restitution: Filled
    friction: Filled
    pair: Pair


class Problem(NamedTuple):
    """A request in the terms of the numeric core."""

    body_a: Body
    body_b: Body
    contact: Contact
    model: ImpactModel


def problem_of(request: ResolveCollision.Request, parameters: Parameters) -> tuple[Problem, FilledIn]:
    """What a request asks for, in which both bodies are given in full, and where its coefficients came from.

    Raises:
        ImpactError: it cannot be put to the numeric core.
    """
    bodies = body_of("body_a", request.body_a), body_of("body_b", request.body_b)
    coefficients = coefficients_of(request, parameters)
    model = model_of(request.model, _defaults(parameters.model, coefficients.pair))
    return Problem(*bodies, contact_with(request.contact, coefficients, model.law), model), coefficients


def body_of(owner: str, state: BodyState) -> Body:
    """The body of a message. What must hold of its numbers, the core sees to.

    Raises:
        ImpactError: NOT_FINITE or INVALID_MOTION_TYPE, its field starting with ``owner``.
    """
    position, q = vector_of(state.pose.position), state.pose.orientation
    turn = Quaternion(q.x, q.y, q.z, q.w)
    velocity, angular_velocity = vector_of(state.twist.linear), vector_of(state.twist.angular)
    orientation = None if turn == IDENTITY_QUATERNION else turn
    if state.motion_type != BodyState.DYNAMIC:
        _check_immovable(owner, state.motion_type, Twist(velocity, angular_velocity))
        return Body.kinematic(position, velocity, angular_velocity)._replace(orientation=orientation)
    if state.inverse_inertia:
        try:
            return Body.articulated(state.inverse_inertia, position, velocity, angular_velocity)
        except ImpactError as error:
            raise error.within(owner) from None
    i = state.inertia
    check_mass(owner, i.m)
    return Body(
        i.m,
        Symmetric3(i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz),
        position,
        orientation,
        velocity,
        angular_velocity,
        vector_of(i.com),
    )


def check_mass(owner: str, mass: float) -> None:
    """Refuse what the core would take for the mass of an immovable body. Raises: ImpactError: NOT_FINITE."""
    if not math.isfinite(mass):
        raise ImpactError(StatusCode.NOT_FINITE, f"{owner}.inertia.m", f"must be finite; is {mass}")


TRIAL = Body.dynamic(1.0), Contact.of((0, 0, 0), normal=(1, 0, 0)), ImpactModel(precision=Precision.SINGLE)
"""An impact that nothing is wrong with but what is wrong with body_a."""


def check_body(owner: str, body: Body) -> None:
    """Whether the core takes a body.

    Raises:
        ImpactError: it does not; the field starts with ``owner``.
    """
    try:
        resolve(body, *TRIAL)
    except ImpactError as error:
        if error.field.startswith("body_a."):
            raise error.with_owner(owner) from None


def _check_immovable(owner: str, motion_type: int, twist: Twist) -> None:
    field = f"{owner}.motion_type"
    if motion_type not in (BodyState.KINEMATIC, BodyState.STATIC):
        reason = f"must be DYNAMIC (0), KINEMATIC (1) or STATIC (2); is {motion_type}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)
    if motion_type == BodyState.STATIC and twist != AT_REST:
        reason = f"is STATIC, but the twist is not 0: {(*twist.linear, *twist.angular)}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)


def contact_with(
    message: ContactMessage, coefficients: FilledIn, law: Law, tangential_restitution: float | None = None
) -> Contact:
    """Where the bodies touch, with these coefficients.

    Raises:
        ImpactError: INVALID_MODEL: the law follows friction by slip speed along its path. An answer has one
            number for it, which would not give the same again.
    """
    e, mu = coefficients.restitution.value, coefficients.friction.value
    if callable(mu) and law in BY_SPEED:
        reason = f"depends on slip speed, which {law.name} follows in Python alone: give a number"
        raise ImpactError(StatusCode.INVALID_MODEL, "contact.friction", f"{reason}, or ask COULOMB")
    return Contact(vector_of(message.position), vector_of(message.normal), e, mu, tangential_restitution)


GREATEST = {"restitution": 1.0, "friction": math.inf}


def coefficients_of(touch: Any, parameters: Parameters) -> FilledIn:
    """What the contact says; else the entry of the pair of materials; else both materials; else both bodies;
    else the node's parameter.

    Args:
        touch: a ``contact``, its ``body_a`` and ``body_b``, such as a request for one impact.
        parameters: of the node.

    Raises:
        ImpactError: UNKNOWN_MATERIAL, or for a coefficient of a body NOT_FINITE or INVALID_COEFFICIENT.
    """
    materials = touch.body_a.material, touch.body_b.material
    for owner, material in zip(("body_a", "body_b"), materials, strict=True):
        if material:
            parameters.materials.check(f"{owner}.material", material)
    return FilledIn(
        _filled("restitution", touch, parameters),
        _filled("friction", touch, parameters),
        parameters.materials.between(*materials),
    )


def _filled(field: str, touch: Any, parameters: Parameters) -> Filled:
    of_a, of_b = getattr(touch.body_a, field), getattr(touch.body_b, field)
    for owner, own in (("body_a", of_a), ("body_b", of_b)):
        if own != UNSET:
            check_number(f"{owner}.{field}", own, 0, GREATEST[field], StatusCode.INVALID_COEFFICIENT)
    given = getattr(touch.contact, field)
    if given != UNSET:
        return Filled(given, Source.CONTACT, "")  # for the core to refuse, if need be
    rule: CombineRule = getattr(parameters, f"combine_{field}")
    a, b = touch.body_a.material, touch.body_b.material
    found = parameters.materials.find(field, a, b, rule) if a and b else None
    if found is not None:
        return Filled(found.value, Source.PAIR if found.is_of_pair else Source.MATERIALS, found.how)
    if of_a != UNSET and of_b != UNSET:
        return Filled(combine(rule, of_a, of_b), Source.BODIES, rule.value)
    return Filled(getattr(parameters, field), Source.PARAMETER, "")


@lru_cache(maxsize=64)
def _defaults(model: ImpactModel, pair: Pair) -> ImpactModel:
    """The node's model, with what a pair of materials says of it. Equal ones are one object."""
    of_pair = {name: x for name, x in pair._asdict().items() if name in ImpactModel._fields and x is not None}
    return model._replace(**of_pair)


def only_one_body_says(field: str, request: ResolveCollision.Request) -> bool:
    """Whether the coefficient of one body is of no use, because the other has none, nor both a material."""
    if request.body_a.material and request.body_b.material:
        return False
    of_a, of_b = getattr(request.body_a, field), getattr(request.body_b, field)
    return getattr(request.contact, field) == UNSET and (of_a == UNSET) != (of_b == UNSET)


def model_of(message: ImpactModelMessage, defaults: ImpactModel) -> ImpactModel:
    """What to model. A number without a name stays a number, for the core to refuse by name."""
    return _model(tuple(getattr(message, field) for field in ImpactModel._fields), defaults)


@lru_cache(maxsize=64)
def _model(fields: tuple[Any, ...], defaults: ImpactModel) -> ImpactModel:
    """Equal ones are one object: the core remembers by that what a model comes to."""
    law, geometry, precision, *numbers = fields
    named = LAWS.get(law, law), GEOMETRIES.get(geometry, geometry), PRECISIONS.get(precision, precision)
    chosen: list[Any] = [x or default for x, default in zip((*named, *numbers), defaults, strict=True)]
    return ImpactModel(*chosen)


def write_answer(
    result: CollisionResult, request: ResolveCollision.Request, impact: Impact, coefficients: FilledIn
) -> None:
    """Fill in a result from what the core answered."""
    echo(result, request)
    result.status.code = int(impact.status)
    result.status.message = "; ".join(notes(impact))
    _, result.restitution_from, result.restitution_rule = coefficients.restitution
    _, result.friction_from, result.friction_rule = coefficients.friction
    result.contact.restitution = impact.contact.restitution
    result.contact.friction = impact.contact.friction
    write_model(result.model, impact.model)
    _write_twist(result.twist_a, impact.twist_a)
    _write_twist(result.twist_b, impact.twist_b)
    _write_vector(result.impulse, impact.impulse)
    for field in NUMBERS:
        setattr(result, field, getattr(impact, field))
    result.regime = int(impact.regime)
    result.adjustments = int(impact.adjustments)


def notes(impact: Impact | SceneImpact) -> Iterator[str]:
    """What a person should know of an answer."""
    if impact.adjustments:
        yield from (note for flag, note in NOTES.items() if flag in impact.adjustments)
    if impact.status is StatusCode.TOLERANCE_NOT_MET:
        tolerance = impact.model.tolerance
        above = f", above the tolerance of {tolerance:.3g}" if tolerance else ""
        yield f"error_bound is {impact.error_bound:.3g}{above}"


def write_refusal(
    result: CollisionResult | SceneResult, model: ImpactModelMessage, error: ImpactError
) -> None:
    """Fill in a result that says why there is none; its model is that of the request."""
    result.model, result.error_bound = model, -1.0
    result.status.code, result.status.message = int(error.code), as_in_message(error)


def as_in_message(error: ImpactError) -> str:
    """What an error says, its field named as the messages name it."""
    owner, _, field = error.field.partition(".")
    head, dot, rest = field.partition(".")
    if owner.startswith(("body_a", "body_b", "bodies[", "names[")) and head in CORE_TO_MESSAGE:
        return f"{owner}.{CORE_TO_MESSAGE[head]}{dot}{rest}: {error.reason}"
    return str(error)


def echo(result: CollisionResult, request: ResolveCollision.Request) -> None:
    """Fill in a result with the contact of its request, the names of the bodies too."""
    result.header = request.contact.header
    result.contact = request.contact
    result.contact.body_a = request.contact.body_a or request.body_a.name
    result.contact.body_b = request.contact.body_b or request.body_b.name


def vector_of(message: Any) -> Vec3:
    """A vector, or a point."""
    return Vec3(message.x, message.y, message.z)


def twist_message(twist: Twist) -> TwistMessage:
    """A new message."""
    message = TwistMessage()
    _write_twist(message, twist)
    return message


def vector_message(vector: Vec3) -> Vector3:
    """A new message."""
    message = Vector3()
    _write_vector(message, vector)
    return message


def _write_twist(message: TwistMessage, twist: Twist) -> None:
    _write_vector(message.linear, twist.linear)
    _write_vector(message.angular, twist.angular)


def _write_vector(message: Vector3, vector: Vec3) -> None:
    message.x, message.y, message.z = vector
