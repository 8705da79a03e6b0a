"""Messages to bodies, answers to messages: the only file that knows both, but for batches.

A message gives the pose and the twist of the *origin of the body frame*; the numeric core knows a
body by its centre of mass. With ``c`` from the one to the other, in world axes,

    x = p + c        v_com = v + w x c        v+ = v + (dv_com - dw x c)

The last form adds the impact's change to the twist that came in, so that the detour over the centre
of mass rounds nothing that the impact did not touch.

Errors name fields as the messages do: ``body_a.inertia.m``, not the core's ``body_a.mass``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from geometry_msgs.msg import Twist, Vector3

from .. import Impact
from ..model import Adjustment, Geometry, ImpactModel, Law, Precision
from ..msg import BodyState, CollisionResult
from ..msg import ImpactModel as ImpactModelMessage
from ..physics.body import Body
from ..physics.body import Twist as Change
from ..physics.combine import CombineRule, combine
from ..physics.contact import Contact
from ..physics.orientation import Quaternion
from ..physics.vector import ZERO, Vec3
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from ..validate import check_coefficient
from .parameters import Parameters

CORE_TO_MESSAGE = {
    "mass": "inertia.m",
    "position": "pose.position",
    "orientation": "pose.orientation",
    "velocity": "twist.linear",
    "angular_velocity": "twist.angular",
}
"""What the message calls the fields of the core's ``Body``, where the two differ."""

NOTES = {
    Adjustment.NORMALISED_ORIENTATION: "a pose.orientation was not of unit length: normalised",
    Adjustment.RESTITUTION_THRESHOLD: "approach slower than restitution_threshold: restitution taken as 0",
    Adjustment.LAW_FALLBACK: "MOREAU has no solution here, or would create energy: COULOMB answered",
}

POSE = *(f"pose.position.{axis}" for axis in "xyz"), *(f"pose.orientation.{axis}" for axis in "xyzw")
TWIST = *(f"twist.linear.{axis}" for axis in "xyz"), *(f"twist.angular.{axis}" for axis in "xyz")
MOTION = POSE + TWIST
"""What :func:`_motion` reads."""

TENSOR = tuple(f"inertia.i{axes}" for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
INERTIA = ("inertia.m", "inertia.com.x", "inertia.com.y", "inertia.com.z", *TENSOR)
"""What :func:`_inertia` reads."""

NUMBERS = (
    "normal_impulse",
    "tangential_impulse",
    "normal_velocity_before",
    "normal_velocity_after",
    "effective_mass",
    "kinetic_energy_before",
    "kinetic_energy_after",
    "energy_lost_restitution",
    "energy_lost_friction",
    "error_bound",
)
"""Fields of ``CollisionResult`` and of :class:`~collision_response.resolve.Impact` alike."""

LAWS = {int(law): law for law in Law}
GEOMETRIES = {int(geometry): geometry for geometry in Geometry}
PRECISIONS = {int(precision): precision for precision in Precision}


class Placed(NamedTuple):
    """A body, and where the message's reference point lies on it.

    Attributes:
        body: as the numeric core knows it.
        centre: from the origin of the body frame to the centre of mass, in world axes [m].
    """

    body: Body
    centre: Vec3


class Scene(NamedTuple):
    """A request in the terms of the numeric core."""

    a: Placed
    b: Placed
    contact: Contact
    model: ImpactModel


def scene_of(request: ResolveCollision.Request, parameters: Parameters) -> Scene:
    """What a request asks for, in which both bodies are given in full.

    Raises:
        ImpactError: it cannot be put to the numeric core.
    """
    return Scene(
        placed("body_a", request.body_a),
        placed("body_b", request.body_b),
        contact_of(request, parameters),
        model_of(request.model, parameters.model),
    )


def placed(owner: str, state: BodyState) -> Placed:
    """The body of a message.

    Raises:
        ImpactError: NOT_FINITE, INVALID_MASS, INVALID_ORIENTATION or INVALID_MOTION_TYPE, its field
            starting with ``owner``.
    """
    motion = _motion(state)
    _check_finite(owner, MOTION, motion)
    position, velocity, angular_velocity = motion[0:3], motion[7:10], motion[10:13]
    orientation = _orientation(owner, Quaternion(*motion[3:7]))
    if state.motion_type != BodyState.DYNAMIC:
        _check_immovable(owner, state.motion_type, motion[7:])
        body = Body.kinematic(position, velocity, angular_velocity)
        return Placed(body._replace(orientation=orientation), ZERO)

    mass, x, y, z, *tensor = inertia = _inertia(state)
    _check_finite(owner, INERTIA, inertia)
    try:
        body = Body.dynamic(mass, tensor, position, orientation, velocity, angular_velocity)
    except ImpactError as error:
        raise error.within(owner) from None
    if not (x or y or z):
        return Placed(body, ZERO)
    com = Vec3(x, y, z)
    centre = com if orientation is None else _to_world(orientation, com)
    return Placed(body._replace(position=body.position + centre, velocity=body.velocity_at(centre)), centre)


def _motion(state: BodyState) -> tuple[float, ...]:
    p, q = state.pose.position, state.pose.orientation
    v, w = state.twist.linear, state.twist.angular
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z


def _inertia(state: BodyState) -> tuple[float, ...]:
    i, c = state.inertia, state.inertia.com
    return i.m, c.x, c.y, c.z, i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz


def _check_finite(owner: str, fields: tuple[str, ...], numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        field, number = next(pair for pair in zip(fields, numbers, strict=True) if not math.isfinite(pair[1]))
        raise ImpactError(StatusCode.NOT_FINITE, f"{owner}.{field}", f"must be finite, is {number}")


def _orientation(owner: str, q: Quaternion) -> Quaternion | None:
    if q == (0, 0, 0, 1):
        return None
    if not any(q):
        reason = f"is a quaternion of length 0: {tuple(q)}"
        raise ImpactError(StatusCode.INVALID_ORIENTATION, f"{owner}.pose.orientation", reason)
    return q


def _to_world(q: Quaternion, com: Vec3) -> Vec3:
    longest = max(map(abs, q))  # so that no square overflows, or is 0
    return Quaternion(*(component / longest for component in q)).to_world(com)


def _check_immovable(owner: str, motion_type: int, twist: tuple[float, ...]) -> None:
    field = f"{owner}.motion_type"
    if motion_type not in (BodyState.KINEMATIC, BodyState.STATIC):
        reason = f"must be DYNAMIC (0), KINEMATIC (1) or STATIC (2), is {motion_type}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)
    if motion_type == BodyState.STATIC and any(twist):
        reason = f"is STATIC, but the twist is not 0: {twist}"
        raise ImpactError(StatusCode.INVALID_MOTION_TYPE, field, reason)


def contact_of(request: ResolveCollision.Request, parameters: Parameters) -> Contact:
    """Where the bodies touch, with coefficients filled in.

    Raises:
        ImpactError: NOT_FINITE or INVALID_COEFFICIENT, for a coefficient of a body.
    """
    position, normal = request.contact.position, request.contact.normal
    return Contact(
        Vec3(position.x, position.y, position.z),
        Vec3(normal.x, normal.y, normal.z),
        _coefficient("restitution", 1.0, request, parameters.combine_restitution, parameters.restitution),
        _coefficient("friction", math.inf, request, parameters.combine_friction, parameters.friction),
    )


def _coefficient(
    field: str, most: float, request: ResolveCollision.Request, rule: CombineRule, default: float
) -> float:
    asked = getattr(request.contact, field)
    if not -math.inf < asked < 0:
        return asked  # NaN and infinity too, for the core to refuse
    of_a, of_b = getattr(request.body_a, field), getattr(request.body_b, field)
    if of_a < 0 or of_b < 0:
        return default
    check_coefficient(f"body_a.{field}", of_a, 0, most)
    check_coefficient(f"body_b.{field}", of_b, 0, most)
    return combine(rule, of_a, of_b)


def model_of(message: ImpactModelMessage, defaults: ImpactModel) -> ImpactModel:
    """What to model. A number without a name stays a number, for the core to refuse by name."""
    return ImpactModel(
        LAWS.get(message.law, message.law) or defaults.law,
        GEOMETRIES.get(message.geometry, message.geometry) or defaults.geometry,
        PRECISIONS.get(message.precision, message.precision) or defaults.precision,
        message.tolerance or defaults.tolerance,
        message.tangential_restitution or defaults.tangential_restitution,
        message.restitution_threshold or defaults.restitution_threshold,
    )


def write_answer(
    result: CollisionResult, request: ResolveCollision.Request, scene: Scene, impact: Impact
) -> None:
    """Fill in a result from what the core answered."""
    _echo(result, request)
    result.status.code = int(impact.status)
    result.status.message = "; ".join(_notes(impact))
    result.contact.restitution = float(impact.contact.restitution)
    result.contact.friction = float(impact.contact.friction)
    _write_model(result.model, impact.model)
    _write_twist(result.twist_a, request.body_a.twist, scene.a, impact.change_a)
    _write_twist(result.twist_b, request.body_b.twist, scene.b, impact.change_b)
    _write_vector(result.impulse, impact.impulse)
    for field in NUMBERS:
        setattr(result, field, float(getattr(impact, field)))
    result.regime = int(impact.regime)
    result.adjustments = int(impact.adjustments)


def _notes(impact: Impact) -> Iterator[str]:
    yield from (note for flag, note in NOTES.items() if flag in impact.adjustments)
    if impact.status is StatusCode.TOLERANCE_NOT_MET:
        tolerance = impact.model.tolerance
        above = f", above the tolerance of {tolerance:.3g}" if tolerance else ""
        yield f"error_bound is {impact.error_bound:.3g}{above}"


def write_refusal(
    result: CollisionResult, request: ResolveCollision.Request, code: StatusCode, message: str
) -> None:
    """Fill in a result that says why there is none; contact and model are those of the request."""
    _echo(result, request)
    result.model = request.model
    result.error_bound = -1.0
    result.status.code = int(code)
    result.status.message = message


def as_in_message(error: ImpactError) -> str:
    """What an error says, its field named as the messages name it."""
    owner, _, field = error.field.partition(".")
    head, dot, rest = field.partition(".")
    if owner.startswith(("body_a", "body_b", "names[")) and head in CORE_TO_MESSAGE:
        return f"{owner}.{CORE_TO_MESSAGE[head]}{dot}{rest}: {error.reason}"
    return str(error)


def _echo(result: CollisionResult, request: ResolveCollision.Request) -> None:
    result.header = request.contact.header
    result.contact = request.contact
    result.contact.body_a = request.contact.body_a or request.body_a.name
    result.contact.body_b = request.contact.body_b or request.body_b.name


def _write_model(message: ImpactModelMessage, model: ImpactModel) -> None:
    law, geometry, precision, tolerance, tangential_restitution, restitution_threshold = model
    message.law, message.geometry, message.precision = int(law), int(geometry), int(precision)
    message.tolerance = float(tolerance)
    message.tangential_restitution = float(tangential_restitution)
    message.restitution_threshold = float(restitution_threshold)


def _write_twist(message: Twist, before: Twist, body: Placed, change: Change) -> None:
    linear, angular = change
    if body.centre is not ZERO:
        linear -= angular.cross(body.centre)
    _write_sum(message.linear, before.linear, linear)
    _write_sum(message.angular, before.angular, angular)


def _write_sum(message: Vector3, before: Vector3, change: Vec3) -> None:
    x, y, z = change
    message.x, message.y, message.z = float(before.x + x), float(before.y + y), float(before.z + z)


def _write_vector(message: Vector3, vector: Vec3) -> None:
    message.x, message.y, message.z = float(vector.x), float(vector.y), float(vector.z)
