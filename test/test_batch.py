"""Batches: every backend and kind of array gives the answers of one impact at a time."""

from __future__ import annotations

import re
import runpy
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from batches import FIRST_FAULTY, N, scene_of, some

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
from collision_response.batch import FEW, BatchResult, prepare_batch, resolve_batch
from collision_response.batch.backends import Backend
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.model import EXACT_LAWS
from collision_response.numerics import compiled
from collision_response.physics.effective_mass import Spatial
from collision_response.physics.laws import Parameters, chatterjee_ruina, frictionless
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.tiers import GEOMETRIES

KINDS = list(product(GEOMETRIES, EXACT_LAWS))
ROOT = Path(__file__).parents[1]
STICKS = 7
"""A contact of the spatial batch that sticks."""

by_numpy = partial(resolve_batch, backend=Backend.NUMPY)


def assert_same(one: BatchResult, other: BatchResult) -> None:
    for field, a, b in zip(BatchResult._fields, one, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=field)


def each(function, result: BatchResult) -> BatchResult:
    return BatchResult(*(function(array) for array in result if array is not None))


def columns(result: BatchResult, at) -> BatchResult:
    return each(lambda array: array[..., at], result)


# against one impact at a time


def status_of_one(geometry: Geometry, law: Law, bodies, contacts, i: int) -> StatusCode:
    of = body_rows(geometry)
    if law is Law.FRICTIONLESS:  # whose batches have no friction
        contacts = contacts.copy()
        contacts[contact_rows(geometry).friction] = 0.0
    try:
        scene = scene_of(geometry, bodies, contacts, i)
        for lane in (0, 1):
            if bodies[of.mass, lane, i] == np.inf and bodies[of.inertia, lane, i].any():
                return StatusCode.INVALID_INERTIA
        return resolve(*scene, ImpactModel(law, geometry)).status
    except ImpactError as error:
        return error.code


@pytest.mark.parametrize(("geometry", "law"), KINDS)
def test_the_status_is_that_of_one_impact(geometry, law):
    bodies, contacts = some(geometry)
    status = by_numpy(bodies, contacts, ImpactModel(law)).status
    expected = [status_of_one(geometry, law, bodies, contacts, i) for i in range(N)]
    in_range = status != StatusCode.OUT_OF_RANGE  # which resolve may avoid: it chooses its units
    assert np.count_nonzero(~in_range) < 10
    np.testing.assert_array_equal(status[in_range], np.array(expected)[in_range])
    assert len(set(expected)) >= 6


@pytest.mark.parametrize(("geometry", "law"), KINDS)
def test_the_answer_is_that_of_one_impact(geometry, law):
    bodies, contacts = some(geometry)
    result = by_numpy(bodies, contacts, ImpactModel(law))
    first = {Geometry.POINT: 3, Geometry.PLANAR: 2, Geometry.SPATIAL: 0}[geometry]
    axes = len(result.velocity)
    for i in range(FIRST_FAULTY):
        one = resolve(*scene_of(geometry, bodies, contacts, i), ImpactModel(law, geometry))
        size = abs(np.array([*one.impulse, *one.twist_a.linear, *one.twist_b.linear])).max()
        # The answers differ by roundings; no scene here amplifies them a thousandfold.
        close = partial(np.testing.assert_allclose, rtol=0, atol=size * 1e-12)
        close(result.impulse[:, i], one.impulse[:axes])
        for lane, twist in enumerate((one.twist_a, one.twist_b)):
            close(result.velocity[:, lane, i], twist.linear[:axes])
            spin = np.array(twist.angular[first:])
            np.testing.assert_allclose(result.angular_velocity[:, lane, i], spin, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("geometry", "law"), KINDS)
def test_a_bad_contact_spoils_itself_alone(geometry, law):
    bodies, contacts = some(geometry)
    result = by_numpy(bodies, contacts, ImpactModel(law))
    bad = ~np.isin(result.status, (StatusCode.OK, StatusCode.SEPARATING))
    assert bad[FIRST_FAULTY:].any() and not bad[:FIRST_FAULTY].any()
    assert np.isnan(columns(result, bad).velocity).all() and np.isnan(columns(result, bad).impulse).all()
    assert np.isfinite(columns(result, ~bad).velocity).all()
    assert_same(columns(result, ~bad), by_numpy(bodies[..., ~bad], contacts[..., ~bad], ImpactModel(law)))


def test_beyond_the_range():
    bodies, contacts = (array[..., STICKS : STICKS + 30].copy() for array in some(Geometry.SPATIAL))
    of, at = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    contacts[at.normal, 0] *= 1e-200
    contacts[at.normal, 1], bodies[of.velocity, 0, 1], bodies[of.velocity, 1, 1] = 1.0, -1e308, 1e308
    for few in (slice(None), slice(0, FEW)):
        status = by_numpy(bodies[..., few], contacts[..., few]).status
        assert (status[:2] == StatusCode.OUT_OF_RANGE).all()
        assert (status[2:] <= StatusCode.SEPARATING).all()


# backends


@pytest.mark.parametrize(("geometry", "law"), KINDS)
def test_one_by_one_is_as_in_blocks(geometry, law):
    bodies, contacts = some(geometry)
    whole = by_numpy(bodies, contacts, ImpactModel(law))
    for start in range(0, N, FEW):
        part = slice(start, start + FEW)
        assert_same(columns(whole, part), by_numpy(bodies[..., part], contacts[..., part], ImpactModel(law)))


@pytest.mark.parametrize(
    ("geometry", "dtype"), [(Geometry.POINT, np.float32), (Geometry.SPATIAL, np.float64)]
)
def test_compiled_is_as_numpy(machine_code, geometry, dtype):
    bodies, contacts = (np.tile(array.astype(dtype), 9) for array in some(geometry))
    model = ImpactModel(Law.COULOMB)
    by_loop = resolve_batch(bodies, contacts, model, backend=Backend.COMPILED)
    assert_same(by_numpy(bodies, contacts, model), by_loop)
    assert prepare_batch(bodies, contacts, model).backend is Backend.COMPILED

    out = each(lambda array: np.empty(array.shape[::-1], array.dtype).T, by_loop)
    resolve_batch(bodies, contacts, model, out=out)
    assert_same(out, by_loop)


def test_a_directory_that_cannot_be_written_is_no_obstacle(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv(compiled.CACHE_VARIABLE, str(tmp_path / "file"))
    assert compiled.load("answer = 42\n").answer == 42


def test_a_written_module_is_used_again(monkeypatch, tmp_path):
    monkeypatch.setenv(compiled.CACHE_VARIABLE, str(tmp_path / "cache"))
    assert compiled.load("answer = 43\n") is compiled.load("answer = 43\n")
    assert [path.suffix for path in (tmp_path / "cache").glob("impacts*")] == [".py"]


def test_without_numba_numpy_computes(monkeypatch):
    monkeypatch.setattr(compiled, "is_available", lambda: False)
    bodies, contacts = some(Geometry.POINT)
    assert prepare_batch(bodies, contacts.astype(float)).backend is Backend.NUMPY
    assert_same(resolve_batch(bodies, contacts), by_numpy(bodies, contacts))


def test_blocks_have_no_seams():
    bodies, contacts = (np.tile(array, 90) for array in some(Geometry.PLANAR))
    whole, part = by_numpy(bodies, contacts), by_numpy(bodies[..., :N], contacts[..., :N])
    assert_same(whole, each(lambda array: np.tile(array, 90), part))


def test_single_is_double_to_its_precision():
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in some(Geometry.SPATIAL))
    exact = by_numpy(bodies, contacts)
    single = by_numpy(bodies.astype(np.float32), contacts.astype(np.float32))
    assert single.velocity.dtype == np.float32
    error = abs(single.velocity - exact.velocity).max(axis=(0, 1)) / abs(exact.velocity).max(axis=(0, 1))
    assert np.median(error) < 2e-6  # some tens of roundings
    assert error[[2, 4]].max() < 1e-4  # a thin rod is known as one in float32, too


# what may vary


def test_tangential_restitution_of_the_model_or_of_each_contact():
    bodies, contacts = some(Geometry.SPATIAL)
    one = by_numpy(bodies, contacts, ImpactModel(Law.COULOMB, tangential_restitution=0.5))
    assert resolve(*scene_of(Geometry.SPATIAL, bodies, contacts, STICKS)).regime is Regime.STICKING
    row = np.full((1, N), 0.5)
    assert_same(one, by_numpy(bodies, np.concatenate([contacts, row]), ImpactModel(Law.COULOMB)))
    row[0, 8] = 1.5
    each = by_numpy(bodies, np.concatenate([contacts, row]))
    assert each.status[8] == StatusCode.INVALID_COEFFICIENT
    assert (one.impulse[:, STICKS] != by_numpy(bodies, contacts).impulse[:, STICKS]).all()


def test_restitution_threshold():
    bodies, contacts = some(Geometry.SPATIAL)
    model = ImpactModel(Law.FRICTIONLESS, restitution_threshold=1.0)
    result, at = by_numpy(bodies, contacts, model), contact_rows(Geometry.SPATIAL)
    plastic = contacts.copy()
    plastic[at.restitution, :FIRST_FAULTY] = 0.0
    slow = []
    for i in range(FIRST_FAULTY):
        before = resolve(*scene_of(Geometry.SPATIAL, bodies, contacts, i)).normal_velocity_before
        slow.append(-1 < before < 0)
    assert 5 < sum(slow) < 95
    expected = by_numpy(bodies, plastic, model._replace(restitution_threshold=0.0))
    assert_same(columns(result, np.flatnonzero(slow)), columns(expected, np.flatnonzero(slow)))


def test_friction_is_left_out_where_the_law_has_none():
    bodies, contacts = some(Geometry.PLANAR)
    at = contact_rows(Geometry.PLANAR)
    assert_same(
        by_numpy(bodies, contacts[: at.friction.start]),
        by_numpy(bodies, contacts, ImpactModel(Law.FRICTIONLESS)),
    )
    assert_same(by_numpy(bodies, contacts), by_numpy(bodies, contacts, ImpactModel(Law.COULOMB)))


def test_oriented_bodies_are_solved_in_their_own_axes():
    bodies, contacts = some(Geometry.SPATIAL, oriented=True)
    result = by_numpy(bodies, contacts, ImpactModel(Law.FRICTIONLESS))
    assert result.status[N - 4] == StatusCode.INVALID_ORIENTATION
    for i in range(FIRST_FAULTY):
        one = resolve(*scene_of(Geometry.SPATIAL, bodies, contacts, i), ImpactModel(Law.FRICTIONLESS))
        np.testing.assert_allclose(
            result.angular_velocity[:, 0, i], one.twist_a.angular, rtol=1e-11, atol=1e-11
        )


def test_out_is_written_to():
    bodies, contacts = some(Geometry.SPATIAL)
    result = by_numpy(bodies, contacts)
    out = each(lambda array: np.full_like(array, 9), result)
    assert by_numpy(bodies, contacts, out=out) is out
    assert_same(out, result)


def test_no_contacts():
    bodies, contacts = (array[..., :0] for array in some(Geometry.POINT))
    assert by_numpy(bodies, contacts).status.shape == (0,)


def test_memory_is_that_of_a_few_blocks():
    tracemalloc = pytest.importorskip("tracemalloc")
    bodies, contacts = (np.tile(array, 400) for array in some(Geometry.SPATIAL))
    out = by_numpy(bodies, contacts)
    tracemalloc.start()
    by_numpy(bodies, contacts, out=out)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 16e6


# what is refused


def refused() -> list[tuple[str, dict]]:
    bodies, contacts = some(Geometry.SPATIAL)
    out = by_numpy(bodies, contacts)
    return [
        ("bodies, contacts: must both be float32 or float64", {"bodies": np.zeros((16, 2, N), int)}),
        ("are float32, float64", {"bodies": bodies.astype(np.float32)}),
        ("bodies: must be of shape", {"bodies": bodies[:5]}),
        ("bodies: must be of shape", {"bodies": bodies[:, 0]}),
        ("contacts: must be of shape (rows, 300)", {"contacts": contacts[:, :7]}),
        ("contacts: SPATIAL has 7 to 9 rows, not 3", {"contacts": contacts[:3]}),
        ("COULOMB needs a row of friction", {"contacts": contacts[:7], "model": ImpactModel(Law.COULOMB)}),
        ("model.law: must be AUTO, FRICTIONLESS, COULOMB", {"model": ImpactModel(Law.MOREAU)}),
        ("model.geometry: must be AUTO, SPATIAL", {"model": ImpactModel(geometry=Geometry.POINT)}),
        ("model.precision: must be AUTO, DOUBLE", {"model": ImpactModel(precision=Precision.SINGLE)}),
        (
            "model.tolerance: must be 0.0",
            {
                "bodies": bodies.astype(np.float32),
                "contacts": contacts.astype(np.float32),
                "model": ImpactModel(tolerance=1e-6),
            },
        ),
        ("out.error_bound: must be float64", {"out": out, "model": ImpactModel(tolerance=1e-6)}),
        ("out.error_bound: must be None", {"out": out._replace(error_bound=np.empty(N))}),
        ("out.velocity: must be float64 of shape (3, 2, 300)", {"out": columns(out, slice(5))}),
        ("out.impulse: overlaps the input", {"out": out._replace(impulse=bodies[10:13, 0])}),
    ]


@pytest.mark.parametrize("case", range(len(refused())), ids=lambda i: refused()[i][0])
def test_is_refused(case):
    message, changes = refused()[case]
    bodies, contacts = some(Geometry.SPATIAL)
    with pytest.raises(ValueError, match=re.escape(message)):
        by_numpy(**{"bodies": bodies, "contacts": contacts, **changes})


# arrays of other makes


def scene_of_arrays(number) -> tuple[Body, Body, Contact]:
    """The sound contacts of the shared batch; ``number`` makes an array of another make from a row."""
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in some(Geometry.SPATIAL))

    def body(of: np.ndarray) -> Body:
        rows = [number(row) for row in of]
        vectors = (Vec3(*rows[start : start + 3]) for start in (7, 10, 13))
        return Body(rows[0], 1 / rows[0], Symmetric3(*rows[1:7]), next(vectors), None, *vectors)

    rows = [number(row) for row in contacts]
    return body(bodies[:, 0]), body(bodies[:, 1]), Contact(Vec3(*rows[:3]), Vec3(*rows[3:6]), *rows[6:])


def changes(law, scene: tuple[Body, Body, Contact]) -> list:
    """How the laws themselves change the bodies' motion, in arrays of any make."""
    approach = Spatial.prepare(*scene)
    outcome = law(approach, Parameters(scene[2].restitution, scene[2].friction))
    response = approach.respond(outcome.impulse)
    return [response.change_a.linear.x, response.change_b.angular.z]


@pytest.mark.parametrize("law", [frictionless, chatterjee_ruina])
@pytest.mark.parametrize("make", ["array_api_strict", "dask.array"])
def test_the_laws_take_arrays_of_other_makes(law, make):
    module = pytest.importorskip(make)
    for one, other in zip(
        changes(law, scene_of_arrays(np.array)), changes(law, scene_of_arrays(module.asarray)), strict=True
    ):
        np.testing.assert_array_equal(np.asarray(other), one)


def test_a_dask_cluster_resolves_chunks(tmp_path):
    pytest.importorskip("dask.array")
    distributed = pytest.importorskip("dask.distributed")
    import dask.array as da

    example = runpy.run_path(str(ROOT / "examples" / "dask_batch.py"))
    bodies, contacts = (np.tile(array, 4) for array in some(Geometry.SPATIAL))
    chunked = (da.from_array(array, chunks=(*array.shape[:-1], N)) for array in (bodies, contacts))
    local = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "local_directory": tmp_path}
    with distributed.LocalCluster(**local, host="127.0.0.1") as cluster, distributed.Client(cluster):
        results = example["resolve"](*chunked)
        assert results.numblocks == (1, 4)
        results = results.compute()
    whole = by_numpy(bodies, contacts)
    np.testing.assert_array_equal(results[:6], whole.velocity.reshape(6, -1))
    np.testing.assert_array_equal(results[-1], whole.status)


@pytest.mark.parametrize("law", [frictionless, chatterjee_ruina])
def test_gradients_by_torch(law):
    torch = pytest.importorskip("torch")
    a, b, contact = scene_of_arrays(torch.tensor)
    movable = b.inverse_mass > 0

    def kept(x):
        return type(x)(*map(kept, x)) if isinstance(x, tuple) else x if x is None else x[movable]

    a, b, contact = kept(a), kept(b), kept(contact)

    def answer(mass_a, restitution, friction):
        body = a._replace(mass=mass_a, inverse_mass=1 / mass_a)
        return tuple(changes(law, (body, b, contact._replace(restitution=restitution, friction=friction))))

    inputs = [x.clone().requires_grad_() for x in (a.mass, contact.restitution, contact.friction)]
    assert torch.autograd.gradcheck(answer, inputs)
