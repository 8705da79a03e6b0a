"""Error bounds in batches, and the contacts that are computed again to meet a tolerance."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from batches import FIRST_FAULTY, N, scene_of, some
from random_impacts import RandomImpacts
from reference import exact_answer
from test_extended_batch import table_of

from collision_response import Geometry, ImpactError, ImpactModel, Law, Precision, StatusCode, resolve
from collision_response.batch import more_digits, prepare_batch, resolve_batch
from collision_response.batch.backends import Backend
from collision_response.batch.doubled import ULP

LAWS = (Law.FRICTIONLESS, Law.COULOMB)
PROBLEMS = [*product((Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL), LAWS)]
ANSWERED = (StatusCode.OK, StatusCode.SEPARATING)


def ill_conditioned(law: Law, wildness: float, count: int = 120):
    """Scenes and their models, and the same as a batch."""
    impacts = RandomImpacts(seed=int(wildness), wildness=wildness)
    drawn = [impacts.request(law) for _ in range(count)]
    if law is Law.FRICTIONLESS:
        drawn = [
            (scene._replace(contact=scene.contact._replace(friction=0.0)), model) for scene, model in drawn
        ]
    models = [model._replace(geometry=Geometry.SPATIAL) for _, model in drawn]
    scenes = [scene for scene, _ in drawn]
    return scenes, models, *table_of(scenes, models)


def errors(scenes, models, result, rows) -> list[float]:
    """Of the impulses, relative to the exact ones."""
    found = []
    for i in rows:
        exact = exact_answer(*scenes[i], models[i]).impact.impulse
        off = sum((x - y) ** 2 for x, y in zip(result.impulse[:, i].tolist(), exact, strict=True))
        size = exact.dot(exact)
        found.append(float((off / size).sqrt()) if size > 0 else float(off))
    return found


@pytest.mark.parametrize("wildness", [0, 3, 8, 60])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_no_error_is_above_its_bound(law, wildness):
    scenes, models, bodies, contacts = ill_conditioned(law, wildness)
    result = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.DOUBLE, tolerance=1e300))
    rows = np.flatnonzero(np.isin(result.status, ANSWERED) & np.isfinite(result.error_bound))
    assert len(rows) > 20
    for error, bound in zip(errors(scenes, models, result, rows), result.error_bound[rows], strict=True):
        assert error <= bound


@pytest.mark.parametrize(("geometry", "law"), PROBLEMS)
def test_the_bound_is_that_of_one_impact(geometry, law):
    bodies, contacts = some(geometry)
    result = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.DOUBLE, tolerance=1e300))
    compared = 0
    for i in range(FIRST_FAULTY):
        impact = resolve(*scene_of(geometry, bodies, contacts, i), ImpactModel(law, geometry))
        if impact.status is StatusCode.OK and geometry is not Geometry.PLANAR:
            assert result.error_bound[i] == pytest.approx(impact.error_bound, rel=1e-9)
        compared += impact.status is StatusCode.OK
        assert (result.error_bound[i] == 0) == (impact.error_bound == 0)
    assert compared > 30


@pytest.mark.parametrize("many", [0, 10**6], ids=["double-double", "one by one"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_only_what_misses_the_tolerance_is_computed_again(law, many, monkeypatch):
    monkeypatch.setattr(more_digits, "MANY", many)
    scenes, models, bodies, contacts = ill_conditioned(law, 3)
    plain = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.DOUBLE, tolerance=1e-12))
    result = resolve_batch(bodies, contacts, ImpactModel(law, tolerance=1e-12), backend=Backend.NUMPY)
    missed = plain.status == StatusCode.TOLERANCE_NOT_MET
    assert 5 < missed.sum() < 100
    np.testing.assert_array_equal(result.precision == Precision.EXTENDED, missed)
    np.testing.assert_array_equal(result.velocity[..., ~missed], plain.velocity[..., ~missed])
    assert np.isin(result.status, ANSWERED).all()
    assert (result.error_bound <= 1e-12).all()
    assert (result.error_bound[missed] <= ULP).all()
    assert max(errors(scenes, models, result, np.flatnonzero(missed))) <= ULP


@pytest.mark.parametrize("many", [0, 10**6], ids=["double-double", "one by one"])
@pytest.mark.parametrize(("geometry", "law"), PROBLEMS)
def test_extended_is_exact_to_an_ulp_or_refused_alike(geometry, law, many, monkeypatch):
    monkeypatch.setattr(more_digits, "MANY", many)
    bodies, contacts = some(geometry)
    plain = resolve_batch(bodies, contacts, ImpactModel(law), backend=Backend.NUMPY)
    result = resolve_batch(
        bodies, contacts, ImpactModel(law, precision=Precision.EXTENDED), backend=Backend.NUMPY
    )
    differ = plain.status != result.status
    assert (plain.status[differ] == StatusCode.OUT_OF_RANGE).all()
    answered = np.isin(result.status, ANSWERED)
    assert (result.error_bound[answered] <= ULP).all() and np.isnan(result.error_bound[~answered]).all()
    assert np.isfinite(result.velocity[..., answered]).all() and np.isnan(result.impulse[:, ~answered]).all()
    model = ImpactModel(law, geometry, Precision.EXTENDED)
    for i in range(FIRST_FAULTY):
        impact = resolve(*scene_of(geometry, bodies, contacts, i), model)
        given, axes = result.impulse[:, i].tolist(), len(result.impulse)
        assert math.dist(given, impact.impulse[:axes]) <= ULP * math.hypot(*given)


def test_contacts_have_tangential_restitution_of_their_own():
    bodies, contacts = some(Geometry.SPATIAL)
    contacts = np.vstack([contacts, np.linspace(-1, 1, N)])
    result = resolve_batch(bodies, contacts, ImpactModel(precision=Precision.EXTENDED))
    for i in range(0, FIRST_FAULTY, 7):
        model = ImpactModel(Law.COULOMB, Geometry.SPATIAL, Precision.EXTENDED, 0.0, contacts[-1, i])
        impulse = resolve(*scene_of(Geometry.SPATIAL, bodies, contacts, i), model).impulse
        np.testing.assert_array_equal(result.impulse[:, i], impulse)


def test_a_tolerance_that_nothing_meets():
    bodies, contacts = some(Geometry.POINT)
    result = resolve_batch(bodies, contacts, ImpactModel(tolerance=1e-17))
    collided = result.error_bound > 0
    assert collided.sum() > 30
    assert (result.status[collided] == StatusCode.TOLERANCE_NOT_MET).all()
    assert (result.error_bound[collided] <= ULP).all()


def test_results_go_where_they_are_wanted():
    bodies, contacts = some(Geometry.PLANAR)
    model = ImpactModel(tolerance=1e-9)
    expected = resolve_batch(bodies, contacts, model)
    out = expected._replace(error_bound=np.zeros(N), precision=np.zeros(N, np.uint8))
    assert resolve_batch(bodies, contacts, model, out=out) is out
    np.testing.assert_array_equal(out.error_bound, expected.error_bound)
    np.testing.assert_array_equal(out.precision, expected.precision)


def test_extended_is_for_float64():
    bodies, contacts = (array.astype(np.float32) for array in some(Geometry.POINT))
    with pytest.raises(ImpactError, match="precision"):
        resolve_batch(bodies, contacts, ImpactModel(precision=Precision.EXTENDED))


def test_getting_ready_includes_the_digits_that_may_be_wanted():
    bodies, contacts = some(Geometry.POINT)
    plain, exact = (
        prepare_batch(
            bodies, contacts, ImpactModel(precision=precision, tolerance=1e-9), backend=Backend.NUMPY
        )
        for precision in (Precision.DOUBLE, Precision.AUTO)
    )
    assert exact.backend is plain.backend is Backend.NUMPY
    assert exact.seconds > plain.seconds  # by what the double-double program took
