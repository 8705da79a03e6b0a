"""What a batch computes, and how: decided by the model and by how many rows its tables have."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..kernels.protocol import NumberType
from ..model import Geometry, ImpactModel, ModelPlan, Precision, check_model, law_for, plan_model
from ..physics.laws import PATHS, STEPPED, Law
from ..status import ImpactError, StatusCode
from .arrays import Array, check_unmasked
from .result import BatchResult, is_bounded, result_fields
from .rows import TABLE_LAYOUTS, Layout

_PRECISIONS = {
    np.dtype(np.float32): (Precision.SINGLE,),
    np.dtype(np.float64): (Precision.DOUBLE, Precision.EXTENDED),
}


class BatchPlan(NamedTuple):
    """Everything about a batch that does not depend on its numbers, or on how many contacts there are.

    Attributes:
        layout: the layout of the tables.
        model: with the law and the geometry that are used.
        number_type, settings: the number type and the settings, as the kernels take them.
        model_plan: the plan of the model: which precisions to try, and the error bounds to reach.
    """

    layout: Layout
    model: ImpactModel
    number_type: NumberType
    settings: Array
    model_plan: ModelPlan

    def result_fields(self, n: int, report: bool) -> BatchResult:
        """Return the shape and type of each array of a result, in its place."""
        bounded, real = is_bounded(self.model), self.settings.dtype
        return result_fields(self.layout.bodies, n, bounded=bounded, report=report, real=real)


class BatchRequest(NamedTuple):
    """The input of a batch: see :func:`~collision_response.batch.resolve_batch`."""

    plan: BatchPlan
    bodies: Array
    pairs: Array | None
    contacts: Array

    @classmethod
    def of(cls, bodies: Array, contacts: Array, model: ImpactModel, pairs: Array | None) -> BatchRequest:
        """Return the request for these arrays. Raises: as ``resolve_batch``."""
        check_unmasked("bodies", bodies)
        check_unmasked("contacts", contacts)
        bodies, contacts = np.asarray(bodies), np.asarray(contacts)  # subclasses may lie about their shapes
        return cls(plan_for(bodies, contacts, model, pairs), bodies, pairs, contacts)

    def contiguous(self) -> BatchRequest:
        """Return the request with contiguous tables."""
        if self.bodies.flags.c_contiguous and self.contacts.flags.c_contiguous:
            return self
        bodies, contacts = np.ascontiguousarray(self.bodies), np.ascontiguousarray(self.contacts)
        return BatchRequest(self.plan, bodies, self.pairs, contacts)

    def select(self, columns: Array) -> BatchRequest:
        """Return the request for some contacts, each with its own copy of its two bodies."""
        at = columns if self.pairs is None else self.pairs.take(columns, 1)
        return BatchRequest(self.plan, self.bodies.take(at, -1), None, self.contacts.take(columns, -1))

    def part(self, out: BatchResult, start: int, stop: int) -> tuple[BatchRequest, BatchResult]:
        """Return the request for a range of contacts, and their part of ``out``, without copies."""
        own = slice(start, stop)
        bodies = self.bodies[..., own] if self.pairs is None else self.bodies
        pairs = None if self.pairs is None else self.pairs[:, own]
        request = BatchRequest(self.plan, bodies, pairs, self.contacts[:, own])
        return request, out.mapped(lambda array: array[..., own])


def plan_for(bodies: Array, contacts: Array, model: ImpactModel, pairs: Array | None) -> BatchPlan:
    """Return the plan for a batch with such tables. Raises: as ``resolve_batch``."""
    shape, n = bodies.shape, contacts.shape[-1] if contacts.ndim == 2 else -1
    if pairs is None:
        fits = len(shape) == 3 and shape[1:] == (2, n)
    else:
        fits = len(shape) == 2 and pairs.shape[1] == n
    key = shape[0] if fits else 0, contacts.shape[:1], bodies.dtype, contacts.dtype, id(model)
    model_and_plan = _recent_plans.get(key)
    if model_and_plan is None:
        _check_tables(bodies, contacts, pairs)
        plan = _plan(shape[0], contacts.shape[0], bodies.dtype, model)
        if not plan.model_plan.may_be_kept:
            return plan
        if len(_recent_plans) >= KEPT:
            _recent_plans.clear()
        model_and_plan = _recent_plans[key] = model, plan  # keeps the model alive, and so its id valid
    return model_and_plan[1]


KEPT = 64
"""Greatest number of plans to keep."""

_recent_plans: dict[tuple[Any, ...], tuple[ImpactModel, BatchPlan]] = {}
"""Recent plans, by the identity of the model: hashing a model takes as long as a hundred contacts."""


@np.errstate(over="ignore")  # a threshold beyond float32 is infinite
def _plan(rows: int, height: int, dtype: np.dtype[Any], model: ImpactModel) -> BatchPlan:
    layout = TABLE_LAYOUTS[rows]
    geometry, contact = layout.geometry, layout.contacts
    heights = contact.heights
    if height not in heights:
        raise ValueError(f"contacts: {geometry.name} has {heights[0]} to {heights[-1]} rows, not {height}")
    _check_model(model, geometry, dtype)
    law = law_for(model.law, has_friction=height >= contact.height)
    if law is not Law.FRICTIONLESS and height < contact.height:
        reason = f"is {law.name}, but contacts has no row of friction"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", reason)
    model_plan = plan_model(model)
    if law in STEPPED:
        model_plan = model_plan._replace(first_precision=Precision.DOUBLE, last_precision=Precision.DOUBLE)
    number_type = NumberType.FLOAT if dtype == np.float32 else NumberType.PLAIN
    if is_bounded(model):
        number_type = (
            NumberType.EXTENDED if model_plan.first_precision is Precision.EXTENDED else NumberType.BOUNDED
        )
    return BatchPlan(
        layout=layout,
        model=model._replace(law=law, geometry=geometry),
        number_type=number_type,
        settings=np.array(model_plan.settings, dtype),
        model_plan=model_plan,
    )


def _check_tables(bodies: Array, contacts: Array, pairs: Array | None) -> None:
    if bodies.dtype not in _PRECISIONS or contacts.dtype != bodies.dtype:
        raise ValueError(
            f"bodies, contacts: must both be float32 or float64; are {bodies.dtype}, {contacts.dtype}"
        )
    heights = " or ".join(map(str, TABLE_LAYOUTS))
    if pairs is not None:
        n, shape, fits = pairs.shape[1], f"({heights}, B)", bodies.ndim == 2
    else:
        n, shape = bodies.shape[-1] if bodies.ndim else 0, f"({heights}, 2, N)"
        fits = bodies.ndim == 3 and bodies.shape[1] == 2
    if not fits or bodies.shape[0] not in TABLE_LAYOUTS:
        hint = "; a table of bodies needs the argument pairs" if pairs is None and bodies.ndim == 2 else ""
        raise ValueError(f"bodies: must be of shape {shape}, is {bodies.shape}{hint}")
    if contacts.ndim != 2 or contacts.shape[1] != n:
        raise ValueError(f"contacts: must be of shape (rows, {n}), is {contacts.shape}")


def _check_model(model: ImpactModel, geometry: Geometry, dtype: np.dtype[Any]) -> None:
    check_model(model)
    allowed: dict[str, tuple[Any, ...]] = {
        "geometry": (Geometry.AUTO, geometry),
        "precision": (Precision.AUTO, *_PRECISIONS[dtype]),
    }
    if dtype == np.float32:
        allowed["tolerance"] = (0.0,)
        allowed["law"] = tuple(law for law in Law if law not in PATHS)
    for field, values in allowed.items():
        value = getattr(model, field)
        if value not in values:
            names = ", ".join(str(getattr(one, "name", one)) for one in values)
            reason = (
                f"must be {names} for a batch of {geometry.name} {dtype}; is {getattr(value, 'name', value)}"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, f"model.{field}", reason)
