"""Many independent contacts at once, from arrays to arrays.

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_batch
    >>> rows, touch = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((rows.height, 2, 1)), np.zeros((touch.height, 1))
    >>> bodies[rows.mass] = [[1.0], [np.inf]]  # the second body is immovable
    >>> bodies[rows.velocity] = [[[0.0], [0.0]], [[0.0], [0.0]], [[-2.0], [0.0]]]
    >>> contacts[touch.normal] = [[0.0], [0.0], [1.0]]
    >>> contacts[touch.restitution] = 0.5
    >>> resolve_batch(bodies, contacts).velocity[2]
    array([[1.],
           [0.]])

What a row of ``bodies`` and of ``contacts`` holds, :mod:`~collision_response.batch.rows` says. The numbers
are those of :func:`~collision_response.resolve`, bit by bit. With a tolerance every contact gets an error
bound, and those whose bound is above the tolerance are computed again with more digits. A contact that
cannot be answered has its own status and NaN for results, and does its neighbours no harm.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from ..kernels import library
from ..kernels.layout import Layout
from ..model import LARGEST, Geometry, ImpactModel, Law, Precision, check_model, law_for
from ..physics.laws import PATHS
from ..status import ImpactError, StatusCode
from . import one_by_one
from .rows import body_rows, contact_rows, layout_of

Array = np.ndarray[Any, Any]

DEFAULT = ImpactModel()

ULP = 2.0**-52
"""A unit in the last place, at its largest relative to a number."""

UINT8 = np.dtype(np.uint8)

SHARE = 1024
"""Contacts below which a second worker is not worth waking."""

_PRECISIONS = {
    np.dtype(np.float32): (Precision.SINGLE,),
    np.dtype(np.float64): (Precision.DOUBLE, Precision.EXTENDED),
}
_LAYOUTS = (Layout.POINT, Layout.PLANAR, Layout.SPATIAL, Layout.SPATIAL_ORIENTED)
_TABLES = {
    body_rows(geometry, oriented=oriented).height: (geometry, oriented)
    for geometry, oriented in (
        (Geometry.POINT, False),
        (Geometry.PLANAR, False),
        (Geometry.SPATIAL, False),
        (Geometry.SPATIAL, True),
    )
}


class BatchResult(NamedTuple):
    """What became of the bodies.

    Attributes:
        velocity: of the centres of mass after the impact [m/s], shape ``(3, 2, N)``; PLANAR ``(2, 2, N)``.
        angular_velocity: after the impact [rad/s], shape ``(3, 2, N)``; PLANAR, about z, ``(1, 2, N)``;
            POINT ``(0, 2, N)``.
        impulse: on body_a [N s], shape ``(3, N)``; PLANAR ``(2, N)``.
        status: a :class:`~collision_response.StatusCode` for each contact, uint8, shape ``(N,)``.
        error_bound: of each contact, as that of :class:`~collision_response.Impact`, shape ``(N,)``; there
            only with a tolerance or EXTENDED. NaN where there is no answer.
        precision: the :class:`~collision_response.Precision` used for each contact, uint8, shape ``(N,)``;
            there only with the error bound.
    """

    velocity: Any
    angular_velocity: Any
    impulse: Any
    status: Any
    error_bound: Any = None
    precision: Any = None


def is_bounded(model: ImpactModel) -> bool:
    """Whether results in this model have error bounds."""
    return bool(model.tolerance) or model.precision is Precision.EXTENDED


def resolve_batch(
    bodies: Any,
    contacts: Any,
    model: ImpactModel = DEFAULT,
    *,
    out: BatchResult | None = None,
    workers: int = 1,
) -> BatchResult:
    """The motion of N pairs of bodies after they collide.

    Args:
        bodies: the pairs, shape ``(rows, 2, N)``: ``[:, 0]`` are body_a, to whom the normals point. The
            number of rows tells the geometry.
        contacts: the contacts, shape ``(rows, N)``, of the same type: float32 or float64.
        model: which law; AUTO is COULOMB if ``contacts`` has a row of friction. A tolerance, or EXTENDED,
            is for float64.
        out: where to write the results: an earlier result, or arrays like one. They must not overlap
            the input.
        workers: threads to use. Each takes its share of the contacts; Python runs on meanwhile.

    Returns:
        Arrays of the library that the input is made of. Of Dask they are lazy, cut as the input is.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT: the model is none for a batch.
        ValueError: an array has not the right shape or type.
    """
    if not isinstance(bodies, np.ndarray):
        from . import elsewhere

        converted = elsewhere.resolve_batch(bodies, contacts, model, out, workers)
        if converted is not None:
            return converted
        bodies = np.asarray(bodies)
    contacts = np.asarray(contacts)
    plan = _plan_for(bodies, contacts, model)
    if out is None:
        out = BatchResult(*(np.empty(shape, dtype) for shape, dtype in plan.results(bodies.shape[2])))
    else:
        _check_out(plan, bodies.shape[2], out)
    for _ in resolve_with_pauses(bodies, contacts, model, out, workers):
        pass
    return out


def resolve_with_pauses(
    bodies: Array, contacts: Array, model: ImpactModel, out: BatchResult, workers: int = 1
) -> Iterator[None]:
    """The same on NumPy's arrays, with a pause after each contact that needs more than the kernels give.

    So whoever has other things to do meanwhile can do them. The results are complete at the end.
    """
    if not bodies.shape[2]:
        return
    plan = _plan_for(bodies, contacts, model)
    target = out
    if not all(array is None or array.flags.c_contiguous for array in out):
        target = BatchResult(*(None if array is None else np.empty_like(array, order="C") for array in out))
    bodies, contacts = np.ascontiguousarray(bodies), np.ascontiguousarray(contacts)
    yield from _compute(plan, bodies, contacts, target, workers)
    if target is not out:
        for written, wanted in zip(target, out, strict=True):
            if wanted is not None:
                wanted[...] = written


class Plan(NamedTuple):
    """All that does not depend on the numbers, nor on how many contacts there are."""

    layout: int
    geometry: Geometry
    oriented: bool
    model: ImpactModel
    number: library.Number
    constants: Array
    axes: int
    spins: int
    has_bounds: bool

    def results(self, n: int) -> tuple[tuple[tuple[int, ...], np.dtype[Any]], ...]:
        """Shapes and types of a :class:`BatchResult`."""
        real, code = self.constants.dtype, UINT8
        found = (
            ((self.axes, 2, n), real),
            ((self.spins, 2, n), real),
            ((self.axes, n), real),
            ((n,), code),
            ((n,), real),
            ((n,), code),
        )
        return found if self.has_bounds else found[:4]


def _compute(plan: Plan, bodies: Array, contacts: Array, out: BatchResult, workers: int) -> Iterator[None]:
    """Fill in the results, climbing to more digits where the bound is above the limit."""
    worst, loosest = _run(plan, plan.number, bodies, contacts, out, workers)
    if out.precision is None:
        if worst >= StatusCode.OUT_OF_RANGE:
            odd = np.flatnonzero(out.status >= StatusCode.OUT_OF_RANGE)
            yield from one_by_one.retry(plan, bodies, contacts, out, odd)
        return
    model = plan.model
    exact = model.precision is Precision.EXTENDED
    out.precision[:] = Precision.EXTENDED if exact else Precision.DOUBLE
    limit = ULP if exact else model.tolerance
    tolerance = model.tolerance or LARGEST
    if worst <= StatusCode.SEPARATING and loosest <= min(limit, tolerance):
        return
    wanting = _wanting(out, limit)
    if model.precision is Precision.AUTO and wanting.size:
        few = BatchResult(*(np.empty((*array.shape[:-1], wanting.size), array.dtype) for array in out))
        some_bodies, some_contacts = bodies.take(wanting, -1), contacts.take(wanting, -1)
        _run(plan, library.Number.EXTENDED, some_bodies, some_contacts, few, workers)
        few.precision[:] = Precision.EXTENDED
        for array, better in zip(out, few, strict=True):
            array[..., wanting] = better
        wanting = wanting[_wanting(few, limit)]
    if model.precision is Precision.DOUBLE:
        wanting = _wanting(out, LARGEST)
    yield from one_by_one.retry(plan, bodies, contacts, out, wanting)
    answered = (out.status == StatusCode.OK) | (out.status == StatusCode.SEPARATING)
    out.status[answered & ~(out.error_bound <= tolerance)] = StatusCode.TOLERANCE_NOT_MET


def _wanting(out: BatchResult, limit: float) -> Array:
    """The columns of sound contacts whose error bound is above a limit."""
    sound = np.isin(out.status, (StatusCode.OK, StatusCode.SEPARATING, StatusCode.OUT_OF_RANGE))
    return np.flatnonzero(sound & ~(out.error_bound <= limit))


def _run(
    plan: Plan, number: library.Number, bodies: Array, contacts: Array, out: BatchResult, workers: int
) -> tuple[int, float]:
    """Compute all columns; the greatest status, and the greatest error bound."""
    n = out.status.size
    arrays = (bodies, contacts, plan.constants, *out[:3], out.error_bound, out.status)
    law, layout = plan.model.law, plan.layout

    def run(start: int, stop: int) -> tuple[int, float]:
        return library.batch(law, layout, number, *arrays, start, stop)

    shares = max(1, min(workers, n // SHARE))
    if shares == 1:
        return run(0, n)
    cuts = [n * i // shares // 64 * 64 for i in range(shares)] + [n]
    with ThreadPoolExecutor(shares) as pool:
        statuses, bounds = zip(*pool.map(run, cuts[:-1], cuts[1:]), strict=True)
    return max(statuses), max(bounds)


def _plan_for(bodies: Array, contacts: Array, model: ImpactModel) -> Plan:
    _check_tables(bodies, contacts)
    key = bodies.shape[0], contacts.shape[0], bodies.dtype, id(model)
    model_and_plan = _RECENT.get(key)
    if model_and_plan is None:
        if len(_RECENT) >= KEPT:
            _RECENT.clear()
        model_and_plan = _RECENT[key] = model, _plan(*key[:3], model)  # the model stays alive, and so its id
    return model_and_plan[1]


NUMBERS = ("tangential_restitution", "restitution_threshold", "tolerance", "stiffness_ratio")
"""Of a model, in the order of the kernels."""

KEPT = 64
_RECENT: dict[tuple[Any, ...], tuple[ImpactModel, Plan]] = {}
"""The plans of the last models, by identity: to hash one takes as long as a hundred contacts."""


def _plan(rows: int, height: int, dtype: np.dtype[Any], model: ImpactModel) -> Plan:
    geometry, oriented = _TABLES[rows]
    least = contact_rows(geometry)
    if height not in (least.friction.start, least.height, least.height + 1):
        raise ValueError(
            f"contacts: {geometry.name} has {least.friction.start} to {least.height + 1} rows, not {height}"
        )
    _check_model(model, geometry, dtype)
    law = law_for(model.law, has_friction=height >= least.height)
    if law is not Law.FRICTIONLESS and height < least.height:
        raise ValueError(f"contacts: {law.name} needs a row of friction")
    number = library.Number.FLOAT if dtype == np.float32 else library.Number.PLAIN
    if is_bounded(model):
        number = library.Number.EXTENDED if model.precision is Precision.EXTENDED else library.Number.BOUNDED
    of = body_rows(geometry)
    return Plan(
        _LAYOUTS.index(layout_of(geometry, oriented=oriented)),
        geometry,
        oriented,
        model._replace(law=law, geometry=geometry),
        number,
        np.array([getattr(model, name) for name in NUMBERS], dtype),
        of.velocity.stop - of.velocity.start,
        of.angular_velocity.stop - of.angular_velocity.start,
        is_bounded(model),
    )


def _check_tables(bodies: Array, contacts: Array) -> None:
    if bodies.dtype not in _PRECISIONS or contacts.dtype != bodies.dtype:
        raise ValueError(
            f"bodies, contacts: must both be float32 or float64; are {bodies.dtype}, {contacts.dtype}"
        )
    if bodies.ndim != 3 or bodies.shape[1] != 2 or bodies.shape[0] not in _TABLES:
        raise ValueError(
            f"bodies: must be of shape ({' or '.join(map(str, _TABLES))}, 2, N), is {bodies.shape}"
        )
    if contacts.ndim != 2 or contacts.shape[1] != bodies.shape[2]:
        raise ValueError(f"contacts: must be of shape (rows, {bodies.shape[2]}), is {contacts.shape}")


def _check_model(model: ImpactModel, geometry: Geometry, dtype: np.dtype[Any]) -> None:
    check_model(model)
    possible: dict[str, tuple[Any, ...]] = {
        "geometry": (Geometry.AUTO, geometry),
        "precision": (Precision.AUTO, *_PRECISIONS[dtype]),
    }
    if dtype == np.float32:
        possible["tolerance"] = (0.0,)
        possible["law"] = tuple(law for law in Law if law not in PATHS)
    for field, known in possible.items():
        value = getattr(model, field)
        if value not in known:
            names = ", ".join(str(getattr(one, "name", one)) for one in known)
            reason = (
                f"must be {names} for a batch of {geometry.name} {dtype}; is {getattr(value, 'name', value)}"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, f"model.{field}", reason)


def _check_out(plan: Plan, n: int, out: BatchResult) -> None:
    expected = plan.results(n)
    found = tuple(None if array is None else (array.shape, array.dtype) for array in out)
    if found == expected + (None,) * (len(found) - len(expected)):
        return
    for field, own, (shape, dtype) in zip(BatchResult._fields, found, expected, strict=False):
        if own != (shape, dtype):
            what = None if own is None else f"{own[1]} of {own[0]}"
            raise ValueError(f"out.{field}: must be {dtype} of shape {shape}, is {what}")
    field = next(name for name in BatchResult._fields[len(expected) :] if getattr(out, name) is not None)
    raise ValueError(f"out.{field}: must be None, for this model has neither tolerance nor EXTENDED")
