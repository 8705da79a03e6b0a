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
and AUTO precision stays in DOUBLE, even where ``resolve`` would notice that DOUBLE is not enough. MOREAU and
Routh's laws then take a slip that is nothing but rounding for a slip: they may differ from ``resolve`` in the
last bits and the regime, and altogether where that has no bound. But an answer that gains energy by more than
rounding is left to ``resolve``, and has the status TOLERANCE_NOT_MET if that knows no bound either.

Numbers near the ends of float64's range may differ, too, also with a tolerance: ``resolve`` changes to other
units where an energy overflows, a batch without a report has no energies.

A contact that cannot be resolved gets its own status and NaN for results; it does not affect the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations, product
from typing import Any

import numpy as np

from ..arguments import check_count
from ..kernels import library
from ..kernels.protocol import NumberType
from ..model import (
    DEFAULT,
    LARGEST_BOUND,
    USEFUL_BOUND,
    ImpactModel,
    Precision,
    in_finest_steps,
    settled_bound,
)
from ..status import StatusCode, format_value
from .arrays import Array, as_numpy, converter_like, is_lazy, library_of
from .dask_arrays import resolve_lazily
from .one_by_one import resolve_one_by_one
from .pairs import as_pairs
from .plan import BatchRequest
from .result import BatchResult, names_bodies
from .threads import run_in_parts

CONTACTS_PER_WORKER = 1024
"""With fewer contacts, another worker takes longer to start than it saves."""


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
        pairs: for each contact the columns of its body_a and its body_b, integers, shape ``(2, N)``: the
            transpose of what :func:`~collision_response.resolve_scene` takes. A pair that names one body
            twice gets the status SAME_BODY, a pair that names no column of ``bodies`` gets UNKNOWN_BODY.
        report: whether to report regimes, energies and adjustments, too. A contact with an energy beyond
            the type of the tables is then OUT_OF_RANGE, as in :func:`~collision_response.resolve`.
        out: where to write the results: an earlier result, or a BatchResult of arrays of the same shapes and
            types. They must not overlap the input, each other or themselves. Arrays for a report are written
            if they are there.
        workers: number of threads, at least 1, that share the contacts. Other Python threads run meanwhile;
            an interrupt waits for the end.

    Returns:
        Arrays of the library of ``bodies``, on the same device: inputs on a GPU are copied to the CPU, which
        needs NumPy 2.1, and results back. If any input is a Dask array, they are lazy. Their chunks are
        those of ``bodies``, or with ``pairs`` those of ``contacts``, without the empty ones.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT, if the model is invalid, or not for batches, or
            ``workers`` is below 1.
        TypeError: if ``model`` is not an :class:`~collision_response.ImpactModel`, or ``workers`` not a whole
            number.
        ValueError: if an array has the wrong shape or type.
    """
    check_count("workers", workers, 1, math.inf)
    if not (out is None or isinstance(out, BatchResult)):
        raise ValueError(f"out: must be a BatchResult, is {type(out).__name__}")
    if not (isinstance(bodies, np.ndarray) and isinstance(contacts, np.ndarray)) or (
        pairs is not None and is_lazy(pairs)
    ):
        return _resolve_other_arrays(bodies, contacts, model, pairs, report, out, workers)
    request = BatchRequest.of(bodies, contacts, model, None if pairs is None else as_pairs(pairs))
    if out is None:
        request = request.contiguous()
        fields = request.plan.result_fields(request.contacts.shape[1], report)
        out = fields.mapped(lambda field: np.empty(*field))
    elif report and out.regime is None:
        raise ValueError("out.regime: must be there for a report, is None")
    for _ in resolve_with_pauses(request, out, workers):
        pass
    return out


def _resolve_other_arrays(
    bodies: Any,
    contacts: Any,
    model: ImpactModel,
    pairs: Any,
    report: bool,
    out: BatchResult | None,
    workers: int,
) -> BatchResult:
    """Resolve a batch. The results are in the library of ``bodies``, or lazy if any of the arrays is lazy.

    Raises:
        ValueError: if an argument is not an array, or if ``out`` is given: it is only for arrays of NumPy.
    """
    lazy = any(map(is_lazy, (bodies, contacts, pairs)))
    convert = None if lazy else converter_like(bodies)
    if out is not None and (lazy or convert is not None):
        raise ValueError(f"out: must be None for arrays of {'dask' if lazy else library_of(bodies)}")
    if lazy:
        return resolve_lazily(resolve_batch, bodies, contacts, model, pairs, report, workers)
    result = resolve_batch(
        as_numpy("bodies", bodies),
        as_numpy("contacts", contacts),
        model,
        pairs=pairs,
        report=report,
        out=out,
        workers=workers,
    )
    return result if convert is None else result.mapped(convert)


def resolve_with_pauses(
    request: BatchRequest, out: BatchResult, workers: int = 1, start: int = 0, stop: int | None = None
) -> Iterator[None]:
    """Resolve a batch of NumPy arrays, pausing after each contact that the kernels cannot answer well enough.

    Callers that have other work can do it in the pauses. When the iterator ends, the results of the contacts
    from ``start`` to ``stop`` are complete in ``out``.
    """
    target, n = out, request.contacts.shape[1]
    columns = start, n if stop is None else min(stop, n)
    worst = _run(request, request.plan.number_type, out, workers, *columns)
    if worst is None:  # an array is not contiguous, does not fit, or shares memory with another
        _check_out(request, out)
        request = request.contiguous()
        worst = _run(request, request.plan.number_type, out, workers, *columns)
    if worst is None:  # ``out`` is not contiguous
        target = out.mapped(lambda array: np.empty_like(array, order="C"))
        worst = _run(request, request.plan.number_type, target, workers, *columns)
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


def _refine(
    request: BatchRequest, out: BatchResult, worst_status: int, worst_bound: float, workers: int
) -> Iterator[None]:
    """Compute contacts again with more digits where their error bound is too large."""
    plan = request.plan.model_plan
    if out.precision is None:
        if worst_status >= StatusCode.OUT_OF_RANGE:
            columns = _compute_alone(request, out, np.flatnonzero(out.status >= StatusCode.OUT_OF_RANGE))
            yield from resolve_one_by_one(request.select(columns), out, columns)
        return
    out.precision[:] = plan.first_precision
    if any(plan.settings_errors._replace(tolerance=0.0)):  # which the kernels of batches do not count
        columns = np.flatnonzero(names_bodies(out.status))
        yield from resolve_one_by_one(request.select(columns), out, columns)
        return
    if worst_status <= StatusCode.SEPARATING and worst_bound <= plan.target_bound:
        return
    model = request.plan.model
    columns = _inexact(out, LARGEST_BOUND if model.precision is Precision.DOUBLE else plan.target_bound)
    undecided = columns[:0]
    if plan.first_precision is not plan.last_precision:
        is_large = ~(out.error_bound[columns] <= USEFUL_BOUND)  # ``resolve`` first decides if they approach
        undecided, columns = columns[is_large], columns[~is_large]
        # With more digits, slip may be known to stop before a path is too long.
        too_long = np.flatnonzero(out.status == StatusCode.PATH_TOO_LONG)
        columns = _compute_extended(request, out, np.union1d(columns, too_long), workers)
    columns = _compute_alone(request, out, np.union1d(undecided, _unsettled(out, columns, model)))
    columns = _unsettled(out, columns, model)
    yield from resolve_one_by_one(request.select(columns), out, columns)
    yield from _follow_finest_steps(request, out, workers)
    has_answer = (out.status == StatusCode.OK) | (out.status == StatusCode.SEPARATING)
    out.status[has_answer & ~(out.error_bound <= plan.bound_limit)] = StatusCode.TOLERANCE_NOT_MET


def _unsettled(out: BatchResult, columns: Array, model: ImpactModel) -> Array:
    """Return the columns in which more digits may still change something."""
    return columns[~(out.error_bound[columns] < settled_bound(model))]


def _compute_alone(request: BatchRequest, out: BatchResult, columns: Array) -> Array:
    """Compute contacts as the kernels do for ``resolve``, and return those that need still more digits."""
    if not columns.size or out.velocity.dtype == np.float32:
        return columns
    plan, bodies, _, contacts = request.select(columns)
    alone = _empty_result(out, columns.size)
    library.resolve_columns(plan.model, plan.layout.number, bodies, contacts, plan.settings, alone)
    is_known = alone.status != StatusCode.UNSET
    _copy(alone.mapped(lambda array: array[..., is_known]), out, columns[is_known])
    if alone.error_bound is not None:
        is_known &= alone.error_bound <= plan.model_plan.target_bound
    return columns[~is_known]


def _follow_finest_steps(request: BatchRequest, out: BatchResult, workers: int) -> Iterator[None]:
    """Follow paths again in the finest steps, where that lowers an error bound that is too large."""
    finest = in_finest_steps(request.plan.model)
    if finest is None:
        return
    columns = _inexact(out, request.plan.model_plan.bound_limit)
    if not columns.size:
        return
    again = request.select(columns)
    again = BatchRequest.of(again.bodies, again.contacts, finest, None)
    finer = _empty_result(out, columns.size)
    yield from resolve_with_pauses(again, finer, workers)
    better = finer.error_bound < out.error_bound[columns]
    finer.status[:] = out.status[columns]  # whether the bodies separate does not depend on the steps
    _copy(finer.mapped(lambda array: array[..., better]), out, columns[better])


def _compute_extended(request: BatchRequest, out: BatchResult, columns: Array, workers: int) -> Array:
    """Compute contacts in double-doubles, and return those that need still more digits."""
    if not columns.size:
        return columns
    refined = _empty_result(out, columns.size)
    _run(request.select(columns), NumberType.EXTENDED, refined, workers, 0, columns.size)
    refined.precision[:] = Precision.EXTENDED
    _copy(refined, out, columns)
    return columns[_inexact(refined, request.plan.model_plan.target_bound)]


def _empty_result(like: BatchResult, n: int) -> BatchResult:
    """Return room for the results of ``n`` contacts, with the fields of another result."""
    return like.mapped(lambda array: np.empty((*array.shape[:-1], n), array.dtype))


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
    law, layout, settings = plan.model.law, plan.layout.number, plan.settings

    def run(start: int, stop: int) -> tuple[int, float] | None:
        return library.batch(law, layout, number_type, bodies, pairs, contacts, settings, out, start, stop)

    threads = min(workers, (stop - start) // CONTACTS_PER_WORKER)
    if threads <= 1:
        return run(start, stop)
    worst = [part for part in run_in_parts(run, start, stop, threads) if part is not None]
    return (max(status for status, _ in worst), max(bound for _, bound in worst)) if worst else None


def _check_out(request: BatchRequest, out: BatchResult) -> None:
    """Raises: ValueError: if an array has the wrong shape or type, cannot be written, or shares memory."""
    fields = request.plan.result_fields(request.contacts.shape[1], out.regime is not None)
    for name, array, expected in zip(BatchResult._fields, out, fields, strict=True):
        found = (array.shape, array.dtype) if isinstance(array, np.ndarray) else array
        fits = found == expected if isinstance(found, tuple) else found is expected
        if not fits:
            raise ValueError(f"out.{name}: must be {_described(expected)}, is {_described(found)}")
        if array is not None and not array.flags.writeable:
            raise ValueError(f"out.{name}: must be writable, is read-only")
    given = [(name, array) for name, array in zip(BatchResult._fields, out, strict=True) if array is not None]
    for name, array in given:
        if _overlaps_itself(array):
            raise ValueError(f"out.{name}: must not overlap itself")
    for (one, first), (other, second) in combinations(given, 2):
        if np.shares_memory(first, second):
            raise ValueError(f"out.{other}: must have memory of its own, shares that of out.{one}")
    for (_, written), table in product(given, request[1:]):
        if table is not None and np.shares_memory(written, table):
            raise ValueError("out: overlaps the input")


def _overlaps_itself(array: Array) -> bool:
    """Whether two elements share memory.

    They differ in some index; then that of 0 along this axis shares memory with those of greater indices.
    """
    if array.flags.c_contiguous:
        return False
    axes = (np.moveaxis(array, axis, 0) for axis in range(array.ndim))
    return any(np.shares_memory(along[:1], along[1:]) for along in axes)


def _described(array: Any) -> str:
    return f"{array[1]} of shape {array[0]}" if isinstance(array, tuple) else format_value(array)
