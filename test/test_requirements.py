"""The geometry, law and precision that a scene requires: sufficient, minimal and explained."""

from __future__ import annotations

import doctest
import math
from fractions import Fraction

import pytest
from collisions import collisions
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused

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
    Vec3,
    resolve,
    scene_requirements,
)
from collision_response.physics.mass_properties import sphere
from collision_response.requirements import SceneSurvey


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
"""Its contact does not slip, so friction has no effect."""


def test_the_docstring_examples_run():
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
    """Little friction hardly changes the twist of the ball, but decides which way the link turns."""
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


def _recommended(needs) -> ImpactModel:
    """The model that the requirements recommend."""
    return ImpactModel(needs.law.least, needs.geometry.least, needs.precision.least, needs.tolerance)


def _serves(model: ImpactModel, scene) -> bool:
    """Whether an impact has the same status in this model as in full."""
    whole = resolve(*scene, ImpactModel(precision=Precision.EXTENDED))
    try:
        return resolve(*scene, model).status is whole.status
    except ImpactError:
        return False


def _lesser(model: ImpactModel) -> list[ImpactModel]:
    """Models with the same law and either the next lower precision or a simpler geometry."""
    lesser = [model._replace(precision=p) for p in Precision if Precision.AUTO < p < model.precision][-1:]
    flat = [g for g in Geometry if Geometry.AUTO < g < model.geometry]
    return lesser + [model._replace(geometry=g, precision=Precision.EXTENDED) for g in flat]


def _assert_least(bodies, contacts, tolerance) -> ImpactModel:
    """Check that the recommended model serves every contact and no lesser one does; return it."""
    model = _recommended(scene_requirements(bodies, contacts, tolerance))
    asked = [(bodies[a], bodies[b], contact) for a, b, contact in contacts]
    assert all(_serves(model, scene) for scene in asked)
    for lesser in _lesser(model):
        assert not all(_serves(lesser, scene) for scene in asked)
    return model


@given(st.lists(collisions(), min_size=1, max_size=4), st.sampled_from([1e-2, 1e-5, 1e-9, 1e-14]))
def test_requirements_are_sufficient_and_minimal(drawn, tolerance):
    """In the recommended model every contact meets the tolerance or separates; in no lesser model."""
    bodies, contacts = {}, []
    for i, (a, b, contact) in enumerate(drawn):
        bodies[f"a{i}"], bodies[f"b{i}"] = a, b
        contacts.append(SceneContact(f"a{i}", f"b{i}", contact))
    model = _assert_least(bodies, contacts, tolerance)
    for scene in drawn:
        impact, exact = resolve(*scene, model), resolve(*scene, ImpactModel(precision=Precision.EXTENDED))
        apart = (impact.impulse - exact.impulse).norm() / (exact.impulse.norm() or 1.0)
        # The law may cause an error of the tolerance, and the precision another.
        assert apart <= 2 * tolerance + exact.error_bound


TURNED = [Vec3(*axes) for axes in ((0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0))]


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("normal", TURNED)
def test_separation_by_rotation_alone_requires_rotation(normal, friction):
    """The centre falls at 1 m/s, while the corner half a metre to the side rises at 2 m/s relative to it."""
    aside = Vec3(normal.y, normal.z, normal.x)
    box = Body.box(
        1.0,
        (1.0, 1.0, 1.0),
        position=normal * 0.5,
        velocity=-normal,
        angular_velocity=aside.cross(normal) * 4.0,
    )
    contact = SceneContact("box", "ground", Contact.of(aside * 0.5, normal, 0.5, friction))
    bodies = {**BODIES, "box": box}
    assert resolve(box, BODIES["ground"], contact.contact).normal_velocity_before == 1.0
    model = _assert_least(bodies, [contact], 1e-6)
    in_plane = normal.z == aside.z == 0
    assert model.geometry is (Geometry.PLANAR if in_plane else Geometry.SPATIAL)
    assert resolve(box, BODIES["ground"], contact.contact, model).status is StatusCode.SEPARATING


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("bits", "precision"),
    [(10, Precision.SINGLE), (30, Precision.DOUBLE), (40, Precision.DOUBLE), (60, Precision.EXTENDED)],
)
def test_slow_separation_requires_enough_digits(bits, precision, sign):
    """``n.u`` is 1 + 2^-bits - 1: only all of its digits show the sign."""
    body = Body.dynamic(1.0, velocity=(1.0, sign * 2.0**-bits, -1.0))
    contact = SceneContact("body", "ground", Contact.of((0, 0, 0), (1, 1, 1)))
    model = _assert_least({**BODIES, "body": body}, [contact], 0.1)
    assert model == ImpactModel(Law.FRICTIONLESS, Geometry.POINT, precision, 0.1)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("spin", [(5.0, 0.0, 0.0), (0.0, 3.0, 1.0), (0.0, 0.0, 0.0)])
def test_frictionless_contacts_use_the_law_of_the_scene(spin, order):
    """The error bound of COULOMB differs from that of FRICTIONLESS even without friction."""
    bodies = {
        "top": Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(0, 0, -1), angular_velocity=spin),
        "point": Body.dynamic(1.0, position=(2, 0, 0), velocity=(1, 0, -1)),
        "floor": Body.static(),
    }
    contacts = [
        SceneContact("top", "floor", Contact.of((0, 0, 0), (0, 0, 1), 0.5)),
        SceneContact("point", "floor", Contact.of((2, 0, 0), (0, 0, 1), 0.5, 0.3)),
    ]
    for tolerance in (1e-3, 2e-6, 1e-12):
        model = _assert_least(bodies, contacts[::order], tolerance)
        assert model.law is Law.COULOMB
        alone = _assert_least(bodies, contacts[:1], tolerance)
        assert (alone.law, alone.geometry) == (Law.FRICTIONLESS, Geometry.POINT)


@pytest.mark.parametrize("order", [1, -1])
def test_a_planar_contact_and_one_out_of_the_plane_require_spatial(order):
    """Alone they need PLANAR and POINT, but PLANAR cannot have a normal along z."""
    bodies = {**BODIES, "ball": _ball((1e-6, 0, 1), (0, 0, -1))}
    assert _assert_least(bodies, [CENTRAL], 1e-4).geometry is Geometry.POINT
    assert _assert_least(bodies, [IN_PLANE], 1e-4).geometry is Geometry.PLANAR
    contacts = [CENTRAL, IN_PLANE][::order]
    assert _assert_least(bodies, contacts, 1e-4).geometry is Geometry.SPATIAL
    assert scene_requirements(bodies, contacts, 1e-4).geometry.reason == (
        "tilted - ground turns a body, within the x-y plane, and ball - ground is not in it"
    )


@pytest.mark.parametrize("arm", [0.0, 1e-12, 1e-6, 1e-3, 0.5])
def test_a_lever_arm_matters_as_far_as_it_changes_the_impact(arm):
    """Leaving it out changes the twist of a sphere of radius 1 by ``arm (5/2)^(1/2)`` of its norm."""
    body = _ball((arm, 0, 1), (0, 0, -1))
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5)
    flat = resolve(body, Body.static(), contact, ImpactModel(geometry=Geometry.POINT))
    assert flat.error_bound == pytest.approx(arm * math.sqrt(2.5), rel=arm**2, abs=1e-14)
    touch = SceneContact("body", "ground", contact)
    for tolerance in (1e-10, 1e-4, 1e-1):
        model = _assert_least({**BODIES, "body": body}, [touch], tolerance)
        assert (model.geometry is Geometry.POINT) == (arm * math.sqrt(2.5) < tolerance)


def test_bodies_that_separate_require_nothing():
    leaving = RUBBING._replace(body_a="leaving")
    assert scene_requirements(BODIES, [leaving], 1e-6) == scene_requirements(BODIES, [], 1e-6)


def test_friction_below_the_tolerance_is_not_required():
    slippery = RUBBING._replace(contact=RUBBING.contact._replace(friction=1e-8))
    assert scene_requirements(BODIES, [slippery], 1e-3).law.least is Law.FRICTIONLESS
    assert scene_requirements(BODIES, [slippery], 1e-12).law.least is Law.COULOMB


@pytest.mark.parametrize(
    ("tolerance", "law"), [(0.59, Law.COULOMB), (0.599999, Law.COULOMB), (0.600001, Law.FRICTIONLESS)]
)
def test_the_reason_says_by_how_much_friction_changes_an_impact(tolerance, law):
    """The impulse has a slope of 0.75: friction is (0.75, 1) / 1.25 of it."""
    bodies = {"point": Body.dynamic(1.0, velocity=(4.0, 0.0, -1.0)), "ground": Body.static()}
    contacts = [SceneContact("point", "ground", Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.75))]
    needs = scene_requirements(bodies, contacts, tolerance)
    assert needs.law.least is law
    if law is Law.COULOMB:
        assert needs.law.reason == "friction changes the impact of point - ground by 0.6 of it"


def test_friction_that_rounding_hides_is_required():
    """It is 1e-18 of the impulse, which a float64 of no component shows, and above the tolerance."""
    bodies = {"point": Body.dynamic(1.0, velocity=(40.0, 1.0, -17.0)), "ground": Body.static()}
    contacts = [SceneContact("point", "ground", Contact.of((0, 0, 0), (1, 2, 3), 0.5, 1e-18))]
    assert scene_requirements(bodies, contacts, 1e-19).law.least is Law.COULOMB


def test_rounding_requires_no_friction_where_more_digits_do_not():
    """float64 leaves 1e-7 of the impulse open, because the approach is so slow; friction is 1e-12 of it."""
    bodies = {"point": Body.dynamic(1.0, velocity=(1.0, -(2.0**-30), -1.0)), "ground": Body.static()}
    contacts = [SceneContact("point", "ground", Contact.of((0, 0, 0), (1, 1, 1), 0.5, 1e-12))]
    assert scene_requirements(bodies, contacts, 1e-10).law.least is Law.FRICTIONLESS


@pytest.mark.parametrize("tolerance", [1e-2, 1e-9])
def test_an_impact_that_no_precision_answers_requires_extended(tolerance):
    """As floats, the two fractions cancel, so with friction nothing shows that the bodies approach."""
    velocity = (Fraction(1, 3), -Fraction(1, 3) - Fraction(1, 10**20), Fraction(0))
    bodies = {"point": Body.dynamic(1.0, velocity=velocity), "ground": Body.static()}
    contacts = [SceneContact("point", "ground", Contact.of((0, 0, 0), (1, 1, 0), 0.5, 0.3))]
    needs = scene_requirements(bodies, contacts, tolerance)
    assert (needs.law.least, needs.precision.least) == (Law.COULOMB, Precision.EXTENDED)


def test_friction_that_matters_only_to_the_spin_is_required():
    """It is 1e-4 of the impulse, but changes the twist of a body of small inertia by 1e-2."""
    slippery = SLIPPING._replace(contact=SLIPPING.contact._replace(friction=1e-4))
    assert scene_requirements(BODIES, [slippery], 1e-3).law.least is Law.FRICTIONLESS
    slender = Body.dynamic(1.0, sphere(1.0, 0.015).inertia, (0, 1, 0), None, (10, -1, 0))
    bodies = {**BODIES, "slipping": slender}
    assert scene_requirements(bodies, [slippery], 1e-3).law.least is Law.COULOMB


@pytest.mark.parametrize(
    ("tolerance", "precision"),
    [(1e-2, Precision.SINGLE), (1e-6, Precision.DOUBLE), (1e-15, Precision.EXTENDED)],
)
def test_grazing_contacts_and_small_tolerances_require_precision(tolerance, precision):
    """The ground moves at almost the speed of the falling ball."""
    bodies = {"ball": _ball((0, 0, 1), (0.1, 0, -1)), "lift": Body.kinematic((0, 0, 0), (0, 0, -0.999))}
    contact = SceneContact("ball", "lift", Contact.of((0, 0, 0), (0.001, 0.002, 1), 0.5))
    needs = scene_requirements(bodies, [contact], tolerance)
    assert needs.precision.least is precision
    assert ("ball - lift" in needs.precision.reason) == (precision is not Precision.SINGLE)


def test_a_scene_says_which_body_it_does_not_know():
    says = r"^contacts\[1\]\.body_a: must be the name of one of the bodies; is 'nobody'$"
    with refused(StatusCode.UNKNOWN_BODY, "contacts[1].body_a", says):
        scene_requirements(BODIES, [CENTRAL, CENTRAL._replace(body_a="nobody")], 1e-6)


@pytest.mark.parametrize(
    ("names", "code", "field"),
    [
        ((["a"], "floor"), StatusCode.UNKNOWN_BODY, "contacts[0].body_a"),
        (("a", "a"), StatusCode.SAME_BODY, "contacts[0]"),
        (("floor", "wall"), StatusCode.NO_DYNAMIC_BODY, "contacts[0]"),
    ],
)
def test_a_pair_of_bodies_that_cannot_collide_is_refused(names, code, field):
    bodies = {"a": Body.dynamic(1.0, velocity=(0, 0, -1)), "floor": Body.static(), "wall": Body.static()}
    with refused(code, field):
        scene_requirements(bodies, [SceneContact(*names, Contact.of((0, 0, 0), (0, 0, 1), 0.5))], 1e-6)


@pytest.mark.parametrize(
    "tolerance",
    [
        0.0,
        -1.0,
        math.nan,
        math.inf,
        10**400,
        pytest.param(10**5000, id="5001 digits"),
        Fraction(-1, 3),
        Fraction(1, 10**400),
    ],
)
def test_an_invalid_tolerance_is_refused(tolerance):
    with refused(StatusCode.INVALID_MODEL, "tolerance", r"^tolerance: must be "):
        scene_requirements(BODIES, [], tolerance)


@pytest.mark.parametrize("tolerance", [None, "a", "1e-3", True, [1.0], 1j])
def test_a_tolerance_of_the_wrong_type_is_refused(tolerance):
    with pytest.raises(TypeError, match=r"^tolerance: must be a real number, is "):
        scene_requirements(BODIES, [], tolerance)


def test_an_error_of_a_function_of_the_caller_stays_as_it_is():
    error = TypeError("can only concatenate str")

    def restitution(speed):
        raise error

    contact = CENTRAL.contact._replace(restitution=restitution)
    with pytest.raises(TypeError) as raised:
        scene_requirements(BODIES, [CENTRAL._replace(contact=contact)], 1e-6)
    assert raised.value is error
    assert raised.traceback[-1].name == "restitution"


def test_what_is_wrong_is_refused_with_the_contact_or_the_body():
    def survey(body=BODIES["thrown"], contact=RUBBING.contact):
        names = SceneContact("thrown", "ground", contact)
        return scene_requirements(BODIES | {"thrown": body}, [CENTRAL, names], 1e-6)

    with refused(StatusCode.INVALID_MASS, "bodies['thrown'].mass"):
        survey(BODIES["thrown"]._replace(mass=-1.0))
    with refused(StatusCode.INVALID_COEFFICIENT, "contacts[1].contact.friction"):
        survey(contact=RUBBING.contact._replace(friction=-1.0))
    with pytest.raises(TypeError, match=r"^bodies\['thrown'\]\.mass: must be a real number, is "):
        survey(BODIES["thrown"]._replace(mass="1"))
    for wrong in (None, "a - b", ("thrown", "ground")):
        with pytest.raises(TypeError, match=r"^contacts\[1\]: must be a SceneContact, is "):
            scene_requirements(BODIES, [CENTRAL, wrong], 1e-6)
    with pytest.raises(TypeError, match=r"^contacts: must be a sequence, is None"):
        scene_requirements(BODIES, None, 1e-6)
    with pytest.raises(TypeError, match=r"^bodies: must be a mapping, is "):
        scene_requirements(list(BODIES.values()), [CENTRAL], 1e-6)


@pytest.mark.parametrize("tolerance", [5e-324, 1e-17])
def test_a_tolerance_that_nothing_meets_requires_extended(tolerance):
    assert scene_requirements(BODIES, [RUBBING], tolerance).precision.least is Precision.EXTENDED


def test_a_tolerance_below_rounding_asks_for_digits_and_nothing_else():
    needs = scene_requirements(
        BODIES, [SceneContact("ball", "ground", Contact.of((0, 0, 0), (0, 0, 1), 0.3))], 1e-17
    )
    assert (needs.law.least, needs.geometry.least) == (Law.FRICTIONLESS, Geometry.POINT)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
@pytest.mark.parametrize(
    ("third", "least"), [(1 / 3, Precision.EXTENDED), (Fraction(1, 3), Precision.SINGLE)]
)
def test_a_contact_that_touches_exactly_requires_digits_or_fractions(tolerance, third, least):
    """A third minus a third: SINGLE and DOUBLE leave open whether the bodies separate, fractions do not."""
    bodies = {"sliding": Body.dynamic(1.0, velocity=(third, -third, 0.0)), "ground": Body.static()}
    contacts = [SceneContact("sliding", "ground", Contact.of((0, 0, 0), (1, 1, 0), 0.5, 0.3))]
    needs = scene_requirements(bodies, contacts, tolerance)
    assert (needs.law.least, needs.precision.least) == (Law.FRICTIONLESS, least)


@pytest.mark.parametrize("spin", [0.5, -0.5])
def test_a_step_of_restitution_at_the_approach_speed_requires_no_rotation(spin):
    """Rotation changes the approach of 2 m/s by 5e-5: that decides the restitution, in every geometry."""
    body = Body.sphere(1.0, 1.0, position=(1e-4, 0, 1), velocity=(0, 0, -2), angular_velocity=(0, spin, 0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), lambda v: 0.9 if v <= 2.0 else 0.1)
    bodies = {"body": body, "ground": Body.static()}
    model = _assert_least(bodies, [SceneContact("body", "ground", contact)], 1e-2)
    assert model.geometry is Geometry.POINT
    used, exact = resolve(body, bodies["ground"], contact, model), resolve(body, bodies["ground"], contact)
    assert used.contact.restitution == exact.contact.restitution == (0.9 if spin > 0 else 0.1)
    assert (used.impulse - exact.impulse).norm() <= 1e-2 * exact.impulse.norm()


def test_an_invalid_contact_leaves_a_survey_unchanged():
    survey = SceneSurvey(1e-6)
    with pytest.raises(ImpactError):
        survey.add("bad", BODIES["thrown"], BODIES["ground"], RUBBING.contact._replace(friction=-1.0))
    assert survey.requirements() == scene_requirements(BODIES, [], 1e-6)


def test_what_no_model_answers_is_the_reason():
    """A wall that a point mass approaches by 1e-40 m/s: all digits of floats leave open whether it does."""
    point = Body.dynamic(1.0, velocity=(Fraction(1, 3), Fraction(-1, 3) - Fraction(1, 10**40), 0))
    contacts = [SceneContact("point", "wall", Contact.of((0, 0, 0), (1, 1, 0), 0.5, 0.3))]
    needs = scene_requirements({"point": point, "wall": Body.static()}, contacts, 1e-6)
    reason = "point - wall meets the tolerance in no model"
    assert needs.geometry == (Geometry.SPATIAL, reason)
    assert needs.precision == (Precision.EXTENDED, reason)
