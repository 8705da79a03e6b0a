"""The front door: what it chooses, what it refuses, what it reports."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
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
    Regime,
    StatusCode,
    choose_model,
    resolve,
)
from collision_response.physics.mass_properties import box, rod

BALL = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, 0.0, 1.0), None, (0.0, 0.0, -2.0))
FLOOR = Body.static()
CONTACT = Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), restitution=0.5)
NAN, INF = math.nan, math.inf


def body(**changes) -> Body:
    given = {"mass": 1.0, "inertia": (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), **changes}
    return Body.dynamic(**given)


REFUSALS = [
    ("mass zero", StatusCode.INVALID_MASS, "mass", lambda: body(mass=0.0)),
    ("mass negative", StatusCode.INVALID_MASS, "mass", lambda: body(mass=-1.0)),
    ("mass NaN", StatusCode.INVALID_MASS, "mass", lambda: body(mass=NAN)),
    ("mass too small", StatusCode.INVALID_MASS, "mass", lambda: body(mass=5e-309)),
    ("mass infinite", StatusCode.NOT_FINITE, "body_a.mass", lambda: resolve(body(mass=INF), FLOOR, CONTACT)),
    (
        "mass and inverse do not match",
        StatusCode.INVALID_MASS,
        "body_a.mass",
        lambda: resolve(BALL._replace(mass=0.0), FLOOR, CONTACT),
    ),
    *(
        (
            f"{field} not finite",
            StatusCode.NOT_FINITE,
            f"body_b.{field}.y",
            lambda field=field: resolve(BALL, body(**{field: (0.0, INF, 0.0)}), CONTACT),
        )
        for field in ("position", "velocity", "angular_velocity")
    ),
    (
        "inertia NaN",
        StatusCode.NOT_FINITE,
        "body_a.inertia.yz",
        lambda: resolve(body(inertia=(1.0, 0.0, 0.0, 1.0, NAN, 1.0)), FLOOR, CONTACT),
    ),
    (
        "inertia negative",
        StatusCode.INVALID_INERTIA,
        "body_a.inertia",
        lambda: resolve(body(inertia=(-1.0, 0.0, 0.0, 1.0, 0.0, 1.0)), FLOOR, CONTACT),
    ),
    (
        "inertia indefinite by a product",
        StatusCode.INVALID_INERTIA,
        "body_a.inertia",
        lambda: resolve(body(inertia=(1.0, 1.1, 0.0, 1.0, 0.0, 1.5)), FLOOR, CONTACT),
    ),
    (
        "inertia against the triangle inequality",
        StatusCode.INVALID_INERTIA,
        "body_a.inertia",
        lambda: resolve(body(inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 2.001)), FLOOR, CONTACT),
    ),
    (
        "inertia of products alone",
        StatusCode.INVALID_INERTIA,
        "body_a.inertia",
        lambda: resolve(body(inertia=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0)), FLOOR, CONTACT),
    ),
    (
        "orientation of length zero",
        StatusCode.INVALID_ORIENTATION,
        "body_a.orientation",
        lambda: resolve(body(orientation=(0.0, 0.0, 0.0, 0.0)), FLOOR, CONTACT),
    ),
    (
        "normal of length zero",
        StatusCode.INVALID_NORMAL,
        "contact.normal",
        lambda: resolve(BALL, FLOOR, Contact.of((0, 0, 0), (0, 0, 0))),
    ),
    (
        "normal NaN",
        StatusCode.NOT_FINITE,
        "contact.normal.z",
        lambda: resolve(BALL, FLOOR, Contact.of((0, 0, 0), (0, 0, NAN))),
    ),
    (
        "normal across the plane that is modelled",
        StatusCode.INVALID_NORMAL,
        "contact.normal",
        lambda: resolve(BALL, FLOOR, CONTACT, ImpactModel(geometry=Geometry.PLANAR)),
    ),
    *(
        (
            f"restitution {e}",
            code,
            "contact.restitution",
            lambda e=e: resolve(BALL, FLOOR, CONTACT._replace(restitution=e)),
        )
        for e, code in [
            (-0.1, StatusCode.INVALID_COEFFICIENT),
            (1.1, StatusCode.INVALID_COEFFICIENT),
            (NAN, StatusCode.NOT_FINITE),
        ]
    ),
    (
        "restitution function out of range",
        StatusCode.INVALID_COEFFICIENT,
        "contact.restitution(approach_speed)",
        lambda: resolve(BALL, FLOOR, CONTACT._replace(restitution=lambda speed: speed)),
    ),
    *(
        (
            f"friction {mu}",
            code,
            "contact.friction",
            lambda mu=mu: resolve(BALL, FLOOR, CONTACT._replace(friction=mu)),
        )
        for mu, code in [(-0.1, StatusCode.INVALID_COEFFICIENT), (INF, StatusCode.NOT_FINITE)]
    ),
    (
        "tangential restitution",
        StatusCode.INVALID_COEFFICIENT,
        "model.tangential_restitution",
        lambda: resolve(BALL, FLOOR, CONTACT, ImpactModel(tangential_restitution=1.5)),
    ),
    (
        "unknown law",
        StatusCode.INVALID_MODEL,
        "model.law",
        lambda: resolve(BALL, FLOOR, CONTACT, ImpactModel(law=17)),
    ),
    (
        "negative tolerance",
        StatusCode.INVALID_MODEL,
        "model.tolerance",
        lambda: resolve(BALL, FLOOR, CONTACT, ImpactModel(tolerance=-1e-3)),
    ),
    (
        "tolerance NaN",
        StatusCode.NOT_FINITE,
        "model.tolerance",
        lambda: resolve(BALL, FLOOR, CONTACT, ImpactModel(tolerance=NAN)),
    ),
    (
        "both immovable",
        StatusCode.NO_DYNAMIC_BODY,
        "body_a",
        lambda: resolve(Body.kinematic(velocity=(1.0, 0.0, 0.0)), FLOOR, CONTACT),
    ),
    ("itself", StatusCode.SAME_BODY, "body_b", lambda: resolve(BALL, BALL, CONTACT)),
]


@pytest.mark.parametrize(
    ("code", "field", "request_it"), [case[1:] for case in REFUSALS], ids=[case[0] for case in REFUSALS]
)
def test_a_bad_request_gets_its_code_and_field(code, field, request_it):
    with pytest.raises(ImpactError) as refusal:
        request_it()
    assert refusal.value.code is code
    assert refusal.value.field == field
    assert str(refusal.value).startswith(field)


def test_the_code_is_named_as_in_the_messages():
    with pytest.raises(ValueError, match=r"body_a\.inertia: violates the triangle inequality.* 1, 1, 2\.001"):
        resolve(body(inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 2.001)), FLOOR, CONTACT)


@pytest.mark.parametrize(
    "inertia",
    [rod(1.0, 2.0).inertia, box(1.0, (1.0, 1.0, 0.0)).inertia, (0.0,) * 6],
    ids=["rod", "plate", "point"],
)
@pytest.mark.parametrize("orientation", [None, (0.1, -0.7, 0.3, 0.5)])
def test_degenerate_bodies_are_legal(inertia, orientation):
    falling = body(
        inertia=inertia, orientation=orientation, position=(0.3, 0.2, 0.5), velocity=(0.0, 0.0, -1.0)
    )
    impact = resolve(falling, FLOOR, CONTACT)
    assert impact.normal_velocity_after == pytest.approx(0.5, rel=1e-14)
    assert impact.kinetic_energy_after < impact.kinetic_energy_before


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 2.0, 3.0), (-0.3, 0.1, 0.7)])
def test_a_rod_given_in_any_axes_is_the_same_rod(axis):
    """Its tensor ``1 - dd`` is singular, or off by rounding: no spin about the rod itself is made of that."""
    length = math.hypot(*axis)
    d = [x / length for x in axis]
    tensor = [(i == j) - d[i] * d[j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))]
    falling = body(inertia=tensor, position=(0.3, 0.2, 0.5), velocity=(0.0, 0.0, -1.0))
    impact = resolve(falling, FLOOR, CONTACT)
    spin = impact.twist_a.angular
    assert abs(sum(s * x for s, x in zip(spin, d, strict=True))) <= 1e-15 * spin.norm()
    arm = (CONTACT.position - falling.position).cross(impact.impulse)
    across = [t - x * sum(p * q for p, q in zip(arm, d, strict=True)) for t, x in zip(arm, d, strict=True)]
    assert spin == pytest.approx(across, abs=1e-14)


@pytest.mark.parametrize(
    ("geometry", "scene"),
    [
        (Geometry.POINT, Scene(BALL, FLOOR, CONTACT)),
        (
            Geometry.POINT,
            Scene(Body.dynamic(1.0), Body.dynamic(2.0), Contact.of((5, 6, 7), (1, 2, 3), friction=0.5)),
        ),
        (Geometry.SPATIAL, Scene(BALL, FLOOR, CONTACT._replace(friction=0.3))),
        (Geometry.SPATIAL, Scene(BALL, FLOOR, Contact.of((0.1, 0, 0), (0, 0, 1)))),
        (Geometry.PLANAR, Scene(body(position=(0.1, 1.0, 0.0)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0)))),
        (Geometry.SPATIAL, Scene(body(position=(0.1, 1.0, 0.1)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0)))),
        (
            Geometry.SPATIAL,
            Scene(
                body(position=(0.1, 1.0, 0.0), velocity=(0, -1, 0.5)),
                FLOOR,
                Contact.of((0, 0, 0), (0, 1, 0), friction=0.5),
            ),
        ),
        (
            Geometry.PLANAR,
            Scene(
                body(position=(0.1, 1.0, 0.0), velocity=(0, -1, 0.5)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0))
            ),
        ),
        (
            Geometry.SPATIAL,
            Scene(
                body(position=(0.1, 1.0, 0.0), inertia=(0.4, 0.0, 0.1, 0.4, 0.0, 0.4)),
                FLOOR,
                Contact.of((0, 0, 0), (0, 1, 0)),
            ),
        ),
    ],
    ids=[
        "central",
        "points rub",
        "rubs",
        "off-centre",
        "in plane",
        "off plane",
        "slides out",
        "glides",
        "coupled",
    ],
)
def test_the_cheapest_exact_geometry_is_chosen_and_named(geometry, scene):
    assert choose_model(*scene, ImpactModel()).geometry is geometry
    assert resolve(*scene).model.geometry is geometry


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_chosen_geometry_is_exact(friction):
    @settings(max_examples=40, deadline=None)
    @given(scene=planar_scenes() | scenes())
    def holds(scene: Scene) -> None:
        contact = scene.contact._replace(friction=friction)
        chosen = resolve(scene.body_a, scene.body_b, contact)
        spatial = resolve(scene.body_a, scene.body_b, contact, ImpactModel(geometry=Geometry.SPATIAL))
        for name in ("twist_a", "twist_b"):
            for part, exact in zip(getattr(chosen, name), getattr(spatial, name), strict=True):
                # rounding, at condition numbers below 1e3
                assert (part - exact).norm() <= 1e-11 * (exact.norm() + 1e-3)

    holds()


def test_separating_bodies_get_no_impulse_and_are_told_so():
    impact = resolve(BALL._replace(velocity=-BALL.velocity), FLOOR, CONTACT)
    assert impact.status is StatusCode.SEPARATING
    assert impact.regime is Regime.SEPARATING
    assert impact.impulse == (0, 0, 0)
    assert impact.twist_a.linear == (0, 0, 2)
    assert impact.effective_mass == 1.0


def test_an_answer_says_what_was_modelled():
    impact = resolve(BALL, FLOOR, CONTACT._replace(friction=0.3))
    assert impact.model == ImpactModel(Law.COULOMB, Geometry.SPATIAL, Precision.DOUBLE)
    frictionless = resolve(BALL, FLOOR, CONTACT._replace(friction=0.3), ImpactModel(law=Law.FRICTIONLESS))
    assert frictionless.contact.friction == 0.0


def test_a_quaternion_that_is_not_of_unit_length_is_normalised_and_said_so():
    tilted = body(orientation=(0.0, 0.0, 0.3, 0.4), position=(0.3, 0.1, 1.0), velocity=(0.0, 0.0, -1.0))
    unit = tilted._replace(orientation=type(tilted.orientation)(0.0, 0.0, 0.6, 0.8))
    said, silent = resolve(tilted, FLOOR, CONTACT), resolve(unit, FLOOR, CONTACT)
    assert said.adjustments == Adjustment.NORMALISED_ORIENTATION
    assert silent.adjustments == Adjustment.NONE
    assert said.twist_a == silent.twist_a


def test_the_length_of_the_normal_does_not_matter():
    for length in (1e-3, 7.0):
        scaled = CONTACT._replace(normal=CONTACT.normal * length, friction=0.3)
        expected = resolve(BALL, FLOOR, CONTACT._replace(friction=0.3))
        impact = resolve(BALL, FLOOR, scaled)
        assert impact.impulse == pytest.approx(expected.impulse, rel=1e-15)
        assert impact.effective_mass == pytest.approx(expected.effective_mass, rel=1e-15)
        assert impact.normal_velocity_after == pytest.approx(expected.normal_velocity_after, rel=1e-15)


def test_a_kinematic_body_moves_as_it_did():
    pusher = Body.kinematic(velocity=(0.0, 0.0, 3.0), angular_velocity=(1.0, 0.0, 0.0))
    impact = resolve(BALL, pusher, CONTACT)
    assert impact.twist_b == (pusher.velocity, pusher.angular_velocity)
    assert impact.twist_a.linear.z == pytest.approx(3.0 + 0.5 * 5.0)
