"""A batch of contacts shared by all tests of batches: sound ones, unusual ones, and some of every fault."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache

import numpy as np
from collisions import Collision
from random_impacts import RandomImpacts

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.batch import BatchResult
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.kernels.layout import NO_ROWS
from collision_response.physics.vector import ZERO, Vec3

GEOMETRIES = (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL)
ANSWERED = (StatusCode.OK, StatusCode.SEPARATING)
N = 300
FIRST_FAULTY = 100
FAULTY_VALUES = (math.nan, math.inf, -1.0, 0.0, 2.0, 5e-309)
"""Each faulty contact has one number replaced by one of these, which are not all invalid everywhere."""


@cache
def shared_batch(geometry: Geometry, *, oriented: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """``bodies`` and ``contacts``: sound ones first; the first four contacts have an immovable body."""
    random = np.random.default_rng(int(geometry))
    body_row, contact_row = body_rows(geometry, oriented=oriented), contact_rows(geometry)
    bodies = random.normal(size=(body_row.height, 2, N))
    contacts = random.normal(size=(contact_row.height, N))
    bodies[body_row.mass] = random.uniform(0.5, 2.0, size=(1, 2, N))
    bodies[body_row.inertia] = _inertias(geometry, random)
    contacts[contact_row.restitution] = random.uniform(size=N)
    contacts[contact_row.friction] = random.uniform(size=N)
    bodies[body_row.mass, 1, 0:3], bodies[body_row.inertia, 1, 0:3] = math.inf, 0.0
    bodies[body_row.mass, 0, 3], bodies[body_row.inertia, 0, 3] = math.inf, 0.0
    if geometry is Geometry.SPATIAL:
        for thin_rod in (2, 4):
            bodies[body_row.inertia, 0, thin_rod] = (0.25, 0.0, 0.0, 0.0, 0.0, 0.25)
    _insert_faults(bodies, contacts, random)
    bodies[body_row.mass, :, N - 1], bodies[body_row.inertia, :, N - 1] = math.inf, 0.0
    contacts[contact_row.normal, N - 2] = 0.0
    bodies[body_row.inertia, 0, N - 3] = 3.0 if geometry is Geometry.PLANAR else _invalid_inertia(geometry)
    if oriented:
        bodies[body_row.orientation, 1, N - 4] = 0.0
    bodies.flags.writeable = contacts.flags.writeable = False
    return bodies, contacts


def _inertias(geometry: Geometry, random: np.random.Generator) -> np.ndarray:
    """Inertias of bodies made of a few points; empty for POINT."""
    if geometry is Geometry.POINT:
        return np.empty((0, 2, N))
    if geometry is Geometry.PLANAR:
        return random.uniform(0.1, 1.0, size=(1, 2, N))
    x, y, z = random.normal(size=(3, 4, 2, N)) * 0.4
    tensor = (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
    return np.array([component.sum(axis=0) for component in tensor])


def _invalid_inertia(geometry: Geometry) -> tuple[float, ...]:
    return (1.0, 0.0, 0.0, 1.0, 0.0, 3.0) if geometry is Geometry.SPATIAL else ()


def _insert_faults(bodies: np.ndarray, contacts: np.ndarray, random: np.random.Generator) -> None:
    numbers = [(bodies, (row, lane)) for row in range(bodies.shape[0]) for lane in (0, 1)]
    numbers += [(contacts, (row,)) for row in range(contacts.shape[0])]
    replaced = [(*number, fault) for number in numbers for fault in FAULTY_VALUES]
    random.shuffle(replaced)
    for i, (array, index, fault) in zip(range(FIRST_FAULTY, N - 4), replaced, strict=False):
        array[(*index, i)] = fault


def collision_at(
    geometry: Geometry, bodies: np.ndarray, contacts: np.ndarray, i: int, number=float
) -> Collision:
    """The bodies and the contact of column ``i``, as the API for single impacts takes them."""
    body_row = body_rows(
        geometry, oriented=bodies.shape[0] == body_rows(Geometry.SPATIAL, oriented=True).height
    )
    contact_row = contact_rows(geometry)

    def read(array: np.ndarray, rows: slice) -> list:
        return [number(x) for x in array[rows].tolist()]

    def vector(components: list, at_end: bool = False) -> Vec3:
        zeros = [number(0.0)] * (3 - len(components))
        return Vec3(*(zeros + components if at_end else components + zeros))

    def body(column: np.ndarray) -> Body:
        position, velocity = vector(read(column, body_row.position)), vector(read(column, body_row.velocity))
        turning = vector(read(column, body_row.angular_velocity), at_end=True)
        inertia = read(column, body_row.inertia)
        if geometry is not Geometry.SPATIAL:  # only the moment about z is in the table
            zz = inertia[0] if inertia else number(0.0)
            inertia = [zz, number(0.0), number(0.0), zz, number(0.0), zz]
        orientation = read(column, body_row.orientation) if body_row.orientation != NO_ROWS else None
        return Body.dynamic(
            number(column[body_row.mass][0]), inertia, position, orientation, velocity, turning
        )

    contact = contacts[:, i]
    return Collision(
        body(bodies[:, 0, i]),
        body(bodies[:, 1, i]),
        Contact(
            vector(read(contact, contact_row.position)),
            vector(read(contact, contact_row.normal)),
            number(contact[contact_row.restitution][0]),
            number(contact[contact_row.friction][0]),
        ),
    )


def collisions_at(geometry: Geometry, bodies: np.ndarray, contacts: np.ndarray) -> list[Collision]:
    """The bodies and the contact of every column."""
    return [collision_at(geometry, bodies, contacts, i) for i in range(bodies.shape[-1])]


def has_tiny_numbers(bodies: np.ndarray) -> np.ndarray:
    """Which contacts have a number so small that products underflow.

    There the kernels of two layouts may differ, and a single impact is computed in other units.
    """
    return ((bodies != 0) & (abs(bodies) < 1e-290)).any(axis=(0, 1))


def batch_of(
    collisions: Iterable[tuple[Body, Body, Contact]],
    geometry: Geometry = Geometry.SPATIAL,
    *,
    oriented: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Pack collisions into the columns of a batch, which has only what its geometry models."""
    collisions = list(collisions)
    body_row, contact_row = body_rows(geometry, oriented=oriented), contact_rows(geometry)
    bodies = np.zeros((body_row.height, 2, len(collisions)))
    contacts = np.zeros((contact_row.height, len(collisions)))

    def first(rows: slice, numbers: tuple[float, ...]) -> tuple[float, ...]:
        return numbers[: rows.stop - rows.start]

    def last(rows: slice, numbers: tuple[float, ...]) -> tuple[float, ...]:
        return numbers[len(numbers) - (rows.stop - rows.start) :]

    for i, (body_a, body_b, contact) in enumerate(collisions):
        for side, body in enumerate((body_a, body_b)):
            column = bodies[:, side, i]
            column[body_row.mass] = body.mass
            column[body_row.inertia] = last(body_row.inertia, body.inertia)
            column[body_row.position] = first(body_row.position, body.position)
            column[body_row.velocity] = first(body_row.velocity, body.velocity)
            column[body_row.angular_velocity] = last(body_row.angular_velocity, body.angular_velocity)
            if oriented:
                column[body_row.orientation] = body.orientation or (0.0, 0.0, 0.0, 1.0)
        contacts[contact_row.position, i] = first(contact_row.position, contact.position)
        contacts[contact_row.normal, i] = first(contact_row.normal, contact.normal)
        contacts[contact_row.restitution, i] = contact.restitution
        contacts[contact_row.friction, i] = contact.friction
    return bodies, contacts


def resolve_one_by_one(
    geometry: Geometry, collisions: list[Collision], models: list[ImpactModel]
) -> BatchResult:
    """The expected result of a batch: each contact by ``resolve``, in the precision of its model.

    In batches, AUTO without a tolerance is DOUBLE, and its errors are not known.
    """
    axes, spins = {Geometry.POINT: (3, 0), Geometry.PLANAR: (2, 1), Geometry.SPATIAL: (3, 3)}[geometry]
    n = len(collisions)
    velocity, spin, impulse = (np.full(shape, np.nan) for shape in ((axes, 2, n), (spins, 2, n), (axes, n)))
    status, bound, precision = np.zeros(n, np.uint8), np.full(n, np.nan), np.zeros(n, np.uint8)
    for i, (collision, model) in enumerate(zip(collisions, models, strict=True)):
        bounded = model.tolerance or model.precision is Precision.EXTENDED
        if not bounded and model.precision is Precision.AUTO:
            model = model._replace(precision=Precision.DOUBLE)
        try:
            impact = resolve(*collision, model)
        except ImpactError as refusal:
            status[i] = refusal.code
            continue
        for side, twist in enumerate((impact.twist_a, impact.twist_b)):
            velocity[:, side, i], spin[:, side, i] = twist.linear[:axes], twist.angular[3 - spins :]
        impulse[:, i] = impact.impulse[:axes]
        status[i], bound[i], precision[i] = impact.status, impact.error_bound, impact.model.precision
        if not bounded and impact.status is StatusCode.TOLERANCE_NOT_MET:
            status[i] = StatusCode.SEPARATING if impact.regime is Regime.SEPARATING else StatusCode.OK
    return BatchResult(velocity, spin, impulse, status, bound, precision)


def columns(result: BatchResult, at) -> BatchResult:
    """Some contacts of a result."""
    return result.mapped(lambda array: array[..., at])


def assert_same(one: BatchResult, other: BatchResult) -> None:
    """Check for equal bits, except for the sign of a zero."""
    for field, a, b in zip(BatchResult._fields, one, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=field)


def assert_same_values(one: BatchResult, other: BatchResult) -> None:
    """Check everything except error bounds and precisions."""
    assert_same(
        one._replace(error_bound=None, precision=None), other._replace(error_bound=None, precision=None)
    )


def ill_conditioned(law: Law, decades: float, count: int = 120):
    """Return random collisions and their models, and the same collisions as a batch."""
    impacts = RandomImpacts(seed=int(decades), decades=decades)
    drawn = [impacts.request(law) for _ in range(count)]
    collisions = [
        Collision(
            body_a._replace(com=ZERO),
            body_b._replace(com=ZERO),
            contact._replace(friction=0.0) if law is Law.FRICTIONLESS else contact,
        )
        for (body_a, body_b, contact), _ in drawn
    ]
    models = [model._replace(geometry=Geometry.AUTO) for _, model in drawn]
    bodies, contacts = batch_of(collisions)
    of_their_own = [model.tangential_restitution for model in models]
    return collisions, models, bodies, np.vstack([contacts, of_their_own])


def on_another_device(array):
    """An array in memory of its own, as that of a GPU: it cannot be mixed with arrays elsewhere."""
    import array_api_strict

    return array_api_strict.asarray(array, device=array_api_strict.Device("device1"))
