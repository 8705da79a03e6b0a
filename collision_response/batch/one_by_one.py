"""The few contacts of a batch that the compiled functions cannot answer well enough: ``resolve`` does."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..answer import Impact
from ..kernels import library
from ..model import ImpactModel, Precision
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.tensor import ZERO_TENSOR, Symmetric3
from ..physics.vector import ZERO, Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .arrays import Array
from .plan import BatchRequest
from .result import REPORT, REPORTED_ADJUSTMENTS, BatchResult
from .rows import BodyRows, ContactRows


def resolve_one_by_one(request: BatchRequest, out: BatchResult, columns: Array) -> Iterator[None]:
    """Resolve the contacts of ``request``, with as many digits as it takes; pause after each.

    The results are written to these ``columns`` of ``out``.
    """
    plan, bodies, _, contacts = request
    model, rows, contact_rows = plan.model, plan.layout.bodies, plan.layout.contacts
    resolve_one = _resolve_in_single if out.velocity.dtype == np.float32 else resolve
    for k, i in enumerate(columns.tolist()):
        body_a, body_b = (body_of(rows, bodies[:, side, k]) for side in (0, 1))
        contact, own_model = contacts[:, k], model
        if contact.size > contact_rows.height:
            own_model = model._replace(
                tangential_restitution=float(contact[contact_rows.tangential_restitution])
            )
        try:
            _write_impact(out, i, resolve_one(body_a, body_b, contact_of(contact_rows, contact), own_model))
        except ImpactError as error:
            _write_refusal(out, i, error.code)
        yield


def _resolve_in_single(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """Resolve in SINGLE. Where that leaves no digit, as for a rod whose tensor SINGLE rounds, in AUTO."""
    try:
        impact = resolve(body_a, body_b, contact, model._replace(precision=Precision.SINGLE))
    except ImpactError:
        impact = None
    if impact is None or impact.status is StatusCode.TOLERANCE_NOT_MET:
        return resolve(body_a, body_b, contact, model._replace(precision=Precision.AUTO))
    return impact


@np.errstate(over="ignore")
def _write_impact(out: BatchResult, i: int, impact: Impact) -> None:
    twists = impact.twist_a, impact.twist_b
    linear, angular = len(out.velocity), len(out.angular_velocity)
    out.velocity[..., i] = np.array([twist.linear[:linear] for twist in twists]).T
    out.angular_velocity[..., i] = np.array([twist.angular[3 - angular :] for twist in twists]).T
    out.impulse[..., i] = impact.impulse[:linear]
    out.status[i] = impact.status
    report = REPORT if out.regime is not None else ()
    for field in report:
        getattr(out, field)[i] = getattr(impact, field)
    if report:
        out.adjustments[i] = impact.adjustments & REPORTED_ADJUSTMENTS
    written = [*out[:3], *(getattr(out, field) for field in report)]
    if not all(np.isfinite(array[..., i]).all() for array in written):  # beyond float32
        raise library.refusal(StatusCode.OUT_OF_RANGE)
    if out.precision is not None:
        out.error_bound[i], out.precision[i] = impact.error_bound, impact.model.precision


def _write_refusal(out: BatchResult, i: int, code: StatusCode) -> None:
    for array in out:
        if array is not None:
            array[..., i] = math.nan if array.dtype.kind == "f" else 0
    out.status[i] = code


def body_of(rows: BodyRows, column: Array) -> Body:
    """Return the body in a column of a table."""
    angular_velocity = column[rows.angular_velocity].tolist()
    inertia = column[rows.inertia].tolist()
    if len(inertia) == 1:  # only the moment of inertia about z matters
        inertia = ZERO_TENSOR._replace(xx=inertia[0], yy=inertia[0], zz=inertia[0])
    elif inertia and column.dtype == np.float32:
        inertia = _without_rounding(Symmetric3(*column[rows.inertia]))
    orientation = column[rows.orientation].tolist() or None
    return Body.dynamic(
        float(column[rows.mass][0]),
        inertia or ZERO_TENSOR,
        _vector(column[rows.position]),
        orientation,
        _vector(column[rows.velocity]),
        Vec3(*ZERO[len(angular_velocity) :], *angular_velocity),
    )


def _without_rounding(inertia: Symmetric3) -> Symmetric3:
    """Return a tensor of float32 numbers as float64, whose formulas would take its rounding for inertia.

    Of the second moments of mass, whose matrix is ``S = tr(I)/2 1 - I``, a thin rod has one, and none is
    negative. A moment ``s`` along ``a`` adds ``s (a.a 1 - a a^T)`` to ``I``.
    """
    full: Array = np.array(inertia.rows(), float)
    moments, axes = np.linalg.eigh(np.eye(3) * full.trace() / 2 - full)
    exact = np.maximum(moments, 0.0)
    if not Body.dynamic(np.float32(1), inertia).inverse_tensor().has_factors:
        exact[:2] = 0.0
    if (exact != moments).any():
        arms = [np.cross(np.eye(3, dtype=np.longdouble), axis) for axis in axes.T]
        full = sum(s * (arm @ arm.T) for s, arm in zip(exact, arms, strict=True)).astype(float)
    return Symmetric3.of(full.tolist())


def contact_of(rows: ContactRows, column: Array) -> Contact:
    """Return the contact in a column of a table."""
    friction = column[rows.friction].tolist()
    return Contact(
        _vector(column[rows.position]),
        _vector(column[rows.normal]),
        float(column[rows.restitution][0]),
        friction[0] if friction else 0.0,
    )


def _vector(components: Array) -> Vec3:
    return Vec3(*components.tolist(), *ZERO[len(components) :])
