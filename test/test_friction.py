"""Friction as a function of the slip speed: the functions, and impacts that use them."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from refusals import refused

from collision_response import (
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    StatusCode,
    resolve,
    resolve_contact,
    resolve_scene,
)
from collision_response.derivatives import differentiate
from collision_response.in_python.coefficients_at_speed import initial_slip_speed
from collision_response.physics.friction import stribeck, tabulated

FLOOR = Body.static()
ONCE = (Law.AUTO, Law.COULOMB, Law.MOREAU)
SPHERE = [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]]


def ball(vx, vz=-1.0, spin=0.0):
    return Body.dynamic(
        1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0, 0, 1), velocity=(vx, 0, vz), angular_velocity=(0, spin, 0)
    )


def contact(friction, **more):
    return Contact.of((0, 0, 0), (0, 0, 1), restitution=0.5, friction=friction, **more)


def test_stribeck_falls_from_the_static_to_the_kinetic_coefficient():
    mu = stribeck(0.5, 0.25, 0.125)
    assert mu(0.0) == 0.5
    assert mu(0.125) == pytest.approx(0.25 + 0.25 / math.e, rel=1e-15)
    assert mu(1e3) == 0.25


def test_a_table_is_interpolated_and_may_exceed_1():
    mu = tabulated([0.5, 1.5], [2.0, 1.0])
    assert [mu(v) for v in (0.0, 0.5, 0.75, 1.5, 9.0)] == [2.0, 2.0, 1.75, 1.0, 1.0]


@pytest.mark.parametrize("law", ONCE)
@pytest.mark.parametrize("speed", [0.0, 0.25, 3.0])
def test_the_coefficient_is_evaluated_at_the_initial_slip_and_reported(law, speed):
    """The slip of this ball is v + spin, however it is divided between the two."""
    mu = stribeck(0.4, 0.1, 1.0)
    for given in (ball(speed), ball(0.0, spin=-speed), ball(2 * speed, spin=speed)):
        by_function = resolve(given, FLOOR, contact(mu), ImpactModel(law))
        assert by_function.contact.friction == mu(speed)
        assert by_function == resolve(given, FLOOR, contact(mu(speed)), ImpactModel(law))
        assert by_function.kinetic_energy_after < by_function.kinetic_energy_before


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, *ONCE])
def test_both_coefficients_may_be_functions_with_tangential_restitution(law):
    asked = contact(lambda v: 0.1 * v, tangential_restitution=0.5)._replace(restitution=lambda v: 1 / (1 + v))
    impact = resolve(ball(2.0, -1.0), FLOOR, asked, ImpactModel(law))
    used = 0.0 if law is Law.FRICTIONLESS else 0.2
    assert impact.contact == asked._replace(restitution=0.5, friction=used)


def test_compliant_refuses_it_by_name():
    reason = "COMPLIANT takes no friction that depends on slip speed"
    with refused(StatusCode.INVALID_MODEL, "contact.friction", reason):
        resolve(ball(1.0), FLOOR, contact(stribeck(0.4, 0.1, 1.0)), ImpactModel(Law.COMPLIANT))


@pytest.mark.parametrize(
    ("value", "code"),
    [
        (-0.1, StatusCode.INVALID_COEFFICIENT),
        (math.nan, StatusCode.NOT_FINITE),
        (math.inf, StatusCode.NOT_FINITE),
    ],
)
def test_a_function_with_an_invalid_value_is_refused(value, code):
    with refused(code, "contact.friction(slip_speed)"):
        resolve(ball(1.0), FLOOR, contact(lambda v: value))
    with refused(code, "friction(slip_speed)"):
        resolve_contact(SPHERE, (1, 0, -1), (0, 0, 1), 0.5, lambda v: value)
    with pytest.raises(TypeError):
        resolve(ball(1.0), FLOOR, contact(lambda v: "much"))


def test_an_invalid_request_is_refused_before_the_function_is_called():
    with refused(StatusCode.NOT_FINITE, "body_a.velocity"):
        resolve(ball(math.nan), FLOOR, contact(pytest.fail))


@pytest.mark.parametrize("scale", [2.0**-300, 1.0, 2.0**300])
@pytest.mark.parametrize("length", [2.0**-200, 3.0, 2.0**200])
def test_the_slip_speed_is_right_to_rounding_where_it_cancels(scale, length):
    """v and w r are equal up to their last bits; the normal is not of unit length."""
    v, w = scale * (1 + 2.0**-50), scale
    spinning = Body.dynamic(
        1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0, 0, 1), velocity=(v, 0, -scale), angular_velocity=(0, w, 0)
    )
    assert initial_slip_speed(spinning, FLOOR, Contact.of((0, 0, 0), (0, 0, length))) == scale * 2.0**-50


@pytest.mark.parametrize("aside", [0.0, 1e-9, 1e-25, 2.0])
@pytest.mark.parametrize("n", [(1.0, 0.7, 0.0), (0.1, -0.2, 1.0), (3e-9, 1.0, 7.0), (0.0, 0.0, 0.3)])
def test_the_slip_speed_has_no_part_of_the_approach(n, aside):
    """The velocity is along the normal but for its last digits, and a little aside."""
    v = tuple(-3.0 * n_i + aside * a for n_i, a in zip(n, (0.6, 0.3, -0.1), strict=True))
    slip = initial_slip_speed(Body.dynamic(1.0, velocity=v), FLOOR, Contact.of((0, 0, 0), n))
    across = exact_cross(n, v)
    # Rounded in the three components, their root of squares and the quotient of lengths.
    expected = math.sqrt(sum(x * x for x in across) / sum(Fraction(n_i) ** 2 for n_i in n))
    assert slip == pytest.approx(expected, rel=8 * 2**-53, abs=0.0)


@pytest.mark.parametrize("length", [1e-300, 1e-120, 1e120, 1e300])
def test_the_slip_speed_does_not_depend_on_the_length_of_the_normal(length):
    """Products with normals this long or short leave float64. Both bodies move: the slip is (3, 4) m/s."""
    body_a = Body.dynamic(1.0, velocity=(2.0, 3.0, -1.0))
    body_b = Body.kinematic(velocity=(-1.0, -1.0, 0.0))
    speed = initial_slip_speed(body_a, body_b, Contact.of((0, 0, 0), (0, 0, length)))
    assert speed == 5.0


def exact_cross(a, b):
    (a_x, a_y, a_z), (b_x, b_y, b_z) = (map(Fraction, v) for v in (a, b))
    return a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x


@pytest.mark.parametrize("large", [10**400, Fraction(10) ** 400, math.inf])
def test_a_normal_beyond_float64_is_refused(large):
    with refused(StatusCode.NOT_FINITE, "contact.normal"):
        resolve(ball(1.0), FLOOR, contact(pytest.fail)._replace(normal=(0, 0, large)))


def test_a_slip_speed_beyond_float64_is_refused():
    fast = Body.dynamic(1.0, velocity=(1.7e308, 1.7e308, -1.0))
    for law in (Law.COULOMB, Law.ROUTH_STRONGE):
        with refused(StatusCode.OUT_OF_RANGE):
            resolve(fast, FLOOR, contact(lambda v: 0.5), ImpactModel(law))


def test_the_slip_speed_of_rotated_offset_and_articulated_bodies():
    """The twist is that of the reference point, so neither orientation nor centre of mass matters."""
    q = (0, 0, Fraction(1, 2), 1)
    body = Body.dynamic(1.0, (1, 0, 0, 2, 0, 3), (0, 0, 0), q, (3, 4, -1), (0, 0, 2), com=(0.5, 0.25, 0.125))
    assert initial_slip_speed(body, FLOOR, Contact.of((0, 0, -1), (0, 0, 1))) == 5.0
    arm = Body.articulated(
        [[float(i == j) for j in range(6)] for i in range(6)], (0, 0, 1), (3, 4, -1), (0, 0, 9)
    )
    assert initial_slip_speed(FLOOR, arm, Contact.of((0, 0, 0), (0, 0, -2))) == 5.0


def test_resolve_contact_accepts_functions():
    mu = stribeck(0.4, 0.1, 1.0)
    assert resolve_contact(SPHERE, (0.6, 0.8, -1), (0, 0, 1), 0.5, mu) == resolve_contact(
        SPHERE, (0.6, 0.8, -1), (0, 0, 1), 0.5, mu(1.0)
    )


@pytest.mark.parametrize("law", ONCE)
def test_in_a_scene_each_contact_has_its_own_slip(law):
    """A bar on two feet turns about one of them: one foot slips, the other does not."""
    bar = Body.dynamic(
        1.0, (0.1, 0, 0, 0.1, 0, 0.1), (0, 0, 0), velocity=(0, 1.0, -1.0), angular_velocity=(0, 0, 1.0)
    )
    mu = stribeck(0.5, 0.125, 0.5)
    feet = [contact(mu)._replace(position=(x, 0.0, 0.0)) for x in (-1.0, 1.0)]
    found = resolve_scene([bar, FLOOR], [(0, 1)] * 2, feet, ImpactModel(law))
    assert [contact.friction for contact in found.contacts] == [0.5, mu(2.0)]
    numbers = [foot._replace(friction=x) for foot, x in zip(feet, (0.5, mu(2.0)), strict=True)]
    assert found == resolve_scene([bar, FLOOR], [(0, 1)] * 2, numbers, ImpactModel(law))
    assert found.kinetic_energy_after < found.kinetic_energy_before


def test_frictionless_clusters_ignore_the_function_and_path_laws_refuse_it():
    feet = [contact(stribeck(0.5, 0.125, 0.5))._replace(position=(x, 0.0, 0.0)) for x in (-1.0, 1.0)]
    scene = [ball(1.0), FLOOR], [(0, 1)] * 2
    smooth = resolve_scene(*scene, feet, ImpactModel(Law.FRICTIONLESS))
    assert [contact.friction for contact in smooth.contacts] == [0.0, 0.0]
    exact = [ball(Fraction(1)), FLOOR], [(0, 1)] * 2
    assert resolve_scene(*exact, feet, ImpactModel(Law.FRICTIONLESS)).contacts[0].friction == 0
    with pytest.raises(ImpactError, match="ROUTH_STRONGE takes no friction of several contacts") as error:
        resolve_scene(*scene, feet, ImpactModel(Law.ROUTH_STRONGE))
    assert error.value.field == "contacts[0].friction"
    feet[1] = contact(lambda v: -1.0)._replace(position=(1.0, 0.0, 0.0))
    with pytest.raises(ImpactError) as error:
        resolve_scene(*scene, feet)
    assert error.value.field == "contacts[1].friction(slip_speed)"


def test_friction_that_rises_with_speed_may_turn_sticking_into_sliding():
    slow = resolve(ball(0.1), FLOOR, contact(lambda v: 1 - min(v, 1)))
    fast = resolve(ball(0.9), FLOOR, contact(lambda v: 1 - min(v, 1)))
    assert (slow.regime, fast.regime) == (Regime.STICKING, Regime.SLIDING)


def test_derivatives_need_a_number():
    with pytest.raises(ImpactError) as error:
        differentiate(ball(1.0), FLOOR, contact(stribeck(0.4, 0.1, 1.0)))
    assert error.value.field == "contact.friction"
