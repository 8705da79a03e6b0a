"""How small changes of a state before an impact appear after it, at the same time.

The state of a body is ``(dx, dtheta, dv, dw)``: of its reference point, turned by ``R <- exp([theta]x) R``,
in the axes of the world. A changed state meets the surface earlier or later. With the impact as a map ``R``
of states, with ``F`` the rate of the state in free flight, and the distance ``g`` of the surfaces,

    Xi = DR + (F+ - DR F-) Dg / (Dg F-)        Dg F- = u_n
    DR = [[1, 0], [dv+/dq, dv+/dv]]            dv+/dq = d_q v+ + d_C v+ dC/dq + d_n v+ dn/dq
    Dg = (n, d_A x n, 0, 0; -n, -d_B x n, 0, 0)

where ``d`` goes from the reference point to the contact. In free flight the centre of mass, at ``c`` from the
reference point, falls with ``g``, and the body turns with ``I w' = -w x (I w)``; an immovable body keeps its
twist.

Sources: Aizerman & Gantmacher, "Determination of stability by linear approximation of a periodic solution of
a system of differential equations with discontinuous right-hand sides", Q. J. Mech. Appl. Math. 11 (1958);
Kong, Payne, Zhu & Johnson, "Saltation Matrices: The Essential Tool for Linearizing Hybrid Dynamical Systems",
Proc. IEEE 112 (2024).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..body_conversions import body_rotation, com_in_world_axes
from ..model import DEFAULT, ImpactModel, check_number
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.vector import Vec3, as_vector
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .differentiate import Derivatives, Smoothness, differentiate
from .surfaces import SurfaceMotion, Surfaces, unit_normal

Array = np.ndarray[Any, Any]

STANDARD_GRAVITY = (0.0, 0.0, -9.80665)

POSE, TWIST = ("position", "orientation"), ("velocity", "angular_velocity")
STATE = [f"{body}.{name}" for body in ("body_a", "body_b") for name in (*POSE, *TWIST)]
POSES, TWISTS = [*range(6), *range(12, 18)], [*range(6, 12), *range(18, 24)]
"""Where positions and turns lie in the state of two bodies, and where their twists do."""


class Passage(NamedTuple):
    """An impact, linearised.

    Attributes:
        derivatives: of the impact, by the state, contact point, normal, restitution and friction.
        matrix: the saltation matrix of both bodies, shape ``(24, 24)``.
        by_normal: of the state after, as the unit normal turns by itself, shape ``(24, 3)``.
        motion: of contact point and normal.
        kept: the places of bodies that can move.
    """

    derivatives: Derivatives
    matrix: Array
    by_normal: Array
    motion: SurfaceMotion
    kept: list[int]


def saltation_matrix(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel = DEFAULT,
    surfaces: Surfaces | SurfaceMotion | None = None,
    gravity: Sequence[float] = STANDARD_GRAVITY,
) -> Array:
    """The matrix from changes of the state before an impact to those after it, at one time.

    Args:
        body_a, body_b, contact, model: as for :func:`~collision_response.derivatives.differentiate`.
        surfaces: how contact point and normal move with the poses: a form of ``surfaces.py``, or the
            matrices. It cannot be left out: nothing else tells a ball on a plane from a corner.
        gravity: [m/s^2].

    Returns:
        Of ``(dx, dtheta, dv, dw)`` of body_a, shape ``(12, 12)``, if body_b is immovable, or the other way
        round; else of body_a and of body_b, shape ``(24, 24)``.

    Raises:
        ImpactError: as ``differentiate``; INVALID_NORMAL: ``surfaces`` is missing, or not of its shape;
            SEPARATING: there is no impact; OUT_OF_RANGE: a number is beyond float64.
    """
    passage = linearised(body_a, body_b, contact, model, surfaces, gravity)
    return passage.matrix[np.ix_(passage.kept, passage.kept)]


def linearised(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel,
    surfaces: Surfaces | SurfaceMotion | None,
    gravity: Sequence[float],
) -> Passage:
    """All that is known to first order of an impact at its time."""
    for acceleration in as_vector("gravity", gravity):
        check_number("gravity", acceleration, -math.inf, math.inf, StatusCode.NOT_FINITE)
    resolve(body_a, body_b, contact, model)  # names what is wrong, before surfaces are asked
    motion = _checked(surfaces, body_a, body_b, contact)
    names = [*STATE, "contact.position", "contact.normal", "contact.restitution", "contact.friction"]
    contact = contact._replace(normal=Vec3(*unit_normal(contact).tolist()))
    derivatives = differentiate(body_a, body_b, contact, model, names)
    u_n = derivatives.impact.normal_velocity_before
    if not u_n < 0:
        raise ImpactError(
            StatusCode.SEPARATING, "contact.normal", f"there is no impact: the normal velocity is {u_n}"
        )
    J = derivatives.jacobian[:12]
    by_point, by_n = (J[:, derivatives.columns[name]] for name in names[len(STATE) : len(STATE) + 2])
    across = np.eye(3) - np.outer(contact.normal, contact.normal)
    by_state = J[:, :24].copy()
    by_state[:, POSES] += by_point @ motion.position + by_n @ motion.normal
    reset = np.eye(24)
    reset[TWISTS] = by_state
    by_normal = np.zeros((24, 3))
    by_normal[TWISTS] = (by_n + by_point @ motion.position_by_normal) @ across

    bodies = body_a, body_b
    n = Vec3(*contact.normal)
    arms = [Vec3(*np.subtract(contact.position, body.position).tolist()) for body in bodies]
    none = [0.0] * 6
    guard = np.array([*n, *arms[0].cross(n), *none, *-n, *-(arms[1].cross(n)), *none])
    answers = derivatives.impact.twist_a, derivatives.impact.twist_b
    before = np.concatenate([_rate(body, gravity) for body in bodies])
    moved = (body.with_twist(twist) for body, twist in zip(bodies, answers, strict=True))
    after = np.concatenate([_rate(body, gravity) for body in moved])
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = finite("matrix", reset + np.outer(after - reset @ before, guard) / u_n)
    kept = [12 * side + i for side, body in enumerate(bodies) if body.is_movable() for i in range(12)]
    return Passage(derivatives, matrix, by_normal, motion, kept)


def finite(name: str, numbers: Array) -> Array:
    """Raises: ImpactError: OUT_OF_RANGE: a number is beyond float64, as where the bodies hardly approach."""
    if not np.isfinite(numbers).all():
        raise ImpactError(
            StatusCode.OUT_OF_RANGE, name, "a number is beyond float64: the bodies hardly approach"
        )
    return numbers


def finite_numbers(value: Any, shape: tuple[int, ...]) -> Array | None:
    """As floats; ``None`` if it is anything else than so many finite real numbers."""
    try:
        if np.asarray(value).dtype.kind not in "biufO":
            return None
        numbers = np.asarray(value, float)
    except (OverflowError, TypeError, ValueError):
        return None
    return numbers if numbers.shape == shape and np.isfinite(numbers).all() else None


def may_be_off(derivatives: Derivatives) -> bool:
    """Whether the answer has a kink or a jump just here."""
    return bool((derivatives.smoothness != Smoothness.SMOOTH).any())


def _checked(
    surfaces: Surfaces | SurfaceMotion | None, body_a: Body, body_b: Body, contact: Contact
) -> SurfaceMotion:
    motion = surfaces(body_a, body_b, contact) if callable(surfaces) else surfaces
    if motion is None:
        reason = (
            "is missing: how contact point and normal move with the poses, dC/dq and dn/dq; "
            "see collision_response.derivatives.surfaces"
        )
        raise ImpactError(StatusCode.INVALID_NORMAL, "surfaces", reason)
    for name, shape in (("position", (3, 12)), ("normal", (3, 12)), ("position_by_normal", (3, 3))):
        value: Any = getattr(motion, name, None)
        if finite_numbers(value, shape) is None:
            reason = f"must be finite numbers of shape {shape}, is {value}"
            raise ImpactError(StatusCode.INVALID_NORMAL, f"surfaces.{name}", reason)
    return motion


def _rate(body: Body, gravity: Sequence[float]) -> Array:
    """Of the state, in free flight."""
    v, w = np.array(body.velocity, float), np.array(body.angular_velocity, float)
    if not body.is_movable():
        return np.concatenate([v, w, np.zeros(6)])
    R = np.array(body_rotation(body)[:3], float)
    xx, xy, xz, yy, yz, zz = body.inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)
    spin = R.T @ w
    turning = R @ np.linalg.lstsq(tensor, -np.cross(spin, tensor @ spin), rcond=None)[0]
    c = com_in_world_axes(body)
    falling = np.array(gravity, float) - np.cross(turning, c) - np.cross(w, np.cross(w, c))
    return np.concatenate([v, w, falling, turning])
