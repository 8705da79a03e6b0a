"""Batches with error bounds: those of single impacts, with more digits only where they are needed."""

from __future__ import annotations

from itertools import product

import pytest

pytest.importorskip("flint")

import numpy as np
from batch_cases import (
    ANSWERED,
    FIRST_FAULTY,
    GEOMETRIES,
    N,
    assert_same,
    assert_same_values,
    batch_of,
    collisions_at,
    columns,
    ill_conditioned,
    resolve_one_by_one,
    shared_batch,
)
from collisions import CLOSED_FORM_LAWS, LAWS_WITH_ORACLE, PATH_LAWS, Collision
from exact import impulse_error
from exact_adapter import exact_answer

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
from collision_response.batch import body_rows, contact_rows, resolve_batch
from collision_response.physics.vector import Vec3

BOX = Body.box(1.0, (1.0, 0.5, 0.25))
CORNER = Contact.of((0.25, 0.125, -0.125), normal=(0.0, 0.0, 1.0), friction=0.3)
DOUBLE = ImpactModel(precision=Precision.DOUBLE, tolerance=1e300)
"""Report bounds, and never recompute with more digits."""


PLATE = Body.dynamic(1.0, (1e-15, 0.0, 0.0, 0.5, 0.0, 0.5), (0.5, 1.0, 2.0), None, (0.0, 0.0, -1.0))
"""Almost a rod, for which the path of Routh's laws is too long in DOUBLE."""


def impulse_errors(collisions, models, result, rows) -> list[float]:
    """The relative errors of the impulses of some columns."""
    found = []
    for i in rows:
        (impulse,) = exact_answer(*collisions[i], models[i]).impulses
        found.append(impulse_error(result.impulse[:, i].tolist(), impulse))
    return found


def assert_same_to_the_bound(result, expected):
    """Check the values, the bounds, and the precisions of contacts with an answer."""
    assert_same_values(result, expected)
    np.testing.assert_array_equal(result.error_bound, expected.error_bound)
    answered = ~np.isnan(expected.error_bound)
    np.testing.assert_array_equal(result.precision[answered], expected.precision[answered])


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize(("geometry", "law"), [*product(GEOMETRIES, LAWS_WITH_ORACLE)])
def test_every_column_equals_resolve(geometry, law, precision):
    """Including its bound and the precision that was used."""
    bodies, contacts = shared_batch(geometry)
    model = ImpactModel(law, precision=precision, tolerance=1e-13)
    result = resolve_batch(bodies, contacts, model)
    expected = resolve_one_by_one(geometry, collisions_at(geometry, bodies, contacts), [model] * N)
    assert_same_to_the_bound(result, expected)


@pytest.mark.parametrize("masses", [(-200, 200), (200, -200), (-200, -200), (200, 200)])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_rescaling_is_preferred_to_more_digits(law, masses):
    """Masses of 1e-200 and 1e200 overflow in the given units, not in others."""
    geometry, model = Geometry.SPATIAL, ImpactModel(law, tolerance=1e-9)
    bodies, contacts = shared_batch(geometry)
    bodies = bodies[..., :FIRST_FAULTY].copy()
    contacts = contacts[:, :FIRST_FAULTY]
    for side, power in enumerate(masses):
        bodies[:7, side] *= 10.0**power
    result = resolve_batch(bodies, contacts, model)
    collisions = collisions_at(geometry, bodies, contacts)
    expected = resolve_one_by_one(geometry, collisions, [model] * FIRST_FAULTY)
    assert_same_to_the_bound(result, expected)


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize("tolerance", [0.5, 2.0**-20, 1e-9, 2.0**-48, 1e-15, 1e-20])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_every_tolerance_uses_the_precision_that_resolve_uses(law, tolerance, precision):
    collisions, _, bodies, contacts = ill_conditioned(law, 7.0)
    model = ImpactModel(law, precision=precision, tolerance=tolerance)
    result = resolve_batch(bodies, contacts[:-1], model)
    expected = resolve_one_by_one(Geometry.SPATIAL, collisions, [model] * len(collisions))
    assert_same_to_the_bound(result, expected)


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
@pytest.mark.parametrize("decades", [1, 10])
def test_every_ill_conditioned_column_equals_resolve(law, decades):
    collisions, models, bodies, contacts = ill_conditioned(law, decades, 60)
    model = ImpactModel(law, tolerance=1e-10)
    expected = resolve_one_by_one(
        Geometry.SPATIAL,
        collisions,
        [model._replace(tangential_restitution=one.tangential_restitution) for one in models],
    )
    result = resolve_batch(bodies, contacts, model)
    assert_same_values(result, expected)
    np.testing.assert_array_equal(result.error_bound, expected.error_bound)


@pytest.mark.parametrize("decades", [0, 3, 8, 60])
@pytest.mark.parametrize("law", CLOSED_FORM_LAWS, ids=lambda law: law.name)
def test_no_error_exceeds_its_bound(law, decades):
    collisions, models, bodies, contacts = ill_conditioned(law, decades)
    result = resolve_batch(bodies, contacts, DOUBLE._replace(law=law))
    rows = np.flatnonzero(np.isin(result.status, ANSWERED) & np.isfinite(result.error_bound))
    assert len(rows) > 20
    for error, bound in zip(
        impulse_errors(collisions, models, result, rows), result.error_bound[rows], strict=True
    ):
        assert error <= bound


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE, ids=lambda law: law.name)
def test_only_contacts_that_miss_the_tolerance_are_recomputed(law):
    collisions, models, bodies, contacts = ill_conditioned(law, 3)
    bounds = resolve_batch(bodies, contacts, DOUBLE._replace(law=law)).error_bound
    tolerance = float(np.median(bounds[bounds > 0]))
    if law in PATH_LAWS:  # their step length depends on the tolerance
        tolerance = 1e-11
    plain = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.DOUBLE, tolerance=tolerance))
    result = resolve_batch(bodies, contacts, ImpactModel(law, tolerance=tolerance))
    missed = plain.status == StatusCode.TOLERANCE_NOT_MET
    assert 5 < missed.sum() < 100
    np.testing.assert_array_equal(result.precision == Precision.EXTENDED, missed)
    assert_same(columns(result, ~missed), columns(plain, ~missed))
    assert (np.isin(result.status, ANSWERED) == (result.error_bound <= tolerance)).all()
    if law in CLOSED_FORM_LAWS:
        assert np.isin(result.status, ANSWERED).all()
        assert max(impulse_errors(collisions, models, result, np.flatnonzero(missed))) <= tolerance


def test_a_tolerance_that_nothing_meets():
    bodies, contacts = shared_batch(Geometry.POINT)
    result = resolve_batch(bodies, contacts, ImpactModel(tolerance=1e-17))
    collided = result.error_bound > 0
    assert collided.sum() > 30
    assert (result.status[collided] == StatusCode.TOLERANCE_NOT_MET).all()
    assert (result.error_bound[collided] <= 2.0**-52).all()


def test_out_is_written_to():
    bodies, contacts = shared_batch(Geometry.PLANAR)
    model = ImpactModel(tolerance=1e-14)
    expected = resolve_batch(bodies, contacts, model)
    out = expected._replace(error_bound=np.zeros(N), precision=np.zeros(N, np.uint8))
    assert resolve_batch(bodies, contacts, model, out=out) is out
    assert_same(out, expected)
    assert (expected.precision[:FIRST_FAULTY] == Precision.EXTENDED).any()


def test_float32_has_no_bounds():
    bodies, contacts = (array.astype(np.float32) for array in shared_batch(Geometry.POINT))
    for model in (ImpactModel(precision=Precision.EXTENDED), ImpactModel(tolerance=1e-3)):
        with pytest.raises(ImpactError, match=r"model\.(precision|tolerance)"):
            resolve_batch(bodies, contacts, model)


def slender_boxes(n: int, approach: float) -> tuple[np.ndarray, np.ndarray]:
    """Boxes that slide on a corner, so rough that many jam, at once or after reversing.

    They approach the ground at between ``10**approach`` and 1 times their slip.
    """
    random = np.random.default_rng(5)
    body_row = body_rows(Geometry.SPATIAL)
    contact_row = contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((body_row.height, 2, n)), np.zeros((contact_row.height, n))
    edges = 10 ** random.uniform(-1.5, 0.3, (3, n))
    axes = np.linalg.qr(random.normal(size=(n, 3, 3)))[0]
    inertia = np.einsum("nij,jn,nkj->ikn", axes, ((edges**2).sum(0) - edges**2) / 12, axes)
    corner = np.einsum("nij,jn->in", axes, edges * random.choice([-0.5, 0.5], (3, n)))
    way, fall = random.uniform(0, 2 * np.pi, n), 10 ** random.uniform(approach, 0, n)
    bodies[body_row.mass], bodies[body_row.mass, 1] = 1.0, np.inf
    bodies[body_row.inertia, 0] = inertia[np.triu_indices(3)]
    bodies[body_row.position, 0] = corner * np.sign(corner[2])
    bodies[body_row.velocity, 0] = 5 * np.cos(way), 5 * np.sin(way), -5 * fall
    contacts[contact_row.normal] = [[0.0], [0.0], [1.0]]
    contacts[contact_row.restitution] = random.uniform(0, 1, n)
    contacts[contact_row.friction] = 10 ** random.uniform(-0.5, 0.7, n)
    return bodies, contacts


@pytest.mark.parametrize("law", PATH_LAWS)
def test_a_path_that_jams_ends(law):
    bodies, contacts = slender_boxes(20_000, -6)
    found = resolve_batch(bodies, contacts, ImpactModel(law), report=True)
    assert set(found.status) == {StatusCode.OK}
    assert sum(found.regime == Regime.JAMMED) > 1000
    found = resolve_batch(bodies, contacts, ImpactModel(law, tolerance=1e-9))
    assert set(found.status) == {StatusCode.OK, StatusCode.TOLERANCE_NOT_MET}
    assert sum(found.status == StatusCode.TOLERANCE_NOT_MET) < 200
    assert np.isfinite(found.error_bound).all()


@pytest.mark.parametrize("restitution", [1e-3, 0.5])
@pytest.mark.parametrize("law", [Law.COMPLIANT, Law.ROUTH_STRONGE, Law.COULOMB], ids=lambda law: law.name)
def test_an_approach_at_the_threshold_has_the_bound_of_a_single_impact(law, restitution):
    """More digits decide that the threshold does not apply, also for a law of one precision."""
    collisions = [
        Collision(BOX._replace(velocity=Vec3(0.5, 0.0, -speed)), Body.static(), CORNER)
        for speed in (1.0, 1.0 + 2.0**-52, 1.0 - 2.0**-53, 2.0)
    ]
    collisions = [one._replace(contact=one.contact._replace(restitution=restitution)) for one in collisions]
    bodies, contacts = batch_of(collisions)
    for precision, tolerance in ((Precision.EXTENDED, 0.0), (Precision.AUTO, 1e-6)):
        model = ImpactModel(law, precision=precision, tolerance=tolerance, restitution_threshold=1.0)
        result = resolve_batch(bodies, contacts, model)
        assert_same_values(result, resolve_one_by_one(Geometry.SPATIAL, collisions, [model] * 4))
        assert (result.error_bound < 1e-6).all()


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE], ids=str)
def test_a_path_that_is_too_long_in_double_is_followed_with_more_digits(law, tolerance):
    model = ImpactModel(law, tolerance=tolerance)
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.5)
    result = resolve_batch(*batch_of([(PLATE, Body.static(), contact)], Geometry.SPATIAL), model)
    alone = resolve(PLATE, Body.static(), contact, model)
    assert result.status == alone.status and result.precision == alone.model.precision
    assert result.impulse[:, 0].tolist() == list(alone.impulse)
