"""What a scene is said to require: enough, no more, and why."""

from __future__ import annotations

import doctest
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import scenes

import collision_response.requirements
from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    SceneContact,
    StatusCode,
    resolve,
    scene_requirements,
)
from collision_response.physics.mass_properties import sphere


def _ball(position, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)) -> Body:
    return Body.dynamic(1.0, sphere(1.0, 1.0).inertia, position, None, velocity, spin)


def _on_ground(body: str, normal, friction: float = 0.0) -> SceneContact:
    return SceneContact(body, "ground", Contact.of((0, 0, 0), normal, 0.5, friction))


BODIES = {
    "ground": Body.static(),
    "ball": _ball((0, 0, 1), (0, 0, -1)),
    "rolling": _ball((0, 0, 1), (1, 0, -1), (0, 1, 0)),
    "slipping": _ball((0, 1, 0), (1, -1, 0)),
    "tilted": _ball((0.3, 0.9, 0), (0.2, -1, 0), (0, 0, 0.4)),
    "thrown": _ball((0.3, -0.4, 0.8), (0.5, 0.1, -1), (0.3, 0.2, 0.1)),
    "leaving": _ball((0.3, -0.4, 0.8), (0, 0, 5)),
}
CENTRAL = _on_ground("ball", (0, 0, 1))
IN_PLANE = _on_ground("tilted", (0, 1, 0))
IN_SPACE = _on_ground("thrown", (0.1, 0.2, 1))
SLIPPING = _on_ground("slipping", (0, 1, 0), friction=0.3)
RUBBING = _on_ground("thrown", (0.1, 0.2, 1), friction=0.3)
ROLLING = _on_ground("rolling", (0, 0, 1), friction=0.3)
"""Its contact does not slip: friction has nothing to do."""


def test_the_example_runs():
    assert doctest.testmod(collision_response.requirements).failed == 0


def test_a_scene_without_contacts_requires_nothing():
    needs = scene_requirements(BODIES, [], 1e-6)
    assert (needs.geometry.least, needs.law.least) == (Geometry.POINT, Law.FRICTIONLESS)
    assert needs.precision.least is Precision.SINGLE
    assert needs.tolerance == 1e-6


@pytest.mark.parametrize(
    ("contact", "geometry", "law"),
    [
        pytest.param(CENTRAL, Geometry.POINT, Law.FRICTIONLESS, id="central"),
        pytest.param(ROLLING, Geometry.POINT, Law.FRICTIONLESS, id="rolling"),
        pytest.param(IN_PLANE, Geometry.PLANAR, Law.FRICTIONLESS, id="in the plane"),
        pytest.param(SLIPPING, Geometry.PLANAR, Law.COULOMB, id="in the plane with friction"),
        pytest.param(IN_SPACE, Geometry.SPATIAL, Law.FRICTIONLESS, id="in space"),
        pytest.param(RUBBING, Geometry.SPATIAL, Law.COULOMB, id="with friction"),
    ],
)
def test_each_contact_asks_for_no_more_than_it_needs(contact, geometry, law):
    needs = scene_requirements(BODIES, [contact], 1e-4)
    assert (needs.geometry.least, needs.law.least) == (geometry, law)
    assert needs.precision.least is Precision.SINGLE
    assert scene_requirements(BODIES, [contact], 1e-9).precision.least is Precision.DOUBLE


@pytest.mark.parametrize("link_first", [True, False])
@pytest.mark.parametrize("turning", [1e-3, 0.0])
def test_friction_that_only_turns_a_link_counts(turning, link_first):
    """Little friction changes the ball's twist by little, and whether the link turns one way or the other."""
    inverse_inertia = [[0.0] * 6 for _ in range(6)]
    inverse_inertia[2][2], inverse_inertia[4][4] = 1e-9, turning
    bodies = {"link": Body.articulated(inverse_inertia), "ball": _ball((0.01, 0, 1), (1, 0, 1))}
    names, down = (("link", "ball"), 1) if link_first else (("ball", "link"), -1)
    touch = SceneContact(*names, Contact.of((0.01, 0, 1), (0, 0, down), 0.5, 0.02))
    needs = scene_requirements(bodies, [touch], 0.05)
    assert needs.law.least is (Law.COULOMB if turning else Law.FRICTIONLESS)


def test_the_most_demanding_contact_decides_and_is_named():
    needs = scene_requirements(BODIES, [CENTRAL, IN_PLANE, RUBBING, IN_PLANE], 1e-6)
    assert needs.geometry.least is Geometry.SPATIAL
    assert needs.law.least is Law.COULOMB
    for need in (needs.geometry, needs.law):
        assert "thrown - ground" in need.reason
        assert need.reason in str(needs)


@pytest.mark.parametrize("contacts", [[ROLLING, SLIPPING], [SLIPPING, ROLLING]])
def test_the_geometry_serves_the_law_of_the_whole_scene(contacts):
    """Without friction a rolling ball is like a point; with it, it may turn out of the x-y plane."""
    needs = scene_requirements(BODIES, contacts, 1e-5)
    assert (needs.geometry.least, needs.law.least) == (Geometry.SPATIAL, Law.COULOMB)
    assert "rolling - ground" in needs.geometry.reason


@given(st.lists(scenes(), min_size=1, max_size=4), st.sampled_from([1e-2, 1e-5, 1e-9, 1e-14]))
def test_what_is_required_is_enough(drawn, tolerance):
    """In the model that is recommended every contact meets the tolerance."""
    bodies, contacts = {}, []
    for i, (a, b, contact) in enumerate(drawn):
        bodies[f"a{i}"], bodies[f"b{i}"] = a, b
        contacts.append(SceneContact(f"a{i}", f"b{i}", contact))
    needs = scene_requirements(bodies, contacts, tolerance)
    model = ImpactModel(needs.law.least, needs.geometry.least, needs.precision.least, tolerance)
    best = ImpactModel(precision=Precision.EXTENDED)
    for scene in drawn:
        impact, exact = resolve(*scene, model), resolve(*scene, best)
        if exact.status is StatusCode.SEPARATING:
            continue
        assert impact.status is not StatusCode.TOLERANCE_NOT_MET
        apart = (impact.impulse - exact.impulse).norm() / exact.impulse.norm()
        # The law may be wrong by the tolerance, and its answer by another.
        assert apart <= 2 * tolerance + exact.error_bound


def test_bodies_that_separate_require_nothing():
    leaving = RUBBING._replace(body_a="leaving")
    assert scene_requirements(BODIES, [leaving], 1e-6) == scene_requirements(BODIES, [], 1e-6)


def test_friction_below_the_tolerance_is_not_required():
    slippery = RUBBING._replace(contact=RUBBING.contact._replace(friction=1e-8))
    assert scene_requirements(BODIES, [slippery], 1e-3).law.least is Law.FRICTIONLESS
    assert scene_requirements(BODIES, [slippery], 1e-12).law.least is Law.COULOMB


def test_friction_that_matters_to_the_spin_alone_is_required():
    """It is a ten thousandth of the impulse, and a hundredth of what a body of little inertia makes of it."""
    slippery = SLIPPING._replace(contact=SLIPPING.contact._replace(friction=1e-4))
    assert scene_requirements(BODIES, [slippery], 1e-3).law.least is Law.FRICTIONLESS
    slender = Body.dynamic(1.0, sphere(1.0, 0.015).inertia, (0, 1, 0), None, (10, -1, 0))
    bodies = {**BODIES, "slipping": slender}
    assert scene_requirements(bodies, [slippery], 1e-3).law.least is Law.COULOMB


@pytest.mark.parametrize(
    ("tolerance", "precision"),
    [(1e-2, Precision.SINGLE), (1e-6, Precision.DOUBLE), (1e-15, Precision.EXTENDED)],
)
def test_grazing_and_the_tolerance_ask_for_precision(tolerance, precision):
    """The ground moves along at almost the speed at which the ball falls."""
    bodies = {"ball": _ball((0, 0, 1), (0.1, 0, -1)), "lift": Body.kinematic((0, 0, 0), (0, 0, -0.999))}
    contact = SceneContact("ball", "lift", Contact.of((0, 0, 0), (0.001, 0.002, 1), 0.5))
    needs = scene_requirements(bodies, [contact], tolerance)
    assert needs.precision.least is precision
    assert ("ball - lift" in needs.precision.reason) == (precision is not Precision.SINGLE)


def test_a_scene_says_which_body_it_does_not_know():
    with pytest.raises(KeyError, match="nobody"):
        scene_requirements(BODIES, [CENTRAL._replace(body_a="nobody")], 1e-6)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, math.nan, math.inf])
def test_a_scene_asks_for_a_tolerance(tolerance):
    with pytest.raises(ImpactError) as raised:
        scene_requirements(BODIES, [], tolerance)
    assert (raised.value.code, raised.value.field) == (StatusCode.INVALID_MODEL, "tolerance")
