"""Batches of hard impacts: each column as one impact alone, whatever is wrong with the others."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from itertools import product
from typing import Any

import pytest

pytest.importorskip("flint")  # EXTENDED must be exact here

import attacks
import exact
import numpy as np
from answer_faults import ANSWERS, LAST_PLACE, resolved, right_answer
from batch_cases import GEOMETRIES, batch_of, collision_at
from exact import PlainCollision
from exact_adapter import as_request

from collision_response import (
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
)
from collision_response.batch import one_by_one, resolve_batch
from collision_response.batch.rows import body_rows, contact_rows

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # NumPy must not warn


def pack(geometry: Geometry, collisions: list[PlainCollision]) -> tuple[np.ndarray, np.ndarray]:
    """The arrays of some collisions; spatial ones have orientations."""
    return batch_of(map(as_request, collisions), geometry, oriented=geometry is Geometry.SPATIAL)


def reduced_to(geometry: Geometry, collision: PlainCollision) -> PlainCollision:
    """The collision without what a batch of this geometry has no rows for, so that AUTO means the same."""
    if geometry is Geometry.SPATIAL:
        return collision
    flat = [solid._replace(orientation=None, inertia=_about_z(solid.inertia)) for solid in collision[:2]]
    if geometry is Geometry.POINT:
        here = collision.contact.position
        flat = [s._replace(inertia=(0.0,) * 6, spin=(0.0,) * 3, position=here) for s in flat]
    return PlainCollision(*flat, collision.contact)


def _about_z(inertia: tuple[float, ...]) -> tuple[float, ...]:
    """The tensor of a PLANAR batch, which has only the moment about z."""
    zz = inertia[5]
    return zz, 0.0, 0.0, zz, 0.0, zz


def differences_to_impact(geometry: Geometry, result: Any, i: int, impact: Impact) -> list[str]:
    """How the numbers of a column differ from those of a single impact, to the bit."""
    axes = len(result.impulse)
    first = {Geometry.POINT: 3, Geometry.PLANAR: 2, Geometry.SPATIAL: 0}[geometry]
    found = []
    if result.status[i] != impact.status:
        found.append(f"status {result.status[i]}, not {impact.status!r}")
    pairs = [("impulse", result.impulse[:, i], impact.impulse[:axes])]
    for lane, twist in enumerate((impact.twist_a, impact.twist_b)):
        pairs.append((f"velocity {lane}", result.velocity[:, lane, i], twist.linear[:axes]))
        pairs.append((f"spin {lane}", result.angular_velocity[:, lane, i], twist.angular[first:]))
    if result.error_bound is not None:
        pairs.append(("error_bound", result.error_bound[i : i + 1], (impact.error_bound,)))
    for name, row, one in pairs:
        if row.tolist() != list(one):
            found.append(f"{name} is {row.tolist()}, not {list(one)}")
    return found


def sound_collisions(geometry: Geometry) -> list[PlainCollision]:
    draw = random.Random("good rows")
    return [
        reduced_to(geometry, attacks.random_boxes(draw, planar=geometry is not Geometry.SPATIAL))
        for _ in range(8)
    ]


BATCH_MODELS = {
    "double": {"precision": Precision.DOUBLE},
    "extended": {"precision": Precision.EXTENDED},
    "tolerance 1e-6": {"tolerance": 1e-6},
    "tolerance 1e-15": {"tolerance": 1e-15},
    "threshold": {"precision": Precision.DOUBLE, "restitution_threshold": 1.0},
    "e_t": {"precision": Precision.DOUBLE, "tangential_restitution": 0.5},
}


@pytest.mark.parametrize("fields", BATCH_MODELS.values(), ids=BATCH_MODELS)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("repeats", [1, 8])
def test_a_column_equals_a_single_impact(geometry, law, fields, repeats):
    """The status and the numbers, in the same model."""
    collisions = sound_collisions(geometry) * repeats
    model = ImpactModel(law, **fields)
    result = resolve_batch(*pack(geometry, collisions), model)
    found = []
    impacts = [resolved(collision, model._replace(geometry=geometry)) for collision in collisions[:8]]
    for i in range(len(collisions)):
        impact = impacts[i % 8]
        found += [f"row {i}: {fault}" for fault in differences_to_impact(geometry, result, i, impact)]
    assert not found, "\n".join(found)


def faulty_values(geometry: Geometry) -> list[tuple[str, str, Any, float]]:
    """Faults: a name, ``bodies`` or ``contacts``, the rows of that table, and the wrong value."""
    body_row, contact_row = body_rows(geometry, oriented=geometry is Geometry.SPATIAL), contact_rows(geometry)
    faults: list[tuple[str, str, Any, float]] = []
    for field in ("mass", "inertia", "position", "velocity", "angular_velocity", "orientation"):
        rows = getattr(body_row, field)
        if rows.stop > rows.start:
            bad = (math.nan, -math.inf) if field == "mass" else (math.nan, -math.inf, math.inf)
            faults += [(f"{field} {value}", "bodies", rows.start, value) for value in bad]
    for field in ("position", "normal", "restitution", "friction"):
        rows = getattr(contact_row, field)
        bad = (math.nan, math.inf, -math.inf)
        faults += [(f"{field} {value}", "contacts", rows.start, value) for value in bad]
    faults += [
        ("mass -1", "bodies", body_row.mass, -1.0),
        ("mass 0", "bodies", body_row.mass, 0.0),
        ("restitution 1.5", "contacts", contact_row.restitution, 1.5),
        ("friction -1", "contacts", contact_row.friction, -1.0),
        ("normal of length 0", "contacts", contact_row.normal, 0.0),
    ]
    if geometry is not Geometry.POINT:
        faults.append(("inertia -1", "bodies", body_row.inertia.start, -1.0))
    if geometry is Geometry.SPATIAL:
        faults.append(("inertia 9", "bodies", body_row.inertia.start, 9.0))
        faults.append(("quaternion of length 0", "bodies", body_row.orientation, 0.0))
    return faults


def with_faulty_columns(geometry: Geometry) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Bodies and contacts with a fault in every other column, which columns are sound, and the faults."""
    sound, faults = sound_collisions(geometry), faulty_values(geometry)
    count = 2 * len(faults)
    bodies, contacts = pack(geometry, [sound[i % len(sound)] for i in range(count)])
    names = [""] * count
    for k, (name, table, rows, value) in enumerate(faults):
        names[2 * k] = name
        if table == "bodies":
            bodies[rows, k % 2, 2 * k] = value
        else:
            contacts[rows, 2 * k] = value
    return bodies, contacts, np.array([not name for name in names]), names


@pytest.mark.parametrize("fields", BATCH_MODELS.values(), ids=BATCH_MODELS)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_faulty_columns_do_not_affect_others(geometry, law, fields):
    """Sound columns have the bits that they have alone; faulty ones have no numbers."""
    bodies, contacts, is_good, names = with_faulty_columns(geometry)
    model = ImpactModel(law, **fields)
    together = resolve_batch(bodies, contacts, model)
    alone = resolve_batch(bodies[..., is_good].copy(), contacts[..., is_good].copy(), model)
    for field, mixed, clean in zip(together._fields, together, alone, strict=True):
        if mixed is not None:
            np.testing.assert_array_equal(mixed[..., is_good], clean, err_msg=field)
    for i, name in enumerate(names):
        if name and together.status[i] not in ANSWERS:
            assert np.isnan(together.impulse[:, i]).all(), name
            assert np.isnan(together.velocity[:, :, i]).all(), name
    one = resolve_batch(bodies[..., 1:2].copy(), contacts[..., 1:2].copy(), model)
    np.testing.assert_array_equal(one.impulse[:, 0], together.impulse[:, 1])


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_faulty_column_has_the_code_of_a_single_impact(geometry, law, precision):
    bodies, contacts, _, names = with_faulty_columns(geometry)
    model = ImpactModel(law, precision=precision)
    status = resolve_batch(bodies, contacts, model).status
    found = []
    for i, name in enumerate(names):
        try:
            code = resolve(
                *collision_at(geometry, bodies, contacts, i), model._replace(geometry=geometry)
            ).status
        except ImpactError as refusal:
            code = refusal.code
        if status[i] != code:
            found.append(f"{name or 'good'}: {StatusCode(status[i]).name}, one impact: {code.name}")
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("geometry", "size"), [*product(GEOMETRIES, (1, 20)), (Geometry.POINT, 600), (Geometry.SPATIAL, 600)]
)
def test_extended_batches_with_much_friction(geometry, size):
    """Each column is within its bound, in batches of any size."""
    cases = list(attacks.batches_with_much_friction())
    cases = (cases * (1 + size // len(cases)))[:size]
    collisions = [case.collision for case in cases]
    if geometry is not Geometry.SPATIAL:
        flat = [attacks.random_boxes(random.Random(case.name), planar=True) for case in cases]
        collisions = [
            attacks.with_contact(reduced_to(geometry, collision), friction=case.collision.contact.friction)
            for collision, case in zip(flat, cases, strict=True)
        ]
    model = ImpactModel(Law.COULOMB, precision=Precision.EXTENDED)
    result = resolve_batch(*pack(geometry, collisions), model)
    found = []
    for field, array in zip(result._fields, result, strict=True):
        if array is None:  # no report was requested
            continue
        for start in range(20, size, 20):  # the same rows again
            np.testing.assert_array_equal(array[..., start : start + 20], array[..., :20], err_msg=field)
    for i, collision in enumerate(collisions[:20]):
        right = right_answer(collision, "COULOMB", 0.0, 0.0)
        row = [*result.impulse[:, i].tolist(), 0.0][:3]
        error = exact.impulse_error(row, right.impulses[0])
        bound, status = result.error_bound[i], result.status[i]
        expected = StatusCode.SEPARATING if right.separating else StatusCode.OK
        if not error <= bound <= LAST_PLACE or status != expected:
            found.append(f"{cases[i].name}: error {error:.3g}, bound {bound:.3g}, status {status}")
    assert not found, "\n".join(found)


@pytest.mark.parametrize("kind", [np.float64, np.float32, Fraction])
@pytest.mark.parametrize("field", ["restitution_threshold", "tolerance", "tangential_restitution"])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_batch_models_with_other_number_types(geometry, field, kind):
    """As with plain floats, bit for bit, or refused by name."""
    arrays = pack(geometry, sound_collisions(geometry))
    plain = resolve_batch(*arrays, ImpactModel(**{field: 0.5}))
    try:
        other = resolve_batch(*arrays, ImpactModel(**{field: kind(0.5)}))
    except (TypeError, ImpactError) as refusal:
        assert kind is not np.float64, refusal  # it is a float
        assert field in str(refusal)
        return
    for name, a, b in zip(plain._fields, plain, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


THIRD = Fraction(1, 3)


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize(
    ("fields", "friction", "velocity_a", "velocity_b"),
    [
        ({"restitution_threshold": THIRD}, 0.3, (0.0, 0.0, -1 / 3), (0.0, 0.0, 1e-18)),  # slower, by rounding
        ({"tangential_restitution": -THIRD}, 1e16, (1e9, 0.0, -1e-6), (0.0, 0.0, 0.0)),
    ],
    ids=["restitution_threshold", "tangential_restitution"],
)
def test_the_rounding_of_a_model_counts_in_a_batch(fields, friction, velocity_a, velocity_b, precision):
    bodies = [Body.dynamic(m, velocity=v) for m, v in ((1.0, velocity_a), (2.0, velocity_b))]
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, friction)
    model = ImpactModel(Law.COULOMB, Geometry.POINT, precision, tolerance=1e-9, **fields)
    alone = resolve(*bodies, contact, model)
    table, contacts = batch_of([(*bodies, contact)], Geometry.POINT, oriented=False)
    for result in (
        resolve_batch(table, contacts, model, report=True),
        resolve_batch(table[..., 0], contacts, model, pairs=[[0], [1]], report=True),
    ):
        assert differences_to_impact(Geometry.POINT, result, 0, alone) == []
        assert (result.error_bound[0], result.precision[0]) == (alone.error_bound, alone.model.precision)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_rounding_of_a_tolerance_changes_no_number(monkeypatch, geometry):
    arrays = pack(geometry, sound_collisions(geometry))
    plain = resolve_batch(*arrays, ImpactModel(tolerance=1e-9))
    monkeypatch.setattr(one_by_one, "resolve", lambda *_: pytest.fail("a row was left to Python"))
    result = resolve_batch(*arrays, ImpactModel(tolerance=Fraction(1, 10**9)))
    for name, a, b in zip(plain._fields, plain, result, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)
