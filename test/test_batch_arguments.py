"""Arguments of batches: what is refused by name, and where results may lie in memory."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("array_api_strict")
pytest.importorskip("dask.array")
import array_api_strict
import dask.array as da
import numpy as np
from batch_cases import N, assert_same, columns, shared_batch
from collisions import LAWS_WITH_FRICTION
from refusals import refused

from collision_response import Geometry, ImpactModel, Law, Precision, StatusCode
from collision_response.batch import BatchResult, resolve_batch, resolve_scenes
from collision_response.batch.rows import body_rows, contact_rows


@pytest.mark.parametrize("order", ["C", "F"])
def test_out_is_written_to(order):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    result = resolve_batch(bodies, contacts)
    out = result.mapped(lambda array: np.full_like(array, 9, order=order))
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
        out = expected.mapped(lambda array, offset=offset: shifted(array, offset))
        assert_same(resolve_batch(bodies, contacts, out=out), expected)
        out = expected.mapped(lambda array, offset=offset: shifted(array, offset))
        assert_same(resolve_batch(table, contacts, pairs=pairs, out=out), expected)


def test_any_memory_layout_is_read_and_not_changed():
    bodies, contacts = shared_batch(Geometry.PLANAR)
    expected = resolve_batch(bodies, contacts)
    wide = np.repeat(bodies, 2, axis=-1), np.asfortranarray(contacts)
    assert_same(expected, resolve_batch(wide[0][..., ::2], wide[1]))
    assert_same(expected, resolve_batch(*shared_batch(Geometry.PLANAR)))


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


@pytest.mark.parametrize("field", ["error_bound", "precision", "regime", "kinetic_energy_after"])
def test_an_array_of_out_without_use_is_named(field):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    full = resolve_batch(bodies, contacts, ImpactModel(tolerance=1e-6), report=True)
    out = resolve_batch(bodies, contacts)._replace(**{field: getattr(full, field)})
    with pytest.raises(ValueError, match=r"^out\.\w+: must be "):
        resolve_batch(bodies, contacts, out=out)


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


class LiesAboutItsShape(np.ndarray):
    shape = property(lambda self: (4, 2, 10_000_000))


@pytest.mark.parametrize("which", ["bodies", "contacts"])
def test_an_array_that_lies_about_its_shape_is_read_as_it_is(which):
    """The kernel read beyond its end."""
    rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    tables = {"bodies": np.ones((rows.height, 2, 1)), "contacts": np.ones((contact.height, 1))}
    expected = resolve_batch(**tables)
    tables[which] = tables[which].view(LiesAboutItsShape)
    assert_same(resolve_batch(**tables), expected)


@pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")
@pytest.mark.parametrize("seed", range(20))
def test_a_matrix_gives_what_an_array_gives(seed):
    """A matrix loses an axis where one row is computed again with more digits."""
    rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    rng = np.random.default_rng(seed)
    bodies, contacts = rng.normal(size=(rows.height, 4)), rng.normal(size=(contact.height, 2))
    bodies[rows.mass] = rng.random((1, 4)) + 0.5
    contacts[contact.restitution], contacts[contact.friction] = 0.5, 0.3
    for tolerance in (4e-15, 1e-14, 3e-14):
        model, pairs = ImpactModel(tolerance=tolerance), np.array([[0, 2], [1, 3]])
        expected = resolve_batch(bodies, contacts, model, pairs=pairs)
        found = resolve_batch(np.matrix(bodies), np.matrix(contacts), model, pairs=pairs)
        assert_same(found, expected)


def test_a_table_of_bodies_without_pairs_is_refused_with_the_argument_to_give():
    rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    with pytest.raises(ValueError, match=r"a table of bodies needs the argument pairs$"):
        resolve_batch(np.zeros((rows.height, 3)), np.zeros((contact.height, 2)))
