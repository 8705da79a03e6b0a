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
bound, and those whose bound is above what ``resolve`` climbs to are computed again with more digits. Without
one there is no bound: AUTO stays in DOUBLE, also where ``resolve`` sees that it is not enough. A contact that
cannot be answered has its own status and NaN for results; the others are not affected.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from numbers import Integral
from typing import Any, NamedTuple

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
from . import one_by_one
from .other_arrays import check_unmasked, is_lazy
from .other_arrays import resolve_batch as elsewhere
from .pairs import as_pairs
from .rows import TABLES, body_rows, contact_rows, layout_of

Array = np.ndarray[Any, Any]

UINT8 = np.dtype(np.uint8)

SHARE = 1024
"""Contacts below which a second worker is not worth waking."""

_PRECISIONS = {
    np.dtype(np.float32): (Precision.SINGLE,),
    np.dtype(np.float64): (Precision.DOUBLE, Precision.EXTENDED),
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
        regime: what friction did at each contact, a :class:`~collision_response.Regime`, uint8, shape
            ``(N,)``; 0 where there is no answer. This and the energies are there only with a report.
        kinetic_energy_before, kinetic_energy_after: of the movable bodies of each contact [J],
            shape ``(N,)``.
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


def is_bounded(model: ImpactModel) -> bool:
    """Whether results in this model have error bounds."""
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
    """The motion of N pairs of bodies after they collide.

    Each contact is answered for itself, as if it were the only one; for what follows from that see
    :func:`~collision_response.batch.independent_sets`.

    Args:
        bodies: the pairs, shape ``(rows, 2, N)``: ``[:, 0]`` are body_a, to whom the normals point. The
            number of rows tells the geometry. With ``pairs``, a table of bodies, shape ``(rows, B)``.
        contacts: the contacts, shape ``(rows, N)``, of the same type: float32 or float64.
        model: which law; AUTO is COULOMB if ``contacts`` has a row of friction. A tolerance, or EXTENDED,
            is for float64.
        pairs: for each contact the column of its body_a and that of its body_b, integers, shape ``(2, N)``.
            A pair of one body twice gets the status SAME_BODY, a column that is not there UNKNOWN_BODY.
        report: whether to report regimes and energies, too.
        out: where to write the results: an earlier result, or a BatchResult of arrays like its. They must
            overlap neither the input nor each other. Those of a report are written if they are there.
        workers: threads to use, at least 1. Each takes its share of the contacts; Python runs on meanwhile.

    Returns:
        Arrays of the library that ``bodies`` are of. If any of the arrays is Dask's, they are lazy: cut as
        the bodies are, with ``pairs`` as the contacts are, but without empty chunks.

    Raises:
        ImpactError: INVALID_MODEL or INVALID_COEFFICIENT: the model is none for a batch.
        ValueError: an array has not the right shape or type.
    """
    check_workers(workers)
    if not (out is None or isinstance(out, BatchResult)):
        raise ValueError(f"out: must be a BatchResult, is {type(out).__name__}")
    if not (isinstance(bodies, np.ndarray) and isinstance(contacts, np.ndarray)) or (
        pairs is not None and is_lazy(pairs)
    ):
        return elsewhere(bodies, contacts, model, pairs=pairs, report=report, out=out, workers=workers)
    pairs = None if pairs is None else as_pairs(pairs)
    if out is None:
        plan = plan_for(bodies, contacts, model, pairs)
        shapes = plan.results(contacts.shape[1], report)
        out = BatchResult(*(None if one is None else np.empty(*one) for one in shapes))
    elif report and out.regime is None:
        raise ValueError("out.regime: must be there for a report, is None")
    else:
        _check_apart(out)
    for _ in resolve_with_pauses(bodies, contacts, model, out, workers, pairs=pairs):
        pass
    return out


def check_workers(workers: Any) -> None:
    """Raises: ValueError: they are no number of threads."""
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
    """The same on NumPy's arrays, with a pause after each contact that needs more than the kernels give.

    So whoever has other things to do meanwhile can do them. The results of the contacts from ``start`` to
    ``stop`` are complete at the end.
    """
    plan, target, n = plan_for(bodies, contacts, model, pairs), out, contacts.shape[1]
    asked, columns = Asked(plan, bodies, pairs, contacts), (start, n if stop is None else min(stop, n))
    found = _run(asked, plan.number, out, workers, *columns)
    if found is None:  # some array has gaps between its numbers, or is not what it should be
        _check_out(plan, n, out)
        asked = Asked(plan, np.ascontiguousarray(bodies), pairs, np.ascontiguousarray(contacts))
        target = BatchResult(*(None if array is None else np.empty_like(array, order="C") for array in out))
        found = _run(asked, plan.number, target, workers, *columns)
        assert found is not None, "copies fit"
    yield from _improve(
        *((asked, target) if columns == (0, n) else asked.part(target, *columns)), found, workers
    )
    if target is not out:
        for written, wanted in zip(target, out, strict=True):
            if wanted is not None:
                own = (..., slice(*columns))
                wanted[own] = written[own]


class Plan(NamedTuple):
    """All that does not depend on the numbers, nor on how many contacts there are.

    Attributes:
        layout: its number.
        oriented: whether bodies are.
        model: with the law and the geometry that are used.
        number, constants: what kernels take: the kind of number, and those of the model.
        axes, spins: of velocities, and of angular ones.
        climb: through which precisions, until the error bound is within what is wanted: as ``resolve`` does.
    """

    layout: int
    oriented: bool
    model: ImpactModel
    number: NumberType
    constants: Array
    axes: int
    spins: int
    climb: ModelPlan

    def results(self, n: int, report: bool) -> tuple[tuple[tuple[int, ...], np.dtype[Any]] | None, ...]:
        """Shapes and types of a :class:`BatchResult`."""
        real, number, code = self.constants.dtype, ((n,), self.constants.dtype), ((n,), UINT8)
        motion = ((self.axes, 2, n), real), ((self.spins, 2, n), real), ((self.axes, n), real), code
        bounds = (number, code) if is_bounded(self.model) else (None, None)
        return *motion, *bounds, *((code, *[number] * 4) if report else [None] * 5)


class Asked(NamedTuple):
    """What is asked of a batch: see :func:`resolve_batch`."""

    plan: Plan
    bodies: Array
    pairs: Array | None
    contacts: Array

    def some(self, columns: Array) -> Asked:
        """Of some contacts, each with its own two bodies."""
        at = columns if self.pairs is None else self.pairs.take(columns, 1)
        return Asked(self.plan, self.bodies.take(at, -1), None, self.contacts.take(columns, -1))

    def part(self, out: BatchResult, *columns: int) -> tuple[Asked, BatchResult]:
        """Of contacts that follow each other, and what became of them."""
        own = slice(*columns)
        bodies, pairs = self.bodies, self.pairs
        if pairs is None:
            bodies = bodies[..., own]
        else:
            pairs = pairs[:, own]
        part = BatchResult(*(None if array is None else array[..., own] for array in out))
        return Asked(self.plan, bodies, pairs, self.contacts[:, own]), part


def _improve(asked: Asked, out: BatchResult, found: tuple[int, float], workers: int) -> Iterator[None]:
    """Climb to more digits where the bound is above the limit."""
    worst, loosest = found
    climb = asked.plan.climb
    if out.precision is None:
        if worst >= StatusCode.OUT_OF_RANGE:
            odd = np.flatnonzero(out.status >= StatusCode.OUT_OF_RANGE)
            yield from one_by_one.retry(asked.some(odd), out, odd)
        return
    out.precision[:] = climb.first_precision
    if worst <= StatusCode.SEPARATING and loosest <= climb.target_bound:
        return
    wanting = _wanting(out, climb.target_bound)
    beyond = wanting[:0]
    if climb.first_precision is not climb.last_precision and wanting.size:
        is_beyond = out.status[wanting] == StatusCode.OUT_OF_RANGE  # in these units
        beyond, wanting = wanting[is_beyond], wanting[~is_beyond]
        few = BatchResult(
            *(None if a is None else np.empty((*a.shape[:-1], wanting.size), a.dtype) for a in out)
        )
        _run(asked.some(wanting), NumberType.EXTENDED, few, workers, 0, wanting.size)
        few.precision[:] = Precision.EXTENDED
        for array, better in zip(out, few, strict=True):
            if array is not None:
                array[..., wanting] = better
        wanting = wanting[_wanting(few, climb.target_bound)]
    if climb.last_precision is Precision.DOUBLE:
        wanting = _wanting(out, LARGEST_BOUND)
    wanting = np.concatenate([wanting, beyond])
    if wanting.size:
        yield from one_by_one.retry(asked.some(wanting), out, wanting)
    answered = (out.status == StatusCode.OK) | (out.status == StatusCode.SEPARATING)
    out.status[answered & ~(out.error_bound <= climb.bound_limit)] = StatusCode.TOLERANCE_NOT_MET


def _wanting(out: BatchResult, limit: float) -> Array:
    """The columns of sound contacts whose error bound is above a limit."""
    sound = np.isin(out.status, (StatusCode.OK, StatusCode.SEPARATING, StatusCode.OUT_OF_RANGE))
    return np.flatnonzero(sound & ~(out.error_bound <= limit))


def _run(
    asked: Asked, number: NumberType, out: BatchResult, workers: int, start: int, stop: int
) -> tuple[int, float] | None:
    """Compute columns; the greatest status, and the greatest error bound; ``None`` if arrays do not fit."""
    plan, bodies, pairs, contacts = asked
    law, layout, constants = plan.model.law, plan.layout, plan.constants

    def run(start: int, stop: int) -> tuple[int, float] | None:
        return library.batch(law, layout, number, bodies, pairs, contacts, constants, out, start, stop)

    n = max(0, stop - start)
    shares = max(1, min(workers, n // SHARE))
    if shares == 1:
        return run(start, start + n)
    cuts = [start + n * i // shares // 64 * 64 for i in range(shares)] + [start + n]
    with ThreadPoolExecutor(shares) as pool:
        found = [each for each in pool.map(run, cuts[:-1], cuts[1:]) if each is not None]
    statuses, bounds = zip(*found, strict=True) if found else ((), ())
    return (max(statuses), max(bounds)) if found else None


def plan_for(bodies: Array, contacts: Array, model: ImpactModel, pairs: Array | None) -> Plan:
    """What is to be done with such tables. Raises: as :func:`resolve_batch`."""
    check_unmasked("bodies", bodies)
    check_unmasked("contacts", contacts)
    shape, n = bodies.shape, contacts.shape[-1] if contacts.ndim == 2 else -1
    if pairs is None:
        fits = len(shape) == 3 and shape[1:] == (2, n)
    else:
        fits = len(shape) == 2 and pairs.shape[1] == n
    key = shape[0] if fits else 0, contacts.shape[:1], bodies.dtype, contacts.dtype, id(model)
    model_and_plan = _RECENT.get(key)
    if model_and_plan is None:
        _check_tables(bodies, contacts, pairs)
        if len(_RECENT) >= KEPT:
            _RECENT.clear()
        plan = _plan(shape[0], contacts.shape[0], bodies.dtype, model)
        model_and_plan = _RECENT[key] = model, plan  # the model stays alive, and so its id
    return model_and_plan[1]


KEPT = 64
_RECENT: dict[tuple[Any, ...], tuple[ImpactModel, Plan]] = {}
"""The plans of the last models, by identity: to hash one takes as long as a hundred contacts."""


def _plan(rows: int, height: int, dtype: np.dtype[Any], model: ImpactModel) -> Plan:
    geometry, oriented = TABLES[rows]
    least = contact_rows(geometry)
    if height not in (least.friction.start, least.height, least.height + 1):
        raise ValueError(
            f"contacts: {geometry.name} has {least.friction.start} to {least.height + 1} rows, not {height}"
        )
    _check_model(model, geometry, dtype)
    law = law_for(model.law, has_friction=height >= least.height)
    if law is not Law.FRICTIONLESS and height < least.height:
        raise ValueError(f"contacts: {law.name} needs a row of friction")
    climb = plan_model(model)
    if law in STEPPED:
        climb = climb._replace(first_precision=Precision.DOUBLE, last_precision=Precision.DOUBLE)
    number = NumberType.FLOAT if dtype == np.float32 else NumberType.PLAIN
    if is_bounded(model):
        number = NumberType.EXTENDED if climb.first_precision is Precision.EXTENDED else NumberType.BOUNDED
    of = body_rows(geometry)
    return Plan(
        list(Layout).index(layout_of(geometry, oriented=oriented)),
        oriented,
        model._replace(law=law, geometry=geometry),
        number,
        np.array([getattr(model, name) for name in Settings._fields], dtype),
        of.velocity.stop - of.velocity.start,
        of.angular_velocity.stop - of.angular_velocity.start,
        climb,
    )


def _check_tables(bodies: Array, contacts: Array, pairs: Array | None) -> None:
    if bodies.dtype not in _PRECISIONS or contacts.dtype != bodies.dtype:
        raise ValueError(
            f"bodies, contacts: must both be float32 or float64; are {bodies.dtype}, {contacts.dtype}"
        )
    heights = " or ".join(map(str, TABLES))
    if pairs is not None:
        n, shape, fits = pairs.shape[1], f"({heights}, B)", bodies.ndim == 2
    else:
        n, shape = bodies.shape[-1] if bodies.ndim else 0, f"({heights}, 2, N)"
        fits = bodies.ndim == 3 and bodies.shape[1] == 2
    if not fits or bodies.shape[0] not in TABLES:
        raise ValueError(f"bodies: must be of shape {shape}, is {bodies.shape}")
    if contacts.ndim != 2 or contacts.shape[1] != n:
        raise ValueError(f"contacts: must be of shape (rows, {n}), is {contacts.shape}")


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
    for field, array, expected in zip(
        BatchResult._fields, out, plan.results(n, out.regime is not None), strict=True
    ):
        found = None if array is None else (array.shape, array.dtype)
        if found != expected:
            raise ValueError(f"out.{field}: must be {_described(expected)}, is {_described(found)}")


def _check_apart(out: BatchResult) -> None:
    """Raises: ValueError: an array is there twice."""
    fields: dict[int, str] = {}
    for field, array in zip(BatchResult._fields, out, strict=True):
        if array is not None and (other := fields.setdefault(id(array), field)) != field:
            raise ValueError(f"out.{field}: must be an array of its own, is that of {other}")


def _described(array: tuple[tuple[int, ...], np.dtype[Any]] | None) -> str:
    return "None" if array is None else f"{array[1]} of shape {array[0]}"
