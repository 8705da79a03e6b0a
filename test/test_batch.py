"""Batches: bit for bit the answers of single impacts, for every geometry, law and array library."""

from __future__ import annotations

import re
import tracemalloc
from itertools import product

import pytest

pytest.importorskip("array_api_strict")
pytest.importorskip("dask.array")

import array_api_strict
import dask
import dask.array as da
import numpy as np
from batch_cases import (
    ANSWERED,
    FIRST_FAULTY,
    GEOMETRIES,
    N,
    assert_same,
    assert_same_values,
    collision_at,
    collisions_at,
    columns,
    has_tiny_numbers,
    map_arrays,
    resolve_one_by_one,
    shared_batch,
)
from collisions import LAWS_WITH_FRICTION, LAWS_WITH_ORACLE
from refusals import refused

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
from collision_response.batch import BatchResult, resolve_batch, resolve_scenes
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.impact import impact
from collision_response.kernels import library
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

KINDS = [
    *product(GEOMETRIES, (False,), LAWS_WITH_ORACLE),
    *product((Geometry.SPATIAL,), (True,), LAWS_WITH_ORACLE),
]
STICKS = 7
"""Column of the shared spatial batch whose contact sticks."""

every_kind = pytest.mark.parametrize(("geometry", "oriented", "law"), KINDS)


# against one impact at a time


@every_kind
def test_every_column_equals_resolve(geometry, oriented, law):
    """Sound, unusual and faulty contacts; one with several faults has the code of the first."""
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    model = ImpactModel(law)
    expected = resolve_one_by_one(geometry, collisions_at(geometry, bodies, contacts), [model] * N)
    result = resolve_batch(bodies, contacts, model)
    tiny = has_tiny_numbers(bodies)
    assert_same_values(columns(result, ~tiny), columns(expected, ~tiny))
    np.testing.assert_array_equal(result.status, expected.status)
    # A batch without bounds keeps its units, in which products may underflow.
    np.testing.assert_allclose(result.impulse[:, tiny], expected.impulse[:, tiny], rtol=1e-13, atol=1e-300)
    assert len(set(expected.status)) >= 6
    assert np.isin(expected.status[:FIRST_FAULTY], ANSWERED).all()


@every_kind
def test_a_faulty_contact_affects_no_other(geometry, oriented, law):
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    bad = ~np.isin(result.status, ANSWERED)
    assert bad[FIRST_FAULTY:].any() and not bad[:FIRST_FAULTY].any()
    assert all(np.isnan(array).all() for array in columns(result, bad)[:3])
    assert all(np.isfinite(array).all() for array in columns(result, ~bad)[:3])
    assert_same(
        columns(result, ~bad), resolve_batch(bodies[..., ~bad], contacts[..., ~bad], ImpactModel(law))
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 9, 31])
def test_results_do_not_depend_on_the_size_of_the_batch(count, dtype):
    """SIMD vectors of several contacts are filled up at the end."""
    bodies, contacts = (array.astype(dtype) for array in shared_batch(Geometry.SPATIAL))
    whole = resolve_batch(bodies, contacts)
    for start in range(0, N - count, 61):
        part = slice(start, start + count)
        assert_same(columns(whole, part), resolve_batch(bodies[..., part], contacts[..., part]))


@pytest.mark.parametrize(
    "model",
    [ImpactModel(Law.COULOMB), ImpactModel(Law.MOREAU, tolerance=1e-9), ImpactModel(Law.ROUTH_STRONGE)],
)
@pytest.mark.parametrize("workers", [2, 3])
def test_threads_give_the_same_bits(workers, model):
    bodies, contacts = (np.tile(array, 12) for array in shared_batch(Geometry.SPATIAL))
    shared = resolve_batch(bodies, contacts, model, workers=workers)
    assert_same(shared, resolve_batch(bodies, contacts, model))
    once = resolve_batch(*shared_batch(Geometry.SPATIAL), model)
    assert_same(shared, map_arrays(lambda array: np.tile(array, 12), once))


def test_intermediate_overflow_is_answered_as_by_resolve():
    bodies, contacts = (array[..., STICKS : STICKS + 30].copy() for array in shared_batch(Geometry.SPATIAL))
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    contacts[contact_row.normal, 0] *= 1e-200
    contacts[contact_row.normal, 1] = 1.0
    bodies[body_row.velocity, 0, 1] = -1e308
    bodies[body_row.velocity, 1, 1] = 1e308
    model = ImpactModel(Law.COULOMB)
    result = resolve_batch(bodies, contacts, model)
    assert (result.status[0], result.status[1]) == (StatusCode.OK, StatusCode.OUT_OF_RANGE)
    collisions = collisions_at(Geometry.SPATIAL, bodies, contacts)
    assert_same_values(result, resolve_one_by_one(Geometry.SPATIAL, collisions, [model] * 30))


@pytest.mark.parametrize("length", [1e155, 1e200, 1e-200, 1e300])
@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_normal_may_have_any_length(geometry, law, length):
    """Its square, or ``n.K n``, is beyond float64."""
    bodies, contacts = (array[..., STICKS : STICKS + 9].copy() for array in shared_batch(geometry))
    contacts[contact_rows(geometry).normal, ::2] *= length  # next to ordinary ones
    model = ImpactModel(law)
    result = resolve_batch(bodies, contacts, model)
    collisions = collisions_at(geometry, bodies, contacts)
    assert_same_values(result, resolve_one_by_one(geometry, collisions, [model] * 9))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize(("mass", "length"), [(1.0, 1e20), (1e-36, 100.0), (1e-30, 1e5)])
def test_float32_survives_intermediate_overflow(law, mass, length):
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies = np.zeros((body_row.height, 2, 5), np.float32)
    contacts = np.zeros((contact_row.height, 5), np.float32)
    bodies[body_row.mass], bodies[body_row.velocity][1, 0] = mass, -1
    contacts[contact_row.normal][1] = length
    contacts[contact_row.restitution] = 0.5
    contacts[contact_row.friction] = 0.25
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    np.testing.assert_allclose(result.impulse[1], 0.75 * mass, rtol=1e-5)
    np.testing.assert_allclose(result.velocity[1], [[-0.25] * 5, [-0.75] * 5], rtol=1e-5)


@pytest.mark.parametrize("speed", [-1e200, 1e200])
def test_energies_beyond_float64_are_refused_where_they_are_reported(speed):
    bodies, contacts = (array[..., STICKS : STICKS + 5].copy() for array in shared_batch(Geometry.POINT))
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies[body_row.velocity], contacts[contact_row.normal] = 0.0, 0.0
    contacts[contact_row.normal][0], bodies[body_row.velocity][0, 0, 2] = 1.0, speed
    result = resolve_batch(bodies, contacts, ImpactModel(Law.COULOMB), report=True)
    with pytest.raises(ImpactError) as refused:
        resolve(*collision_at(Geometry.POINT, bodies, contacts, 2), ImpactModel(Law.COULOMB))
    assert result.status[2] == refused.value.code == StatusCode.OUT_OF_RANGE
    assert np.isnan(result.velocity[..., 2]).all() and np.isnan(result.kinetic_energy_before[2])
    assert np.isfinite(result.velocity[..., [0, 1, 3, 4]]).all()


# float32


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_float32_equals_single_precision(geometry, law):
    """Thin rods are left out: float32 knows their tensors to fewer digits."""
    bodies, contacts = (array[..., 5:FIRST_FAULTY].astype(np.float32) for array in shared_batch(geometry))
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    assert {array.dtype for array in result[:3]} == {np.dtype(np.float32)}
    model = ImpactModel(law, precision=Precision.SINGLE)
    collisions = collisions_at(geometry, bodies.astype(float), contacts.astype(float))
    assert_same_values(result, resolve_one_by_one(geometry, collisions, [model] * len(collisions)))


def skew_bodies(thickness):
    """Float32 tables of bodies whose tensors float32 holds to rounding only: thin rods, or flat plates.

    Each strikes the floor, in many orientations of its axes.
    """
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(200, 3, 3)))[0]
    S = np.einsum("nij,j,nkj->nik", axes, [1.0, thickness, 0.0], axes)  # second moments of mass
    full = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
    bodies, contacts = np.zeros((body_row.height, 2, 200)), np.zeros((contact_row.height, 200))
    bodies[body_row.mass] = [[1.0], [np.inf]]
    bodies[body_row.inertia][:, 0] = full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]].T
    bodies[body_row.velocity][:, 0] = [[0.5], [0.0], [-1.0]]
    contacts[contact_row.position], contacts[contact_row.normal][2] = [[0.3], [0.2], [-0.1]], 1.0
    contacts[contact_row.restitution], contacts[contact_row.friction] = 0.5, 0.2
    return bodies.astype(np.float32), contacts.astype(np.float32)


@pytest.mark.parametrize("power", [-70, 70])
@pytest.mark.parametrize("thickness", [0.0, 0.25])
def test_thin_bodies_of_float32_are_the_same_in_any_units(thickness, power):
    """Contacts near the ends of float32 are computed again, from tensors with the rounding of float32."""
    bodies, contacts = skew_bodies(thickness)
    body_row, model = body_rows(Geometry.SPATIAL), ImpactModel(Law.COULOMB)
    usual = resolve_batch(bodies, contacts, model)
    assert (usual.status == StatusCode.OK).all()
    bodies[body_row.mass], bodies[body_row.inertia] = (
        np.ldexp(bodies[rows], power) for rows in (body_row.mass, body_row.inertia)
    )
    again = resolve_batch(bodies, contacts, model)
    np.testing.assert_array_equal(again.status, usual.status)
    # tens of roundings of float32
    np.testing.assert_allclose(np.ldexp(again.impulse, -power), usual.impulse, atol=4e-6)
    np.testing.assert_allclose(again.velocity, usual.velocity, atol=4e-6)
    np.testing.assert_allclose(again.angular_velocity, usual.angular_velocity, atol=4e-6)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize(("mass", "speed", "report"), [(1e30, 1e20, False), (1.0, 1e38, True)])
def test_results_beyond_float32_are_refused(law, mass, speed, report, recwarn):
    bodies, contacts = sound_tables(Geometry.POINT, np.float32)
    body_row, model = body_rows(Geometry.POINT), ImpactModel(law)
    bodies[body_row.mass][..., 1], bodies[body_row.velocity][..., 1] = mass, 0.0
    bodies[body_row.velocity][0, 0, 1] = -speed
    result = resolve_batch(bodies, contacts, model, report=report)
    assert result.status.tolist() == [StatusCode.OK, StatusCode.OUT_OF_RANGE, StatusCode.SEPARATING]
    assert np.isnan(result.velocity[..., 1]).all() and np.isnan(result.impulse[..., 1]).all()
    assert not recwarn.list


def test_single_agrees_with_double_to_its_precision():
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))
    exact = resolve_batch(bodies, contacts)
    single = resolve_batch(bodies.astype(np.float32), contacts.astype(np.float32))
    error = abs(single.velocity - exact.velocity).max(axis=(0, 1)) / abs(exact.velocity).max(axis=(0, 1))
    assert np.median(error) < 2e-6  # tens of roundings
    assert error[[2, 4]].max() < 1e-4  # thin rods, whose float32 tensors have fewer digits


# what may vary


def test_tangential_restitution_of_the_model_or_of_each_contact():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    one = resolve_batch(bodies, contacts, ImpactModel(Law.COULOMB, tangential_restitution=0.5))
    assert resolve(*collision_at(Geometry.SPATIAL, bodies, contacts, STICKS)).regime is Regime.STICKING
    row = np.full((1, N), 0.5)
    assert_same(one, resolve_batch(bodies, np.concatenate([contacts, row]), ImpactModel(Law.COULOMB)))
    row[0, 8] = 1.5
    result = resolve_batch(bodies, np.concatenate([contacts, row]))
    assert result.status[8] == StatusCode.INVALID_COEFFICIENT
    assert (one.impulse[:, STICKS] != resolve_batch(bodies, contacts).impulse[:, STICKS]).all()


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_restitution_threshold(law):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    model = ImpactModel(law, restitution_threshold=1.0)
    result, at = resolve_batch(bodies, contacts, model), contact_rows(Geometry.SPATIAL)
    plastic = contacts.copy()
    plastic[at.restitution, :FIRST_FAULTY] = 0.0
    before = [
        resolve(*collision_at(Geometry.SPATIAL, bodies, contacts, i)).normal_velocity_before
        for i in range(FIRST_FAULTY)
    ]
    slow = np.flatnonzero([-1 < speed < 0 for speed in before])
    assert 5 < slow.size < 95
    expected = resolve_batch(bodies, plastic, model._replace(restitution_threshold=0.0))
    assert_same(columns(result, slow), columns(expected, slow))


def test_frictionless_needs_no_row_of_friction():
    bodies, contacts = shared_batch(Geometry.PLANAR)
    contact_row = contact_rows(Geometry.PLANAR)
    sound = slice(FIRST_FAULTY)  # faulty friction is refused even where the law does not use it
    bare = resolve_batch(bodies, contacts[: contact_row.friction.start])
    assert_same(
        columns(bare, sound), columns(resolve_batch(bodies, contacts, ImpactModel(Law.FRICTIONLESS)), sound)
    )
    assert_same(resolve_batch(bodies, contacts), resolve_batch(bodies, contacts, ImpactModel(Law.COULOMB)))


def test_oriented_bodies_are_solved_in_their_own_axes():
    bodies, contacts = shared_batch(Geometry.SPATIAL, oriented=True)
    assert resolve_batch(bodies, contacts).status[N - 4] == StatusCode.INVALID_ORIENTATION
    aligned, of = bodies.copy(), body_rows(Geometry.SPATIAL, oriented=True)
    aligned[of.orientation] = [[[0.0]], [[0.0]], [[0.0]], [[2.0]]]
    turned, straight = (resolve_batch(array, contacts) for array in (bodies, aligned))
    bare = resolve_batch(bodies[: of.orientation.start], contacts)
    sound = slice(FIRST_FAULTY)
    assert_same(columns(straight, sound), columns(bare, sound))
    assert (abs(turned.impulse - straight.impulse)[:, sound].max(axis=0) > 1e-9).sum() > 20


# where results go


@pytest.mark.parametrize("order", ["C", "F"])
def test_out_is_written_to(order):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    result = resolve_batch(bodies, contacts)
    out = map_arrays(lambda array: np.full_like(array, 9, order=order), result)
    assert resolve_batch(bodies, contacts, out=out) is out
    assert_same(out, result)


def shifted(array: np.ndarray, offset: int) -> np.ndarray:
    """An array of this shape and type that begins some elements after the start of a cache line, filled."""
    memory = np.zeros(array.nbytes + 128, np.uint8)
    start = -memory.ctypes.data % 64 + offset * array.itemsize
    found = memory[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
    found.fill(9)
    return found


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [1, 3, 7, 8, 9, 16, 17, 33, 119, 121, 127, 240, N])
def test_results_may_begin_anywhere_in_a_cache_line(n, dtype):
    """The kernels write whole lines, and the columns before and after them with columns next to them."""
    bodies, contacts = (array[..., :n].astype(dtype) for array in shared_batch(Geometry.SPATIAL))
    table, pairs = bodies.reshape(len(bodies), -1), np.arange(2 * n).reshape(2, n)
    expected = resolve_batch(bodies, contacts)
    for offset in range(64 // expected.velocity.itemsize):
        out = map_arrays(lambda array, offset=offset: shifted(array, offset), expected)
        assert_same(resolve_batch(bodies, contacts, out=out), expected)
        out = map_arrays(lambda array, offset=offset: shifted(array, offset), expected)
        assert_same(resolve_batch(table, contacts, pairs=pairs, out=out), expected)


def test_any_memory_layout_is_read_and_not_changed():
    bodies, contacts = shared_batch(Geometry.PLANAR)
    expected = resolve_batch(bodies, contacts)
    wide = np.repeat(bodies, 2, axis=-1), np.asfortranarray(contacts)
    assert_same(expected, resolve_batch(wide[0][..., ::2], wide[1]))
    assert_same(expected, resolve_batch(*shared_batch(Geometry.PLANAR)))


def test_no_contacts():
    for geometry in GEOMETRIES:
        bodies, contacts = (array[..., :0] for array in shared_batch(geometry))
        result = resolve_batch(bodies, contacts)
        assert result.status.shape == (0,)
        assert result.impulse.shape == (2 if geometry is Geometry.PLANAR else 3, 0)


def test_only_the_results_take_memory():
    bodies, contacts = (np.tile(array[..., :FIRST_FAULTY], 400) for array in shared_batch(Geometry.SPATIAL))
    out = resolve_batch(bodies, contacts)
    tracemalloc.start()
    resolve_batch(bodies, contacts, out=out)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < bodies.nbytes / 50  # masks for the few contacts that are computed again


# what is refused


def invalid_arguments() -> list[tuple[str, dict]]:
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    out = resolve_batch(bodies, contacts)
    single = {"bodies": bodies.astype(np.float32), "contacts": contacts.astype(np.float32)}
    return [
        ("bodies, contacts: must both be float32 or float64", {"bodies": np.zeros((16, 2, N), int)}),
        ("are float32, float64", {"bodies": bodies.astype(np.float32)}),
        ("bodies: must be of shape", {"bodies": bodies[:5]}),
        ("bodies: must be of shape", {"bodies": bodies[:, 0]}),
        ("contacts: must be of shape (rows, 300)", {"contacts": contacts[:, :7]}),
        ("contacts: SPATIAL has 7 to 9 rows, not 3", {"contacts": contacts[:3]}),
        *(
            (
                f"model.law: is {law.name}, but contacts has no row of friction",
                {"contacts": contacts[:7], "model": ImpactModel(law)},
            )
            for law in LAWS_WITH_FRICTION
        ),
        ("model.geometry: must be AUTO, SPATIAL", {"model": ImpactModel(geometry=Geometry.POINT)}),
        ("model.precision: must be AUTO, DOUBLE", {"model": ImpactModel(precision=Precision.SINGLE)}),
        (
            "model.precision: must be AUTO, SINGLE",
            {**single, "model": ImpactModel(precision=Precision.DOUBLE)},
        ),
        *(
            ("model.law: must be AUTO, FRICTIONLESS, COULOMB, MOREAU", {**single, "model": ImpactModel(law)})
            for law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
        ),
        ("model.tolerance: must be 0.0", {**single, "model": ImpactModel(tolerance=1e-6)}),
        ("out.error_bound: must be float64", {"out": out, "model": ImpactModel(tolerance=1e-6)}),
        ("out.error_bound: must be None", {"out": out._replace(error_bound=np.empty(N))}),
        ("out.velocity: must be float64 of shape (3, 2, 300)", {"out": columns(out, slice(5))}),
        ("out.status: must be uint8 of shape (300,), is [1, 1]", {"out": out._replace(status=[1, 1])}),
        (
            "out: must be None for arrays of dask",
            {"bodies": da.from_array(bodies), "contacts": da.from_array(contacts), "out": out},
        ),
        (
            "contacts: must have a known number of rows",
            {"contacts": da.from_array(contacts)[da.from_array(np.ones(8, bool))]},
        ),
    ]


INVALID = invalid_arguments()


@pytest.mark.parametrize(("message", "changes"), INVALID, ids=[message for message, _ in INVALID])
def test_invalid_arguments_are_refused(message, changes):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    with pytest.raises(ValueError, match=re.escape(message)):
        resolve_batch(**{"bodies": bodies, "contacts": contacts, **changes})


@pytest.mark.parametrize(
    "changes",
    [changes for message, changes in INVALID if "out" not in changes and "known" not in message],
    ids=lambda changes: "-".join(changes),
)
@pytest.mark.parametrize("known", [True, False])
def test_lazy_arrays_are_refused_in_the_same_words(changes, known):
    """Before anything is computed. An array of unknown length has the length of the other one."""
    given = dict(zip(("bodies", "contacts"), shared_batch(Geometry.SPATIAL), strict=True)) | changes
    with pytest.raises(ValueError) as refusal:
        resolve_batch(**given)
    model = given.pop("model", ImpactModel())
    lazy = {name: da.from_array(array) for name, array in given.items()}
    if not known and lazy["bodies"].shape[-1] == lazy["contacts"].shape[-1]:
        lazy["bodies"] = lazy["bodies"][..., da.ones(N, dtype=bool)]
    with pytest.raises(type(refusal.value), match=f"^{re.escape(str(refusal.value))}$"):
        resolve_batch(**lazy, model=model)


def test_an_invalid_model_is_refused():
    with refused(StatusCode.INVALID_COEFFICIENT):
        resolve_batch(*shared_batch(Geometry.POINT), ImpactModel(tangential_restitution=2.0))


# arrays of other makes


MODELS = [
    ImpactModel(),
    ImpactModel(Law.MOREAU, tolerance=1e-10),
    ImpactModel(Law.ROUTH_POISSON),
    ImpactModel(precision=Precision.EXTENDED),
]


@pytest.mark.parametrize("model", MODELS)
def test_array_api_arrays_give_array_api_arrays(model):
    bodies, contacts = shared_batch(Geometry.PLANAR)
    result = resolve_batch(array_api_strict.asarray(bodies), array_api_strict.asarray(contacts), model)
    expected = resolve_batch(bodies, contacts, model)
    for array, wanted in zip(result, expected, strict=True):
        assert (array is None) == (wanted is None)
        if wanted is not None:
            assert isinstance(array, type(array_api_strict.asarray([0.0])))
            np.testing.assert_array_equal(np.from_dlpack(array), wanted)


@pytest.mark.parametrize("model", MODELS)
def test_dask_is_lazy_and_keeps_its_chunks(model):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    read = []

    def block(array, start, stop):
        read.append((start, stop))
        return array[..., start:stop]

    cuts = [(0, 100), (100, 110), (110, N)]

    def chunked(array):
        parts = [
            da.from_delayed(
                dask.delayed(block)(array, *cut), (*array.shape[:-1], cut[1] - cut[0]), array.dtype
            )
            for cut in cuts
        ]
        return da.concatenate(parts, axis=-1)

    result = resolve_batch(chunked(bodies), chunked(contacts), model)
    assert read == []
    expected = resolve_batch(bodies, contacts, model)
    for array, wanted in zip(result, expected, strict=True):
        assert (array is None) == (wanted is None)
        if wanted is not None:
            assert array.chunks[-1] == (100, 10, 190)
            assert (array.shape, array.dtype) == (wanted.shape, wanted.dtype)
    some_velocities = result.velocity[..., :100].compute(scheduler="synchronous")
    assert set(read) == {(0, 100)}
    np.testing.assert_array_equal(some_velocities, expected.velocity[..., :100])
    computed = dask.compute(*(array for array in result if array is not None), scheduler="synchronous")
    for array, wanted in zip(computed, (x for x in expected if x is not None), strict=True):
        np.testing.assert_array_equal(array, wanted)


LAZY = {"bodies": (4, 1, 90), "contacts": (3, 70)}


@pytest.mark.parametrize("report", [False, True])
@pytest.mark.parametrize("lazy", [{"bodies"}, {"contacts"}, {"bodies", "contacts"}])
@pytest.mark.parametrize("other", [np.asarray, array_api_strict.asarray])
def test_one_dask_array_makes_the_results_dask_arrays(lazy, other, report):
    """Chunked as the bodies are, or as the contacts where only those are dask arrays."""
    given = dict(zip(LAZY, shared_batch(Geometry.SPATIAL), strict=True))
    mixed = {
        name: da.from_array(array, chunks=LAZY[name]) if name in lazy else other(array)
        for name, array in given.items()
    }
    result = resolve_batch(**mixed, report=report)
    here = [array for array in result if array is not None]
    assert all(isinstance(array, da.Array) for array in here)
    cuts = (90, 90, 90, 30) if "bodies" in lazy else (70, 70, 70, 70, 20)
    assert {array.chunks[-1] for array in here} == {cuts}
    assert result.impulse.chunks == ((3,), cuts)
    computed = map_arrays(lambda array: array.compute(scheduler="synchronous"), result)
    assert_same(computed, resolve_batch(**given, report=report))


@pytest.mark.parametrize("cuts", [(100, 0, 200), (0, 300), (100, 0, 0, 200, 0), (300,)])
def test_empty_chunks_are_left_out(cuts):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    result = resolve_batch(
        da.from_array(bodies, chunks=(16, 2, cuts)), da.from_array(contacts, chunks=(8, cuts))
    )
    assert result.status.chunks == (tuple(n for n in cuts if n),)
    np.testing.assert_array_equal(
        result.status.compute(scheduler="synchronous"), resolve_batch(bodies, contacts).status
    )


@pytest.mark.parametrize("of_contacts", [("bodies", "contacts"), ("contacts", "pairs")])
@pytest.mark.parametrize("lazy", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("chunks", [(50, 50), (50, 100), (N, N)])
def test_chunks_of_unknown_length_must_be_those_of_every_contact(chunks, lazy, of_contacts):
    """They hold the contacts that a condition chose. If only some arrays have them, another one is named."""
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    given = {"bodies": bodies, "contacts": contacts}
    if "pairs" in of_contacts:
        given["bodies"] = bodies.reshape(len(bodies), -1)
        given["pairs"] = np.array([range(N), range(N, 2 * N)])
    chosen = np.arange(N) % 3 > 0
    known = given | {name: given[name][..., chosen] for name in of_contacts}
    unknown = {
        name: da.from_array(given[name], chunks=(*given[name].shape[:-1], size))[
            ..., da.from_array(chosen, chunks=size)
        ]
        for name, size, is_lazy in zip(of_contacts, chunks, lazy, strict=True)
        if is_lazy
    }
    if all(lazy) and chunks[0] == chunks[1]:
        result = resolve_batch(**known | unknown)
        assert_same(
            map_arrays(lambda array: array.compute(scheduler="synchronous"), result), resolve_batch(**known)
        )
    else:
        with pytest.raises(ValueError, match=r"^(bodies|contacts|pairs): must have the chunks of "):
            resolve_batch(**known | unknown)


@pytest.mark.parametrize("make", [np.asarray, array_api_strict.asarray, da.asarray])
@pytest.mark.parametrize(
    ("changes", "name"),
    [
        *(({"bodies": no_table}, "bodies") for no_table in (np.float64(1), None, "x", [[1], [1, 2]], {})),
        *(({"contacts": no_table}, "contacts") for no_table in (np.float64(1), None, "x", [[1], [1, 2]])),
        *(({"out": none}, "out") for none in ((), [], "out", np.zeros(3), {})),
    ],
)
def test_arguments_of_wrong_types_are_refused_by_name(make, changes, name):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    with pytest.raises(ValueError, match=rf"^(bodies, )?{name}\b") as refusal:
        resolve_batch(**{"bodies": make(bodies), "contacts": make(contacts)} | changes)
    assert ": must " in str(refusal.value)


@pytest.mark.parametrize("make", [tuple, list])
def test_an_out_of_another_type_is_refused(make):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    out = make(resolve_batch(bodies, contacts))
    with pytest.raises(ValueError, match=f"^out: must be a BatchResult, is {make.__name__}$"):
        resolve_batch(bodies, contacts, out=out)


def with_masked_entry(array: np.ndarray) -> np.ma.MaskedArray:
    """The array with its last entry masked."""
    mask = np.zeros(array.shape, bool)
    mask.flat[-1] = True
    return np.ma.masked_array(array, mask)


@pytest.mark.parametrize("name", ["bodies", "contacts", "pairs"])
def test_masked_entries_are_refused(name):
    """A mask that hides nothing is accepted."""
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies = np.zeros((body_row.height, 3))
    contacts = np.zeros((contact_row.height, 2))
    pairs = np.array([[0, 1], [2, 2]])
    bodies[body_row.mass], contacts[contact_row.normal] = (2.0, 1.0, np.inf), [[0.0], [0.0], [1.0]]
    bodies[body_row.velocity][2] = -1.0
    given = {"bodies": bodies, "contacts": contacts, "pairs": pairs}
    expected = resolve_batch(**given)
    assert_same(resolve_batch(**given | {name: np.ma.masked_array(given[name])}), expected)
    for solve in (resolve_batch, resolve_scenes):
        with pytest.raises(ValueError, match=f"^{name}: must be numbers, some are masked$"):
            solve(**given | {name: with_masked_entry(given[name])})


def test_a_masked_tolerance_is_refused(recwarn):
    with pytest.raises(TypeError, match=r"^model\.tolerance: must be a real number"):
        resolve_batch(*shared_batch(Geometry.POINT), ImpactModel(tolerance=np.ma.masked))
    assert not recwarn.list


def test_results_may_not_share_memory():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    out = resolve_batch(bodies, contacts, report=True)
    for one, other in (("kinetic_energy_before", "kinetic_energy_after"), ("status", "regime")):
        shared = out._replace(**{other: getattr(out, one)})
        with pytest.raises(
            ValueError, match=f"^out.{other}: must have memory of its own, shares that of out.{one}"
        ):
            resolve_batch(bodies, contacts, report=True, out=shared)
    n = contacts.shape[1]
    memory = np.empty((5, n))
    parts = out._replace(impulse=memory[:3], kinetic_energy_before=memory[2])
    with pytest.raises(ValueError, match=r"^out\.kinetic_energy_before: .* shares that of out\.impulse$"):
        resolve_batch(bodies, contacts, report=True, out=parts)
    parts = out._replace(impulse=memory[:3], kinetic_energy_before=memory[3], kinetic_energy_after=memory[4])
    assert_same(resolve_batch(bodies, contacts, report=True, out=parts), out)


@pytest.mark.parametrize("field", ["velocity", "status", "energy_lost_friction"])
def test_results_that_cannot_be_written_are_named(field):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    out = resolve_batch(bodies, contacts, report=True)
    getattr(out, field).flags.writeable = False
    with pytest.raises(ValueError, match=f"^out.{field}: must be writable, is read-only"):
        resolve_batch(bodies, contacts, report=True, out=out)


def overlapping(array: np.ndarray, axis: int, step: int) -> np.ndarray:
    """An array of this shape and type whose elements along an axis are ``step`` bytes apart."""
    strides = list(np.empty(array.shape, array.dtype).strides)
    strides[axis] = step
    memory = np.zeros(2 * array.nbytes + 64, np.uint8).view(array.dtype)
    return np.lib.stride_tricks.as_strided(memory, array.shape, strides)


@pytest.mark.parametrize("field", BatchResult._fields)
def test_a_result_that_overlaps_itself_is_refused(field):
    """Where two of its elements have a byte in common, one of them would be lost."""
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    model = ImpactModel(tolerance=1e-6)
    out = resolve_batch(bodies, contacts, model, report=True)
    array = getattr(out, field)
    steps = [(-1, step) for step in {0, array.itemsize // 2}] + [(axis, 0) for axis in range(array.ndim - 1)]
    if array.ndim > 1:
        row = array.shape[-1] * array.itemsize
        steps += [(array.ndim - 2, row - array.itemsize), (array.ndim - 2, array.itemsize)]
    for axis, step in steps:
        given = out._replace(**{field: overlapping(array, axis, step)})
        with pytest.raises(ValueError, match=f"^out.{field}: must not overlap itself$"):
            resolve_batch(bodies, contacts, model, report=True, out=given)


def test_a_result_may_have_any_strides_without_overlap():
    """Also two rows that interleave: elements 0, 2, 4, ... and 3, 5, 7, ... of the memory."""
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    expected = resolve_batch(bodies, contacts)
    n, size = contacts.shape[1], 8
    reverse = np.empty((n, 3))[::-1, ::-1].T
    strides = 4 * n * size, 3 * size, 2 * size
    interleaved = np.lib.stride_tricks.as_strided(np.empty(12 * n), (3, 2, n), strides)
    out = expected._replace(impulse=reverse, velocity=interleaved)
    assert_same(resolve_batch(bodies, contacts, out=out), expected)


NO_RESULTS = {
    "nothing": lambda array: None,
    "a list": lambda array: array.tolist(),
    "a number": lambda array: array.dtype.type(0),
    "no axis": lambda array: np.zeros((), array.dtype),
    "one too few": lambda array: array[..., 1:],
    "another type": lambda array: np.zeros(array.shape, np.int16),
}


@pytest.mark.parametrize("wrong", NO_RESULTS)
@pytest.mark.parametrize("field", BatchResult._fields)
def test_an_array_of_out_that_does_not_fit_is_named(field, wrong):
    """Of any kind: kernels that read its memory unchecked would crash."""
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    model = ImpactModel(tolerance=1e-6)
    out = resolve_batch(bodies, contacts, model, report=True)
    given = NO_RESULTS[wrong](getattr(out, field))
    with pytest.raises(ValueError, match=r"^out\.\w+: must be "):
        resolve_batch(bodies, contacts, model, report=True, out=out._replace(**{field: given}))


def test_results_may_lie_between_each_other_in_memory():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    expected = resolve_batch(bodies, contacts, report=True)
    memory = np.empty((contacts.shape[1], 2))
    mixed = expected._replace(kinetic_energy_before=memory[:, 0], kinetic_energy_after=memory[:, 1])
    assert_same(resolve_batch(bodies, contacts, report=True, out=mixed), expected)


def test_results_are_compared_by_identity():
    """The truth value of arrays that are compared would be an error."""
    batch = shared_batch(Geometry.POINT)
    one, other = resolve_batch(*batch), resolve_batch(*batch)
    assert (one == one, one == other, one != one, one != other) == (True, False, False, True)
    assert len({one, other, one}) == 2


@pytest.mark.parametrize("workers", [1, 2, np.int64(2), np.uint8(3)])
def test_workers_may_be_any_integer_type(workers):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    assert_same(resolve_batch(bodies, contacts, workers=workers), resolve_batch(bodies, contacts))


def collision_of_arrays(number) -> tuple[Body, Body, Contact]:
    """The sound contacts of the shared batch as one collision of arrays; ``number`` converts a row."""
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))

    def body(of: np.ndarray) -> Body:
        rows = [number(row) for row in of]
        position, velocity, spin = (Vec3(*rows[start : start + 3]) for start in (7, 10, 13))
        return Body(rows[0], Symmetric3(*rows[1:7]), position, None, velocity, spin)

    rows = [number(row) for row in contacts]
    return body(bodies[:, 0]), body(bodies[:, 1]), Contact(Vec3(*rows[:3]), Vec3(*rows[3:6]), *rows[6:])


MAKES = [
    *product([np.array, array_api_strict.asarray], LAWS_WITH_ORACLE),
    (da.from_array, Law.COULOMB),  # dask would recompute every turn of a loop from the start
]


@pytest.mark.parametrize(("make", "law"), MAKES, ids=lambda one: getattr(one, "__module__", None) or one.name)
def test_the_formulas_accept_arrays_of_other_libraries(make, law):
    """All contacts of a batch at once, bit for bit as the batch answers."""
    with np.errstate(all="ignore"):
        answer = impact(*collision_of_arrays(make), law)
        impulse = [np.asarray(x) for x in answer.changes.impulse]
        spin = [np.asarray(x) for x in answer.report.twist_b.angular]
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))
    expected = resolve_batch(bodies, contacts, ImpactModel(law))
    np.testing.assert_array_equal(impulse, expected.impulse)
    np.testing.assert_array_equal(spin, expected.angular_velocity[:, 1])


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("e", [0.0, 1e-100, 1e-20, 1e-16, 0.5, 1.0])
def test_slip_that_stops_as_compression_ends(law, e):
    """Friction stops the slip of these balls after 3.5 mu of the approach. All numbers except the moments are
    dyadic.
    """
    slips = np.array(
        [(mu, 3.5 * mu * speed, speed) for mu in (0.125, 0.25, 0.5, 1.0) for speed in (0.5, 1, 3)]
    )
    mu, slip, speed = slips.T
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((body_row.height, 2, mu.size)), np.zeros((contact_row.height, mu.size))
    bodies[body_row.mass, 0], bodies[body_row.mass, 1] = 1, np.inf
    bodies[body_row.inertia, 0] = np.array([[0.1, 0, 0, 0.1, 0, 0.1]]).T
    bodies[body_row.position, 0] = [[0], [0], [0.5]]
    bodies[body_row.velocity, 0] = slip, 0 * slip, -speed
    contacts[contact_row.normal] = [[0], [0], [1]]
    contacts[contact_row.restitution], contacts[contact_row.friction] = e, mu
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    assert (result.status == StatusCode.OK).all()
    # u_n+ = -e u_n, and all the friction has gone into stopping the slip.
    expected = np.array([-mu * speed, 0 * speed, (1 + e) * speed])
    np.testing.assert_allclose(result.impulse, expected, rtol=1e-12, atol=1e-14)


# the levels of the machine


@pytest.mark.parametrize("model", [{}, {"tolerance": 1e-10}, {"precision": Precision.EXTENDED}])
@every_kind
def test_every_vector_width_gives_the_same_bits(geometry, oriented, law, model):
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    model = ImpactModel(law, **model)
    usual = ~has_tiny_numbers(bodies)
    by_longest = columns(resolve_batch(bodies, contacts, model, report=True), usual)
    for bits in (256, 0):
        library.limit_vectors(bits)
        try:
            by_others = columns(resolve_batch(bodies, contacts, model, report=True), usual)
        finally:
            library.limit_vectors(512)
        assert_same(by_longest, by_others)


# units


def sound_tables(geometry: Geometry, dtype: type) -> tuple[np.ndarray, np.ndarray]:
    """Contacts that slide, stick, and separate."""
    body_row, contact_row = body_rows(geometry), contact_rows(geometry)
    bodies, contacts = np.zeros((body_row.height, 2, 3), dtype), np.zeros((contact_row.height, 3), dtype)
    bodies[body_row.mass] = [[1.0] * 3, [3.0] * 3]
    bodies[body_row.velocity][:, 0] = [[1.0, 1.0, 1.0], [-2.0, -2.0, 2.0], [-0.5, -0.5, 0.5]]
    contacts[contact_row.normal] = [[1.0] * 3, [2.0] * 3, [2.0] * 3]
    contacts[contact_row.restitution], contacts[contact_row.friction] = 0.5, [0.25, 4.0, 0.25]
    if geometry is Geometry.SPATIAL:
        inertia = bodies[body_row.inertia]
        inertia[0], inertia[3], inertia[5] = 0.5, 0.25, 0.625
        bodies[body_row.position][:, 0] = [[0.5] * 3, [1.0] * 3, [0.25] * 3]
    return bodies, contacts


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU], ids=lambda law: law.name)
@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.SPATIAL], ids=lambda geometry: geometry.name)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_units_do_not_matter(dtype, geometry, law):
    """From dust to planets: intermediate overflow and underflow must not change the answer."""
    bodies, contacts = sound_tables(geometry, dtype)
    body_row, contact_row, model = body_rows(geometry), contact_rows(geometry), ImpactModel(law)
    expected = resolve_batch(bodies, contacts, model, report=True)
    assert expected.status.tolist() == [StatusCode.OK, StatusCode.OK, StatusCode.SEPARATING]
    assert law is Law.FRICTIONLESS or expected.regime[0] != expected.regime[1]
    reach = 60 if dtype is np.float32 else 500
    for mass, speed, length in product((-reach, -reach // 3, 0, reach // 2, reach), repeat=3):
        if abs(mass + 2 * speed) > 1.9 * reach:  # the energies themselves would be out of range
            continue
        scaled, touching = bodies.copy(), contacts.copy()
        scaled[body_row.mass] = np.ldexp(bodies[body_row.mass], mass)
        scaled[body_row.inertia] = np.ldexp(bodies[body_row.inertia], mass)
        scaled[body_row.velocity] = np.ldexp(bodies[body_row.velocity], speed)
        touching[contact_row.normal] = np.ldexp(contacts[contact_row.normal], length)
        result = resolve_batch(scaled, touching, model, report=True)
        np.testing.assert_array_equal(result.status, expected.status)
        np.testing.assert_array_equal(result.regime, expected.regime)
        # Columns of float64 that overflow are computed in EXTENDED, right to the last digit.
        near = {"rtol": 0.0 if dtype is np.float32 else 2.0**-50, "atol": 0.0}
        np.testing.assert_allclose(result.velocity, np.ldexp(expected.velocity, speed), **near)
        np.testing.assert_allclose(result.impulse, np.ldexp(expected.impulse, mass + speed), **near)


@pytest.mark.parametrize("friction", [1e-30, 0.25, 1e30])
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU], ids=lambda law: law.name)
def test_slip_and_approach_may_differ_by_many_magnitudes(law, friction):
    """Squares of float32 overflow at 2^64; the same numbers in float64 do not."""
    body_row = body_rows(Geometry.POINT)
    contact_row = contact_rows(Geometry.POINT)
    powers = range(-60, 61, 10)
    velocities = [(2.0**slip, 0.0, -(2.0**approach)) for slip, approach in product(powers, repeat=2)]
    bodies, contacts = np.zeros((body_row.height, 2, 169)), np.zeros((contact_row.height, 169))
    bodies[body_row.mass] = [[1.0], [3.0]]
    bodies[body_row.velocity][:, 0] = np.array(velocities).T
    contacts[contact_row.normal], contacts[contact_row.restitution] = [[0.0], [0.0], [1.0]], 0.5
    contacts[contact_row.friction] = friction
    contacts = contacts.astype(np.float32)
    right = resolve_batch(bodies, contacts.astype(np.float64), ImpactModel(law))
    found = resolve_batch(bodies.astype(np.float32), contacts, ImpactModel(law))
    np.testing.assert_array_equal(found.status, right.status)
    assert (right.status == StatusCode.OK).all()
    # A component may be the difference of two larger ones that were rounded.
    size = abs(right.velocity).max(axis=0)
    assert (abs(found.velocity - right.velocity) <= 2.0**-20 * size).all()


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU], ids=lambda law: law.name)
@pytest.mark.parametrize(
    ("dtype", "mass", "speed", "length"),
    [
        (np.float32, 1e-15, 1e-30, 1.0),
        (np.float32, 1.0, 1e-32, 1e14),
        (np.float64, 1.0, 1e-250, 1e80),
        (np.float64, 1e-160, 1e-165, 1.0),
    ],
)
def test_no_impulse_is_lost_to_underflow(law, dtype, mass, speed, length):
    """Products of these sound numbers underflow: the ball must still bounce with half its speed."""
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((body_row.height, 2, 9), dtype), np.zeros((contact_row.height, 9), dtype)
    bodies[body_row.mass] = [[mass], [np.inf]]
    bodies[body_row.velocity][2, 0] = -speed
    contacts[contact_row.normal][2] = length
    contacts[contact_row.restitution] = 0.5
    contacts[contact_row.friction] = 0.25
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    assert (result.status == StatusCode.OK).all()
    np.testing.assert_allclose(result.velocity[2, 0], speed / 2, rtol=4 * np.finfo(dtype).eps)


@pytest.mark.parametrize(
    ("dtype", "speed"), [(np.float32, 1e-25), (np.float32, 1e20), (np.float64, 1e-79), (np.float64, 1e-200)]
)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB], ids=lambda law: law.name)
def test_a_threshold_applies_also_where_squares_leave_the_range(law, dtype, speed, recwarn):
    bodies, contacts = sound_tables(Geometry.POINT, dtype)
    contacts[contact_rows(Geometry.POINT).normal] = [[1.0], [0.0], [0.0]]
    bodies[body_rows(Geometry.POINT).velocity] = 0.0
    bodies[body_rows(Geometry.POINT).velocity][0, 0] = -np.array([1.0, 2.0, 3.0]) * speed
    model = ImpactModel(law, restitution_threshold=1.5 * speed)
    result = resolve_batch(bodies, contacts, model)
    without = resolve_batch(bodies, contacts, ImpactModel(law))
    assert (result.status == StatusCode.OK).all()
    approach = result.velocity[0, 0] - result.velocity[0, 1]
    assert abs(approach[0]) <= 4 * np.finfo(dtype).eps * speed  # no rebound
    np.testing.assert_array_equal(result.velocity[..., 1:], without.velocity[..., 1:])
    if dtype is np.float32:
        above = resolve_batch(bodies, contacts, ImpactModel(law, restitution_threshold=1e39))
        np.testing.assert_allclose(above.velocity[0, 0], above.velocity[0, 1], rtol=1e-6)
    assert not recwarn.list
