"""Batches of arrays of other libraries: the array API, and dask by the chunk."""

from __future__ import annotations

from itertools import product

import pytest

pytest.importorskip("array_api_strict")
pytest.importorskip("dask.array")
import array_api_strict
import dask
import dask.array as da
import numpy as np
from batch_cases import FIRST_FAULTY, N, assert_same, on_another_device, shared_batch
from collisions import LAWS_WITH_ORACLE

from collision_response import Body, Contact, Geometry, ImpactModel, Law, Precision
from collision_response.batch import resolve_batch
from collision_response.batch.arrays import as_numpy
from collision_response.impact import impact
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

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


@pytest.mark.parametrize("model", MODELS)
def test_results_are_on_the_device_of_the_bodies(model):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    result = resolve_batch(on_another_device(bodies), on_another_device(contacts), model)
    here = [array for array in result if array is not None]
    assert {array.device for array in here} == {on_another_device(bodies).device}
    expected = resolve_batch(bodies, contacts, model)
    assert_same(result.mapped(np.from_dlpack), expected)


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
    computed = result.mapped(lambda array: array.compute(scheduler="synchronous"))
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
            result.mapped(lambda array: array.compute(scheduler="synchronous")), resolve_batch(**known)
        )
    else:
        with pytest.raises(ValueError, match=r"^(bodies|contacts|pairs): must have the chunks of "):
            resolve_batch(**known | unknown)


def test_a_table_of_unknown_length_is_named():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    table = da.from_array(bodies.reshape(len(bodies), -1), chunks=(-1, 50))
    chosen = table[:, da.from_array(np.ones(table.shape[1], bool), chunks=50)]
    with pytest.raises(
        ValueError, match=r"^bodies: must have chunks of known length: call compute_chunk_sizes"
    ):
        resolve_batch(chosen, contacts, pairs=np.array([range(N), range(N, 2 * N)]))


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
    *product([np.array, array_api_strict.asarray, on_another_device], LAWS_WITH_ORACLE),
    (da.from_array, Law.COULOMB),  # dask would recompute every turn of a loop from the start
]


@pytest.mark.parametrize(("make", "law"), MAKES, ids=lambda one: getattr(one, "__name__", None) or one.name)
def test_the_formulas_accept_arrays_of_other_libraries(make, law):
    """All contacts of a batch at once, bit for bit as the batch answers."""
    with np.errstate(all="ignore"):
        answer = impact(*collision_of_arrays(make), law)
        impulse = [as_numpy("impulse", x) for x in answer.changes.impulse]
        spin = [as_numpy("spin", x) for x in answer.report.twist_b.angular]
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))
    expected = resolve_batch(bodies, contacts, ImpactModel(law))
    np.testing.assert_array_equal(impulse, expected.impulse)
    np.testing.assert_array_equal(spin, expected.angular_velocity[:, 1])


def test_numbers_whose_sign_is_pending_are_read_with_it():
    """As those of PyTorch: ``z.conj().imag`` is negated only when it is used, and not in its memory."""

    class Pending:
        def __init__(self, memory, is_negated):
            self.memory, self.is_negated = memory, is_negated

        def resolve_neg(self):
            return Pending(-self.memory if self.is_negated else self.memory, False)

        def __dlpack__(self, **options):
            return self.memory.__dlpack__(**options)

        def __dlpack_device__(self):
            return self.memory.__dlpack_device__()

    numbers = np.array([1.0, -2.0])
    assert as_numpy("numbers", Pending(-numbers, True)).tolist() == [1.0, -2.0]
    assert as_numpy("numbers", Pending(numbers, False)).tolist() == [1.0, -2.0]
