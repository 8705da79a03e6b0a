"""Requests for a batch to arrays, results to responses.

Tables are read where they arrived, and results written where they are sent from.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time

from ..batch import BatchResult, is_bounded, resolve_with_pauses
from ..batch.rows import Tables
from ..body_conversions import IDENTITY_QUATERNION, with_com_as_reference
from ..model import Geometry, ImpactModel, check_model, law_for
from ..msg import BodyState
from ..physics.laws import Law
from ..srv import ResolveCollisionBatch
from ..status import ImpactError, StatusCode
from . import convert
from .batch_fields import (
    ENERGIES,
    LAYOUTS,
    Array,
    Request,
    Response,
    names_in,
    result_shapes,
    with_zeros,
    write_model,
)
from .parameters import LatestParameters, Parameters
from .patience import TOGETHER, Look, when_not_too_early
from .request import (
    TooEarly,
    Used,
    check_age,
    check_distinct,
    check_frame,
    check_immovable,
    check_world_frame,
    find,
)
from .serialized import nanoseconds
from .server import Work
from .states import LatestStates


class Bodies(NamedTuple):
    """The bodies of a request, those of the table first.

    Attributes:
        table: a column for each, shape ``(rows, bodies)``.
        faults: a :class:`StatusCode` for each that cannot be used, whatever its column holds; else UNSET.
        errors: what is wrong with those.
        stamps: of the states that stand for those given by name.
        ages: how much older those are than the request [s]; NaN if that is not known.
    """

    table: Array
    faults: Array
    errors: list[ImpactError]
    stamps: list[Time]
    ages: list[float]


NO_STAMP = Time()

BLOCK = 256
"""Contacts that are computed without a pause at first; more or fewer when it is known how long they take."""

PAUSE = 0.001, 0.004
"""Times [s] between pauses: computing less, more contacts are taken together; computing longer, fewer."""


@dataclass
class Batches:
    """The service for many impacts.

    Attributes:
        parameters: of the node.
        states: of the bodies that it has heard of.
        now: the time by the node's clock [ns].
    """

    interface = ResolveCollisionBatch
    name = "~/resolve_collision_batch"
    parameters: LatestParameters
    states: LatestStates
    now: Callable[[], int]

    def answer(self, request: Request) -> Work:
        """The work for a request, in parts."""
        current = self.parameters.values
        response = Response()
        check_world_frame("header.frame_id", request.header.frame_id, current.world_frame)
        layout = layout_of(request)
        pairs = pairs_of(request, current.budget_contacts)
        contacts = contacts_of(request, layout, pairs.shape[1])
        model = model_of(request, layout, contacts, current.model)
        bodies = yield from when_not_too_early(
            partial(bodies_of, request, layout, self.states, current, self.now), current.max_state_wait
        )
        shape = layout.geometry, pairs.shape[1]
        out = result_in(response, *shape, bounded=is_bounded(model), report=request.report)
        yield from compute(bodies.table, pairs, contacts, model, out)
        if bodies.errors:
            blame(pairs, bodies.faults, out.status)
        response.success, response.code, response.header = True, int(StatusCode.OK), request.header
        response.message = note_of(bodies.errors)
        response.state_stamps, response.state_ages = bodies.stamps, array("d", bodies.ages)
        write_model(response.model, model)
        return response

    def refusal(self, request: Request, error: ImpactError) -> Response:
        """The response that says why there is none; its model is that of the request."""
        return Response(
            header=request.header,
            model=request.model,
            code=int(error.code),
            message=convert.as_in_message(error),
        )

    def code(self, response: Response) -> StatusCode:
        """How the request ended."""
        return StatusCode(response.code)


def result_in(response: Response, geometry: Geometry, n: int, *, bounded: bool, report: bool) -> BatchResult:
    """A result of ``n`` contacts whose arrays are the fields of a response."""
    shapes = result_shapes(geometry, n)
    tables = {name: with_zeros(getattr(response, name), shape) for name, shape in shapes.items()}
    tables["status"] = with_zeros(response.status, (n,))
    if bounded:
        tables["error_bound"] = with_zeros(response.error_bounds, (n,))
        tables["precision"] = with_zeros(response.precisions, (n,))
    if report:
        tables["regime"] = with_zeros(response.regimes, (n,))
        tables |= {name: with_zeros(getattr(response, name), (n,)) for name in ENERGIES}
    return BatchResult(**tables)


def compute(
    table: Array, pairs: Array, contacts: Array, model: ImpactModel, out: BatchResult
) -> Iterator[None]:
    """Fill in the results, with pauses."""
    start, block, n = 0, BLOCK, pairs.shape[1]
    while start < n:
        began = time.perf_counter()
        stop = start + block
        yield from resolve_with_pauses(table, contacts, model, out, pairs=pairs, start=start, stop=stop)
        start = stop
        taken = time.perf_counter() - began
        if taken < PAUSE[0]:
            block *= 2
        elif taken > PAUSE[1] and block > 1:
            block //= 2
        if start < n:
            yield


def layout_of(request: Request) -> Tables:
    """Raises: ImpactError: INVALID_TABLE."""
    if request.layout not in LAYOUTS:
        known = ", ".join(f"{layout.name} ({number})" for number, layout in LAYOUTS.items())
        reason = f"must be one of {known}; is {request.layout}"
        raise ImpactError(StatusCode.INVALID_TABLE, "layout", reason)
    return LAYOUTS[request.layout]


def pairs_of(request: Request, most: int) -> Array:
    """Columns of bodies, shape ``(2, N)``.

    Raises:
        ImpactError: INVALID_TABLE, or BUDGET_EXCEEDED for more than ``most`` contacts.
    """
    indices = np.asarray(request.pairs)
    if indices.size % 2:
        reason = f"must hold two indices for each contact, holds {indices.size} in all"
        raise ImpactError(StatusCode.INVALID_TABLE, "pairs", reason)
    if indices.size > 2 * most:
        reason = f"has {indices.size // 2} contacts; budget.contacts is {most}: send fewer at a time"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "pairs", reason)
    return indices.reshape(2, -1).astype(np.int64)


def contacts_of(request: Request, layout: Tables, n: int) -> Array:
    """The contacts, shape ``(rows, n)``.

    Raises:
        ImpactError: INVALID_TABLE.
    """
    numbers, at = np.asarray(request.contacts), layout.contacts
    rows = numbers.size // n if n else at.height
    if numbers.size != rows * n or not at.friction.start <= rows <= at.height + 1:
        least, most = at.friction.start, at.height + 1
        reason = f"must hold {least} to {most} rows of {n} for {layout.name}, holds {numbers.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, "contacts", reason)
    return numbers.reshape(rows, n)


def model_of(request: Request, layout: Tables, contacts: Array, defaults: ImpactModel) -> ImpactModel:
    """What to model: every AUTO decided, but for the precision, which depends on each contact.

    Raises:
        ImpactError: NOT_FINITE, INVALID_MODEL or INVALID_COEFFICIENT.
    """
    model = convert.model_of(request.model, defaults._replace(geometry=layout.geometry))
    check_model(model)
    has_friction = len(contacts) >= layout.contacts.height
    model = model._replace(law=law_for(model.law, has_friction=has_friction))
    if model.law is not Law.FRICTIONLESS and not has_friction:
        reason = f"is {model.law.name}, but contacts has no row mu"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.law", reason)
    if model.geometry is Geometry.AUTO:
        model = model._replace(geometry=layout.geometry)
    return model


def bodies_of(
    request: Request, layout: Tables, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> Look[Bodies]:
    """The bodies of the table and those given by name.

    Raises:
        TooEarly: a state is older than ``not_before``, or unknown.
        ImpactError: INVALID_TABLE, BUDGET_EXCEEDED for more names than contacts may have bodies, or
            SAME_BODY for a name that is there twice.
    """
    numbers, height = np.asarray(request.bodies), layout.bodies.height
    if numbers.size % height:
        reason = f"must hold {height} rows for {layout.name}, all of one length; holds {numbers.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, "bodies", reason)
    table = without_give(numbers.reshape(height, -1), request.immovable, layout)
    names = names_in(request)
    faults = np.zeros(table.shape[1] + len(names), np.uint8)
    if not names:
        return Bodies(table, faults, [], [], [])

    most = parameters.budget_contacts
    if len(names) > 2 * most:
        reason = f"are {len(names)}; budget.contacts is {most}, and those have {2 * most} bodies at most"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "names", reason)
    check_distinct(names)
    columns, errors = np.full((height, len(names)), math.nan), []
    stamps, ages = [NO_STAMP] * len(names), [math.nan] * len(names)
    at, not_before = nanoseconds(request.header.stamp) or now(), nanoseconds(request.not_before)
    for i, name in enumerate(names):
        if not i % TOGETHER:
            yield
        owner = f"names[{i}]"
        try:
            state = find(states, owner, owner, name, not_before)
            stamps[i], ages[i] = Used.of(state, at)
            check_frame(f"{owner}.header.frame_id", state, "header.frame_id", request.header.frame_id)
            check_age(owner, name, ages[i], parameters.max_state_age)
            columns[:, i] = _column(owner, state, layout)
        except TooEarly:
            raise
        except ImpactError as error:
            errors.append(error)
            faults[table.shape[1] + i] = error.code
    return Bodies(np.concatenate([table, columns], axis=1), faults, errors, stamps, ages)


def without_give(table: Array, immovable: Sequence[int], layout: Tables) -> Array:
    """The bodies of the table; those that do not give way with infinite mass and no inertia.

    Raises:
        ImpactError: INVALID_TABLE.
    """
    if not immovable:
        return table
    check_immovable(immovable, table.shape[1])
    columns, rows = np.asarray(immovable), layout.bodies
    table = table.copy()
    table[rows.mass, columns], table[rows.inertia, columns] = math.inf, 0.0
    return table


def _column(owner: str, state: BodyState, layout: Tables) -> list[float]:
    body = convert.body_of(owner, state)
    convert.check_body(owner, body)
    if body.is_articulated():
        reason = "is for ~/resolve_collision: tables hold rigid bodies"
        raise ImpactError(StatusCode.INVALID_INERTIA, f"{owner}.inverse_inertia", reason)
    body = with_com_as_reference(body)
    if not all(map(math.isfinite, (*body.position, *body.velocity))):
        reason = "the centre of mass is, or moves, beyond float64"
        raise ImpactError(StatusCode.OUT_OF_RANGE, f"{owner}.com", reason)
    if layout.geometry is Geometry.POINT:
        return [body.mass, *body.velocity]
    if layout.geometry is Geometry.PLANAR:
        motion = *body.position[:2], *body.velocity[:2], body.angular_velocity.z
        return [body.mass, body.inertia.zz, *motion]
    column = [body.mass, *body.inertia, *body.position, *body.velocity, *body.angular_velocity]
    if layout.oriented:
        return [*column, *(body.orientation or IDENTITY_QUATERNION)]
    if body.orientation and body.is_movable():
        reason = f"is {tuple(body.orientation)}, for which the layout must be SPATIAL_ORIENTED"
        raise ImpactError(StatusCode.INVALID_ORIENTATION, f"{owner}.pose.orientation", reason)
    return column


def blame(pairs: Array, faults: Array, status: Array) -> None:
    """Write why bodies cannot be used into the status of their contacts."""
    of_a, of_b = np.append(faults, np.uint8(StatusCode.UNKNOWN_BODY)).take(pairs, mode="clip")
    found = np.where(of_a, of_a, of_b)
    np.copyto(status, found, where=(found != StatusCode.UNSET) & (status != StatusCode.SAME_BODY))


def note_of(errors: list[ImpactError]) -> str:
    """What is wrong with the first of the bodies that cannot be used, and how many there are."""
    if not errors:
        return ""
    first = convert.as_in_message(errors[0])
    return first if len(errors) == 1 else f"{first}; {len(errors)} bodies in all cannot be used"
