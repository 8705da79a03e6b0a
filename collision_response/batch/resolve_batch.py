"""Many independent contacts at once, from arrays to arrays.

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import resolve_batch
    >>> from collision_response.batch.rows import body_rows, contact_rows
    >>> of, at = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((of.height, 2, 1)), np.zeros((at.height, 1))
    >>> bodies[of.mass] = [[1.0], [np.inf]]  # the second body is immovable
    >>> bodies[of.velocity] = [[[0.0], [0.0]], [[0.0], [0.0]], [[-2.0], [0.0]]]
    >>> contacts[at.normal] = [[0.0], [0.0], [1.0]]
    >>> contacts[at.restitution] = 0.5
    >>> resolve_batch(bodies, contacts).velocity[2]
    array([[1.],
           [0.]])

What a row of ``bodies`` and of ``contacts`` holds, :mod:`~collision_response.batch.rows` says. The numbers
are those of :func:`~collision_response.resolve` in plain arithmetic, SINGLE's or DOUBLE's; a grazing approach
speed stays as rounded as it comes. With a tolerance, every contact gets an error bound, and those whose
bound is above the tolerance are computed again in EXTENDED. A contact that cannot be answered has its own
status and NaN for results, and does its neighbours no harm. Beyond input and output, the memory is that of a
few blocks, whatever N is.

One call uses one core. Calls in several threads are independent.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..model import Geometry, ImpactModel, Law, Precision
from ..status import ImpactError, StatusCode
from ..validate import check_model
from .backends import Arrays, Backend, is_compiled, one_by_one, prepare, programs_for
from .more_digits import make_all_exact, make_exact, pays_in_double_double, unsure
from .problem import Arithmetic, Problem, Tangential, contact_count
from .rows import body_rows, contact_rows

Array = np.ndarray[Any, Any]

DEFAULT = ImpactModel()

FEW = 20
"""Up to so many contacts a Python loop is faster than NumPy's calls."""

_PRECISIONS = {
    np.dtype(np.float32): (Precision.SINGLE,),
    np.dtype(np.float64): (Precision.DOUBLE, Precision.EXTENDED),
}
_ARRAYS = ("bodies", "contacts", "model", "velocity", "angular_velocity", "impulse", "status", "error_bound")
_LAWS = (Law.AUTO, Law.FRICTIONLESS, Law.COULOMB)
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

    velocity: Array
    angular_velocity: Array
    impulse: Array
    status: Array
    error_bound: Array | None = None
    precision: Array | None = None


def is_bounded(model: ImpactModel) -> bool:
    """Whether results in this model have error bounds."""
    return bool(model.tolerance) or model.precision is Precision.EXTENDED


class Preparation(NamedTuple):
    """What a batch will be computed by.

    Attributes:
        backend: COMPILED or NUMPY.
        seconds: what it took to get ready: to trace, and to compile or to find the machine code on
            disk, where it is kept from one process to the next.
    """

    backend: Backend
    seconds: float


def resolve_batch(
    bodies: ArrayLike,
    contacts: ArrayLike,
    model: ImpactModel = DEFAULT,
    *,
    out: BatchResult | None = None,
    backend: Backend = Backend.AUTO,
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
        backend: AUTO is the fastest that is installed. All give the same bits.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT: the model is none for a batch.
        ValueError: an array has not the right shape or type.
    """
    bodies, contacts = np.asarray(bodies), np.asarray(contacts)
    plan = _plan_for(bodies, contacts, model)
    n = bodies.shape[2]
    if out is None:
        out = BatchResult(*(np.empty(shape, dtype) for shape, dtype in plan.results(n)))
    else:
        _check_out(plan, n, out, (bodies, contacts))
    if n:
        given = bodies, contacts[: plan.contact_rows], plan.constants
        results = (*out[:3], *(row[np.newaxis] for row in out[3:5] if row is not None))
        arrays = dict(zip(_ARRAYS, (*given, *results), strict=False))
        _compute(plan, {name: arrays[name] for name in plan.arrays}, out, backend)
    return out


def _compute(plan: _Plan, arrays: Arrays, out: BatchResult, backend: Backend) -> None:
    n, dtype, model = out.status.size, plan.constants.dtype, plan.model
    if out.precision is not None:
        used = Precision.DOUBLE if model.precision is Precision.AUTO else model.precision
        out.precision[:] = used
    if model.precision is Precision.EXTENDED and pays_in_double_double(n):
        make_all_exact(arrays, plan.problem, model, backend)
    else:
        is_small = n <= FEW and dtype == np.float64 and not is_compiled(backend)
        run = one_by_one(plan.problem) if is_small else prepare(backend, plan.problem, dtype).run
        run(arrays)
        if out.precision is not None and model.precision is not Precision.DOUBLE:
            wanting = unsure(arrays, model.tolerance if model.precision is Precision.AUTO else 0.0)
            out.precision[wanting] = Precision.EXTENDED
            make_exact(arrays, wanting, plan.problem, model, backend)
    if model.tolerance:
        answered = (out.status == StatusCode.OK) | (out.status == StatusCode.SEPARATING)
        out.status[answered & ~(out.error_bound <= model.tolerance)] = StatusCode.TOLERANCE_NOT_MET


def prepare_batch(
    bodies: ArrayLike,
    contacts: ArrayLike,
    model: ImpactModel = DEFAULT,
    *,
    backend: Backend = Backend.AUTO,
) -> Preparation:
    """Get ready for batches like this one, of which only the number of rows and the type are looked at.

    The first call of :func:`resolve_batch` does it otherwise; compiling takes seconds, once per machine.

    Raises:
        as :func:`resolve_batch`.
    """
    bodies, contacts = np.asarray(bodies), np.asarray(contacts)
    problem = _plan_for(bodies, contacts, model).problem
    ready = prepare(backend, problem, bodies.dtype)
    seconds = ready.seconds
    if is_bounded(model) and model.precision is not Precision.DOUBLE:
        seconds += prepare(backend, problem._replace(arithmetic=Arithmetic.DOUBLED), bodies.dtype).seconds
    return Preparation(ready.backend, seconds)


class _Plan(NamedTuple):
    """All that does not depend on the numbers, nor on how many contacts there are."""

    problem: Problem
    model: ImpactModel
    arrays: list[str]
    contact_rows: int
    constants: Array
    axes: int
    turns: int

    def results(self, n: int) -> tuple[tuple[tuple[int, ...], np.dtype[Any]], ...]:
        """Shapes and types of a :class:`BatchResult`."""
        dtype, code = self.constants.dtype, np.dtype(np.uint8)
        shapes = (self.axes, 2, n), (self.turns, 2, n), (self.axes, n), (n,), (n,), (n,)
        all_results = tuple(zip(shapes, (dtype, dtype, dtype, code, dtype, code), strict=True))
        return all_results if self.problem.arithmetic is Arithmetic.BOUNDED else all_results[:4]


def _plan_for(bodies: Array, contacts: Array, model: ImpactModel) -> _Plan:
    _check_tables(bodies, contacts)
    return _plan(bodies.shape[0], contacts.shape[0], bodies.dtype, model)


@lru_cache(maxsize=64)
def _plan(rows: int, height: int, dtype: np.dtype[Any], model: ImpactModel) -> _Plan:
    problem = _problem(*_TABLES[rows], height, dtype, model)
    of = body_rows(problem.geometry)
    return _Plan(
        problem,
        model._replace(law=problem.law, geometry=problem.geometry),
        programs_for(problem, dtype)[1].arrays(),
        contact_count(problem),
        np.array([[model.tangential_restitution], [model.restitution_threshold]], dtype),
        of.velocity.stop - of.velocity.start,
        of.angular_velocity.stop - of.angular_velocity.start,
    )


def _problem(
    geometry: Geometry, oriented: bool, rows: int, dtype: np.dtype[Any], model: ImpactModel
) -> Problem:
    at = contact_rows(geometry)
    if rows not in (at.friction.start, at.height, at.height + 1):
        raise ValueError(
            f"contacts: {geometry.name} has {at.friction.start} to {at.height + 1} rows, not {rows}"
        )
    _check_model(model, geometry, dtype)
    law = model.law
    if law is Law.AUTO:
        law = Law.COULOMB if rows >= at.height else Law.FRICTIONLESS
    if law is Law.COULOMB and rows < at.height:
        raise ValueError("contacts: COULOMB needs a row of friction")
    tangential = Tangential.ZERO
    if law is Law.COULOMB and rows > at.height:
        tangential = Tangential.CONTACTS
    elif law is Law.COULOMB and model.tangential_restitution:
        tangential = Tangential.MODEL
    arithmetic = Arithmetic.BOUNDED if is_bounded(model) else Arithmetic.PLAIN
    return Problem(geometry, law, oriented, tangential, model.restitution_threshold > 0, arithmetic)


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
        "law": _LAWS,
        "geometry": (Geometry.AUTO, geometry),
        "precision": (Precision.AUTO, *_PRECISIONS[dtype]),
    }
    if dtype == np.float32:
        possible["tolerance"] = (0.0,)
    for field, known in possible.items():
        value = getattr(model, field)
        if value not in known:
            names = ", ".join(str(getattr(one, "name", one)) for one in known)
            reason = (
                f"must be {names} for a batch of {geometry.name} {dtype}; is {getattr(value, 'name', value)}"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, f"model.{field}", reason)


def _check_out(plan: _Plan, n: int, out: BatchResult, inputs: tuple[Array, ...]) -> None:
    expected = plan.results(n)
    for field, array, (shape, dtype) in zip(BatchResult._fields, out, expected, strict=False):
        if array is None or array.shape != shape or array.dtype != dtype:
            found = None if array is None else f"{array.dtype} of {array.shape}"
            raise ValueError(f"out.{field}: must be {dtype} of shape {shape}, is {found}")
        for given in inputs:
            if np.may_share_memory(array, given):
                raise ValueError(f"out.{field}: overlaps the input")
    for field, array in zip(BatchResult._fields[len(expected) :], out[len(expected) :], strict=True):
        if array is not None:
            raise ValueError(f"out.{field}: must be None, for this model has neither tolerance nor EXTENDED")
