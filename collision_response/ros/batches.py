"""The service for many independent impacts.

Tables are read in the memory of the request, and results are written in the memory of the response.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time

from ..batch import BatchResult
from ..batch.arrays import Array
from ..batch.plan import BatchRequest, plan_for
from ..batch.resolve_batch import resolve_with_pauses
from ..batch.rows import Layout
from ..body_numbers import orientation_of
from ..model import Geometry
from ..msg import BodyState
from ..physics.centre_of_mass import moment_about_z, planar_spin, with_com_as_reference
from ..physics.laws import PATHS
from ..srv import ResolveCollisionBatch
from ..status import ImpactError, StatusCode
from . import convert
from .body_lookup import (
    BODIES_PER_STEP,
    StateFinder,
    StateNotYetReceived,
    check_immovable,
    check_names,
    check_texts,
)
from .parameters import LatestParameters
from .round_robin import Steps
from .states import LatestStates
from .tables import LAYOUTS, Request, Response, names_in, number_of_names, result_in, table_in, zeros_in


class BatchBodies(NamedTuple):
    """The bodies of a request, first those of the table, then those given by name, with the states used.

    Attributes:
        table: a column for each body, shape ``(rows, bodies)``.
        codes: for each body UNSET, or the :class:`StatusCode` that says why it cannot be used.
        unusable: why bodies cannot be used; empty if all can.
        stamps, ages: of the state of each body given by name, as in ``StateFinder.find``.
    """

    table: Array
    codes: Array
    unusable: str
    stamps: list[Time]
    ages: list[float]


INITIAL_BLOCK = 256
"""Contacts that are computed between two pauses at first. Later blocks are sized by the time they take."""

MOST_OF_PATHS = 32
"""Most contacts of a block by a law that follows a path: one that has too many steps takes 20 ms."""

BLOCK_TIMES = 0.001, 0.004
"""Times [s]: if a block takes less than the first, the next is larger; if more than the second, smaller."""


@dataclass
class BatchService:
    """Answers ``~/resolve_collision_batch``."""

    interface = ResolveCollisionBatch
    name = "~/resolve_collision_batch"
    has_budget = True
    parameters: LatestParameters
    states: LatestStates

    def answer(self, request: Request) -> Steps[tuple[StatusCode, Response]]:
        """Compute the response to a request, in steps."""
        parameters = self.parameters.values
        check_texts(request, ["header.frame_id"])
        finder = StateFinder("header", request.header, request.not_before, self.states, parameters)
        layout = layout_of(request)
        pairs = pairs_of(request, parameters.budget_contacts)
        table, contacts = table_of(request, layout), contacts_of(request, layout, pairs.shape[1])
        model = convert.model_of(request.model, parameters.model._replace(geometry=layout.geometry))
        plan = plan_for(table, contacts, model, pairs)
        names = names_of(request, parameters.budget_contacts)
        look_up = partial(bodies_of, names, table, layout, finder)
        bodies = yield from finder.wait(look_up)

        response = Response()
        out = result_in(response, plan.result_fields(pairs.shape[1], request.report), zeros_in)
        yield from compute(BatchRequest(plan, bodies.table, pairs, contacts), out)

        if bodies.unusable:
            write_codes(pairs, bodies.codes, out.status)
        response.success, response.code, response.header = True, int(StatusCode.OK), request.header
        response.message = bodies.unusable
        response.state_stamps, response.state_ages = bodies.stamps, array("d", bodies.ages)
        convert.write_model(response.model, plan.model)
        return StatusCode.OK, response

    def refusal(self, request: Request, error: ImpactError) -> Response:
        """Return the response that says why there is no answer, with the model of the request."""
        return Response(
            header=request.header,
            model=request.model,
            code=int(error.code),
            message=convert.error_text(error),
        )


def compute(batch: BatchRequest, out: BatchResult) -> Iterator[None]:
    """Compute all impacts into ``out``, with pauses."""
    start, n = 0, batch.contacts.shape[1]
    most = MOST_OF_PATHS if batch.plan.model.law in PATHS else n
    block = min(INITIAL_BLOCK, most)
    while start < n:
        block_start = time.perf_counter()
        stop = start + block
        yield from resolve_with_pauses(batch, out, start=start, stop=stop)
        start = stop
        duration = time.perf_counter() - block_start
        if duration < BLOCK_TIMES[0]:
            block = min(2 * block, most)
        elif duration > BLOCK_TIMES[1] and block > 1:
            block //= 2
        if start < n:
            yield


def layout_of(request: Request) -> Layout:
    """Layout of the tables of a request. An unknown one is refused (INVALID_TABLE)."""
    if request.layout not in LAYOUTS:
        known = ", ".join(f"{layout.name} ({number})" for number, layout in LAYOUTS.items())
        reason = f"must be one of {known}; is {request.layout}"
        raise ImpactError(StatusCode.INVALID_TABLE, "layout", reason)
    return LAYOUTS[request.layout]


def pairs_of(request: Request, max_contacts: int) -> Array:
    """Indices of the bodies of each contact, shape ``(2, N)``.

    Raises:
        ImpactError: INVALID_TABLE if there is an odd number of them; BUDGET_EXCEEDED.
    """
    indices = np.asarray(request.pairs)
    if indices.size % 2:
        reason = f"must hold two indices for each contact, holds {indices.size} in all"
        raise ImpactError(StatusCode.INVALID_TABLE, "pairs", reason)
    if indices.size > 2 * max_contacts:
        reason = f"has {indices.size // 2} contacts; budget.contacts is {max_contacts}: send fewer at a time"
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "pairs", reason)
    return indices.reshape(2, -1).astype(np.int64)


def contacts_of(request: Request, layout: Layout, n: int) -> Array:
    """Table of the ``n`` contacts, shape ``(rows, n)``. Another number of rows is refused (INVALID_TABLE)."""
    numbers, heights = np.asarray(request.contacts), layout.contacts.heights
    rows = numbers.size // n if n else layout.contacts.height
    if numbers.size != rows * n or rows not in heights:
        held = f"{heights[0]} to {heights[-1]} rows of {n} for {layout.name}"
        reason = f"must hold {held}, holds {numbers.size} numbers"
        raise ImpactError(StatusCode.INVALID_TABLE, "contacts", reason)
    return numbers.reshape(rows, n)


def table_of(request: Request, layout: Layout) -> Array:
    """Table of the bodies of a request that are given in full, shape ``(rows, bodies)``.

    Raises:
        ImpactError: INVALID_TABLE if it is incomplete, or an index of ``immovable`` is beyond it.
    """
    rows = layout.bodies
    table = table_in("bodies", request.bodies, rows.height, f" for {layout.name}")
    if request.immovable:
        check_immovable(request.immovable, table.shape[1])
        table, columns = table.copy(), np.asarray(request.immovable)
        table[rows.mass, columns], table[rows.inertia, columns] = math.inf, 0.0
    return table


def names_of(request: Request, max_contacts: int) -> list[str]:
    """Names of the bodies of a request that are given by name.

    Raises:
        ImpactError: BUDGET_EXCEEDED if there are too many names; as ``check_names``.
    """
    number, max_names = number_of_names(request), 2 * max_contacts
    if number > max_names:
        reason = (
            f"holds {number} names; budget.contacts is {max_contacts}, and that many contacts have at most "
            f"{max_names} bodies"
        )
        raise ImpactError(StatusCode.BUDGET_EXCEEDED, "names", reason)
    names = names_in(request)
    check_names(names)
    return names


def bodies_of(names: list[str], table: Array, layout: Layout, finder: StateFinder) -> Steps[BatchBodies]:
    """Collect the bodies of a request: those of the table, then the latest states of those given by name.

    A body given by name that cannot be used is no error: the others are used.

    Raises:
        StateNotYetReceived: if a body has no state that is recent enough.
    """
    count, number = table.shape[1], len(names)
    codes = np.zeros(count + number, np.uint8)
    if not number:
        return BatchBodies(table, codes, "", [], [])
    columns, first_error = np.full((len(table), number), math.nan), ""
    stamps, ages = [Time()] * number, [math.nan] * number
    for i, name in enumerate(names):
        if not i % BODIES_PER_STEP:
            yield None
        owner = f"names[{i}]"
        try:
            state, ages[i] = finder.find(owner, owner, name)
            stamps[i] = state.header.stamp
            finder.check(owner, state, ages[i])
            columns[:, i] = _column(owner, state, layout)
        except StateNotYetReceived:
            raise
        except ImpactError as error:
            first_error = first_error or convert.error_text(error)
            codes[count + i] = error.code
    unusable = summary_of(first_error, int(np.count_nonzero(codes)))
    return BatchBodies(np.concatenate([table, columns], axis=1), codes, unusable, stamps, ages)


def _column(owner: str, state: BodyState, layout: Layout) -> list[float]:
    """Column of the table for a body given by name."""
    body = convert.body_of(owner, state)
    convert.check_body(owner, body)
    if body.inverse_inertia is not None:
        reason = "is for ~/resolve_collision: tables hold rigid bodies"
        raise ImpactError(StatusCode.INVALID_INERTIA, f"{owner}.inverse_inertia", reason)
    body = with_com_as_reference(body)
    if not all(map(math.isfinite, (*body.position, *body.velocity))):
        reason = "position or velocity of the centre of mass is beyond float64"
        raise ImpactError(StatusCode.OUT_OF_RANGE, f"{owner}.com", reason)
    if layout.geometry is Geometry.POINT:
        return [body.mass, *body.velocity]
    if layout.geometry is Geometry.PLANAR:
        motion = *body.position[:2], *body.velocity[:2], planar_spin(body)
        return [body.mass, moment_about_z(body), *motion]
    column = [body.mass, *body.inertia, *body.position, *body.velocity, *body.angular_velocity]
    if layout.oriented:
        return [*column, *orientation_of(body)]
    if body.orientation and any(body.orientation[:3]) and body.is_movable():
        reason = f"is {tuple(body.orientation)}: rotated bodies need the layout SPATIAL_ORIENTED"
        raise ImpactError(StatusCode.INVALID_ORIENTATION, f"{owner}.pose.orientation", reason)
    return column


def write_codes(pairs: Array, codes: Array, status: Array) -> None:
    """Write why bodies cannot be used into the status of their contacts, where SAME_BODY stays."""
    code_a, code_b = np.append(codes, np.uint8(StatusCode.UNKNOWN_BODY)).take(pairs, mode="clip")
    code = np.where(code_a, code_a, code_b)
    np.copyto(status, code, where=(code != StatusCode.UNSET) & (status != StatusCode.SAME_BODY))


def summary_of(first_error: str, count: int) -> str:
    """Text of the first error, and the number of bodies that cannot be used if there are more."""
    return first_error if count < 2 else f"{first_error}; {count} bodies in all cannot be used"
