"""EXTENDED batches: right to a unit in the last place, or known not to be."""

from __future__ import annotations

import math
from itertools import product

import pytest

pytest.importorskip("flint")

import numpy as np
from batch_cases import (
    ANSWERED,
    FIRST_FAULTY,
    GEOMETRIES,
    N,
    collision_at,
    ill_conditioned,
    resolve_one_by_one,
    shared_batch,
)
from collisions import CLOSED_FORM_LAWS, Collision
from exact import Fraction, dot, impulse_error, length, plus, times
from exact_adapter import exact_answer

from collision_response import Geometry, ImpactModel, Law, Precision, StatusCode
from collision_response.batch import BatchResult, resolve_batch
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.kernels import library
from collision_response.kernels.layout import Layout
from collision_response.kernels.protocol import NumberType
from collision_response.physics.laws import Settings

ULP = 2.0**-52


def check_contact(model: ImpactModel, result, i: int, collision: Collision) -> None:
    """Check one contact against the exact answer."""
    exact = exact_answer(*collision, model)
    (P,) = exact.impulses
    assert result.status[i] == (StatusCode.OK if any(P) else StatusCode.SEPARATING)
    off = [Fraction(x) - y for x, y in zip(result.impulse[:, i].tolist(), P, strict=False)]
    assert sum(x * x for x in off) <= Fraction(ULP) ** 2 * dot(P, P)
    for side, (body, push) in enumerate(((exact.pair.a, P), (exact.pair.b, times(P, Fraction(-1))))):
        linear, angular = body.response(push)
        check_vector(result.velocity[:, side, i], plus(body.velocity, linear), linear)
        spin = result.angular_velocity[:, side, i]
        if spin.size:
            check_vector(spin, plus(body.spin, angular)[-spin.size :], angular)


def check_vector(given, exact, change) -> None:
    """Check that the change is right to a unit in the last place, and so is its sum with the value before."""
    least = length(change) * Fraction(ULP)
    for x, y in zip(given.tolist(), exact, strict=False):
        assert abs(Fraction(x) - y) <= abs(y) * Fraction(ULP) / 2 + least


@pytest.mark.parametrize("oriented", [False, True])
@pytest.mark.parametrize(("geometry", "law"), [*product(GEOMETRIES, CLOSED_FORM_LAWS)])
def test_shared_contacts_are_exact_to_an_ulp(geometry, law, oriented):
    if oriented and geometry is not Geometry.SPATIAL:
        return  # only those in space have orientations
    bodies, contacts = shared_batch(geometry, oriented=oriented)
    model = ImpactModel(
        law, precision=Precision.EXTENDED, tangential_restitution=0.5, restitution_threshold=0.25
    )
    result = resolve_batch(bodies, contacts, model)
    assert (result.error_bound[:FIRST_FAULTY] <= ULP).all()
    for i in range(FIRST_FAULTY):
        check_contact(model, result, i, collision_at(geometry, bodies, contacts, i))


@pytest.mark.parametrize("law", CLOSED_FORM_LAWS)
@pytest.mark.parametrize("decades", [0, 1, 3, 8])
def test_ill_conditioned_contacts(law, decades):
    """Grazing contacts, thin or lopsided bodies, contacts far from their bodies."""
    collisions, models, bodies, contacts = ill_conditioned(law, decades, 60)
    result = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.EXTENDED))
    assert (result.error_bound <= ULP).all()
    for i, (collision, model) in enumerate(zip(collisions, models, strict=True)):
        (impulse,) = exact_answer(*collision, model).impulses
        assert impulse_error(result.impulse[:, i].tolist(), impulse) <= ULP


@pytest.mark.parametrize("law", CLOSED_FORM_LAWS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_refusals_equal_those_in_double(geometry, law):
    bodies, contacts = shared_batch(geometry)
    plain = resolve_batch(bodies, contacts, ImpactModel(law))
    result = resolve_batch(bodies, contacts, ImpactModel(law, precision=Precision.EXTENDED))
    differ = plain.status != result.status
    assert (plain.status[differ] == StatusCode.OUT_OF_RANGE).all()
    answered = np.isin(result.status, ANSWERED)
    assert (result.error_bound[answered] <= ULP).all() and np.isnan(result.error_bound[~answered]).all()
    assert np.isfinite(result.velocity[..., answered]).all() and np.isnan(result.impulse[:, ~answered]).all()


def test_each_contact_may_have_its_own_tangential_restitution():
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    contacts = np.vstack([contacts, np.linspace(-1, 1, N)])
    result = resolve_batch(bodies, contacts, ImpactModel(precision=Precision.EXTENDED))
    chosen = range(0, FIRST_FAULTY, 7)
    models = [
        ImpactModel(Law.COULOMB, Geometry.AUTO, Precision.EXTENDED, 0.0, contacts[-1, i]) for i in chosen
    ]
    expected = resolve_one_by_one(
        Geometry.SPATIAL, [collision_at(Geometry.SPATIAL, bodies, contacts, i) for i in chosen], models
    )
    np.testing.assert_array_equal(result.impulse[:, chosen], expected.impulse)


def in_double_doubles(bodies, contacts, law: Law):
    """Impulses and bounds by the double-double kernel alone."""
    n = bodies.shape[-1]
    velocity, spin, impulse = (np.empty(shape) for shape in ((3, 2, n), (3, 2, n), (3, n)))
    bound, status = np.empty(n), np.empty(n, np.uint8)
    out = BatchResult(velocity, spin, impulse, status, bound, np.empty_like(status))
    settings = np.zeros(len(Settings._fields))
    tables = np.ascontiguousarray(bodies), None, np.ascontiguousarray(contacts), settings
    kernel = law, list(Layout).index(Layout.SPATIAL), NumberType.EXTENDED
    assert library.batch(*kernel, *tables, out, 0, n) is not None
    return impulse, bound


def test_contacts_that_double_doubles_cannot_decide_are_recomputed():
    """An approach so slow that rounding decides its sign, and numbers at the end of the range."""
    bodies, contacts = (array[..., 10:20].copy() for array in shared_batch(Geometry.SPATIAL))
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    contacts[contact_row.friction] = 0.0
    bodies[body_row.angular_velocity, :, 0] = 0.0
    bodies[body_row.velocity, 0, 0], bodies[body_row.velocity, 1, 0] = [-1.0, 2.0**-60, 0.0], 0.0
    contacts[contact_row.normal, 0] = [2.0**-60, 1.0 - 2.0**-50, 2.0**-1000]
    contacts[contact_row.normal, 1] = [1e-160, 1e-160, 0.0]
    bodies[body_row.inertia, 0, 2] *= (
        1e-60  # double-doubles manage this; below 1e-80 the contact is resolved alone
    )
    impulse, bound = in_double_doubles(bodies, contacts, Law.FRICTIONLESS)
    assert not (bound[:2] <= ULP).any()
    assert (bound[2:] <= ULP).all()
    result = resolve_batch(bodies, contacts, ImpactModel(Law.FRICTIONLESS, precision=Precision.EXTENDED))
    assert (result.error_bound <= ULP).all()
    np.testing.assert_array_equal(result.impulse[:, 2:], impulse[:, 2:])
    for i in range(10):
        collision = collision_at(Geometry.SPATIAL, bodies, contacts, i)
        check_contact(ImpactModel(Law.FRICTIONLESS), result, i, collision)


@pytest.mark.parametrize("law", CLOSED_FORM_LAWS)
def test_double_doubles_suffice_for_most_contacts(law):
    bodies, contacts = (array[..., :FIRST_FAULTY] for array in shared_batch(Geometry.SPATIAL))
    impulse, bound = in_double_doubles(bodies, contacts, law)
    assert (bound <= ULP).mean() > 0.95
    assert not math.isnan(impulse.sum())
