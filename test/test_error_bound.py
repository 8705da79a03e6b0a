"""The error bound against exact answers, and the tiers that promise one."""

from __future__ import annotations

import math
import random
import statistics
from itertools import product

import extremes
import pytest
from random_impacts import RandomImpacts
from reference import exact_answer, true_error
from scenes import Scene, random_scene

from collision_response import (
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
)
from collision_response.physics.effective_mass import Spatial
from collision_response.physics.mass_properties import sphere
from collision_response.physics.vector import Vec3

FORMULAS = [Law.FRICTIONLESS, Law.COULOMB]
PATHS = [Law.ROUTH_POISSON, Law.ROUTH_STRONGE]
TIERS = [Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
ULP = 2.0**-52


@pytest.mark.parametrize("wildness", [0, 3, 10, 60])
@pytest.mark.parametrize("precision", TIERS, ids=lambda tier: tier.name)
@pytest.mark.parametrize("law", FORMULAS, ids=lambda law: law.name)
def test_no_error_is_above_its_bound(law, precision, wildness):
    """A sample of the full run, which ``make stability`` does."""
    impacts = RandomImpacts(seed=wildness, wildness=wildness)
    answered = 0
    for _ in range(150):
        scene, model = impacts.request(law)
        model = model._replace(precision=precision)
        try:
            impact = resolve(*scene, model)
        except ImpactError as refusal:
            assert refusal.code is StatusCode.OUT_OF_RANGE
            continue
        truth = exact_answer(*scene, impact.model)
        assert true_error(impact, truth) <= impact.error_bound, (scene, model)
        if precision is Precision.EXTENDED:
            assert impact.error_bound <= ULP
        answered += impact.error_bound < math.inf
    assert answered >= 75  # most are answered, with a bound that says something


@pytest.mark.parametrize("law", FORMULAS, ids=lambda law: law.name)
def test_the_bound_is_tight_enough_to_be_useful(law):
    """On well-conditioned inputs: solid balls that touch, and roll, spin and meet as they like."""
    ratios = []
    for seed in range(300):
        scene = touching_balls(random.Random(seed))
        impact = resolve(*scene, ImpactModel(law, Geometry.SPATIAL))
        if impact.status is StatusCode.OK:
            error = true_error(impact, exact_answer(*scene, impact.model))
            ratios.append(impact.error_bound / max(error, 2.0**-54))
    assert min(ratios) >= 1
    assert statistics.median(ratios) < 100


def touching_balls(draw: random.Random) -> Scene:
    def vector(size: float) -> Vec3:
        return Vec3(*(size * draw.gauss(0, 1) for _ in range(3)))

    def ball(position: Vec3, radius: float) -> Body:
        mass = draw.uniform(0.5, 2)
        return Body.dynamic(
            mass, sphere(mass, radius).inertia, position, None, vector(1.0), vector(1.0 / radius)
        )

    normal, contact = vector(1.0), vector(1.0)
    unit, radius_a, radius_b = normal / normal.norm(), draw.uniform(0.2, 2), draw.uniform(0.2, 2)
    return Scene(
        ball(contact + unit * radius_a, radius_a),
        ball(contact - unit * radius_b, radius_b),
        Contact.of(contact, normal, draw.random(), draw.random()),
    )


GRAZING = Scene(
    Body.dynamic(
        1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.1, 0.2, 0.5), None, (3.0, 1.0, -1e-9), (0.3, 0.1, 0.7)
    ),
    Body.dynamic(2.0, (0.5, 0.1, 0.0, 0.6, 0.0, 0.4), (0.1, 0.3, -0.5), None, (0.1, 0.1, 0.07)),
    Contact.of((0.3, 0.2, 0.1), (0.0, 0.0, 1.0), 0.5, 0.3),
)


def grazing(share: float) -> Scene:
    """``GRAZING`` with a normal velocity of about ``-share`` times the slip."""
    approach = -resolve(*GRAZING).normal_velocity_before - 3 * share
    velocity = GRAZING.body_a.velocity
    return GRAZING._replace(
        body_a=GRAZING.body_a._replace(velocity=velocity._replace(z=velocity.z + approach))
    )


def test_a_tolerance_gets_the_cheapest_tier_that_meets_it():
    scene, used = grazing(1e-10), []
    for tolerance in (1e-3, 1e-9, 1e-15):
        impact = resolve(*scene, ImpactModel(tolerance=tolerance))
        assert true_error(impact, exact_answer(*scene, impact.model)) <= impact.error_bound <= tolerance
        used.append(impact.model.precision)
    assert used == TIERS


def test_no_tolerance_is_double():
    assert resolve(*grazing(1e-10)).model.precision is Precision.DOUBLE


def test_a_tolerance_that_nothing_meets_is_answered_and_said():
    impact = resolve(*GRAZING, ImpactModel(tolerance=1e-17))
    assert impact.status is StatusCode.TOLERANCE_NOT_MET
    assert impact.model.precision is Precision.EXTENDED
    assert impact.error_bound <= ULP


@pytest.mark.parametrize("offset", [1e-9, 1e-5, 1e-2])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_what_changes_less_than_the_tolerance_is_not_modelled(offset, mu, tolerance):
    """A small ball struck a little off its centre: POINT serves where its error is below the tolerance."""
    ball = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, offset, offset), None, (0.1, 0.2, -1.0))
    scene = Scene(ball, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5, mu))
    impact = resolve(*scene, ImpactModel(tolerance=tolerance))
    spatial = exact_answer(*scene, impact.model._replace(geometry=Geometry.SPATIAL))
    assert true_error(impact, spatial) <= impact.error_bound <= tolerance
    if offset * 100 < tolerance:
        assert impact.model.geometry is Geometry.POINT
    if offset > tolerance:
        assert impact.model.geometry is Geometry.SPATIAL


@pytest.mark.parametrize("law", PATHS, ids=lambda law: law.name)
@pytest.mark.parametrize("tolerance", [0.0, 1e-4])
def test_a_path_meets_its_tolerance(law, tolerance):
    for seed in range(400, 403):
        scene = random_scene(seed)
        impact = scene.resolve(law, tolerance=tolerance)
        assert impact.status is StatusCode.OK
        assert error_of_path(scene, impact) <= impact.error_bound <= (tolerance or 1e-8)


def test_a_tolerance_that_no_path_meets_is_said():
    scene = random_scene(400)
    impact = scene.resolve(Law.ROUTH_STRONGE, tolerance=1e-15)
    assert impact.status is StatusCode.TOLERANCE_NOT_MET
    assert error_of_path(scene, impact) <= impact.error_bound


@pytest.mark.parametrize("law", PATHS, ids=lambda law: law.name)
@pytest.mark.parametrize("share", [1e-2, 1e-7, 1e-12])
def test_a_path_keeps_its_digits_where_it_grazes(law, share):
    for scene in (random_scene(500), random_scene(502, slender=True, friction=5.0)):
        scene = extremes.grazing(share, scene)
        impact = scene.resolve(law)
        assert error_of_path(scene, impact) <= min(impact.error_bound, 1e-12)


@pytest.mark.parametrize("e", [1e-2, 1e-5, 1e-8])
def test_a_path_keeps_its_digits_where_little_is_restored(e):
    """The restored work is e^2 of the work of compression."""
    scene = random_scene(600)
    scene = scene._replace(contact=scene.contact._replace(restitution=e))
    impact = scene.resolve(Law.ROUTH_STRONGE)
    assert error_of_path(scene, impact) <= min(impact.error_bound, 1e-12)


@pytest.mark.parametrize("past", [-1e-2, 1e-2, -1e-5])
def test_the_bound_of_a_path_holds_near_jam(past):
    """Where ``u_n`` hardly rises, little moves the end of compression a lot."""
    scene = extremes.grazing(1e-3, random_scene(701))
    approach = Spatial.prepare(*scene)
    n, K = approach.n / approach.n.norm(), approach.mobility()
    slip = approach.u - n * n.dot(approach.u)
    mu = (1 + past) * n.dot(K @ n) * slip.norm() / slip.dot(K @ n)
    scene = scene._replace(contact=scene.contact._replace(friction=mu))
    for law, tolerance in product(PATHS, (0.0, 1e-3)):
        impact = scene.resolve(law, tolerance=tolerance)
        assert error_of_path(scene, impact) <= impact.error_bound


def error_of_path(scene: Scene, impact: Impact) -> float:
    exact = [float(x) for x in scene.by_oracle(impact.model.law, digits=17).impulse]
    return math.dist(impact.impulse, exact) / math.hypot(*exact)


def test_moreau_has_no_bound():
    assert random_scene(1).resolve(Law.MOREAU).error_bound == -1.0
