"""The covariance of the state of two bodies after an impact, from the covariance before it.

To first order and at one time, with the saltation matrix ``Xi``, and the derivatives ``J`` of the state after
the impact by restitution, friction and normal:

    S+ = Xi S Xi^T + J diag(sd^2) J^T

This holds as long as all likely impacts have the same regime and no jump is between them. To find out, points
within two standard deviations are tried: along each source of uncertainty, and in the directions in which the
friction used, the slip after the impact, the slip before it and the approach change most. If two of them
slide in opposite directions, one that sticks is between them, however few of them there are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..answer import Impact
from ..arguments import check_number
from ..batch.arrays import Array, compared_by_identity
from ..body_numbers import orientation_of
from ..model import DEFAULT, Adjustment, ImpactModel
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law, Regime
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .saltation import (
    COEFFICIENTS,
    POSES,
    STANDARD_GRAVITY,
    TWISTS,
    LinearisedImpact,
    as_finite_array,
    check_finite,
    linearise,
)
from .surfaces import SurfaceMotion, Surfaces, unit_normal

LIKELY_DEVIATIONS = 2.0, 1.0, 0.5
"""Numbers of standard deviations at which impacts are tried. Within the first of them, all must have the same
regime."""

AT_LIMIT = 1e-9
"""Friction that is below its limit by a smaller part is at the limit: the contact slips all the time."""

ASYMMETRY = 1e-12
"""What rounding may do to a matrix of correlations, for each of its rows."""


@compared_by_identity
class CovarianceAfter(NamedTuple):
    """The covariance after an impact, and whether to trust it.

    Attributes:
        covariance: of the state after the impact; its shape is that of the covariance before.
        regimes: all regimes found within two standard deviations; the first is that of the mean state.
        is_reliable: ``False`` if ``regimes`` has separating and another one; if a contact with friction both
            sticks and slips, which for COMPLIANT means that it sticks for a while, and slips throughout; if
            the contact may slide to either side; if a derivative that was used is at a kink or a jump; or if
            there is a jump within two standard deviations, at ``restitution_threshold`` or where MOREAU falls
            back.
    """

    covariance: Array
    regimes: tuple[Regime, ...]
    is_reliable: bool


class _Behaviour(NamedTuple):
    """What sets impacts apart: the regime, whether it slips, the friction, and the sides of the jumps."""

    regime: Regime
    slips: bool
    friction: Vec3
    is_slow: bool
    falls_back: bool


@np.errstate(over="ignore", under="ignore", invalid="ignore")
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
    gravity: Iterable[float] = STANDARD_GRAVITY,
) -> CovarianceAfter:
    """Return the covariance of the state after an impact, at the time of the impact of the mean state.

    Args:
        body_a, body_b, contact, model, surfaces, gravity: as for
            :func:`~collision_response.derivatives.saltation_matrix`; the bodies have their mean states.
        covariance: of ``(dx, dtheta, dv, dw)`` before the impact, of shape ``(12, 12)`` if one body is
            movable, ``(24, 24)`` if both are. Required.
        restitution_sd, friction_sd: standard deviations of the coefficients, >= 0.
        normal_sd: standard deviation of the rotation of the normal about each axis perpendicular to it [rad],
            >= 0.

    Raises:
        ImpactError: as ``saltation_matrix``, or with the status INVALID_TABLE if ``covariance`` is not a
            symmetric positive semi-definite matrix of this shape, INVALID_COEFFICIENT if a standard deviation
            is negative or not finite.
        TypeError: as ``saltation_matrix``, or if a standard deviation is not a real number.
    """
    linearised = linearise(body_a, body_b, contact, model, surfaces, gravity)
    given = {"restitution_sd": restitution_sd, "friction_sd": friction_sd, "normal_sd": normal_sd}
    invalid = StatusCode.INVALID_COEFFICIENT
    deviations = [check_number(name, sd, 0, math.inf, invalid, invalid) for name, sd in given.items()]
    restitution_sd, friction_sd, normal_sd = deviations
    movable = linearised.movable
    root = _square_root(covariance, len(movable))
    by_coefficients = np.zeros((24, 2))
    J, columns = linearised.derivatives.jacobian, linearised.derivatives.columns
    by_coefficients[TWISTS] = np.hstack([J[:12, columns[name]] for name in COEFFICIENTS])
    from_state = linearised.matrix[:, movable] @ root
    from_coefficients = by_coefficients * [restitution_sd, friction_sd]
    root_after = np.hstack([from_state, from_coefficients, linearised.by_normal * normal_sd])[movable]
    after = root_after @ root_after.T
    check_finite("covariance", after, "the bodies approach too slowly, or a standard deviation is too large")
    likely = [_behaviour(linearised.derivatives.impact, model)]
    likely += (_behaviour_at(linearised, change) for change in _likely_changes(linearised, root, deviations))
    regimes = tuple(dict.fromkeys(one.regime for one in likely))
    is_smooth = not linearised.derivatives.smoothness[_varying(linearised, root, deviations)].any()
    is_reliable = is_smooth and _behave_alike(likely, contact, restitution_sd, friction_sd)
    return CovarianceAfter(after, regimes, is_reliable)


def _behave_alike(
    likely: Sequence[_Behaviour], contact: Contact, restitution_sd: float, friction_sd: float
) -> bool:
    """Whether all likely impacts behave alike, and no jump is between them."""
    colliding = [one for one in likely if one.regime is not Regime.SEPARATING]
    has_friction = contact.friction > 0 or friction_sd > 0  # if not, a contact that sticks just does not slip
    may_stick = has_friction and len({one.slips for one in colliding}) > 1
    may_slide_back = has_friction and _slides_back(likely)
    may_jump = _has_jump(colliding, has_restitution=contact.restitution > 0 or restitution_sd > 0)
    return len(colliding) in (0, len(likely)) and not (may_stick or may_slide_back or may_jump)


def _varying(linearised: LinearisedImpact, root: Array, deviations: Sequence[float]) -> Array:
    """Say which inputs of the impact vary, in the order of the columns of its derivatives."""
    motion, n = linearised.motion, unit_normal(linearised.request[2])
    restitution_sd, friction_sd, normal_sd = deviations
    state = linearised.at_impact[:, linearised.movable] @ root
    tilt = (np.eye(3) - np.outer(n, n)) * normal_sd
    normal = np.hstack([motion.normal @ state[POSES], tilt])
    point = np.hstack([motion.position @ state[POSES], motion.position_by_normal @ tilt])
    inputs = (*state, *point, *normal, [restitution_sd], [friction_sd])
    return np.array([np.any(changes) for changes in inputs])


def _slides_back(likely: Sequence[_Behaviour]) -> bool:
    """Whether the mean impact slides, and another one slides in the opposite direction."""
    mean, *others = likely
    return mean.regime is Regime.SLIDING and any(
        one.regime is Regime.SLIDING and mean.friction.dot(one.friction) < 0 for one in others
    )


def _has_jump(colliding: Sequence[_Behaviour], *, has_restitution: bool) -> bool:
    """Whether colliding impacts lie on both sides of a jump."""
    is_slow, falls_back = {one.is_slow for one in colliding}, {one.falls_back for one in colliding}
    return len(falls_back) > 1 or (has_restitution and len(is_slow) > 1)


def _square_root(covariance: Array | None, size: int) -> Array:
    """Return a matrix ``L`` with ``L L^T`` equal to the covariance, which is checked."""
    S = as_finite_array(covariance, (size, size))
    if S is None:
        raise ImpactError(
            StatusCode.INVALID_TABLE, "covariance", f"must be finite numbers of shape ({size}, {size})"
        )
    sd = np.sqrt(np.abs(np.diag(S)))
    is_certain = sd == 0
    scale = np.where(is_certain, 1.0, sd)  # the entries have different units
    values, axes = np.linalg.eigh(S / np.outer(scale, scale))
    rounding = ASYMMETRY * size
    asymmetry = np.abs((S - S.T) / np.outer(scale, scale)).max()
    do_certain_vary = S[is_certain].any() or S[:, is_certain].any()
    if do_certain_vary or asymmetry > rounding or values.min() < -rounding * max(values.max(), 1.0):
        raise ImpactError(
            StatusCode.INVALID_TABLE, "covariance", "must be symmetric and positive semi-definite"
        )
    return sd[:, None] * axes * np.sqrt(np.maximum(values, 0.0))


def _likely_changes(
    linearised: LinearisedImpact, root: Array, deviations: Sequence[float]
) -> Iterator[Array]:
    """Yield changes of the state, restitution, friction and normal within two standard deviations."""
    (body_a, body_b, contact, _), derivatives = linearised[:2]
    impact, J, columns = derivatives.impact, derivatives.jacobian, derivatives.columns
    restitution_sd, friction_sd, normal_sd = deviations
    size = root.shape[0]
    n = unit_normal(contact)
    tilts = np.linalg.svd(n[None])[2][1:].T * normal_sd
    # Rows: state, restitution, friction, normal. One column for each independent source of uncertainty.
    spread = np.zeros((24 + 5, size + 4))
    spread[np.ix_(linearised.movable, range(size))] = root
    spread[24, size], spread[25, size + 1], spread[26:, size + 2 :] = restitution_sd, friction_sd, tilts

    # The derivatives of the twists after the impact and of the impulse, by the rows of `spread`.
    names = *COEFFICIENTS, "contact.normal"
    by_inputs = np.hstack([J[:, :24], *(J[:, columns[name]] for name in names)])
    # Only directions matter: no mass is too large.
    P = np.array(impact.impulse) / (math.hypot(*impact.impulse) or 1.0)
    P_by_inputs = by_inputs[12:] / (abs(by_inputs[12:]).max() or 1.0)
    tangential = np.eye(3) - np.outer(n, n)
    arms = [np.subtract(contact.position, body.position) for body in (body_a, body_b)]

    def relative_velocity(twists: Array) -> Array:
        """Relative velocity at the contact, for twists of both bodies: 12 numbers, or columns of 12."""
        v_a, w_a, v_b, w_b = twists[:3], twists[3:6], twists[6:9], twists[9:12]
        return np.asarray(v_a + np.cross(w_a, arms[0], axis=0) - v_b - np.cross(w_b, arms[1], axis=0))

    before_by_inputs = np.zeros((12, by_inputs.shape[1]))
    before_by_inputs[np.arange(12), TWISTS] = 1.0
    before = np.concatenate([[*b.velocity, *b.angular_velocity] for b in (body_a, body_b)])
    after = np.concatenate([[*t.linear, *t.angular] for t in (impact.twist_a, impact.twist_b)])
    u_before_by_inputs = relative_velocity(before_by_inputs)
    cone = contact.friction * n @ P_by_inputs
    steepest = [n @ u_before_by_inputs @ spread]
    for vector, by_input, limit in (
        (P, P_by_inputs, cone),
        (relative_velocity(after), relative_velocity(by_inputs[:12]), 0.0),
        (relative_velocity(before), u_before_by_inputs, 0.0),
    ):
        steepest.append((_normalised(tangential @ vector) @ by_input - limit) @ spread)
        # Where the vector is 0, its length grows most in the directions in which it varies most.
        steepest += [*np.linalg.svd(tangential @ by_input @ spread, full_matrices=False)[2][:2]]
    steepest = [_normalised(step) for step in steepest]
    for step in [*np.eye(spread.shape[1]), *steepest]:
        for deviation in LIKELY_DEVIATIONS:
            change = spread @ step * deviation
            if change.any():
                yield change
                yield -change


def _normalised(v: Array) -> Array:
    """Return the unit vector along ``v``, or ``v`` if it is zero."""
    length = np.linalg.norm(v)
    return v / length if length > 0 else v


def _behaviour(impact: Impact, model: ImpactModel) -> _Behaviour:
    is_slow = -impact.normal_velocity_before < model.restitution_threshold
    normal = Vec3(*unit_normal(impact.contact).tolist())
    P = impact.impulse / (math.hypot(*impact.impulse) or 1.0)  # products of small impulses would be 0
    friction = P - normal * normal.dot(P)
    slips = impact.regime is not Regime.STICKING
    if impact.model.law is Law.COMPLIANT:  # where a contact that sticks for a while may end in any regime
        slips = impact.tangential_impulse >= (1 - AT_LIMIT) * impact.contact.friction * impact.normal_impulse
    return _Behaviour(impact.regime, slips, friction, is_slow, Adjustment.LAW_FALLBACK in impact.adjustments)


def _behaviour_at(linearised: LinearisedImpact, change: Array) -> _Behaviour:
    """Return the behaviour after a change of the state (24 numbers), restitution, friction and normal (3)."""
    (body_a, body_b, contact, model), motion = linearised.request, linearised.motion
    changed_a, changed_b = _changed(body_a, change[:12]), _changed(body_b, change[12:24])
    poses, tilt = change[POSES], change[26:]
    point = np.array(contact.position) + motion.position @ poses + motion.position_by_normal @ tilt
    normal = unit_normal(contact) + motion.normal @ poses + tilt
    e, mu = contact.restitution + change[24], contact.friction + change[25]
    changed = contact._replace(
        position=Vec3(*point.tolist()),
        normal=Vec3(*normal.tolist()),
        restitution=min(max(float(e), 0.0), 1.0),
        friction=max(float(mu), 0.0),
    )
    return _behaviour(resolve(changed_a, changed_b, changed, model), model)


def _changed(body: Body, change: Array) -> Body:
    """Return the body with a small change ``(dx, dtheta, dv, dw)`` of its state."""
    if not change.any():
        return body
    dx, theta, dv, dw = (Vec3(*part.tolist()) for part in np.split(change, 4))
    half = theta * 0.5
    q = orientation_of(body)
    v = Vec3(*q[:3])
    x, y, z = v + half * q.w + half.cross(v)
    return body._replace(
        position=body.position + dx,
        orientation=Quaternion(x, y, z, q.w - half.dot(v)),
        velocity=body.velocity + dv,
        angular_velocity=body.angular_velocity + dw,
    )
