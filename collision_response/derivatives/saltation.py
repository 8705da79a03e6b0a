"""The saltation matrix: how a small change of the state before an impact appears in the state after it.

Both changes belong to the same time. The state of a body is ``(dx, dtheta, dv, dw)``: the displacement of its
reference point, a rotation by ``R <- exp([theta]x) R``, and the changes of its twist, all in world axes. A
changed state meets the surface earlier or later. With the impact as a map ``R`` of states, the rate ``F`` of
the state in free flight, and the distance ``g`` of the surfaces,

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
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ..arguments import finite_number
from ..batch.arrays import Array
from ..in_python.request_numbers import body_as_fractions, contact_as_fractions, read_request
from ..model import DEFAULT, Adjustment, ImpactModel
from ..physics.body import Body
from ..physics.centre_of_mass import com_in_world_axes
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.vector import Vec3, as_vector
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .differentiate import Derivatives, check_coefficients, differentiate
from .surfaces import SurfaceMotion, Surfaces, sphere_on_plane, sphere_on_sphere, unit_normal

STANDARD_GRAVITY = (0.0, 0.0, -9.80665)

POSE, TWIST = ("position", "orientation"), ("velocity", "angular_velocity")
STATE = [f"{body}.{name}" for body in ("body_a", "body_b") for name in (*POSE, *TWIST)]
COEFFICIENTS = "contact.restitution", "contact.friction"
POSES, TWISTS = [*range(6), *range(12, 18)], [*range(6, 12), *range(18, 24)]
"""Indices of the poses and of the twists in the state of two bodies."""


class LinearisedImpact(NamedTuple):
    """An impact and its first-order behaviour.

    Attributes:
        request: body_a, body_b, contact and model, with floats for all numbers.
        derivatives: of the impact by the state, contact point, normal, restitution and friction.
        matrix: the saltation matrix of both bodies, shape ``(24, 24)``.
        by_normal: derivative of the state after the impact by a change of the unit normal alone, shape
            ``(24, 3)``.
        at_impact: the derivative of the state before the impact, at its time, by the state at the time of the
            mean impact, shape ``(24, 24)``.
        motion: how the contact point and the normal move with the bodies.
        movable: indices, in the state of two bodies, that belong to movable bodies.
    """

    request: tuple[Body, Body, Contact, ImpactModel]
    derivatives: Derivatives
    matrix: Array
    by_normal: Array
    at_impact: Array
    motion: SurfaceMotion
    movable: list[int]


def saltation_matrix(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel = DEFAULT,
    surfaces: Surfaces | SurfaceMotion | None = None,
    gravity: Iterable[float] = STANDARD_GRAVITY,
) -> Array:
    """Return the matrix that maps changes of the state before an impact to changes after it, at one time.

    Args:
        body_a, body_b, contact, model: as for :func:`~collision_response.derivatives.differentiate`.
        surfaces: how the contact point and the normal move with the poses: a function such as
            :func:`~collision_response.derivatives.sphere_on_plane` returns, or a :class:`SurfaceMotion`. It
            is required, because the bodies and the contact do not tell a ball on a plane from a corner.
        gravity: in world axes [m/s^2].

    Returns:
        The matrix for ``(dx, dtheta, dv, dw)`` of the movable body, shape ``(12, 12)``, if the other body is
        immovable; otherwise for those of body_a and then body_b, shape ``(24, 24)``.

    Raises:
        ImpactError: as ``differentiate``, or with the status INVALID_NORMAL if ``surfaces`` is missing or has
            a matrix that does not hold finite numbers of the right shape, SEPARATING if there is no impact,
            NOT_FINITE if ``gravity`` is not finite, or OUT_OF_RANGE if a result is beyond float64.
        TypeError: as ``differentiate``, or if ``gravity`` is not a vector of real numbers, or ``surfaces`` a
            function that makes such a function.
    """
    impact = linearise(body_a, body_b, contact, model, surfaces, gravity)
    return impact.matrix[np.ix_(impact.movable, impact.movable)]


@np.errstate(over="ignore", under="ignore", invalid="ignore")
def linearise(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel,
    surfaces: Surfaces | SurfaceMotion | None,
    gravity: Iterable[float],
) -> LinearisedImpact:
    """Linearise an impact about the given state. Arguments and errors are as for :func:`saltation_matrix`."""
    gravity = as_vector("gravity", gravity)
    for acceleration in gravity:
        finite_number("gravity", acceleration)
    resolve(body_a, body_b, contact, model)  # refuses invalid input before `surfaces` is called with it
    check_coefficients(contact)
    body_a, body_b, contact = read_request(body_a, body_b, contact)
    request = body_a, body_b, contact, model
    motion = _surface_motion(surfaces, body_a, body_b, contact)
    names = [*STATE, "contact.position", "contact.normal", *COEFFICIENTS]
    derivatives = _differentiate_by_unit_normal(body_a, body_b, contact, model, names)
    contact = contact._replace(normal=Vec3(*unit_normal(contact).tolist()))
    J = derivatives.jacobian[:12]  # rows of the twists
    dv_dC, dv_dn = (J[:, derivatives.columns[name]] for name in ("contact.position", "contact.normal"))
    tangential = np.eye(3) - np.outer(contact.normal, contact.normal)
    dv_dstate = J[:, :24].copy()
    dv_dstate[:, POSES] += dv_dC @ motion.position + dv_dn @ motion.normal
    DR = np.eye(24)
    DR[TWISTS] = dv_dstate
    by_normal = np.zeros((24, 3))
    by_normal[TWISTS] = (dv_dn + dv_dC @ motion.position_by_normal) @ tangential

    bodies = body_a, body_b
    n = contact.normal
    d_A, d_B = (contact.position - body.position for body in bodies)
    by_twist = [0.0] * 6
    Dg = np.array([*n, *d_A.cross(n), *by_twist, *-n, *-(d_B.cross(n)), *by_twist])
    impact = derivatives.impact
    bodies_after = body_a.with_twist(impact.twist_a), body_b.with_twist(impact.twist_b)
    F_before = np.concatenate([_free_flight_rate(body, gravity) for body in bodies])
    F_after = np.concatenate([_free_flight_rate(body, gravity) for body in bodies_after])
    u_n = impact.normal_velocity_before
    if Adjustment.MASSLESS_SPIN in impact.adjustments:  # the rotation left out moves the surface all the same
        u_n = _normal_velocity_of_surfaces(body_a, body_b, impact.contact)
    if impact.regime is Regime.SEPARATING or not u_n < 0:
        raise ImpactError(
            StatusCode.SEPARATING, "contact.normal", f"there is no impact: the normal velocity is {u_n}"
        )
    matrix = DR + np.outer(F_after - DR @ F_before, Dg) / u_n
    check_finite("matrix", matrix, "the bodies approach too slowly, or accelerate too much")
    at_impact = np.eye(24) - np.outer(F_before, Dg) / u_n
    movable = [12 * side + i for side, body in enumerate(bodies) if body.is_movable() for i in range(12)]
    return LinearisedImpact(request, derivatives, matrix, by_normal, at_impact, motion, movable)


def _differentiate_by_unit_normal(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, names: Iterable[str]
) -> Derivatives:
    """Differentiate an impact, by the unit normal in place of the normal as it is given.

    The unit normal is rounded, which may decide whether bodies that just graze approach. So the normal keeps
    its digits: a power of two brings it near length 1.
    """
    exponent = math.frexp(max(map(abs, contact.normal)))[1]
    near_unit = Vec3(*(math.ldexp(x, -exponent) for x in contact.normal))
    found = differentiate(body_a, body_b, contact._replace(normal=near_unit), model, names)
    found.jacobian[:, found.columns["contact.normal"]] *= math.hypot(*near_unit)
    return found


def _normal_velocity_of_surfaces(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Return the normal velocity at the contact, with all rotation.

    It is computed in fractions, because surfaces that just graze have none.

    Raises:
        ImpactError: OUT_OF_RANGE if it is beyond float64.
    """
    exact, bodies = contact_as_fractions(contact), map(body_as_fractions, (body_a, body_b))
    a, b = (body.velocity + body.angular_velocity.cross(exact.position - body.position) for body in bodies)
    try:
        return float(exact.normal.dot(a - b)) / math.hypot(*contact.normal)
    except OverflowError:
        reason = "a number is beyond float64: the surfaces move too fast"
        raise ImpactError(StatusCode.OUT_OF_RANGE, "matrix", reason) from None


def check_finite(name: str, array: Array, cause: str) -> None:
    """Check that all numbers are finite.

    Raises:
        ImpactError: OUT_OF_RANGE if one is not, with the ``cause``.
    """
    if not np.isfinite(array).all():
        raise ImpactError(StatusCode.OUT_OF_RANGE, name, f"a number is beyond float64: {cause}")


def as_finite_array(value: Any, shape: tuple[int, ...]) -> Array | None:
    """Return ``value`` as a float64 array, or ``None`` if it is not finite real numbers of this shape."""
    try:
        if np.ma.is_masked(value) or np.asarray(value).dtype.kind not in "biufO":
            return None
        array = np.asarray(value, float)
    except (OverflowError, TypeError, ValueError):
        return None
    return array if array.shape == shape and np.isfinite(array).all() else None


def _surface_motion(
    surfaces: Surfaces | SurfaceMotion | None, body_a: Body, body_b: Body, contact: Contact
) -> SurfaceMotion:
    """Return the motion that ``surfaces`` gives, checked."""
    given: object = surfaces
    if given is sphere_on_plane or given is sphere_on_sphere:
        raise TypeError("surfaces: must be what sphere_on_plane(radius) or sphere_on_sphere(...) returns")
    motion = surfaces(body_a, body_b, contact) if callable(surfaces) else surfaces
    if motion is None:
        reason = (
            "is missing: it says how contact point and normal move with the poses, dC/dq and dn/dq; "
            "see collision_response.derivatives.surfaces"
        )
        raise ImpactError(StatusCode.INVALID_NORMAL, "surfaces", reason)
    return SurfaceMotion(
        _part_of_motion(motion, "position", (3, 12)),
        _part_of_motion(motion, "normal", (3, 12)),
        _part_of_motion(motion, "position_by_normal", (3, 3)),
    )


def _part_of_motion(motion: SurfaceMotion, name: str, shape: tuple[int, int]) -> Array:
    array = as_finite_array(getattr(motion, name, None), shape)
    if array is None:
        reason = f"must be finite numbers of shape {shape}"
        raise ImpactError(StatusCode.INVALID_NORMAL, f"surfaces.{name}", reason)
    return array


def _free_flight_rate(body: Body, gravity: Vec3) -> Array:
    """Rate of the state of a body in free flight, shape ``(12,)``."""
    v, w = np.array(body.velocity), np.array(body.angular_velocity)
    if not body.is_movable():
        return np.concatenate([v, w, np.zeros(6)])
    R = np.array(body.rotation()[:3])
    inertia: Array = np.array(body.inertia.rows())
    w_body = R.T @ w
    angular = R @ np.linalg.lstsq(inertia, -np.cross(w_body, inertia @ w_body), rcond=None)[0]
    c = com_in_world_axes(body)
    linear = np.array(gravity, float) - np.cross(angular, c) - np.cross(w, np.cross(w, c))
    return np.concatenate([v, w, linear, angular])
