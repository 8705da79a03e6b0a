"""The few contacts of a batch that need more than the kernels give: each by the front door for one impact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..answer import Impact
from ..model import Precision
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.tensor import ZERO_TENSOR
from ..physics.vector import ZERO, Vec3
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .rows import BodyRows, ContactRows, body_rows, contact_rows

if TYPE_CHECKING:
    from .resolve_batch import Asked, BatchResult, Plan

Array = np.ndarray[Any, Any]

REPORT = (
    "regime",
    "kinetic_energy_before",
    "kinetic_energy_after",
    "energy_lost_restitution",
    "energy_lost_friction",
)


def retry(asked: Asked, out: BatchResult, columns: Array) -> Iterator[None]:
    """Answer some columns anew, with as many digits as it takes; a pause after each."""
    plan, bodies, _, contacts = asked
    model = plan.model
    if out.velocity.dtype == np.float32:
        model = model._replace(precision=Precision.SINGLE)
    rows, touch = body_rows(model.geometry, oriented=plan.oriented), contact_rows(model.geometry)
    for k, i in enumerate(columns.tolist()):
        contact = contacts[:, k]
        own = model
        if contact.size > touch.height:
            own = model._replace(tangential_restitution=float(contact[touch.height]))
        try:
            impact = resolve(
                body_of(rows, bodies[:, 0, k]),
                body_of(rows, bodies[:, 1, k]),
                contact_of(touch, contact),
                own,
            )
        except ImpactError as error:
            _refuse(out, i, error.code)
        else:
            _write(plan, out, i, impact)
        yield


def _write(plan: Plan, out: BatchResult, i: int, impact: Impact) -> None:
    twists = impact.twist_a, impact.twist_b
    axes, spins = plan.axes, plan.spins
    out.velocity[..., i] = np.array([twist.linear[:axes] for twist in twists]).T
    out.angular_velocity[..., i] = np.array([twist.angular[3 - spins :] for twist in twists]).T
    out.impulse[..., i] = impact.impulse[:axes]
    out.status[i] = impact.status
    for field in REPORT if out.regime is not None else ():
        getattr(out, field)[i] = getattr(impact, field)
    if out.precision is None:
        if impact.status is StatusCode.TOLERANCE_NOT_MET:  # of which this batch knows nothing
            separating = impact.regime == impact.regime.SEPARATING
            out.status[i] = StatusCode.SEPARATING if separating else StatusCode.OK
    else:
        out.error_bound[i], out.precision[i] = impact.error_bound, impact.model.precision


def _refuse(out: BatchResult, i: int, code: StatusCode) -> None:
    for array in out:
        if array is not None:
            array[..., i] = math.nan if array.dtype.kind == "f" else 0
    out.status[i] = code


def body_of(rows: BodyRows, column: Array) -> Body:
    """The body of a column."""
    turning = column[rows.angular_velocity].tolist()
    inertia = column[rows.inertia].tolist()
    if len(inertia) == 1:  # about z, the only one that matters
        inertia = ZERO_TENSOR._replace(xx=inertia[0], yy=inertia[0], zz=inertia[0])
    orientation = column[rows.orientation].tolist() or None
    return Body.dynamic(
        float(column[rows.mass][0]),
        inertia or ZERO_TENSOR,
        _vector(column[rows.position]),
        orientation,
        _vector(column[rows.velocity]),
        Vec3(*ZERO[len(turning) :], *turning),
    )


def contact_of(rows: ContactRows, column: Array) -> Contact:
    """The contact of a column."""
    friction = column[rows.friction].tolist()
    return Contact(
        _vector(column[rows.position]),
        _vector(column[rows.normal]),
        float(column[rows.restitution][0]),
        friction[0] if friction else 0.0,
    )


def _vector(components: Array) -> Vec3:
    return Vec3(*components.tolist(), *ZERO[len(components) :])
