"""The usual answers, computed in one function, against the tiers: every bit the same."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import given
from random_impacts import RandomImpacts
from scenes import Scene, planar_scenes, scenes

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    straight_line,
)
from collision_response.requirements import plan
from collision_response.tiers import TIERS

FORMULAS = (Law.FRICTIONLESS, Law.COULOMB)
GEOMETRIES = (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL)
BALL = Body.dynamic(
    2.0, (0.8, 0.0, 0.0, 0.8, 0.0, 0.8), (0.0, 0.0, 0.5), None, (1.0, 0.0, -2.0), (0.0, 3.0, 0.0)
)
FLOOR = Contact.of((0.1, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.3)
SKIMMING = BALL._replace(velocity=BALL.velocity._replace(z=-1e-15), angular_velocity=BALL.position * 0)
OFF_UNIT = straight_line.TURNED._replace(z=0.1)


def by_tiers(scene: Scene, model: ImpactModel):
    """The answer without the short way."""
    attempt = plan(*scene, model)
    return TIERS[attempt.model.precision](*scene, attempt)


@pytest.mark.parametrize(("law", "precision"), [*product(FORMULAS, (Precision.SINGLE, Precision.DOUBLE))])
@given(scene=scenes())
def test_bit_for_bit_in_space(law, precision, scene):
    same_or_none(scene, ImpactModel(law, Geometry.AUTO, precision, tangential_restitution=0.25))


@pytest.mark.parametrize(("law", "geometry"), [*product(FORMULAS, GEOMETRIES)])
@given(scene=planar_scenes())
def test_bit_for_bit_in_the_plane(law, geometry, scene):
    same_or_none(scene, ImpactModel(law, geometry, Precision.DOUBLE))


@pytest.mark.parametrize("wildness", [0, 3, 10, 60])
@pytest.mark.parametrize("law", FORMULAS)
def test_bit_for_bit_whatever_the_sizes(law, wildness):
    impacts = RandomImpacts(seed=wildness, wildness=wildness)
    requests = (impacts.request(law) for _ in range(200))
    served = sum(same_or_none(scene, model) for scene, model in requests)
    assert served >= (1 if wildness == 60 else 40)  # half of them separate, a third graze


def same_or_none(scene: Scene, model: ImpactModel) -> bool:
    usual = straight_line.usual_answer(*scene, model)
    if usual is not None:
        assert usual == by_tiers(scene, model)
        assert [type(part) for part in usual] == [type(part) for part in by_tiers(scene, model)]
    return usual is not None


def test_a_quaternion_off_unit_length_is_reported():
    scene = Scene(BALL._replace(orientation=OFF_UNIT), Body.static(), FLOOR)
    assert same_or_none(scene, ImpactModel())
    assert resolve(*scene).adjustments is Adjustment.NORMALISED_ORIENTATION


def test_most_impacts_are_usual():
    for scene in (
        Scene(BALL, Body.static(), FLOOR),
        Scene(BALL, BALL._replace(velocity=FLOOR.normal), FLOOR),
    ):
        for law in (Law.AUTO, *FORMULAS):
            assert straight_line.usual_answer(*scene, ImpactModel(law)) is not None


@pytest.mark.parametrize(
    ("scene", "model"),
    [
        (Scene(BALL, Body.static(), FLOOR), ImpactModel(Law.ROUTH_POISSON)),
        (Scene(BALL, Body.static(), FLOOR), ImpactModel(tolerance=1e-3)),
        (Scene(BALL, Body.static(), FLOOR), ImpactModel(precision=Precision.EXTENDED)),
        (Scene(BALL, Body.static(), FLOOR), ImpactModel(restitution_threshold=3.0)),
        (Scene(BALL, Body.static(), FLOOR._replace(restitution=lambda v: 0.5)), ImpactModel()),
        (Scene(BALL, Body.static(), FLOOR._replace(normal=-FLOOR.normal)), ImpactModel()),
        (
            Scene(SKIMMING, Body.static(), FLOOR),
            ImpactModel(),
        ),
        (Scene(BALL._replace(mass=1e40, inverse_mass=1e-40), Body.static(), FLOOR), ImpactModel()),
    ],
    ids=["path", "tolerance", "digits", "threshold", "function", "leaving", "grazing", "range"],
)
def test_what_is_not_usual_is_left_to_others(scene, model):
    assert straight_line.usual_answer(*scene, model) is None
    assert resolve(*scene, model).status is not None


@pytest.mark.parametrize("field", ["position", "velocity", "angular_velocity", "inertia", "orientation"])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_no_number_of_a_body_that_is_not_finite_gets_through(field, geometry):
    ball = BALL._replace(orientation=straight_line.TURNED)
    for i in range(len(getattr(ball, field))):
        for wrong in (math.nan, math.inf):
            value = list(getattr(ball, field))
            value[i] = wrong
            body = ball._replace(**{field: type(getattr(ball, field))(*value)})
            contact = FLOOR._replace(normal=type(FLOOR.normal)(0.0, 1.0, 1.0))
            scene = Scene(body, Body.kinematic(velocity=(0.0, 9.0, 0.0)), contact)
            with pytest.raises(ImpactError) as refusal:
                resolve(*scene, ImpactModel(geometry=geometry))
            assert refusal.value.code is StatusCode.NOT_FINITE
