"""What is known of the bodies after an impact, given what was known before.

To first order, at one time: with the saltation matrix ``Xi``, and the derivatives of the state after by
restitution, friction and normal,

    S+ = Xi S Xi^T + J diag(sd^2) J^T

That holds as long as the impact does the same for all that is likely. Whether friction may stick as well as
slip is found by trying: points at two standard deviations, along the axes of what is uncertain and where the
friction used, the slip that is left and the slip at first change most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..body_conversions import IDENTITY_QUATERNION
from ..model import DEFAULT, ImpactModel, check_number
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .saltation import (
    POSES,
    STANDARD_GRAVITY,
    TWISTS,
    Passage,
    finite,
    finite_numbers,
    linearised,
    may_be_off,
)
from .surfaces import SurfaceMotion, Surfaces, unit_normal

Array = np.ndarray[Any, Any]

LIKELY = 2.0
"""Standard deviations within which the regime must be one for the first order to be believed."""


class CovarianceAfter(NamedTuple):
    """What is known after an impact.

    Attributes:
        covariance: of the state after, of the shape of that before.
        regimes: all that were met within two standard deviations; the first is that of the mean.
        is_reliable: whether sticking and slipping are not both among them, nor separating with any, and the
            mean lies on no kink or jump.
    """

    covariance: Array
    regimes: tuple[Regime, ...]
    is_reliable: bool


def propagate_covariance(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel = DEFAULT,
    covariance: Array | None = None,
    surfaces: Surfaces | SurfaceMotion | None = None,
    *,
    restitution_sd: float = 0.0,
    friction_sd: float = 0.0,
    normal_sd: float = 0.0,
    gravity: Sequence[float] = STANDARD_GRAVITY,
) -> CovarianceAfter:
    """The covariance of a state after an impact, at the time at which the mean state has it.

    Args:
        body_a, body_b, contact, model, surfaces, gravity: as for
            :func:`~collision_response.derivatives.saltation_matrix`; the bodies have their mean states.
        covariance: of ``(dx, dtheta, dv, dw)`` before the impact: shape ``(12, 12)`` with one body that can
            move, ``(24, 24)`` with two.
        restitution_sd, friction_sd: standard deviations of the coefficients.
        normal_sd: of the turn of the normal about each axis across it [rad].

    Raises:
        ImpactError: as ``saltation_matrix``; INVALID_TABLE: ``covariance`` is not of numbers, symmetric,
            positive semi-definite and of its shape; INVALID_COEFFICIENT: a standard deviation is negative or
            infinite.
        TypeError: a standard deviation is no real number.
    """
    passage = linearised(body_a, body_b, contact, model, surfaces, gravity)
    restitution_sd = _deviation("restitution_sd", restitution_sd)
    friction_sd = _deviation("friction_sd", friction_sd)
    normal_sd = _deviation("normal_sd", normal_sd)
    kept = passage.kept
    root = _root(covariance, len(kept))
    by_coefficients = np.zeros((24, 2))
    J, columns = passage.derivatives.jacobian, passage.derivatives.columns
    for i, name in enumerate(("contact.restitution", "contact.friction")):
        by_coefficients[TWISTS, i] = J[:12, columns[name]][:, 0]
    of_coefficients = by_coefficients * [restitution_sd, friction_sd]
    with np.errstate(over="ignore", invalid="ignore"):
        by_state = passage.matrix[:, kept] @ root
        spread = np.hstack([by_state, of_coefficients, passage.by_normal * normal_sd])[kept]
        after = finite("covariance", spread @ spread.T)
    found = list(
        _regimes(passage, body_a, body_b, contact, model, root, (restitution_sd, friction_sd, normal_sd))
    )
    regimes = tuple(dict.fromkeys(found))
    sticking, separating = Regime.STICKING in regimes, Regime.SEPARATING in regimes
    is_reliable = len(regimes) == 1 or not (sticking or separating)
    return CovarianceAfter(after, regimes, is_reliable and not may_be_off(passage.derivatives))


def _deviation(name: str, sd: Any) -> float:
    """Raises: ImpactError: INVALID_COEFFICIENT. TypeError: no real number."""
    invalid = StatusCode.INVALID_COEFFICIENT
    check_number(name, sd, 0, math.inf, invalid, not_finite=invalid)
    return float(sd)


def _root(covariance: Array | None, size: int) -> Array:
    """A square root of the covariance."""
    S = finite_numbers(covariance, (size, size))
    problem = f"must be a covariance of shape ({size}, {size})"
    if S is None:
        raise ImpactError(StatusCode.INVALID_TABLE, "covariance", f"{problem}, is {covariance}")
    sd = np.sqrt(np.abs(np.diag(S)))
    scale = np.where(sd > 0, sd, 1.0)  # its units mix
    values, axes = np.linalg.eigh(S / np.outer(scale, scale))
    rounding = 1e-12 * size
    asymmetry = np.abs((S - S.T) / np.outer(scale, scale)).max()
    if asymmetry > rounding or values.min() < -rounding * max(values.max(), 1.0):
        raise ImpactError(
            StatusCode.INVALID_TABLE, "covariance", f"{problem}, symmetric and positive semi-definite"
        )
    root: Array = scale[:, None] * axes * np.sqrt(np.maximum(values, 0.0))
    return root


def _regimes(
    passage: Passage,
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel,
    root: Array,
    deviations: tuple[float, float, float],
) -> Iterator[Regime]:
    """Of the mean, and of what lies two standard deviations from it."""
    impact, derivatives = passage.derivatives.impact, passage.derivatives
    yield impact.regime
    e_sd, mu_sd, n_sd = deviations
    size = root.shape[0]
    n = unit_normal(contact)
    across = np.linalg.svd(n[None])[2][1:].T * n_sd
    # One column for each independent standard deviation: the state, e, mu, the normal.
    space = np.zeros((24 + 5, size + 4))
    space[np.ix_(passage.kept, range(size))] = root
    space[24, size], space[25, size + 1], space[26:, size + 2 :] = e_sd, mu_sd, across

    by = np.hstack(
        [derivatives.jacobian[:, :24], derivatives.jacobian[:, derivatives.columns["contact.restitution"]],
         derivatives.jacobian[:, derivatives.columns["contact.friction"]],
         derivatives.jacobian[:, derivatives.columns["contact.normal"]]]
    )  # fmt: skip
    P, mu = np.array(impact.impulse), contact.friction
    tangent = np.eye(3) - np.outer(n, n)
    arms = [np.subtract(contact.position, body.position) for body in (body_a, body_b)]

    def slip_of(twists: Array) -> Array:
        """Of twists of both bodies, 12 numbers or columns of them."""
        v_a, w_a, v_b, w_b = twists[:3], twists[3:6], twists[6:9], twists[9:12]
        u = v_a + np.cross(w_a, arms[0], axis=0) - v_b - np.cross(w_b, arms[1], axis=0)
        return tangent @ u

    twists_before = np.zeros((12, by.shape[1]))
    twists_before[np.arange(12), TWISTS] = 1.0
    before = np.concatenate([[*b.velocity, *b.angular_velocity] for b in (body_a, body_b)])
    after = np.concatenate([[*t.linear, *t.angular] for t in (impact.twist_a, impact.twist_b)])
    friction = tangent @ P
    gradients = [
        _along(friction) @ by[12:] - mu * n @ by[12:],
        _along(slip_of(after)) @ slip_of(by[:12]),
        _along(slip_of(before)) @ slip_of(twists_before),
    ]
    steepest = [gradient @ space for gradient in gradients]
    unit = [g / np.linalg.norm(g) for g in steepest if np.linalg.norm(g) > 0]
    for step in [*np.eye(space.shape[1]), *unit]:
        for sign in (LIKELY, -LIKELY):
            shift = space @ step * sign
            if shift.any():
                yield _regime_at(body_a, body_b, contact, model, passage.motion, shift)


def _along(v: Array) -> Array:
    size = np.linalg.norm(v)
    return v / size if size > 0 else v


def _regime_at(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, motion: SurfaceMotion, shift: Array
) -> Regime:
    moved_a, moved_b = (
        _moved(body, shift[12 * side : 12 * side + 12]) for side, body in enumerate((body_a, body_b))
    )
    poses, tilt = shift[POSES], shift[26:]
    point = np.array(contact.position) + motion.position @ poses + motion.position_by_normal @ tilt
    normal = unit_normal(contact) + motion.normal @ poses + tilt
    e, mu = contact.restitution + shift[24], contact.friction + shift[25]
    moved = Contact.of(point.tolist(), normal.tolist(), min(max(float(e), 0.0), 1.0), max(float(mu), 0.0))
    return resolve(moved_a, moved_b, moved, model).regime


def _moved(body: Body, shift: Array) -> Body:
    if not shift.any():
        return body
    dx, theta, dv, dw = (Vec3(*part.tolist()) for part in np.split(shift, 4))
    half = theta * 0.5
    q = body.orientation or IDENTITY_QUATERNION
    v = Vec3(*q[:3])
    x, y, z = v + half * q.w + half.cross(v)
    turned = Quaternion(x, y, z, q.w - half.dot(v))
    return body._replace(
        position=Vec3(*body.position) + dx,
        orientation=turned,
        velocity=Vec3(*body.velocity) + dv,
        angular_velocity=Vec3(*body.angular_velocity) + dw,
    )
