"""Batches: bit for bit the answers of single impacts, for every geometry, law and array library."""

from __future__ import annotations

import tracemalloc
from itertools import product

import pytest

pytest.importorskip("array_api_strict")
pytest.importorskip("dask.array")

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
    resolve_one_by_one,
    shared_batch,
)
from collisions import LAWS_WITH_ORACLE

from collision_response import Geometry, ImpactError, ImpactModel, Law, Precision, Regime, StatusCode, resolve
from collision_response.batch import resolve_batch
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.kernels import library
from collision_response.physics.laws import PATHS

KINDS = [
    *product(GEOMETRIES, (False,), LAWS_WITH_ORACLE),
    *product((Geometry.SPATIAL,), (True,), LAWS_WITH_ORACLE),
]
STICKS = 7
"""Column of the shared spatial batch whose contact sticks."""

every_kind = pytest.mark.parametrize(("geometry", "oriented", "law"), KINDS)


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
    assert_same(shared, once.mapped(lambda array: np.tile(array, 12)))


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


@pytest.mark.parametrize(
    ("dtype", "length"),
    [(np.float64, 1e153), (np.float64, 1e160), (np.float64, 1e300), (np.float64, 1e-160), (np.float32, 1e20)],
)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_quaternion_of_any_length_turns_the_body(dtype, length, law):
    """Its square leaves the range of the floats."""
    if law in PATHS and dtype is np.float32:
        return
    rows, columns = body_rows(Geometry.SPATIAL, oriented=True), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((rows.height, 2, 2), dtype), np.zeros((columns.height, 2), dtype)
    bodies[rows.mass] = np.array([1.0, np.inf])[:, None]
    bodies[rows.inertia, 0] = np.array([0.1, 0, 0, 0.2, 0, 0.25])[:, None]
    bodies[rows.velocity, 0] = np.array([0.3, 0.1, -1.0])[:, None]
    bodies[rows.orientation, 0] = np.array([0.3, -0.4, 0.5, 0.7])[:, None] * [1.0, length]
    bodies[rows.orientation, 1, :] = np.array([0, 0, 0, 1.0])[:, None]
    contacts[columns.position] = np.array([0.5, 0.4, -0.5])[:, None]
    contacts[columns.normal] = np.array([0, 0, 1.0])[:, None]
    contacts[columns.restitution], contacts[columns.friction] = 0.5, 0.3
    result = resolve_batch(bodies, contacts, ImpactModel(law))
    assert (result.status == StatusCode.OK).all()
    # One of them is computed in other units.
    np.testing.assert_allclose(result.impulse[:, 1], result.impulse[:, 0], rtol=50 * np.finfo(dtype).eps)
