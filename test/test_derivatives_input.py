"""Input of derivatives: invalid requests and names are refused by name."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("mpmath")
import numpy as np
from collisions import BODY_A, BODY_B, CONTACT
from refusals import refused

from collision_response import Body, Geometry, ImpactModel, Law, StatusCode
from collision_response.batch import body_rows, contact_rows
from collision_response.derivatives import differentiate, differentiate_batch, unit_directions
from collision_response.physics.vector import Vec3


@pytest.mark.parametrize(
    ("change", "code", "field"),
    [
        ({"with_respect_to": ("body_a.masses",)}, StatusCode.INVALID_MODEL, "with_respect_to"),
        (
            {"contact": CONTACT._replace(restitution=lambda v: 0.5)},
            StatusCode.INVALID_COEFFICIENT,
            "contact.restitution",
        ),
        (
            {"contact": CONTACT._replace(normal=Vec3(0.0, 0.0, 0.0))},
            StatusCode.INVALID_NORMAL,
            "contact.normal",
        ),
        ({"model": ImpactModel(geometry=Geometry.PLANAR)}, StatusCode.INVALID_MODEL, "model.geometry"),
        ({"body_a": BODY_A._replace(mass=-1.0)}, StatusCode.INVALID_MASS, "body_a.mass"),
        (
            {"body_a": Body.articulated(np.eye(6), velocity=BODY_A.velocity)},
            StatusCode.INVALID_INERTIA,
            "body_a.inverse_inertia",
        ),
    ],
)
def test_bad_input_is_refused_by_name(change, code, field):
    request = {"body_a": BODY_A, "body_b": BODY_B, "contact": CONTACT} | change
    with refused(code, field):
        differentiate(**request)


@pytest.mark.parametrize("wrong", [None, 1, "abc", (), (1.0, 2.0), [], Law.COULOMB, math.sin], ids=repr)
@pytest.mark.parametrize("argument", ["body_a", "body_b", "contact", "model"])
def test_arguments_of_wrong_types_are_refused_by_name(argument, wrong):
    request = {"body_a": BODY_A, "body_b": BODY_B, "contact": CONTACT, "model": ImpactModel()}
    with pytest.raises(TypeError, match=f"^{argument}: must be "):
        differentiate(**request | {argument: wrong})


def test_one_name_is_no_sequence_of_names():
    with pytest.raises(TypeError, match=r"^with_respect_to: must be a sequence of names .*'body_a.mass'"):
        differentiate(BODY_A, BODY_B, CONTACT, with_respect_to="body_a.mass")


@pytest.mark.parametrize("first", ["contact.friction", "body_a.velocity", "body_b.inertia"])
@pytest.mark.parametrize("between", [(), ("contact.normal",), ("contact.normal", "body_a.mass")])
def test_a_repeated_name_is_refused(first, between):
    """The columns of a name can only be at one place."""
    names = (first, *between, first, "contact.restitution")
    with refused(StatusCode.INVALID_MODEL, "with_respect_to", first):
        differentiate(BODY_A, BODY_B, CONTACT, with_respect_to=names)
    with refused(StatusCode.INVALID_MODEL, "with_respect_to", first):
        unit_directions(*names)


@pytest.mark.parametrize("name", ["bodies", "contacts", "directions"])
def test_masked_entries_are_refused(name):
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    given = {
        "bodies": np.ones((body_row.height, 2, 1)),
        "contacts": np.ones((contact_row.height, 1)),
        "directions": unit_directions("contact.restitution"),
    }
    hidden = np.ma.masked_array(given[name], np.ones(given[name].shape, bool))
    with pytest.raises(ValueError, match=f"^{name}: must be numbers, some are masked$"):
        differentiate_batch(**given | {name: hidden})


def test_derivatives_are_equal_if_all_their_numbers_are():
    one, same = (differentiate(BODY_A, BODY_B, CONTACT) for _ in range(2))
    assert one == same
    for field in ("jacobian", "smoothness"):
        other = getattr(one, field).copy()
        other[..., -1:] += 1
        assert one != one._replace(**{field: other})
    assert one != differentiate(BODY_A, BODY_B, CONTACT, with_respect_to=["contact.friction"])
    assert one != 1


def test_directions_of_a_wrong_shape_are_refused():
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    with pytest.raises(ValueError, match="directions: must be of shape"):
        differentiate_batch(
            np.ones((body_row.height, 2, 3)), np.ones((contact_row.height, 3)), np.ones((5, 2))
        )


def test_what_is_not_among_the_derivatives_is_refused_with_what_is():
    found = differentiate(BODY_A, BODY_B, CONTACT, with_respect_to=["body_a.mass"])
    with pytest.raises(KeyError, match=r"result: must be one of twist_a.linear, .*; is 'twist_a'"):
        found.of("twist_a", "body_a.mass")
    with pytest.raises(KeyError, match=r"parameter: must be one of body_a.mass; is 'body_a.velocity'"):
        found.of("impulse", "body_a.velocity")


def test_unit_directions_take_names_one_by_one():
    with pytest.raises(
        TypeError, match=r"must be names one by one, as unit_directions\(\*\['body_a.mass'\]\)"
    ):
        unit_directions(["body_a.mass"])
