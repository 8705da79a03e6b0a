"""Batches over one table of bodies: pairs, reports, independent sets and writing velocities back."""

from __future__ import annotations

import doctest
import math
import threading
from decimal import Decimal
from fractions import Fraction
from itertools import product

import pytest

pytest.importorskip("array_api_strict")
pytest.importorskip("dask.array")

import array_api_strict
import dask.array as da
import numpy as np
from batch_cases import (
    FIRST_FAULTY,
    N,
    assert_same,
    batch_of,
    collision_at,
    columns,
    has_tiny_numbers,
    on_another_device,
    shared_batch,
)
from collisions import LAWS_WITH_ORACLE
from programs import run_python

import collision_response.batch.pairs
import collision_response.batch.threads
from collision_response import (
    Adjustment,
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
from collision_response.batch import (
    body_rows,
    contact_rows,
    independent_sets,
    resolve_batch,
    resolve_scenes,
    scatter_velocities,
)
from collision_response.batch.result import ENERGIES, REPORT, REPORTED_ADJUSTMENTS
from collision_response.physics.mass_properties import rod
from collision_response.physics.vector import Vec3

KINDS = [
    (Geometry.POINT, False),
    (Geometry.PLANAR, False),
    (Geometry.SPATIAL, False),
    (Geometry.SPATIAL, True),
]
SHARED_PAIRS = np.arange(2 * N).reshape(2, N)
"""The pairs of the shared batch: columns of its body table."""
PAIR_MODELS = [ImpactModel(), ImpactModel(tolerance=1e-14), ImpactModel(precision=Precision.EXTENDED)]

body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)


def body_table(bodies: np.ndarray) -> np.ndarray:
    """Every body of a batch as one column: those of all body_a first, then those of all body_b."""
    return bodies.reshape(len(bodies), -1)


def crowded_table(seed: int = 0, contacts: int = 1000, bodies: int = 60) -> tuple[np.ndarray, ...]:
    """Bodies with many contacts each, some immovable; three pairs name no body, and column 5 has a NaN."""
    random = np.random.default_rng(seed)
    shared, touches = shared_batch(Geometry.SPATIAL)
    table = body_table(shared[..., 10:FIRST_FAULTY])[:, :bodies].copy()
    table[body_row.mass, :3], table[body_row.inertia, :3] = math.inf, 0.0
    table[body_row.velocity, 5] = math.nan
    pairs = random.integers(bodies, size=(2, contacts))
    pairs[:, 7], pairs[:, 8], pairs[:, 9] = (4, bodies), (-1, 4), (2**40, 2**40)
    return table, pairs, touches.take(random.integers(FIRST_FAULTY, size=contacts), axis=1)


# pairs


@pytest.mark.parametrize("model", PAIR_MODELS)
@pytest.mark.parametrize(("geometry", "oriented"), KINDS)
def test_pairs_give_the_answers_of_bodies_side_by_side(geometry, oriented, model):
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    by_pairs = resolve_batch(body_table(bodies), contacts, model, pairs=SHARED_PAIRS, report=True)
    assert_same(by_pairs, resolve_batch(bodies, contacts, model, report=True))


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_each_contact_of_a_body_is_answered_independently(law):
    table, pairs, contacts = crowded_table()
    result = resolve_batch(table, contacts, ImpactModel(law), pairs=pairs, report=True)
    known = ((pairs >= 0) & (pairs < table.shape[1])).all(axis=0)
    same = pairs[0] == pairs[1]
    np.testing.assert_array_equal(
        result.status[same], StatusCode.SAME_BODY
    )  # also where the pair names no body
    np.testing.assert_array_equal(result.status[~known & ~same], StatusCode.UNKNOWN_BODY)
    assert [int(result.status[i]) for i in (7, 8, 9)] == [8, 8, 15]
    sound = known & ~same
    side_by_side = resolve_batch(table[:, pairs[:, sound]], contacts[:, sound], ImpactModel(law), report=True)
    assert_same(columns(result, sound), side_by_side)
    assert np.isnan(columns(result, ~sound).velocity).all()
    assert set(result.status) >= {StatusCode.OK, StatusCode.NOT_FINITE, StatusCode.NO_DYNAMIC_BODY}


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.uint32, np.int64, np.uint64, list])
def test_pairs_of_any_integers(dtype):
    table, pairs, contacts = crowded_table()
    kept = ~((pairs < 0) | (pairs >= 60)).any(axis=0)
    pairs, contacts = pairs[:, kept], contacts[:, kept]
    given = pairs.tolist() if dtype is list else pairs.astype(dtype)
    assert_same(resolve_batch(table, contacts, pairs=given), resolve_batch(table, contacts, pairs=pairs))


def test_pairs_may_be_repeated_and_swapped():
    """Swapped bodies with the opposite normal give the same motion."""
    table, _, contacts = crowded_table()
    one = contacts[:, :1]
    turned = one.copy()
    turned[contact_row.normal] *= -1
    both = resolve_batch(table, np.hstack([one, one, turned]), pairs=[[10, 10, 11], [11, 11, 10]])
    assert_same(columns(both, 0), columns(both, 1))
    np.testing.assert_array_equal(both.velocity[:, ::-1, 2], both.velocity[..., 0])
    np.testing.assert_array_equal(both.impulse[:, 2], -both.impulse[:, 0])


@pytest.mark.parametrize("number", [0.125, Fraction(1, 10), Decimal("0.1"), np.longdouble("0.1")])
@pytest.mark.parametrize("name", ["restitution_threshold", "tangential_restitution"])
def test_numbers_of_a_model_that_are_no_floats_change_no_status(name, number):
    table, pairs, contacts = crowded_table()
    model = ImpactModel(Law.COULOMB, tolerance=1e-9, **{name: number})
    rounded = ImpactModel(Law.COULOMB, tolerance=1e-9, **{name: float(number)})
    for ask in (resolve_batch, resolve_scenes):
        statuses = (ask(table, contacts, some, pairs=pairs).status for some in (model, rounded))
        np.testing.assert_array_equal(*statuses)


@pytest.mark.parametrize("workers", [2, 3])
def test_threads_give_the_same_bits(workers):
    table, pairs, contacts = crowded_table(contacts=5000)
    shared = resolve_batch(table, contacts, pairs=pairs, workers=workers)
    assert_same(shared, resolve_batch(table, contacts, pairs=pairs))


@pytest.mark.parametrize("most", [0, 1, 2])
def test_contacts_are_resolved_if_the_system_starts_no_more_threads(monkeypatch, most):
    table, pairs, contacts = crowded_table(contacts=5000)
    started = []

    class FewThreads(threading.Thread):
        def start(self):
            if len(started) == most:
                raise RuntimeError("can't start new thread")
            started.append(self)
            super().start()

    monkeypatch.setattr(collision_response.batch.threads, "Thread", FewThreads)
    shared = resolve_batch(table, contacts, pairs=pairs, workers=4)
    assert len(started) == most
    assert not any(thread.is_alive() for thread in started)
    assert_same(shared, resolve_batch(table, contacts, pairs=pairs))


AFTER_THE_MAIN_THREAD = """
import threading
import numpy as np
from collision_response import Geometry
from collision_response.batch import body_rows, contact_rows, resolve_batch

def simulate():
    threading.main_thread().join()
    rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((rows.height, 2, 4096)), np.zeros((contact.height, 4096))
    bodies[rows.mass], bodies[rows.velocity, 0] = 1, -1
    contacts[contact.normal] = 1
    print(set(resolve_batch(bodies, contacts, workers=2).status.tolist()))

threading.Thread(target=simulate).start()
"""


def test_workers_share_a_batch_after_the_main_thread_has_ended():
    run = run_python("-c", AFTER_THE_MAIN_THREAD)
    assert (run.stdout, run.stderr) == (f"{{{int(StatusCode.OK)}}}\n", "")


def test_float32():
    table, pairs, contacts = crowded_table()
    table, contacts = table.astype(np.float32), contacts.astype(np.float32)
    result = resolve_batch(table, contacts, pairs=pairs, report=True)
    assert {getattr(result, name).dtype for name in ENERGIES} == {np.dtype(np.float32)}
    sound = result.status < StatusCode.UNKNOWN_BODY
    assert_same(
        columns(result, sound), resolve_batch(table[:, pairs[:, sound]], contacts[:, sound], report=True)
    )


@pytest.mark.parametrize("model", PAIR_MODELS)
def test_no_contacts_and_no_bodies(model):
    table, _, contacts = crowded_table()
    none = resolve_batch(table, contacts[:, :0], model, pairs=np.empty((2, 0), int))
    assert none.velocity.shape == (3, 2, 0)
    lost = resolve_batch(table[:, :0], contacts[:, :3], model, pairs=[[0, 1, 2], [1, 0, 2]])
    assert lost.status.tolist() == [StatusCode.UNKNOWN_BODY, StatusCode.UNKNOWN_BODY, StatusCode.SAME_BODY]


def test_strided_arrays_give_the_same():
    table, pairs, contacts = crowded_table()
    expected = resolve_batch(table, contacts, pairs=pairs)
    spread = (np.repeat(array, 2, axis=1)[:, ::2] for array in (table, contacts, pairs))
    spread_table, spread_contacts, spread_pairs = spread
    out = expected.mapped(lambda array: np.repeat(array, 2, axis=-1)[..., ::2])
    assert not out.velocity.flags.c_contiguous
    assert resolve_batch(spread_table, spread_contacts, pairs=spread_pairs, out=out) is out
    assert_same(out, expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pairs": np.zeros((2, 3))}, "pairs: must be integers of shape (2, N), are float64 of (2, 3)"),
        ({"pairs": np.zeros((2, 3), bool)}, "pairs: must be integers of shape (2, N), are bool of (2, 3)"),
        ({"pairs": np.zeros((3, 2), int)}, "pairs: must be integers of shape (2, N), are int64 of (3, 2)"),
        ({"pairs": np.zeros(6, int)}, "pairs: must be integers of shape (2, N), are int64 of (6,)"),
        ({"pairs": np.zeros((2, 4), int)}, "contacts: must be of shape (rows, 4), is (8, 3)"),
        ({"bodies": np.zeros((16, 2, 3))}, "bodies: must be of shape (4 or 7 or 16 or 20, B), is (16, 2, 3)"),
        ({"bodies": np.zeros((15, 3))}, "bodies: must be of shape (4 or 7 or 16 or 20, B), is (15, 3)"),
        (
            {"bodies": np.zeros((16, 3), int)},
            "bodies, contacts: must both be float32 or float64; are int64, ",
        ),
        ({"contacts": np.zeros(3)}, "contacts: must be of shape (rows, 3), is (3,)"),
    ],
)
@pytest.mark.parametrize("make", [np.asarray, da.from_array])
def test_invalid_arrays_are_refused_by_name(change, message, make):
    request = {"bodies": np.zeros((16, 5)), "contacts": np.zeros((8, 3)), "pairs": np.zeros((2, 3), int)}
    with pytest.raises(ValueError) as refusal:
        resolve_batch(**{name: make(array) for name, array in (request | change).items()})
    assert str(refusal.value).startswith(message)


def test_out_may_not_overlap_the_input():
    table, pairs, contacts = crowded_table(contacts=24)
    out = resolve_batch(table, contacts, pairs=pairs)
    of_pairs = pairs.view(np.float64).reshape(-1)[:24]
    for overlapping in ({"impulse": contacts[:3]}, {"velocity": table.reshape(-1)[:144].reshape(3, 2, 24)}):
        with pytest.raises(ValueError, match="out: overlaps the input"):
            resolve_batch(table, contacts, pairs=pairs, out=out._replace(**overlapping))
    bounded = resolve_batch(table, contacts, ImpactModel(tolerance=1e-9), pairs=pairs)
    with pytest.raises(ValueError, match="out: overlaps the input"):
        resolve_batch(
            table,
            contacts,
            ImpactModel(tolerance=1e-9),
            pairs=pairs,
            out=bounded._replace(error_bound=of_pairs),
        )


def test_out_may_not_overlap_input_that_is_not_contiguous():
    table, pairs, contacts = crowded_table(contacts=24)
    out, contacts = resolve_batch(table, contacts, pairs=pairs), np.asfortranarray(contacts)
    given = contacts.copy()
    with pytest.raises(ValueError, match="out: overlaps the input"):
        resolve_batch(table, contacts, pairs=pairs, out=out._replace(impulse=contacts[:3]))
    np.testing.assert_array_equal(contacts, given)


@pytest.mark.parametrize("make", [array_api_strict.asarray, on_another_device])
def test_arrays_of_other_libraries(make):
    table, pairs, contacts = crowded_table()
    result = resolve_batch(make(table), make(contacts), pairs=make(pairs), report=True)
    assert type(result.regime) is type(make(table))
    assert result.regime.device == make(table).device
    here = result.mapped(np.from_dlpack)
    assert_same(here, resolve_batch(table, contacts, pairs=pairs, report=True))


@pytest.mark.parametrize("cut", [True, False])
def test_dask_cuts_contacts_and_keeps_the_table_whole(cut):
    table, pairs, contacts = crowded_table()
    lazy_pairs = da.from_array(pairs, chunks=(1, 77)) if cut else pairs
    lazy = resolve_batch(
        da.from_array(table, chunks=(5, 7)),
        da.from_array(contacts, chunks=(3, 300)),
        pairs=lazy_pairs,
        report=True,
    )
    assert lazy.status.chunks == lazy.kinetic_energy_after.chunks == ((300, 300, 300, 100),)
    here = lazy.mapped(da.Array.compute)
    assert_same(here, resolve_batch(table, contacts, pairs=pairs, report=True))


@pytest.mark.parametrize("lazy", [{"table"}, {"contacts"}, {"pairs"}, {"table", "pairs"}])
def test_with_pairs_too_one_dask_array_makes_the_results_dask_arrays(lazy):
    table, pairs, contacts = crowded_table()
    given = {"table": table, "contacts": contacts, "pairs": pairs}
    chunks = {"table": (5, 7), "contacts": (3, 300), "pairs": (1, 77)}
    bodies, touches, who = (
        da.from_array(array, chunks=chunks[name]) if name in lazy else array for name, array in given.items()
    )
    result = resolve_batch(bodies, touches, pairs=who, report=True)
    assert all(isinstance(array, da.Array) for array in result if array is not None)
    size = 300 if "contacts" in lazy else 77 if "pairs" in lazy else 1000
    assert result.status.chunks[0][0] == size
    here = result.mapped(da.Array.compute)
    assert_same(here, resolve_batch(table, contacts, pairs=pairs, report=True))


# regimes and energies


@pytest.mark.parametrize(("kind", "law"), list(product(KINDS, LAWS_WITH_ORACLE)))
def test_regimes_and_energies_equal_those_of_resolve(kind, law):
    geometry, oriented = kind
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    result = resolve_batch(bodies, contacts, ImpactModel(law), report=True)
    refused, tiny = 0, has_tiny_numbers(bodies)
    for i in np.flatnonzero(~tiny).tolist():
        try:
            impact = resolve(
                *collision_at(geometry, bodies, contacts, i), ImpactModel(law, precision=Precision.DOUBLE)
            )
        except ImpactError:
            refused += 1
            assert result.regime[i] == result.adjustments[i] == 0
            assert all(np.isnan(getattr(result, name)[i]) for name in ENERGIES)
            continue
        assert result.regime[i] == impact.regime
        assert [getattr(result, name)[i] for name in ENERGIES] == [getattr(impact, name) for name in ENERGIES]
        assert result.adjustments[i] == impact.adjustments & REPORTED_ADJUSTMENTS
    assert refused > 20


@pytest.mark.parametrize("model", [{}, {"tolerance": 1e-14}, {"precision": Precision.EXTENDED}])
def test_adjustments_are_those_of_resolve(model):
    """MOREAU would give energy to the rod of the published case T3. A slow one is below the threshold."""
    half_length, half_angle, inertia = 0.5, math.atan(2.0) / 2, rod(1.0, 1.0).inertia
    bar = Body.dynamic(
        1.0,
        inertia,
        (half_length * math.cos(2 * half_angle), half_length * math.sin(2 * half_angle), 0.0),
        (0.0, 0.0, 2 * math.sin(half_angle), 2 * math.cos(half_angle)),
        (0.5, -1.0, 0.0),
    )
    turning = Body.dynamic(1.0, inertia, (half_length, 0, 0), None, (0.5, -1, 0), (2, 0, 0))
    slow = bar._replace(velocity=Vec3(0.5, -0.01, 0.0))
    away = bar._replace(velocity=Vec3(0.5, 1.0, 0.0))
    wrong = bar._replace(mass=-1.0)
    floor, contact = Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.9, 0.3)
    requests = [(body, floor, contact) for body in (bar, turning, slow, away, wrong)]
    model = ImpactModel(Law.MOREAU, restitution_threshold=0.1, **model)
    expected = [resolve(*request, model).adjustments & REPORTED_ADJUSTMENTS for request in requests[:-1]]
    assert expected == [
        Adjustment.LAW_FALLBACK,
        Adjustment.MASSLESS_SPIN,
        Adjustment.RESTITUTION_THRESHOLD,
        Adjustment.NONE,
    ]
    found = resolve_batch(*batch_of(requests), model, report=True)
    assert found.status[-1] == StatusCode.INVALID_MASS
    assert found.adjustments.tolist() == [*expected, 0]


@pytest.mark.parametrize("model", [{}, {"tolerance": 1e-14}, {"precision": Precision.EXTENDED}])
@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_a_report_changes_nothing_else(law, model):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    with_report = resolve_batch(bodies, contacts, ImpactModel(law, **model), report=True)
    without = resolve_batch(bodies, contacts, ImpactModel(law, **model))
    assert all(getattr(without, name) is None for name in REPORT)
    assert_same(with_report._replace(**dict.fromkeys(REPORT)), without)
    for count in (1, 2, 3, 5):  # partly filled SIMD vectors
        part = resolve_batch(bodies[..., :count], contacts[:, :count], ImpactModel(law, **model), report=True)
        assert_same(part, columns(with_report, slice(count)))


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_energy_is_accounted_for(law):
    """The energy change is what restitution and friction took, where no immovable body does work."""
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))
    result = resolve_batch(bodies, contacts, ImpactModel(law), report=True)
    movable = np.isfinite(bodies[body_row.mass]).all(axis=(0, 1))
    change = result.kinetic_energy_before - result.kinetic_energy_after
    lost = result.energy_lost_restitution + result.energy_lost_friction
    size = result.kinetic_energy_before[movable]
    assert (abs(change - lost)[movable] <= 1e-12 * size).all()
    assert (lost >= -1e-12 * result.kinetic_energy_before).all()
    assert set(result.regime) >= {Regime.SEPARATING, Regime.SLIDING}


def test_out_decides_whether_a_report_is_written():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    expected = resolve_batch(bodies, contacts, report=True)
    out = resolve_batch(bodies[..., ::-1], contacts[..., ::-1], report=True)
    assert_same(resolve_batch(bodies, contacts, out=out), expected)
    with pytest.raises(ValueError, match=r"out.regime: must be there for a report, is None"):
        resolve_batch(bodies, contacts, report=True, out=resolve_batch(bodies, contacts))
    with pytest.raises(
        ValueError, match=r"out.energy_lost_friction: must be float64 of shape \(300,\), is None"
    ):
        resolve_batch(bodies, contacts, out=expected._replace(energy_lost_friction=None))
    with pytest.raises(ValueError, match=r"out.regime: must be uint8 of shape \(300,\), is int64 of shape"):
        resolve_batch(bodies, contacts, out=expected._replace(regime=np.zeros(N, int)))
    with pytest.raises(ValueError, match=r"out.kinetic_energy_after: must be None, is float64 of shape"):
        resolve_batch(bodies, contacts, out=expected._replace(regime=None, kinetic_energy_before=None))


def test_a_report_after_intermediate_overflow():
    """Such contacts are answered one by one."""
    bodies, contacts = (array[..., 7:9].copy() for array in shared_batch(Geometry.SPATIAL))
    contacts[contact_row.normal, 0] *= 1e-200
    result = resolve_batch(bodies, contacts, ImpactModel(Law.COULOMB), report=True)
    impact = resolve(*collision_at(Geometry.SPATIAL, bodies, contacts, 0))
    assert [getattr(result, name)[0] for name in REPORT] == [getattr(impact, name) for name in REPORT]


# independent sets


def sets_by_definition(pairs: np.ndarray, movable: np.ndarray) -> list[list[int]]:
    """Put each contact into the first set after every set with a contact of one of its movable bodies."""
    sets: list[list[int]] = []
    for i, pair in enumerate(pairs.T.tolist()):
        own = {body for body in pair if movable[body]}
        after = [k for k, some_ in enumerate(sets) if any(own & set(pairs[:, j].tolist()) for j in some_)]
        place = max(after, default=-1) + 1
        if place == len(sets):
            sets.append([])
        sets[place].append(i)
    return sets


@pytest.mark.parametrize("seed", range(20))
def test_sets_are_independent_and_keep_the_order(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 12))
    pairs = random.integers(count, size=(2, int(random.integers(1, 60))))
    movable = random.random(count) < random.choice([0.0, 0.5, 1.0])
    found = independent_sets(pairs, movable)
    assert [one.tolist() for one in found] == sets_by_definition(pairs, movable)
    for one in found:
        bodies = pairs[:, one]
        in_two = [body for body in range(count) if movable[body] and (bodies == body).any(axis=0).sum() > 1]
        assert not in_two
    assert sorted(np.concatenate(found).tolist()) == list(range(pairs.shape[1]))
    everything = independent_sets(pairs)
    assert [one.tolist() for one in everything] == sets_by_definition(pairs, np.ones(count, bool))


def test_sets_of_structured_pairs():
    n = 50
    star = np.array([np.zeros(n, int), np.arange(1, n + 1)])
    assert [one.tolist() for one in independent_sets(star)] == [[i] for i in range(n)]  # a body in every pair
    fixed = np.arange(n + 1) > 0
    assert [one.tolist() for one in independent_sets(star, fixed)] == [list(range(n))]  # a floor
    chain = np.array([np.arange(n), np.arange(1, n + 1)])
    assert len(independent_sets(chain)) == n
    assert [one.tolist() for one in independent_sets(chain[:, [0, 2, 4, 1, 3, 5]])] == [[0, 1, 2], [3, 4, 5]]
    assert [one.tolist() for one in independent_sets(np.ones((2, 3), int))] == [
        [0],
        [1],
        [2],
    ]  # one body twice
    assert [one.tolist() for one in independent_sets([[1, 1], [2, 2]])] == [[0], [1]]  # a pair twice
    assert [one.tolist() for one in independent_sets([[1, 1], [2, 2]], np.zeros(3, bool))] == [[0, 1]]
    assert independent_sets(np.empty((2, 0), int)) == []
    assert independent_sets(np.empty((2, 0), int), np.empty(0, bool)) == []


FAR_APART = [
    lambda body: body,
    lambda body: 10**6 * body,
    lambda body: 2**32 * body,
    lambda body: 2**57 * body,
    lambda body: 2**63 - 1 - body,
]


@pytest.mark.parametrize("column", FAR_APART)
@pytest.mark.parametrize("seed", range(5))
def test_sets_do_not_depend_on_the_body_numbers(column, seed):
    """Memory is used for the bodies that occur only: 2^57 columns would not fit."""
    random = np.random.default_rng(seed)
    pairs = random.integers(0, 60, (2, 200))
    far = np.vectorize(column, otypes=[np.int64])(pairs)
    found = [one.tolist() for one in independent_sets(far)]
    assert found == [one.tolist() for one in independent_sets(pairs)]
    assert found == sets_by_definition(pairs, np.ones(60, bool))


@pytest.mark.parametrize(
    ("pairs", "movable", "message"),
    [
        (
            [[0, 2**63 - 1, -1], [1, 2**40, 0]],
            None,
            f"pairs: must be columns of bodies, from 0 to {2**63 - 1}; contact 2 has (-1, 0)",
        ),
        (
            [[0, 2**63 - 1], [1, 0]],
            [True, True],
            f"pairs: must be columns of bodies, from 0 to 1; contact 1 has ({2**63 - 1}, 0)",
        ),
        (
            [[0, 1], [1, 2]],
            [True, True],
            "pairs: must be columns of bodies, from 0 to 1; contact 1 has (1, 2)",
        ),
        ([[0, -1], [1, 0]], None, "pairs: must be columns of bodies, from 0 to 1; contact 1 has (-1, 0)"),
        ([[-3], [-4]], None, "pairs: must be columns of bodies, from 0 to -1; contact 0 has (-3, -4)"),
        ([[0.5], [1]], None, "pairs: must be integers of shape (2, N), are float64 of (2, 1)"),
        ([[0], [1]], [1, 1], "movable: must be bool of shape (B,), is int64 of (2,)"),
        ([[0], [1]], [[True, True]], "movable: must be bool of shape (B,), is bool of (1, 2)"),
    ],
)
def test_sets_of_invalid_pairs_are_refused(pairs, movable, message):
    with pytest.raises(ValueError) as refusal:
        independent_sets(pairs, movable)
    assert str(refusal.value) == message


# the way back


def resolve_one_after_another(
    table: np.ndarray, pairs: np.ndarray, contacts: np.ndarray, model: ImpactModel
) -> np.ndarray:
    """Resolve each contact with the velocities that the contacts before it left, as a simulator does."""
    table = table.copy()
    for i, pair in enumerate(pairs.T.tolist()):
        try:
            impact = resolve(
                *collision_at(Geometry.SPATIAL, table[:, [pair]].swapaxes(1, 2), contacts[:, [i]], 0), model
            )
        except ImpactError:
            continue
        for body, twist in zip(pair, (impact.twist_a, impact.twist_b), strict=True):
            table[body_row.velocity, body] = twist.linear
            table[body_row.angular_velocity, body] = twist.angular
    return table


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.ROUTH_STRONGE])
def test_a_step_by_sets_equals_a_step_contact_by_contact(law):
    table, pairs, contacts = crowded_table(contacts=300)
    known = ((pairs >= 0) & (pairs < table.shape[1])).all(axis=0) & (pairs[0] != pairs[1])
    pairs, contacts = pairs[:, known], contacts[:, known]
    model = ImpactModel(law, precision=Precision.DOUBLE)
    expected = resolve_one_after_another(table, pairs, contacts, model)
    for group in independent_sets(pairs, np.isfinite(table[0])):
        own = pairs[:, group]
        scatter_velocities(table, own, resolve_batch(table, contacts[:, group], model, pairs=own))
    np.testing.assert_array_equal(table, expected)


def test_bodies_without_an_answer_keep_their_velocity():
    table, _, contacts = crowded_table()
    before = table.copy()
    pairs = np.array([[10, 5, 20, 30], [11, 21, 99, 30]])
    result = resolve_batch(table, contacts[:, :4], pairs=pairs)
    answered = result.status <= StatusCode.SEPARATING
    assert answered.tolist() == [True, False, False, False]
    scatter_velocities(table, pairs, result)
    changed = (table != before).any(axis=0) & ~np.isnan(before).any(axis=0)
    assert set(np.flatnonzero(changed)) <= {10, 11}
    np.testing.assert_array_equal(table[body_row.velocity, 10], result.velocity[:, 0, 0])
    assert np.isnan(table).any(axis=0).sum() == np.isnan(before).any(axis=0).sum()


@pytest.mark.parametrize("make", [np.asarray, array_api_strict.asarray, on_another_device])
@pytest.mark.parametrize(
    "make_result", [np.asarray, array_api_strict.asarray, lambda array: da.from_array(array, chunks=-1)]
)
@pytest.mark.parametrize(("geometry", "oriented"), KINDS)
def test_tables_of_every_array_library_get_the_velocities(geometry, oriented, make, make_result):
    """Bit for bit, with sound contacts only and with contacts that have no answer."""
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    for count in (FIRST_FAULTY, N):
        own = SHARED_PAIRS[:, :count]
        expected, table = body_table(bodies), make(body_table(bodies).copy())
        result = resolve_batch(body_table(bodies), contacts[:, :count], pairs=own)
        expected = expected.copy()
        scatter_velocities(expected, own, result)
        theirs = result.mapped(make_result)
        scatter_velocities(table, make(own), theirs)
        np.testing.assert_array_equal(np.asarray(np.from_dlpack(table)), expected)
        assert not np.array_equal(expected, body_table(bodies), equal_nan=True)


def test_tables_of_a_library_without_assignment_are_refused(monkeypatch):
    """As those of JAX."""
    bodies, contacts = shared_batch(Geometry.POINT)
    table = array_api_strict.asarray(body_table(bodies))
    result = resolve_batch(body_table(bodies), contacts, pairs=SHARED_PAIRS)

    def refuse(self, key, value):
        raise TypeError("immutable")

    monkeypatch.setattr(type(table), "__setitem__", refuse)
    with pytest.raises(ValueError, match=r"^bodies: must be an array that can be changed: immutable$"):
        scatter_velocities(table, SHARED_PAIRS, result)


@pytest.mark.parametrize("make", [da.asarray, np.ndarray.tolist, tuple])
def test_read_only_tables_are_refused(make):
    bodies, contacts = shared_batch(Geometry.POINT)
    result = resolve_batch(body_table(bodies), contacts, pairs=SHARED_PAIRS)
    with pytest.raises(ValueError, match=r"^bodies: must be an array that can be changed, is "):
        scatter_velocities(make(body_table(bodies)), SHARED_PAIRS, result)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda table, pairs, result: (table, pairs + 7, result), "pairs"),
        (lambda table, pairs, result: (table, pairs - 1, result), "pairs"),
        (lambda table, pairs, result: (table, pairs[:, :1], result), "pairs"),
        (lambda table, pairs, result: (table[0], pairs, result), "bodies"),
        (lambda table, pairs, result: (table.astype(int), pairs, result), "bodies"),
        (lambda table, pairs, result: (table, pairs, None), "result"),
        (lambda table, pairs, result: (table, pairs, tuple(result)), "result"),
    ],
    ids=["beyond", "negative", "fewer", "one row", "integers", "none", "a tuple"],
)
def test_invalid_arguments_change_no_table(change, field):
    table = np.ones((body_rows(Geometry.POINT).height, 4))
    contacts = np.ones((contact_rows(Geometry.POINT).height, 2))
    pairs = np.array([[0, 2], [1, 3]])
    result = resolve_batch(table, contacts, pairs=pairs)
    asked = change(table, pairs, result)
    before = asked[0].copy()
    with pytest.raises(ValueError, match=rf"^{field}: must be "):
        scatter_velocities(*asked)
    np.testing.assert_array_equal(asked[0], before)


def test_a_cradle_passes_on_its_momentum_exactly():
    """Equal balls at e = 1, one contact after another: the last ball leaves with the speed of the first."""
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    n = 40
    bodies, contacts = np.zeros((body_row.height, n)), np.zeros((contact_row.height, n - 1))
    bodies[body_row.mass], contacts[contact_row.restitution] = 1.0, 1.0
    contacts[contact_row.normal] = [[-1.0], [0.0], [0.0]]
    bodies[body_row.velocity][0, 0] = 3.0
    pairs = np.array([np.arange(n - 1), np.arange(1, n)])
    for group in independent_sets(pairs):
        own = pairs[:, group]
        scatter_velocities(bodies, own, resolve_batch(bodies, contacts[:, group], pairs=own))
    assert [Fraction(v) for v in bodies[body_row.velocity][0].tolist()] == [0] * (n - 1) + [3]


def test_the_docstring_examples_run():
    assert doctest.testmod(collision_response.batch.pairs).failed == 0


def test_pairs_may_be_unaligned():
    pairs = np.array([[0, 1], [1, 2]])
    odd = np.frombuffer(bytearray(pairs.nbytes + 1), np.uint8)[1:].view(np.int64).reshape(pairs.shape)
    odd[...] = pairs
    assert not odd.flags.aligned
    found, expected = ([one.tolist() for one in independent_sets(p, [True] * 3)] for p in (odd, pairs))
    assert found == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": lambda v: v[..., :1]}, r"^result\.velocity: must be of shape \(3, 2, 2\) "),
        ({"angular_velocity": lambda w: w[:2]}, r"^result\.angular_velocity: must be of shape \(3, 2, 2\) "),
        (
            {"status": lambda status: status.astype(float)},
            r"^result\.status: must be status codes, is float64",
        ),
        ({"status": lambda status: status + 50}, r"^result\.status: must be status codes, has others"),
    ],
)
def test_results_that_do_not_fit_are_refused_before_anything_is_written(change, message):
    rows, contact = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.ones((rows.height, 4)), np.ones((contact.height, 2))
    bodies[rows.inertia] = np.array([1.0, 0, 0, 1.0, 0, 1.0])[:, None]
    pairs = np.array([[0, 1], [2, 3]])
    result = resolve_batch(bodies, contacts, pairs=pairs)
    wrong = result._replace(**{name: make(getattr(result, name)) for name, make in change.items()})
    before = bodies.copy()
    with pytest.raises(ValueError, match=message):
        scatter_velocities(bodies, pairs, wrong)
    assert (bodies == before).all()
    flat = np.ones((body_rows(Geometry.PLANAR).height, 4))
    with pytest.raises(ValueError, match=r"^result\.velocity: must be of shape \(2, 2, 2\) "):
        scatter_velocities(flat, pairs, result)
    bodies.flags.writeable = False
    with pytest.raises(ValueError, match=r"^bodies: must be an array that can be changed, is read-only"):
        scatter_velocities(bodies, pairs, result)
