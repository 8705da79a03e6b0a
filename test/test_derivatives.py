"""The Jacobian of an impact: against reference values in many digits, and against differences of exact
formulas.
"""

from __future__ import annotations

import itertools
import json
import math
from decimal import Decimal
from fractions import Fraction as F
from pathlib import Path

import pytest

pytest.importorskip("mpmath")

import numpy as np
from batch_cases import batch_of
from collisions import (
    BODY_A,
    BODY_B,
    CONTACT,
    EVERY_LAW,
    LAWS_WITH_FRICTION,
    LAWS_WITH_ORACLE,
    PATH_LAWS,
    Collision,
    random_collision,
)
from differences import assert_agrees, by_differences, by_differences_of_resolve
from refusals import refused
from scene_cases import rotate

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.batch import contact_rows
from collision_response.derivatives import (
    PARAMETERS,
    RESULTS,
    Smoothness,
    differentiate,
    differentiate_batch,
    unit_directions,
)
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

REFERENCE = json.loads((Path(__file__).parent / "data" / "jacobians.json").read_text())
"""Columns of two Jacobians, to 17 digits, by the name of the parameter."""
SMOOTH, KINK, JUMP = Smoothness
COEFFICIENTS = ("contact.restitution", "contact.friction", "model.tangential_restitution")
PLACES_OF_INERTIA = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
SPHERE = (0.4, 0.0, 0.0, 0.4, 0.0, 0.4)


def ball(velocity=(0.3, -0.2, -1.0), spin=(1.0, 2.0, 0.5), **given) -> Body:
    return Body.dynamic(1.0, SPHERE, (0.0, 0.0, 1.0), None, velocity, spin, **given)


def on_floor(restitution=0.5, friction=0.3) -> Contact:
    return Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), restitution, friction)


def reference_columns():
    for side in "AB":
        body = f"body_{side.lower()}"
        for field, letter, axes in (
            ("position", "x", "x y z"), ("orientation", "th", "x y z"), ("velocity", "v", "x y z"),
            ("angular_velocity", "w", "x y z"), ("mass", "m", ""), ("inertia", "I", "xx xy xz yy yz zz"),
        ):  # fmt: skip
            for i, axis in enumerate(axes.split() or [""]):
                yield f"{body}.{field}", i, f"{letter}{side}{axis}"
    for field, letter in (("position", "c"), ("normal", "n")):
        for i, axis in enumerate("xyz"):
            yield f"contact.{field}", i, letter + axis
    yield from zip(COEFFICIENTS, (0, 0, 0), ("e", "mu", "et"), strict=True)


@pytest.mark.parametrize(
    ("law", "case"), [(Law.FRICTIONLESS, "FRICTIONLESS"), (Law.COULOMB, "COULOMB sliding")]
)
def test_the_jacobian_to_many_digits(law, case):
    found = differentiate(BODY_A, BODY_B, CONTACT, ImpactModel(law))
    for name, axis, key in reference_columns():
        expected = [float(x) for x in REFERENCE[case][key]]
        column = found.jacobian[:, found.columns[name]][:, axis]
        np.testing.assert_allclose(column, expected, rtol=1e-12, atol=1e-13, err_msg=key)
    assert (found.smoothness == SMOOTH).all()


def test_the_length_of_the_normal_and_of_the_quaternion_do_not_matter():
    found = differentiate(BODY_A, BODY_B, CONTACT)
    along = found.jacobian[:, found.columns["contact.normal"]] @ np.array(CONTACT.normal)
    np.testing.assert_allclose(along, 0, atol=1e-13)
    longer = BODY_A._replace(orientation=Quaternion(*(3 * x for x in BODY_A.orientation)))
    same = differentiate(longer, BODY_B, CONTACT)
    np.testing.assert_allclose(same.jacobian, found.jacobian, rtol=0, atol=1e-12)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_differences_in_many_digits(law, seed):
    assert_agrees(random_collision(seed, off_centre=True), ImpactModel(law, tangential_restitution=0.25))


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("seed", range(2))
def test_path_laws_agree_with_differences(law, seed):
    """A path is right to 1e-13. A difference over 1e-4 makes that 1e-9, and errs by 1e-8 itself."""
    names = ("body_a.velocity", "body_b.orientation", "contact.friction", "contact.restitution")
    assert_agrees(
        random_collision(seed), ImpactModel(law, tolerance=1e-11), names, 3e-6, step="1e-4", digits=20
    )


BOX = Body.dynamic(2.0, (0.03, 0, 0, 0.05, 0, 0.06), (0.1, 0.0, 0.5), None, (0.5, 0, -1.2), (0, -2.0, 0))
ROLLER = ball((0.3, 0.0, -1.0), (0.0, 0.2, 0.0))
IN_AND_OUT_OF_A_PLANE = {
    # Two bodies and their contact; stiffness ratio and regime of COMPLIANT.
    "ball slides": (ball(), Body.static(), on_floor(0.5, 0.05), 1.0, "SLIDING"),
    "ball slides, then sticks": (ball(), Body.static(), on_floor(0.5, 0.3), 0.9, "SLIDING"),
    "ball sticks": (ROLLER, Body.static(), on_floor(0.7, 0.8), 0.8, "REVERSED"),
    "box": (BOX, Body.static(), on_floor(0.5, 0.3), 1.0, "REVERSED"),
    "stiff box": (BOX, Body.static(), on_floor(0.6, 0.3), 10.0, "REVERSED"),
    "box is pressed down": (BOX, Body.static(), on_floor(0.5, 1.0), 1.0, "JAMMED"),
    "little restitution": (BOX, Body.static(), on_floor(0.01, 0.3), 1.0, "REVERSED"),
    "space": (BODY_A, BODY_B, CONTACT, 1.0, "REVERSED"),
    "space, it sticks": (BODY_A, BODY_B, CONTACT._replace(friction=2.0), 0.5, "REVERSED"),
    "space, little friction": (BODY_A, BODY_B, CONTACT._replace(friction=2e-3), 0.5, "SLIDING"),
    "space, stiff": (BODY_A, BODY_B, CONTACT._replace(friction=0.1), 1e3, "SLIDING"),
}


@pytest.mark.parametrize("law", [*LAWS_WITH_FRICTION, Law.COMPLIANT])
@pytest.mark.parametrize("case", IN_AND_OUT_OF_A_PLANE)
def test_all_columns_agree_with_differences_in_and_out_of_the_plane(law, case):
    """Steps of 4e-4 with an error of fourth order, on paths that are right to about 1e-13."""
    *collision, stiffness_ratio, regime = IN_AND_OUT_OF_A_PLANE[case]
    model = ImpactModel(law, stiffness_ratio=stiffness_ratio, tolerance=1e-12)
    found = differentiate(*collision, model)
    assert law is not Law.COMPLIANT or found.impact.regime.name == regime
    for name in PARAMETERS:
        owner, field = name.split(".")
        body = {"body_a": collision[0], "body_b": collision[1]}.get(owner)
        if body is not None and not body.is_movable() and "velocity" not in field:
            continue
        size = max(map(abs, body.inertia)) if field == "inertia" else 1.0
        size = min(size, collision[2].restitution) if field == "restitution" else size
        for axis, column in enumerate(found.jacobian[:, found.columns[name]].T):
            expected = by_differences_of_resolve(collision, model, name, axis, 4e-4 * size)
            scale = max(1.0, np.abs(expected).max())
            np.testing.assert_allclose(column, expected, rtol=0, atol=1e-7 * scale, err_msg=f"{name} {axis}")


STRAIGHT_WITHOUT_SYMMETRY = [  # friction, and the arm, with which slip along x turns neither left nor right
    (1.0, (0.5, 0.25, 0.5)),
    (0.5, (0.5, 0.25, 0.25)),
    (0.25, (0.5, 0.25, 0.125)),
    (2.0, (0.25, 0.25, 0.5)),
]


TURNS = [
    (0, 0, 0, 1),
    (0.5, 0.5, 0.5, 0.5),
    (0.1, 0.7, -0.4, 0.3),
    (-0.3, 0.2, 0.9, 0.1),
    (0.6, -0.2, 0.1, 0.7),
]
"""Quaternions, whose products round the slip of a body that falls straight to something that is not 0."""


def box_on_its_corner(turn, friction: float) -> Collision:
    """A box that falls straight down. Seen in turned axes, its slip is rounding."""
    box = Body.box(1.0, (1.0, 0.5, 0.25), position=(-0.5, 0.25, 0.125), velocity=(0, 0, -1.0))
    return Collision(box, Body.static(), on_floor(0.5, friction)).rotated(Quaternion(*turn))


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("turn", TURNS)
def test_a_box_that_falls_on_its_corner_and_sticks_has_smooth_derivatives(law, turn):
    collision, model = box_on_its_corner(turn, 2.0), ImpactModel(law, tolerance=1e-12)
    found = differentiate(*collision, model)
    assert found.impact.regime is Regime.STICKING
    assert not found.smoothness.any()
    for axis in range(3):
        expected = by_differences_of_resolve(collision, model, "body_a.velocity", axis, step=1e-6)
        column = found.jacobian[:, found.columns["body_a.velocity"]][:, axis]
        # The work of Stronge's law has no second derivative here: differences are off by as much as the step.
        np.testing.assert_allclose(column, expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("turn", TURNS)
def test_a_box_that_falls_on_its_corner_and_slips_has_a_kink_where_slip_begins(law, turn):
    """What does not move the contact sideways is smooth: the impulse grows with the speed."""
    collision = box_on_its_corner(turn, 0.25)
    found = differentiate(*collision, ImpactModel(law, tolerance=1e-12))
    assert found.impact.regime is Regime.SLIDING
    assert (found.smoothness[found.columns["body_a.velocity"]] == KINK).sum() >= 2
    for name in ("body_a.mass", "contact.restitution", "contact.friction"):
        assert not found.smoothness[found.columns[name]].any()
    along = found.of("impulse", "body_a.velocity") @ collision[0].velocity
    np.testing.assert_allclose(along, found.impact.impulse, rtol=0, atol=1e-12)


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("slip", [0.7, 5.0])
@pytest.mark.parametrize(("friction", "arm"), STRAIGHT_WITHOUT_SYMMETRY)
def test_smooth_columns_are_right_where_a_path_is_straight_without_symmetry(law, slip, friction, arm):
    """The force that turns the slip also slows it and presses the bodies together."""
    body = Body.dynamic(1.0, SPHERE, arm, None, (slip, 0.0, -1.0))
    collision = body, Body.static(), on_floor(0.25, friction)
    model = ImpactModel(law, tolerance=1e-12)
    found = differentiate(*collision, model, ["body_a.velocity", "body_a.position", "contact.friction"])
    smooth = 0
    for name, columns in found.columns.items():
        for axis, column in enumerate(found.jacobian[:, columns].T):
            if found.smoothness[columns][axis] == SMOOTH:
                expected = by_differences_of_resolve(collision, model, name, axis, 1e-4)
                scale = max(1.0, np.abs(expected).max())
                np.testing.assert_allclose(
                    column, expected, rtol=0, atol=1e-7 * scale, err_msg=f"{name} {axis}"
                )
                smooth += 1
    assert smooth >= 3
    assert found.smoothness[found.columns["body_a.position"]][0] == KINK


def test_compliant_to_many_digits():
    """A rod that slides, sticks and slides back. The derivatives come from a separate oracle in mpmath."""
    rod = Body.dynamic(1.0, (1 / 3, 0, 0, 1 / 3, 0, 2 / 3), (-1.0, -1.0, 0.0), None, (1.0, -1.0, 0.0))
    touch = Contact.of((0, 0, 0), (0, 1, 0), 0.5, 0.3)
    found = differentiate(rod, Body.static(), touch, ImpactModel(Law.COMPLIANT, stiffness_ratio=10.0))
    J = found.jacobian
    after = np.array([J[0] - J[5], J[1] + J[5], J[12], J[13]])  # of the contact: v + w x r, r = (1, 1); P
    expected = {
        ("body_a.velocity", 0): (0.707905553292, 0.167368575898, -0.119795813231, -0.00493005757921),
        ("body_a.velocity", 1): (0.837246167650, -0.324016843308, 0.0267725385407, -0.513543214199),
        ("contact.friction", 0): (-0.538537609983, -0.0869010836698, -0.369173912615, -0.256264781037),
        ("contact.restitution", 0): (-0.497515337703, 0.847436684292, 0.00684167054532, 0.343079676044),
        ("model.stiffness_ratio", 0): (0.00242802672119, -0.00139762498643, 0.000993407330830, 3.69944039e-5),
    }
    for (name, axis), column in expected.items():
        np.testing.assert_allclose(
            after[:, found.columns[name]][:, axis], column, rtol=0, atol=3e-11, err_msg=name
        )


@pytest.mark.parametrize("sideways", [0.0, 1e-12, 1e-9, 1e-3])
@pytest.mark.parametrize(
    ("moment", "tolerance"), [(1e-3, 1e-6), (1e-4, 1e-6), (1e-4, 0), (1e-5, 0), (1e-7, 0)]
)
def test_compliant_leaves_its_plane_as_differences_say(moment, tolerance, sideways):
    """The contact moves up to 5e5 times as easily across the plane as along the normal, and swings as fast.

    Differences over 1e-3 m/s are off by about 1e-6 of themselves.
    """
    contact, model = (
        Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.5),
        ImpactModel(Law.COMPLIANT, tolerance=tolerance),
    )
    rod = Body.dynamic(1.0, (1 / 12, 0, 0, 1 / 12, 0, moment), position=(0.35, 0, 0.1))

    def at(y, model):
        return rod._replace(velocity=Vec3(0.0, y, -1.0)), Body.static(), contact, model

    found = differentiate(*at(sideways, model), ["body_a.velocity"])
    h, exact = 1e-3, model._replace(tolerance=0)
    ends = [resolve(*at(sideways + by, exact)) for by in (h, -h)]
    expected = (ends[0].twist_a.angular.z - ends[1].twist_a.angular.z) / (2 * h)
    assert found.of("twist_a.angular", "body_a.velocity")[2, 1] == pytest.approx(expected, rel=1e-4)
    assert found.smoothness[1] == Smoothness.SMOOTH


def test_compliant_is_smooth_where_initial_stick_turns_into_slip():
    """It begins with stick if kappa |u_t| <= mu |u_n|. Near that, derivatives change with the root of the
    distance.
    """
    names = ("body_a.velocity", "contact.friction", "model.stiffness_ratio")
    at, before, beyond = (
        differentiate(
            ball((slip, 0.0, -1.0), (0.0, 0.0, 0.0)), Body.static(), on_floor(0.5, 0.25),
            ImpactModel(Law.COMPLIANT, stiffness_ratio=0.5), names,
        )
        for slip in (0.5, 0.5 - 1e-9, 0.5 + 1e-9)
    )  # fmt: skip
    assert (at.smoothness == SMOOTH).all()
    for near in (before, beyond):
        np.testing.assert_allclose(near.jacobian, at.jacobian, rtol=0, atol=1e-5)


def test_compliant_at_zero_friction_has_the_friction_derivative_of_routh():
    """Little friction deflects the tangential spring by little."""
    collision = ball(), Body.static(), on_floor(friction=0.0)
    names = ("contact.friction",)
    soft, hard = (
        differentiate(*collision, ImpactModel(law), names) for law in (Law.COMPLIANT, Law.ROUTH_STRONGE)
    )
    np.testing.assert_array_equal(soft.jacobian, hard.jacobian)
    little = 1e-3
    with_, without = (
        resolve(*collision[:2], on_floor(friction=mu), ImpactModel(Law.COMPLIANT)).impulse
        for mu in (little, 0.0)
    )
    slope = (np.array(with_) - without) / little
    np.testing.assert_allclose(slope, soft.of("impulse", "contact.friction")[:, 0], rtol=0, atol=3 * little)


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_a_ball_that_falls_without_slip_has_smooth_derivatives(law):
    """Friction holds the contact: P_t = -(2/7) m u_t for a solid ball. The root of a slip of 0 does not
    matter.
    """
    found = differentiate(
        ball((0.0, 0.0, -1.0), (0.0, 0.0, 0.0)), Body.static(), on_floor(), ImpactModel(law)
    )
    by_velocity = found.of("impulse", "body_a.velocity")
    held = 0.0 if law is Law.FRICTIONLESS else -2 / 7
    np.testing.assert_allclose(by_velocity, np.diag([held, held, -1.5]), atol=1e-14)
    assert np.isfinite(found.jacobian).all()
    velocities = found.columns["body_a.velocity"]
    assert (found.smoothness[velocities] == SMOOTH).all()


@pytest.mark.parametrize("law", [Law.AUTO, *LAWS_WITH_FRICTION])
def test_at_zero_friction_all_other_derivatives_are_frictionless(law):
    collision = ball(), Body.static(), on_floor(friction=0.0)
    found = differentiate(*collision, ImpactModel(law))
    plain = differentiate(*collision, ImpactModel(Law.FRICTIONLESS))
    others = [i for i in range(found.jacobian.shape[1]) if i != found.columns["contact.friction"].start]
    np.testing.assert_allclose(found.jacobian[:, others], plain.jacobian[:, others], atol=1e-14)
    with_friction = law or Law.COULOMB
    expected = by_differences(collision, with_friction, "contact.friction", side=1, step="1e-10", digits=25)
    np.testing.assert_allclose(
        found.jacobian[:, found.columns["contact.friction"]][:, 0], expected, atol=1e-8
    )


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
def test_restitution_at_both_ends_of_its_range(law):
    for e, side in ((0.0, 1), (1.0, -1)):
        collision = ball(), Body.static(), on_floor(restitution=e)
        found = differentiate(*collision, ImpactModel(law))
        expected = by_differences(collision, law, "contact.restitution", side=side, step="1e-10", digits=25)
        np.testing.assert_allclose(
            found.jacobian[:, found.columns["contact.restitution"]][:, 0], expected, atol=1e-8
        )
        assert np.isfinite(found.jacobian).all()


@pytest.mark.parametrize("e", [0.0, 1e-9, 1e-4, 1.0])
def test_restitution_of_compliant_at_both_ends_of_its_range(e):
    """For e below 1e-7 the derivative is the one at 1e-7, and off by as much. The difference is right to
    1e-8.
    """
    found = differentiate(ball(), Body.static(), on_floor(restitution=e), ImpactModel(Law.COMPLIANT))
    step = 1e-4 if e < 0.5 else -1e-4
    ends = [
        resolve(ball(), Body.static(), on_floor(restitution=e + k * step), ImpactModel(Law.COMPLIANT)).impulse
        for k in range(3)
    ]
    expected = (4 * np.array(ends[1]) - 3 * np.array(ends[0]) - ends[2]) / (2 * step)
    np.testing.assert_allclose(found.of("impulse", "contact.restitution")[:, 0], expected, rtol=0, atol=1e-6)
    assert np.isfinite(found.jacobian).all()


def test_the_edge_of_the_cone_is_a_kink():
    """A ball sticks iff (2/7)|u_t| <= mu (1 + e)|u_n|. On the edge, the derivative belongs to the regime of
    the answer.
    """
    edge = ball((1.05, 0.0, -1.0), (0.0, 0.0, 0.0)), Body.static(), on_floor(0.5, 0.2)
    names = ("body_a.velocity",)
    found = differentiate(*edge, ImpactModel(Law.COULOMB), names)
    assert found.smoothness.tolist() == [KINK, SMOOTH, KINK] or found.smoothness.tolist() == [
        KINK,
        KINK,
        KINK,
    ]
    assert found.impact.regime.name == "STICKING"
    np.testing.assert_allclose(found.of("impulse", "body_a.velocity")[0, 0], -2 / 7, rtol=1e-12)
    for speed in (1.0499, 1.0501):
        near = differentiate(
            ball((speed, 0.0, -1.0), (0.0, 0.0, 0.0)), *edge[1:], ImpactModel(Law.COULOMB), names
        )
        assert (near.smoothness == SMOOTH).all()


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
@pytest.mark.parametrize("normal", [(0, 0.25, 1), (0, 0.5, 1), (1, 2, 2), (0.6, 0, 0.8), (0, 0, 1)])
@pytest.mark.parametrize(("restitution", "friction"), [(0.5, 0.25), (0.25, 0.5), (0.25, 0.125)])
def test_next_to_the_edge_of_the_cone_the_derivative_is_one_of_both(law, normal, restitution, friction):
    """Slip ends with the impact, to some units in the last place. Here a ball sticks iff |u_t| / 2 <= mu (1 +
    e) |u_n|.
    """
    n = np.array(normal) / np.linalg.norm(normal)
    t = np.cross(n, (0.0, 1.0, 0.0)) / np.linalg.norm(np.cross(n, (0.0, 1.0, 0.0)))
    touch = Contact.of((0, 0, 0), normal, restitution, friction)
    at = 2 * friction * (1 + restitution)
    for slip in at + np.spacing(at) * np.arange(-8, 9):
        struck = Body.dynamic(1.0, (1, 0, 0, 1, 0, 1), n.tolist(), None, (slip * t - n).tolist())
        found = differentiate(struck, Body.static(), touch, ImpactModel(law))
        along_slip = t @ found.of("impulse", "body_a.velocity") @ t
        assert min(abs(along_slip), abs(along_slip + 0.5)) < 1e-12
        assert found.smoothness[found.columns["body_a.velocity"]].any()


def test_zero_approach_is_a_kink_with_the_derivative_of_separating_bodies():
    found = differentiate(
        ball((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        Body.static(),
        on_floor(),
        with_respect_to=("body_a.velocity",),
    )
    assert found.smoothness.tolist() == [SMOOTH, SMOOTH, KINK]
    np.testing.assert_array_equal(found.of("impulse", "body_a.velocity"), np.zeros((3, 3)))
    np.testing.assert_array_equal(found.of("twist_a.linear", "body_a.velocity"), np.eye(3))


@pytest.mark.parametrize("law", [*LAWS_WITH_FRICTION, Law.COMPLIANT])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("slip", [5.0, 0.25])
def test_sliding_and_sticking_on_walls_and_floors_is_smooth(law, axis, sign, slip):
    """Far from every edge; the tangential axes that a law chooses must not matter."""
    n, t = np.roll([sign, 0.0, 0.0], axis), np.roll([0.0, 0.6, 0.8], axis)
    struck = Body.dynamic(2.0, SPHERE, n.tolist(), None, (slip * t - n).tolist())
    found = differentiate(
        struck, Body.static(), Contact.of((0, 0, 0), n.tolist(), 0.25, 0.3), ImpactModel(law)
    )
    for name, columns in found.columns.items():
        if name.startswith(("body_a", "contact")):
            assert not found.smoothness[columns].any(), name


UNITS = {
    "position": (0, 1, 0), "orientation": (0, 0, 0), "velocity": (0, 1, -1), "angular_velocity": (0, 0, -1),
    "mass": (1, 0, 0), "inertia": (1, 2, 0), "com": (0, 1, 0), "normal": (0, 0, 0), "restitution": (0, 0, 0),
    "friction": (0, 0, 0), "tangential_restitution": (0, 0, 0), "stiffness_ratio": (0, 0, 0),
    "linear": (0, 1, -1), "angular": (0, 0, -1), "impulse": (1, 1, -1),
}  # fmt: skip
"""Powers of mass, length and time."""


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("powers", [(3, 0, 0), (0, 5, 0), (0, 0, -4), (-20, 13, 7)])
def test_other_units_change_no_bit(law, powers):
    """Units of 2^k kg, m and s: no law compares a number that has a unit with a constant."""

    def factor(name: str) -> float:
        return 2.0 ** np.dot(UNITS[name.rpartition(".")[2]], powers)

    def moved(body: Body) -> Body:
        fields = {
            name: getattr(body, name) for name in Body._fields if name in UNITS and name != "orientation"
        }
        scaled = {
            name: type(x)(*(v * factor(name) for v in x)) if isinstance(x, tuple) else x * factor(name)
            for name, x in fields.items()
        }
        return body._replace(**scaled)

    there = CONTACT._replace(position=Vec3(*(x * factor("position") for x in CONTACT.position)))
    here, other = (
        differentiate(*request, ImpactModel(law))
        for request in ((BODY_A, BODY_B, CONTACT), (moved(BODY_A), moved(BODY_B), there))
    )
    rows = np.repeat([factor(name) for name in RESULTS], 3)
    columns = np.concatenate([[factor(name)] * (at.stop - at.start) for name, at in PARAMETERS.items()])
    np.testing.assert_array_equal(other.jacobian / rows[:, None] * columns, here.jacobian)
    np.testing.assert_array_equal(other.smoothness, here.smoothness)


@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
@pytest.mark.parametrize(
    ("powers", "normal"),
    [
        ((300, 150, 0), 300),
        ((-150, -150, 0), 150),
        ((0, 250, 250), 0),
        ((-86, -33, -42), 0),
        ((-332, 332, 664), 0),
        ((0, 0, 660), 0),
    ],
)
@pytest.mark.parametrize("body_b", [BODY_B, Body.static()], ids=["turning", "static"])
def test_derivatives_are_the_same_in_any_units(law, powers, normal, body_b):
    """From molecules to what no one has seen: products of all these numbers leave the range of floats."""

    def scale(field: str) -> int:
        if field == "normal":
            return normal
        return sum(p * e for p, e in zip(powers, UNITS.get(field, (0, 0, 0)), strict=True))

    def scaled(field, x):
        if isinstance(x, tuple):
            return type(x)(*(math.ldexp(component, scale(field)) for component in x))
        return math.ldexp(x, scale(field)) if scale(field) else x

    def in_units(part):
        return type(part)(*map(scaled, part._fields, part))

    request = [BODY_A._replace(com=Vec3(0.01, -0.02, 0.03)), body_b, CONTACT]
    model = ImpactModel(law, tangential_restitution=0.3)
    usual, found = differentiate(*request, model), differentiate(*map(in_units, request), model)
    # roots may round in another way; the steps of COMPLIANT then differ, to their tolerance
    tolerance = 1e-6 if law is Law.COMPLIANT else 1e-9
    np.testing.assert_array_equal(found.smoothness, usual.smoothness)
    for result in RESULTS:
        for parameter in PARAMETERS:
            power = scale(result.split(".")[-1]) - scale(parameter.split(".")[1])
            expected = usual.of(result, parameter)
            error = abs(np.ldexp(found.of(result, parameter), -power) - expected).max()
            assert error <= tolerance * abs(expected).max(), (result, parameter)


SYMMETRIC = Collision(BODY_A._replace(com=Vec3(0.1, -0.05, 0.2)), BODY_B, CONTACT)


def assert_equal_columns(found, expected, law: Law) -> None:
    """A path, which is right to 1e-12, has other steps in another frame. The other laws only round."""
    tolerance = 1e-8 if law in (*PATH_LAWS, Law.COMPLIANT) else 1e-12
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("friction", [0.0, 0.02, 0.2, 3.0])
def test_the_bodies_may_be_exchanged(law, friction):
    """That reverses the normal and the impulse."""
    collision = SYMMETRIC._replace(contact=CONTACT._replace(friction=friction))
    model = ImpactModel(law, tolerance=1e-12)
    found, other = (differentiate(*one, model) for one in (collision, collision.swapped()))
    rows = np.concatenate([other.jacobian[6:12], other.jacobian[:6], -other.jacobian[12:]])
    sides = {"body_a": "body_b", "body_b": "body_a"}
    for name, place in found.columns.items():
        owner, _, field = name.partition(".")
        there = rows[:, other.columns[f"{sides.get(owner, owner)}.{field}"]]
        assert_equal_columns(-there if field == "normal" else there, found.jacobian[:, place], law)


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("friction", [0.0, 0.02, 0.2, 3.0])
@pytest.mark.parametrize("turn", [Quaternion(0.5, 0.5, 0.5, 0.5), Quaternion(0.1, 0.7, -0.4, 0.3)])
def test_the_frame_may_be_turned(law, friction, turn):
    """Mass, inertia and centre of mass are given in body axes, everything else in the axes of the world."""
    collision = SYMMETRIC._replace(contact=CONTACT._replace(friction=friction))
    model = ImpactModel(law, tolerance=1e-12)
    found, other = (differentiate(*one, model) for one in (collision, collision.rotated(turn)))
    R = np.array([rotate(turn, Vec3(*axis)) for axis in np.eye(3)]).T
    for name, place in found.columns.items():
        expected = np.kron(np.eye(5), R) @ found.jacobian[:, place]
        if name.endswith(("position", "orientation", "velocity", "normal")):
            expected = expected @ R.T
        assert_equal_columns(other.jacobian[:, place], expected, law)


def test_the_threshold_is_a_jump_where_restitution_is_lost():
    model = ImpactModel(Law.COULOMB, restitution_threshold=1.0)
    names = ("body_a.velocity", "contact.restitution")
    at = differentiate(ball((0.1, 0.0, -1.0)), Body.static(), on_floor(), model, names)
    assert at.smoothness[2] == JUMP
    below = differentiate(ball((0.1, 0.0, -0.5)), Body.static(), on_floor(), model, names)
    assert (below.smoothness == SMOOTH).all()
    np.testing.assert_array_equal(below.of("impulse", "contact.restitution"), 0)


@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (1.0, -2.0, 0.5)])
@pytest.mark.parametrize("swapped", [False, True], ids=["body_b", "body_a"])
def test_the_mass_of_an_immovable_body_changes_nothing_smoothly(law, spin, swapped):
    """The next mass is so great that the answer differs by nothing."""
    bodies = [ball((1.5, -0.2, -1.0)), Body.kinematic((0.2, 0.1, -1.0), (0.1, 0.0, 0.3), spin)]
    contact = on_floor(friction=0.05)
    if swapped:
        bodies, contact = bodies[::-1], contact._replace(normal=Vec3(0.0, 0.0, -1.0))
    name = "body_a.mass" if swapped else "body_b.mass"
    found = differentiate(*bodies, contact, ImpactModel(law))
    assert not found.jacobian[:, found.columns[name]].any()
    assert found.smoothness[found.columns[name]] == SMOOTH


def test_zero_inertia_is_not_a_smooth_parameter_but_the_others_are():
    mass = Body.dynamic(2.0, position=(0.1, 0.0, 1.0), velocity=(0.1, 0.2, -1.0))
    found = differentiate(mass, Body.static(), on_floor())
    assert (found.smoothness[found.columns["body_a.inertia"]] != SMOOTH).all()
    others = [
        i for name, place in found.columns.items() if not name.endswith("inertia") for i in range(1000)[place]
    ]
    assert (found.smoothness[others] == SMOOTH).all()
    assert np.isfinite(found.jacobian).all()
    immovable = [found.columns[f"body_b.{field}"] for field in ("mass", "inertia", "orientation", "com")]
    for place in immovable:
        np.testing.assert_array_equal(found.jacobian[:, place], 0)
        assert (found.smoothness[place] == SMOOTH).all()


def sticking_impulse(r, n, v, e, x):
    """COULOMB's impulse where a unit mass with moments x, 1/4, 1/4 sticks to a wall, and its derivative by x.

    In fractions, with ``K = 1 + G^T I^-1 G``: ``P = -e n (n.v) / (n.K n) - K^-1 v``.
    """
    r, n, v, moments = (
        np.array([F(t) for t in r]),
        *(np.array([F(t) for t in a]) for a in (n, v)),
        (F(x), F(1, 4)),
    )
    G = np.array([[F(0), -r[2], r[1]], [r[2], F(0), -r[0]], [-r[1], r[0], F(0)]])
    K = G.T @ np.diag([1 / moments[0], 1 / moments[1], 1 / moments[1]]) @ G + np.diag([F(1)] * 3)
    dK = -np.outer(G[0], G[0]) / moments[0] ** 2
    adjugate = np.array([np.cross(K[(i + 1) % 3], K[(i + 2) % 3]) for i in range(3)]).T
    inverse = adjugate / (K[0] @ adjugate[:, 0])
    along = F(e) * (n @ v) / (n @ K @ n) * n
    return -along - inverse @ v, along * (n @ dK @ n) / (n @ K @ n) + inverse @ dK @ inverse @ v


@pytest.mark.parametrize("exponent", [0, 5, 10, 15, 20])
def test_small_moments_lose_no_more_digits_than_documented(exponent):
    """The bound of docs/derivatives.md: no eigenvalue of K is below 1, and none is above c."""
    rng, x, found = np.random.default_rng(exponent), 2.0 ** -(exponent + 2), 0
    while found < 20:
        r, n, v = rng.uniform(-1, 1, (3, 3))
        if n @ v >= 0:
            continue
        body = Body.dynamic(1.0, (x, 0, 0, 0.25, 0, 0.25), velocity=v)
        model = ImpactModel(Law.COULOMB)
        answer = differentiate(body, Body.static(), Contact.of(r, n, 0.5, 50.0), model, ["body_a.inertia"])
        if answer.impact.regime is not Regime.STICKING:
            continue
        found += 1
        P, by_x = (a.astype(float) for a in sticking_impulse(r, n, v, 0.5, x))
        assert answer.smoothness[0] == SMOOTH
        c, size = 1 + r @ r / x, math.hypot(*P)
        assert math.dist(P, answer.impact.impulse) <= 2 * answer.impact.error_bound * size + 2.0**-52 * size
        assert math.dist(by_x, answer.of("impulse", "body_a.inertia")[:, 0]) <= 2.0**-53 * c * c * size / x


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize(
    "axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (3, 4, 0), (0, 4, 3), (4, 0, 3), (2, 2, 1)]
)
def test_inertia_about_the_axis_of_a_rod_is_never_smooth(law, axis):
    """A rod along a has the inertia ``a.a 1 - a a^T``. A change that does not map a to 0 makes it another
    body.
    """
    aa = sum(x * x for x in axis)
    inertia = [(aa * (i == j) - axis[i] * axis[j]) / 64 for i, j in PLACES_OF_INERTIA]
    rod = Body.dynamic(1.0, inertia, (0.3, 0.2, 0.9), (0.1, 0.3, -0.2, 0.9), (0.3, 0.1, -2.0))
    found = differentiate(rod, BODY_B, CONTACT, ImpactModel(law), ["body_a.inertia"])
    for column, (i, j) in enumerate(PLACES_OF_INERTIA):
        if axis[i] or axis[j]:
            assert found.smoothness[column] != SMOOTH, (i, j)


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
def test_every_law_has_derivatives_at_a_head_on_impact(law):
    """A ball falls straight onto a floor."""
    ball = Body.sphere(0.5, 0.1, position=(0.0, 0.0, 0.1), velocity=(0.0, 0.0, -1.0))
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.75, 0.6)
    found = differentiate(ball, Body.static(), contact, ImpactModel(law), ["body_a.velocity"])
    by_velocity = found.of("twist_a.linear", "body_a.velocity")
    np.testing.assert_allclose(by_velocity[2], (0, 0, -0.75), atol=1e-12)
    np.testing.assert_allclose(by_velocity[:2, 2], 0, atol=1e-12)
    assert by_velocity[0, 0] == pytest.approx(by_velocity[1, 1], rel=1e-12)


def test_a_rod_agrees_with_differences():
    rod = Body.dynamic(
        1.0,
        (0.0, 0.0, 0.0, 0.1, 0.0, 0.1),
        (0.1, 0.2, 0.5),
        (0.1, 0.3, -0.2, 0.9),
        (0.1, 0.0, -2.0),
        (0.5, 1.0, 2.0),
    )
    names = ("body_a.orientation", "body_a.velocity", "body_a.mass", "body_a.position", "contact.friction")
    assert_agrees((rod, BODY_B, CONTACT), ImpactModel(Law.COULOMB), names)


def test_moreau_differentiates_its_fallback():
    """Kane's paradox: MOREAU would create energy at this speed, so COULOMB answers."""
    m = ImpactModel(Law.MOREAU)

    def rod(slip):
        cosine, sine = 1 / math.sqrt(5), 2 / math.sqrt(5)
        inertia = (1 / 12, 0.0, 0.0, 1 / 12, 0.0, 1 / 12)
        return Body.dynamic(1.0, inertia, (0.5 * cosine, 0.5 * sine, 0.0), None, (slip, -1.0, 0.0))

    floor = Contact.of((0, 0, 0), (0, 1, 0), 0.9, 0.3)
    assert resolve(rod(0.5), Body.static(), floor, m).adjustments.name == "LAW_FALLBACK"
    found = differentiate(rod(0.5), Body.static(), floor, m)
    other = differentiate(rod(0.5), Body.static(), floor, ImpactModel(Law.COULOMB))
    np.testing.assert_allclose(found.jacobian, other.jacobian, atol=1e-12)


@pytest.mark.parametrize("law", EVERY_LAW)
def test_a_batch_has_the_same_derivatives(law):
    collisions = [random_collision(seed) for seed in range(5)]
    bodies, contacts = batch_of(collisions)
    contacts[contact_rows(Geometry.SPATIAL).normal, 4] = 0.0
    names = ("body_a.velocity", "contact.friction", "body_b.orientation")
    found = differentiate_batch(bodies, contacts, unit_directions(*names), ImpactModel(law))
    for i, collision in enumerate(collisions[:4]):
        expected = differentiate(*collision, ImpactModel(law), names)
        np.testing.assert_array_equal(found.jacobian[..., i], expected.jacobian)
        np.testing.assert_array_equal(found.smoothness[:, i], expected.smoothness)
    assert found.result.status[4] == StatusCode.INVALID_NORMAL
    assert np.isnan(found.jacobian[..., 4]).all()
    # A direction of many parameters is the sum of theirs, and each contact may have its own.
    weights = np.arange(1.0, 8.0)
    mixed = (unit_directions(*names) @ weights)[:, None, None] * np.arange(5.0)
    along = differentiate_batch(bodies, contacts, mixed, ImpactModel(law))
    expected = np.einsum("rkn,k,n->rn", found.jacobian, weights, np.arange(5.0))
    np.testing.assert_allclose(along.jacobian[:, 0, :4], expected[:, :4], rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("law", [Law.AUTO, Law.COULOMB])
def test_a_table_without_friction_has_the_derivative_by_friction_of_coulomb(law):
    """As for one impact."""
    collision = BODY_A, BODY_B, CONTACT._replace(friction=0.0)
    bodies, contacts = batch_of([collision])
    if law is Law.AUTO:
        contacts = contacts[: contact_rows(Geometry.SPATIAL).friction.start]
    found = differentiate_batch(bodies, contacts, unit_directions("contact.friction"), ImpactModel(law))
    expected = differentiate(*collision, with_respect_to=("contact.friction",))
    assert expected.jacobian.any()
    np.testing.assert_array_equal(found.jacobian[..., 0], expected.jacobian)
    np.testing.assert_array_equal(found.smoothness[:, 0], expected.smoothness)


@pytest.mark.parametrize("signs", [(-1,), (1, -1), (-1, 1), (-2, -1, 3)], ids=str)
def test_directions_against_friction_have_the_derivatives_of_the_same_law(signs):
    """The least friction would create energy by MOREAU, so COULOMB answers in all directions."""
    body = Body.dynamic(
        1.0, (1 / 12, 0, 0, 1 / 12, 0, 1 / 12), (0, 0.5, 1.0), None, (-1.0, 0.75, -0.25), (1.0, -0.25, 1.0)
    )
    request = body, Body.static(), on_floor(1.0, 0.0)
    moreau, coulomb = (differentiate(*request, ImpactModel(law)) for law in (Law.MOREAU, Law.COULOMB))
    by_friction = moreau.jacobian[:, moreau.columns["contact.friction"]]
    np.testing.assert_array_equal(by_friction, coulomb.jacobian[:, coulomb.columns["contact.friction"]])
    directions = unit_directions("contact.friction") * np.array(signs, float)
    found = differentiate_batch(*batch_of([request]), directions, ImpactModel(Law.MOREAU))
    np.testing.assert_allclose(found.jacobian[..., 0], by_friction * signs, rtol=1e-15)


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("great", [1e153, 1e155, 1e300, math.inf])
def test_friction_and_thresholds_far_from_any_edge_have_smooth_derivatives(law, great):
    """Their squares are beyond float64."""
    request = ball((0.3, -0.2, -1.0)), Body.static()
    slow, usual = (ImpactModel(law, restitution_threshold=x) for x in (min(great, 1e300), 1e10))
    found, expected = (differentiate(*request, on_floor(), m) for m in (slow, usual))
    np.testing.assert_array_equal(found.jacobian, expected.jacobian)
    np.testing.assert_array_equal(found.smoothness, expected.smoothness)
    if great < math.inf:
        found, expected = (
            differentiate(*request, on_floor(friction=x), ImpactModel(law)) for x in (great, 1e150)
        )
        np.testing.assert_array_equal(found.jacobian, expected.jacobian)
        np.testing.assert_array_equal(found.smoothness, expected.smoothness)


@pytest.mark.parametrize("half", [F(1, 2), Decimal("0.5"), np.float32(0.5), np.array(0.5)], ids=repr)
@pytest.mark.parametrize("field", ["tangential_restitution", "restitution_threshold", "stiffness_ratio"])
def test_a_batch_takes_settings_of_every_type(half, field):
    law = Law.COMPLIANT if field == "stiffness_ratio" else Law.COULOMB
    batch = batch_of([random_collision(0)]), unit_directions("body_a.velocity")
    found, expected = (
        differentiate_batch(*batch[0], batch[1], ImpactModel(law, **{field: x})).jacobian for x in (half, 0.5)
    )
    np.testing.assert_array_equal(found, expected)


def test_a_batch_has_derivatives_where_the_tolerance_is_not_met():
    batch = batch_of([random_collision(0)])
    strict = ImpactModel(precision=Precision.DOUBLE, tolerance=1e-20)
    found, usual = (
        differentiate_batch(*batch, unit_directions("body_a.velocity"), m) for m in (strict, ImpactModel())
    )
    assert found.result.status == StatusCode.TOLERANCE_NOT_MET
    np.testing.assert_array_equal(found.jacobian, usual.jacobian)


@pytest.mark.parametrize("law", EVERY_LAW)
def test_single_columns_equal_those_of_the_whole_jacobian(law):
    """A point mass has no derivative by its inertia, a rod none by its thickness."""
    rod = Body.dynamic(
        1.0, (0.0, 0, 0, 0.1, 0, 0.1), (0.1, 0.2, 0.5), (0.1, 0.3, -0.2, 0.9), (0.1, 0.0, -2.0)
    )
    for body in (rod, Body.dynamic(2.0, position=(0.1, 0.0, 1.0), velocity=(0.1, 0.2, -1.0))):
        every = differentiate(body, BODY_B, CONTACT, ImpactModel(law))
        for name in ("body_a.inertia", "body_a.velocity", "contact.restitution"):
            alone = differentiate(body, BODY_B, CONTACT, ImpactModel(law), (name,))
            np.testing.assert_array_equal(alone.smoothness, every.smoothness[every.columns[name]])
            np.testing.assert_allclose(
                alone.jacobian, every.jacobian[:, every.columns[name]], rtol=1e-9, atol=1e-9
            )


def test_a_planar_batch_has_the_same_derivatives():
    body = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.1, 1.0, 0.0), None, (0.3, -2.0, 0.0))
    contact = Contact.of((0, 0, 0), (0, 1, 0), 0.5, 0.2)
    bodies, contacts = batch_of([(body, Body.static(), contact)], Geometry.PLANAR, oriented=False)
    assert differentiate_batch(bodies, contacts, unit_directions()).jacobian.shape == (15, 0, 1)
    names = ("body_a.velocity", "contact.normal", "body_a.inertia")
    found = differentiate_batch(bodies, contacts, unit_directions(*names))
    np.testing.assert_array_equal(
        found.jacobian[..., 0], differentiate(body, Body.static(), contact, with_respect_to=names).jacobian
    )


def test_a_result_that_is_changed_changes_no_other():
    names = ("body_a.velocity", "contact.friction")
    first = differentiate(BODY_A, BODY_B, CONTACT, with_respect_to=names)
    del first.columns["body_a.velocity"]
    assert [*differentiate(BODY_A, BODY_B, CONTACT, with_respect_to=names).columns] == [*names]


def test_a_contact_with_its_own_tangential_restitution_overrides_the_model():
    model, plain = (
        ImpactModel(Law.COULOMB, tangential_restitution=0.7),
        CONTACT._replace(friction=2.0),
    )  # sticks
    contact = plain._replace(tangential_restitution=0.7)
    of_model = differentiate(BODY_A, BODY_B, plain, model)
    assert not np.array_equal(of_model.jacobian, differentiate(BODY_A, BODY_B, plain).jacobian)
    assert np.array_equal(differentiate(BODY_A, BODY_B, contact).jacobian, of_model.jacobian)
    some = differentiate(BODY_A, BODY_B, contact, with_respect_to=["contact.friction", "body_a.velocity"])
    assert np.array_equal(some.of("impulse", "body_a.velocity"), of_model.of("impulse", "body_a.velocity"))


def test_places_cover_all_rows_and_columns():
    for places, count in ((PARAMETERS, 54), (RESULTS, 15)):
        assert sorted(i for place in places.values() for i in range(count)[place]) == list(range(count))


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT])
def test_the_derivative_by_friction_at_zero_is_a_kink_where_slip_turns(law):
    """In the plane slip keeps its direction, and the derivative by friction is right: see the test at zero
    friction above.
    """
    for side, mark in ((0.25, Smoothness.KINK), (0.0, Smoothness.SMOOTH)):
        body = Body.box(1.0, (1, 1, 1), position=(0.5, side, 0.5), velocity=(1, 0, -1))
        found = differentiate(
            body,
            Body.static(),
            Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.0),
            ImpactModel(law),
            ["contact.friction", "body_a.velocity"],
        )
        assert [*found.smoothness] == [mark, *[Smoothness.SMOOTH] * 3]


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("restitution", [0.9, 1.0])
@pytest.mark.parametrize("slip", [(0, 0), (0.5, 0), (1, 0), (1.2, 0.4), (1.5, 0.3), (2.5, 0), (-1, 0.5)])
def test_the_derivative_by_friction_at_zero_is_that_of_little_friction(law, restitution, slip):
    """An impact off the centre reverses slip. If that loses no energy and leaves less slip than before, the
    least friction would add some by MOREAU, so COULOMB answers.
    """
    rod = Body.dynamic(1.0, (0.1, 0, 0, 0.08, 0, 0.09), (0.25, 0.125, 0.5), None, (*slip, -1.0))
    with_friction, without = (Contact.of((0, 0, 0), (0, 0, 1), restitution, mu) for mu in (1e-7, 0.0))
    found = differentiate(rod, Body.static(), without, ImpactModel(law), ["contact.friction"])
    little, none = (resolve(rod, Body.static(), c, ImpactModel(law)) for c in (with_friction, without))
    slope = (np.array(little.impulse) - none.impulse) / 1e-7
    np.testing.assert_allclose(found.of("impulse", "contact.friction")[:, 0], slope, rtol=0, atol=1e-5)


def struck_head_on(normal: tuple[float, float, float], with_partner: bool) -> tuple[Body, Body]:
    """A sphere that moves along a normal which rounding turns, and an equal one or an immovable body."""
    n = Vec3(*normal) * (1 / math.sqrt(Vec3(*normal).dot(Vec3(*normal))))
    a, b = (
        Body.sphere(0.5, 0.1, position=n * (0.1 * side), velocity=n * (-2.3 * side + 0.8)) for side in (1, -1)
    )
    return (a, b) if with_partner else (a, Body.static())


@pytest.mark.parametrize("with_partner", [False, True])
@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
def test_friction_does_nothing_at_the_centre(law, with_partner):
    """Without friction nothing slips but the rounding of the velocities: the least friction holds it."""
    for normal in itertools.product((-3.0, 0.0, 1.0, 2.0), repeat=3):
        if not any(normal):
            continue
        bodies = struck_head_on(normal, with_partner)
        n = (bodies[0].position - bodies[1].position) * (1.0 if with_partner else 10.0)
        contact = Contact.of((0, 0, 0), n, 0.8, 0.0)
        found = differentiate(*bodies, contact, ImpactModel(law), ["contact.friction"])
        assert not found.jacobian.any(), normal
        assert found.smoothness[0] == KINK


@pytest.mark.parametrize("law", PATH_LAWS)
def test_the_derivative_by_friction_at_zero_where_slip_turns_back(law):
    """Slip stops after half of the impulse. Friction acts against it, and then the other way for as long."""
    body = Body.dynamic(1.0, (0.5, 0, 0, 1.0, 0, 0.75), velocity=(-0.75, 0.75, -5.0))
    with_friction, without = (Contact.of((1.0, -0.5, -0.5), (0, 0, 1), 0.5, mu) for mu in (1e-6, 0.0))
    found = differentiate(body, Body.static(), without, ImpactModel(law), ["contact.friction"])
    little, none = (
        resolve(body, Body.static(), c, ImpactModel(law, tolerance=1e-11)) for c in (with_friction, without)
    )
    slope = (np.array(little.impulse) - none.impulse) / 1e-6
    # The second derivative is about 30.
    np.testing.assert_allclose(found.of("impulse", "contact.friction")[:, 0], slope, rtol=0, atol=1e-4)
    assert found.smoothness[0] == SMOOTH


@pytest.mark.parametrize(("restitution", "mark"), [(1.0, JUMP), (0.9, SMOOTH)])
def test_moreau_jumps_where_the_least_slip_would_create_energy(restitution, mark):
    """A contact without slip that sticks and loses nothing: with slip to one side, COULOMB answers."""
    rod = Body.dynamic(1.0, (1.0, 0, 0, 1.0, 0, 1.0), (-1.0, -1.0, 0.0), velocity=(0.0, -1.0, 0.0))
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), restitution, friction=1.0)
    found = differentiate(rod, Body.static(), contact, ImpactModel(Law.MOREAU), ["body_a.velocity"])
    assert found.smoothness[0] == mark


def derivatives_beside_a_point_mass_at(far: float, law: Law) -> np.ndarray:
    tiny = Body.sphere(1.0, 1e-60, position=(0, 0, 1e-60), velocity=(0.1, 0, -1.0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)
    names = ["body_a.velocity", "body_a.angular_velocity", "contact.friction"]
    return differentiate(
        tiny, Body.dynamic(1.0, position=(far, 0, 0)), contact, ImpactModel(law), names
    ).jacobian


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_point_mass_has_no_lever_arm(law):
    near = derivatives_beside_a_point_mass_at(1.0, law)
    for far in (1e100, 1e150, 1e200):
        np.testing.assert_allclose(derivatives_beside_a_point_mass_at(far, law), near, rtol=1e-12)


def test_moments_of_inertia_that_are_lost_are_refused():
    """In units in which nothing overflows, the sphere would have none."""
    with refused(StatusCode.OUT_OF_RANGE, "result"):
        derivatives_beside_a_point_mass_at(1e300, Law.COULOMB)
