"""EXTENDED for the contacts of a batch that need it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model import Geometry, ImpactModel, Precision
from ..numerics import extended
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.tensor import ZERO_TENSOR
from ..physics.vector import ZERO, Vec3
from ..report import Impact
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from .backends import Arrays, Backend, column_blocks, prepare, programs_for
from .doubled import ULP
from .kernels import MOTION
from .problem import Arithmetic, Problem
from .rows import BodyRows, ContactRows, body_rows, contact_rows

Array = np.ndarray[Any, Any]

MANY = 2000
"""From so many contacts on it pays to get the double-double program ready; one alone takes 0.4 ms."""

CHUNK = 8192
"""Contacts at once of that program."""

FLOAT64 = np.dtype(np.float64)
ANSWERABLE = (StatusCode.OK, StatusCode.SEPARATING, StatusCode.OUT_OF_RANGE)
"""What sound numbers come to. With more digits it may be another of these."""


def unsure(arrays: Arrays, limit: float) -> Array:
    """The columns of the sound contacts whose error bound is not below a limit."""
    return np.flatnonzero(np.isin(arrays["status"][0], ANSWERABLE) & ~(arrays["error_bound"][0] <= limit))


def make_exact(
    arrays: Arrays, columns: Array, problem: Problem, model: ImpactModel, backend: Backend
) -> None:
    """Compute these contacts to within one unit in the last place.

    Args:
        arrays: of the batch, float64, with error bounds.
        columns: of the contacts.
        problem: of the batch.
        model: every AUTO decided.
        backend: for the double-double program.
    """
    if not pays_in_double_double(columns.size):
        _one_by_one(arrays, columns, model)
        return
    program = programs_for(problem._replace(arithmetic=Arithmetic.DOUBLED), FLOAT64)[1]
    for few in column_blocks(arrays, columns, program, CHUNK):
        make_all_exact(few, problem, model, backend)


def make_all_exact(arrays: Arrays, problem: Problem, model: ImpactModel, backend: Backend) -> None:
    """The same, for the whole batch: by the double-double program, and what that cannot, one by one."""
    prepare(backend, problem._replace(arithmetic=Arithmetic.DOUBLED), FLOAT64).run(arrays)
    if extended.AVAILABLE:
        _one_by_one(arrays, unsure(arrays, ULP), model)


def pays_in_double_double(count: int) -> bool:
    """Whether to get the double-double program ready for so many contacts."""
    return count >= MANY or not extended.AVAILABLE


def _one_by_one(arrays: Arrays, columns: Array, model: ImpactModel) -> None:
    """The same, each contact with as many digits as it takes."""
    model = model._replace(precision=Precision.EXTENDED, tolerance=0.0)
    at = contact_rows(model.geometry)
    plain = body_rows(model.geometry)
    of = plain if arrays["bodies"].shape[0] == plain.height else body_rows(model.geometry, oriented=True)
    for i in columns.tolist():
        bodies, contact = arrays["bodies"][..., i], arrays["contacts"][:, i]
        try:
            if contact.size > at.height:
                model = model._replace(tangential_restitution=float(contact[at.height]))
            impact = resolve(_body(of, bodies[:, 0]), _body(of, bodies[:, 1]), _contact(at, contact), model)
        except ImpactError as error:
            _write(arrays, i, error.code, math.nan, dict.fromkeys(MOTION, math.nan))
        else:
            _write(arrays, i, impact.status, impact.error_bound, _motion(impact, model.geometry))


def _motion(impact: Impact, geometry: Geometry) -> dict[str, Array]:
    """The results of a contact, as the arrays hold them."""
    of = body_rows(geometry)
    axes, turns = of.velocity.stop - of.velocity.start, of.angular_velocity.stop - of.angular_velocity.start
    twists = impact.twist_a, impact.twist_b
    return {
        "velocity": np.array([twist.linear[:axes] for twist in twists]).T,
        "angular_velocity": np.array([twist.angular[3 - turns :] for twist in twists]).T,
        "impulse": np.array(impact.impulse[:axes]),
    }


def _write(arrays: Arrays, i: int, status: StatusCode, error_bound: float, motion: dict[str, Any]) -> None:
    arrays["status"][0, i], arrays["error_bound"][0, i] = status, error_bound
    for name in MOTION:
        if name in arrays:
            arrays[name][..., i] = motion[name]


def _body(of: BodyRows, column: Array) -> Body:
    position, velocity = _vector(column[of.position]), _vector(column[of.velocity])
    turning = column[of.angular_velocity].tolist()
    spin = Vec3(*ZERO[len(turning) :], *turning)
    mass, inertia = float(column[of.mass][0]), column[of.inertia].tolist()
    if mass == math.inf:
        return Body.kinematic(position, velocity, spin)
    if len(inertia) < 6:  # of a flat body, about z alone
        zz = sum(inertia)
        inertia = ZERO_TENSOR._replace(xx=zz / 2, yy=zz / 2, zz=zz)
    orientation = column[of.orientation].tolist() or None
    return Body.dynamic(mass, inertia, position, orientation, velocity, spin)


def _contact(at: ContactRows, column: Array) -> Contact:
    friction = column[at.friction].tolist()
    return Contact(
        _vector(column[at.position]),
        _vector(column[at.normal]),
        float(column[at.restitution][0]),
        friction[0] if friction else 0.0,
    )


def _vector(components: Array) -> Vec3:
    return Vec3(*components.tolist(), *ZERO[len(components) :])
