"""Resolve many independent contacts at once: arrays in, arrays out.

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_batch
    >>> rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((rows.height, 2, 1)), np.zeros((contact.height, 1))
    >>> bodies[rows.mass] = [[1.0], [np.inf]]  # the second body is immovable
    >>> bodies[rows.velocity] = [[[0.0], [0.0]], [[0.0], [0.0]], [[-2.0], [0.0]]]
    >>> contacts[contact.normal] = [[0.0], [0.0], [1.0]]
    >>> contacts[contact.restitution] = 0.5
    >>> resolve_batch(bodies, contacts).velocity[2]
    array([[1.],
           [0.]])

The rows of ``bodies`` and ``contacts`` are listed in :mod:`~collision_response.batch.rows`. The numbers are
those of :func:`~collision_response.resolve`, to the bit. With a tolerance every contact gets an error bound,
and is computed again with more digits where ``resolve`` would do so. Without a tolerance there is no bound,
and AUTO precision stays in DOUBLE, even where ``resolve`` would notice that DOUBLE is not enough. A contact
that cannot be resolved gets its own status and NaN for results; it does not affect the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from numbers import Integral
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..kernels import library
from ..kernels.layout import Layout
from ..kernels.protocol import NumberType
from ..model import (
    DEFAULT,
    LARGEST_BOUND,
    Geometry,
    ImpactModel,
    Law,
    ModelPlan,
    Precision,
    check_model,
    law_for,
    plan_model,
)
from ..physics.laws import PATHS, STEPPED, Settings
from ..status import ImpactError, StatusCode, format_value
from .one_by_one import resolve_one_by_one
from .other_arrays import check_unmasked, is_lazy, resolve_other_arrays
from .pairs import as_pairs
from .rows import TABLE_LAYOUTS, TableLayout

Array = np.ndarray[Any, Any]
T = TypeVar("T")

UINT8 = np.dtype(np.uint8)

CONTACTS_PER_WORKER = 1024
"""With fewer contacts, another worker takes longer to start than it saves."""

_PRECISIONS = {
    np.dtype(np.float32): (Precision.SINGLE,),
    np.dtype(np.float64): (Precision.DOUBLE, Precision.EXTENDED),
}


class BatchResult(NamedTuple):
    """The results of :func:`resolve_batch`.

    Attributes:
        velocity: of the centres of mass after the impact [m/s], shape ``(3, 2, N)``; in PLANAR ``(2, 2, N)``.
        angular_velocity: after the impact [rad/s], shape ``(3, 2, N)``; in PLANAR, about z, ``(1, 2, N)``; in
            POINT ``(0, 2, N)``.
        impulse: on body_a [N s], shape ``(3, N)``; in PLANAR ``(2, N)``.
        status: a :class:`~collision_response.StatusCode` for each contact, uint8, shape ``(N,)``.
        error_bound: of each contact, as in :class:`~collision_response.Impact`, shape ``(N,)``; NaN where
            there is no answer. ``None`` without a tolerance, unless the precision is EXTENDED.
        precision: the :class:`~collision_response.Precision` used for each contact, uint8, shape ``(N,)``;
            ``None`` without error bounds.
        regime: what friction did at each contact, a :class:`~collision_response.Regime`, uint8, shape
            ``(N,)``; 0 where there is no answer. ``None`` without a report, like the energies.
        kinetic_energy_before, kinetic_energy_after: of the movable bodies of each contact [J], shape
            ``(N,)``.
        energy_lost_restitution, energy_lost_friction: work done at each contact against the normal and
            against the tangential impulse [J], shape ``(N,)``.
    """

    velocity: Any
    angular_velocity: Any
    impulse: Any
    status: Any
    error_bound: Any = None
    precision: Any = None
    regime: Any = None
    kinetic_energy_before: Any = None
    kinetic_energy_after: Any = None
    energy_lost_restitution: Any = None
    energy_lost_friction: Any = None

    def mapped(self, function: Callable[[Any], Any]) -> BatchResult:
        """Return the result with ``function`` applied to each array that is there."""
        return BatchResult(*(None if array is None else function(array) for array in self))


def is_bounded(model: ImpactModel) -> bool:
    """Whether the results of a batch with this model have error bounds."""
    return bool(model.tolerance) or model.precision is Precision.EXTENDED


def resolve_batch(
    bodies: Any,
    contacts: Any,
    model: ImpactModel = DEFAULT,
    *,
    pairs: Any = None,
    report: bool = False,
    out: BatchResult | None = None,
    workers: int = 1,
) -> BatchResult:
    """Compute the motion of N pairs of bodies after they collide.

    Each contact is resolved as if it were the only one. For contacts that share bodies see
    :func:`~collision_response.batch.independent_sets`.

    Args:
        bodies: the pairs of bodies, shape ``(rows, 2, N)``: ``[:, 0]`` are the bodies that the normals point
            to, body_a. The number of rows determines the geometry. With ``pairs``, a table of bodies, shape
            ``(rows, B)``.
        contacts: the contacts, shape ``(rows, N)``, of the same type as ``bodies``: float32 or float64.
        model: what to model, and how exactly. AUTO law is COULOMB if ``contacts`` has a row of friction, else
            FRICTIONLESS. A tolerance and EXTENDED precision need float64.
        pairs: for each contact the columns of its body_a and its body_b, integers, shape ``(2, N)``. A pair
            that names one body twice gets the status SAME_BODY, a pair that names no column of ``bodies``
            gets UNKNOWN_BODY.
        report: whether to report regimes and energies, too.
        out: where to write the results: an earlier result, or a BatchResult of arrays of the same shapes and
            types. They must not overlap the input or each other. Arrays for a report are written if they are
            there.
        workers: number of threads, at least 1, that share the contacts. Other Python threads run meanwhile.

    Returns:
        Arrays of the library of ``bodies``. If any input is a Dask array, they are lazy. Their chunks
        are those of ``bodies``, or with ``pairs`` those of ``contacts``, without the empty ones.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT, if the model is invalid, or not for batches.
        ValueError: if an array has the wrong shape or type.
    """
    check_workers(workers)
    if not (out is None or isinstance(out, BatchResult)):
        raise ValueError(f"out: must be a BatchResult, is {type(out).__name__}")
    if not (isinstance(bodies, np.ndarray) and isinstance(contacts, np.ndarray)) or (
        pairs is not None and is_lazy(pairs)
    ):
        return resolve_other_arrays(
            bodies, contacts, model, pairs=pairs, report=report, out=out, workers=workers
        )
    pairs = None if pairs is None else as_pairs(pairs)
    if out is None:
        plan = plan_for(bodies, contacts, model, pairs)
        out = plan.result_fields(contacts.shape[1], report).mapped(lambda field: np.empty(*field))
    elif report and out.regime is None:
        raise ValueError("out.regime: must be there for a report, is None")
    for _ in resolve_with_pauses(bodies, contacts, model, out, workers, pairs=pairs):
        pass
    return out


def check_workers(workers: Any) -> None:
    """Raises: ValueError: if ``workers`` is not a positive integer."""
    if not isinstance(workers, (int, Integral)) or workers < 1:
        raise ValueError(f"workers: must be a whole number, at least 1, is {format_value(workers)}")


def resolve_with_pauses(
    bodies: Array,
    contacts: Array,
    model: ImpactModel,
    out: BatchResult,
    workers: int = 1,
    *,
    pairs: Array | None = None,
    start: int = 0,
    stop: int | None = None,
) -> Iterator[None]:
    """Resolve a batch of NumPy arrays, pausing after each contact that the kernels cannot answer well enough.

    Callers that have other work can do it in the pauses. When the iterator ends, the results of the contacts
    from ``start`` to ``stop`` are complete in ``out``. For the other arguments see :func:`resolve_batch`.
    """
    plan, target, n = plan_for(bodies, contacts, model, pairs), out, contacts.shape[1]
    request, columns = (
        BatchRequest(plan, bodies, pairs, contacts),
        (start, n if stop is None else min(stop, n)),
    )
    worst = _run(request, plan.number_type, out, workers, *columns)
    if worst is None:  # an array is not contiguous, does not fit, or shares memory with another
        _check_out(plan, n, out)
        request = BatchRequest(plan, np.ascontiguousarray(bodies), pairs, np.ascontiguousarray(contacts))
        target = out.mapped(lambda array: np.empty_like(array, order="C"))
        worst = _run(request, plan.number_type, target, workers, *columns)
        assert worst is not None, "copies fit"
    part = (request, target) if columns == (0, n) else request.part(target, *columns)
    yield from _refine(*part, *worst, workers)
    if target is not out:
        _copy(target.mapped(lambda array: array[..., slice(*columns)]), out, slice(*columns))


def _copy(results: BatchResult, out: BatchResult, columns: slice | Array) -> None:
    """Write results to these columns of ``out``."""
    for array, wanted in zip(results, out, strict=True):
        if wanted is not None:
            wanted[..., columns] = array


class BatchPlan(NamedTuple):
    """Everything about a batch that does not depend on its numbers, or on how many contacts there are.

    Attributes:
        table: the layout of the tables.
        model: with the law and the geometry that are used.
        layout, number_type, settings: the layout, the number type and the settings, as the kernels take them.
        model_plan: the plan of the model: which precisions to try, and the error bounds to reach.
    """

    table: TableLayout
    model: ImpactModel
    layout: int
    number_type: NumberType
    settings: Array
    model_plan: ModelPlan

    def result_fields(self, n: int, report: bool) -> BatchResult:
        """Return the shape and type of each array of a result, in its place."""
        real, numbers, codes = self.settings.dtype, ((n,), self.settings.dtype), ((n,), UINT8)
        rows = self.table.bodies
        linear, angular = (each.stop - each.start for each in (rows.velocity, rows.angular_velocity))
        motion = ((linear, 2, n), real), ((angular, 2, n), real), ((linear, n), real), codes
        bounds = (numbers, codes) if is_bounded(self.model) else (None, None)
        return BatchResult(*motion, *bounds, *((codes, *[numbers] * 4) if report else ()))


class BatchRequest(NamedTuple):
    """The input of a batch: see :func:`resolve_batch`."""

    plan: BatchPlan
    bodies: Array
    pairs: Array | None
    contacts: Array

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


def _refine(
    request: BatchRequest, out: BatchResult, worst_status: int, worst_bound: float, workers: int
) -> Iterator[None]:
    """Compute contacts again with more digits where their error bound is too large."""
    plan = request.plan.model_plan
    if out.precision is None:
        if worst_status >= StatusCode.OUT_OF_RANGE:
            columns = np.flatnonzero(out.status >= StatusCode.OUT_OF_RANGE)
            yield from resolve_one_by_one(request.select(columns), out, columns)
        return
    out.precision[:] = plan.first_precision
    if worst_status <= StatusCode.SEPARATING and worst_bound <= plan.target_bound:
        return
    columns = _inexact(out, LARGEST_BOUND if plan.last_precision is Precision.DOUBLE else plan.target_bound)
    if columns.size and plan.first_precision is not plan.last_precision:
        columns = _compute_extended(request, out, columns, workers)
    if columns.size:
        yield from resolve_one_by_one(request.select(columns), out, columns)
    has_answer = (out.status == StatusCode.OK) | (out.status == StatusCode.SEPARATING)
    out.status[has_answer & ~(out.error_bound <= plan.bound_limit)] = StatusCode.TOLERANCE_NOT_MET


def _compute_extended(request: BatchRequest, out: BatchResult, columns: Array, workers: int) -> Array:
    """Compute contacts in double-doubles, and return those that need still more digits."""
    is_out_of_range = out.status[columns] == StatusCode.OUT_OF_RANGE  # double-doubles have the same range
    inexact, out_of_range = columns[~is_out_of_range], columns[is_out_of_range]
    refined = out.mapped(lambda array: np.empty((*array.shape[:-1], inexact.size), array.dtype))
    _run(request.select(inexact), NumberType.EXTENDED, refined, workers, 0, inexact.size)
    refined.precision[:] = Precision.EXTENDED
    _copy(refined, out, inexact)
    return np.concatenate([inexact[_inexact(refined, request.plan.model_plan.target_bound)], out_of_range])


def _inexact(out: BatchResult, limit: float) -> Array:
    """Return the columns of valid contacts whose error bound is above ``limit``."""
    is_valid = np.isin(out.status, (StatusCode.OK, StatusCode.SEPARATING, StatusCode.OUT_OF_RANGE))
    return np.flatnonzero(is_valid & ~(out.error_bound <= limit))


def _run(
    request: BatchRequest, number_type: NumberType, out: BatchResult, workers: int, start: int, stop: int
) -> tuple[int, float] | None:
    """Compute the contacts from ``start`` to ``stop``.

    Returns:
        The greatest status and the greatest error bound; ``None`` if an array has the wrong shape, type or
        memory layout.
    """
    plan, bodies, pairs, contacts = request
    law, layout, settings = plan.model.law, plan.layout, plan.settings

    def run(start: int, stop: int) -> tuple[int, float] | None:
        return library.batch(law, layout, number_type, bodies, pairs, contacts, settings, out, start, stop)

    threads = min(workers, (stop - start) // CONTACTS_PER_WORKER)
    if threads <= 1:
        return run(start, stop)
    worst = [part for part in run_in_parts(run, start, stop, threads) if part is not None]
    return (max(status for status, _ in worst), max(bound for _, bound in worst)) if worst else None


def run_in_parts(work: Callable[[int, int], T], start: int, stop: int, threads: int) -> list[T]:
    """Return the results of ``work(start, stop)`` for parts of a range, each in a thread."""
    if threads <= 1:
        return [work(start, stop)]
    cuts = [start + (stop - start) * i // threads // 64 * 64 for i in range(threads)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, cuts, [*cuts[1:], stop]))


def plan_for(bodies: Array, contacts: Array, model: ImpactModel, pairs: Array | None) -> BatchPlan:
    """Return the plan for a batch with such tables. Raises: as :func:`resolve_batch`."""
    check_unmasked("bodies", bodies)
    check_unmasked("contacts", contacts)
    shape, n = bodies.shape, contacts.shape[-1] if contacts.ndim == 2 else -1
    if pairs is None:
        fits = len(shape) == 3 and shape[1:] == (2, n)
    else:
        fits = len(shape) == 2 and pairs.shape[1] == n
    key = shape[0] if fits else 0, contacts.shape[:1], bodies.dtype, contacts.dtype, id(model)
    model_and_plan = _recent_plans.get(key)
    if model_and_plan is None:
        _check_tables(bodies, contacts, pairs)
        if len(_recent_plans) >= KEPT:
            _recent_plans.clear()
        plan = _plan(shape[0], contacts.shape[0], bodies.dtype, model)
        model_and_plan = _recent_plans[key] = model, plan  # keeps the model alive, and so its id valid
    return model_and_plan[1]


KEPT = 64
_recent_plans: dict[tuple[Any, ...], tuple[ImpactModel, BatchPlan]] = {}
"""Recent plans, by the identity of the model: hashing a model takes as long as a hundred contacts."""


def _plan(rows: int, height: int, dtype: np.dtype[Any], model: ImpactModel) -> BatchPlan:
    table = TABLE_LAYOUTS[rows]
    geometry, contact = table.geometry, table.contacts
    least, most = contact.friction.start, contact.height + 1
    if height not in (least, contact.height, most):
        raise ValueError(f"contacts: {geometry.name} has {least} to {most} rows, not {height}")
    _check_model(model, geometry, dtype)
    law = law_for(model.law, has_friction=height >= contact.height)
    if law is not Law.FRICTIONLESS and height < contact.height:
        raise ValueError(f"contacts: {law.name} needs a row of friction")
    model_plan = plan_model(model)
    if law in STEPPED:
        model_plan = model_plan._replace(first_precision=Precision.DOUBLE, last_precision=Precision.DOUBLE)
    number_type = NumberType.FLOAT if dtype == np.float32 else NumberType.PLAIN
    if is_bounded(model):
        number_type = (
            NumberType.EXTENDED if model_plan.first_precision is Precision.EXTENDED else NumberType.BOUNDED
        )
    return BatchPlan(
        table=table,
        model=model._replace(law=law, geometry=geometry),
        layout=[layout.name for layout in Layout].index(table.name),
        number_type=number_type,
        settings=np.array([getattr(model, name) for name in Settings._fields], dtype),
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
        raise ValueError(f"bodies: must be of shape {shape}, is {bodies.shape}")
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


def _check_out(plan: BatchPlan, n: int, out: BatchResult) -> None:
    """Raises: ValueError: if an array has the wrong shape or type, or shares memory with another."""
    fields = plan.result_fields(n, out.regime is not None)
    for name, array, expected in zip(BatchResult._fields, out, fields, strict=True):
        found = None if array is None else (array.shape, array.dtype)
        if found != expected:
            raise ValueError(f"out.{name}: must be {_described(expected)}, is {_described(found)}")
    given = [(name, array) for name, array in zip(BatchResult._fields, out, strict=True) if array is not None]
    for (one, first), (other, second) in combinations(given, 2):
        if np.shares_memory(first, second):
            raise ValueError(f"out.{other}: must have memory of its own, shares that of out.{one}")


def _described(array: tuple[tuple[int, ...], np.dtype[Any]] | None) -> str:
    return "None" if array is None else f"{array[1]} of shape {array[0]}"
