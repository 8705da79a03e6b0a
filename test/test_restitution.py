"""Speed-dependent restitution: against the equations of motion behind it, and in use."""

from __future__ import annotations

import math
import sys
from fractions import Fraction

import pytest

pytest.importorskip("mpmath")

from collisions import EVERY_LAW
from hypothesis import example, given
from hypothesis import strategies as st
from integrate import integrate_until
from mpmath import mp

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Precision,
    StatusCode,
    resolve,
)
from collision_response.physics import friction
from collision_response.physics.restitution import johnson, plastic, power_law, tabulated, viscoelastic

DROP = Body.dynamic(1.0, velocity=(0.0, 0.0, -2.0))
FLOOR = Body.static()


def contact_with(restitution):
    return Contact.of((0, 0, 0), normal=(0, 0, 1), restitution=restitution)


@pytest.mark.parametrize("damping", [1e-3, 1e-2, 0.1, 0.5, 1.0, 3.0])
def test_viscoelastic_is_the_rebound_of_the_damped_hertz_contact(damping):
    """In scaled units the equation of motion is ``x'' = -x^1.5 - damping x^0.5 x'``, with v = 1."""

    def motion(y):
        x = max(y[0], 0.0)
        return [y[1], -(x**1.5) - damping * math.sqrt(x) * y[1]]

    def pulled_apart(y):
        return -1.0 if y[1] > 0 else -(y[0] + damping * y[1])

    _, end, _ = integrate_until(motion, [0.0, 1.0], [pulled_apart], tolerance=1e-9)
    # the approximation promises 0.01
    assert viscoelastic(damping)(1.0) == pytest.approx(-end[1], abs=0.01)


def test_plastic_is_elastic_up_to_the_yield_speed_and_then_approaches_johnson():
    law = plastic(0.5)
    assert law(0.5) == 1.0
    assert law(0.5 * (1 + 1e-9)) == pytest.approx(1.0, abs=1e-8)
    # the limit is (6 sqrt(3)/5)^(1/2) (4 * 6/5)^(-1/8) q^(1/4); its first correction is of order q
    limit = math.sqrt(6 * math.sqrt(3) / 5) * (4 * 6 / 5) ** -0.125
    assert law(0.5e8) == pytest.approx(limit * 1e-2, rel=1e-7)


def test_a_function_gives_the_coefficient_and_the_answer_reports_it():
    impact = resolve(DROP, FLOOR, contact_with(lambda speed: 1 / (1 + speed)))
    assert impact.contact.restitution == pytest.approx(1 / 3)
    assert impact.twist_a.linear.z == pytest.approx(2 / 3)


@pytest.mark.parametrize("geometry", Geometry)
@pytest.mark.parametrize("friction", [0.0, 0.3, lambda v: 0.3 / (1 + v)])
def test_the_approach_speed_includes_what_a_forced_geometry_leaves_out(geometry, friction):
    """The centre approaches at 2 m/s, the contact at 2.5: that speed decides the restitution."""
    body = Body.sphere(
        1.0, 1.0, position=(0.0, 1.0, -0.1), velocity=(0.0, -2.0, 0.0), angular_velocity=(5.0, 0.0, 0.0)
    )
    contact = Contact.of((0, 0, 0), (0, 1, 0), lambda v: 0.9 if v < 2.25 else 0.1, friction)
    impact = resolve(body, FLOOR, contact, ImpactModel(geometry=geometry, tolerance=0.5))
    exact = resolve(body, FLOOR, contact._replace(restitution=0.1))
    assert impact.contact.restitution == 0.1
    error = (impact.impulse - exact.impulse).norm()
    assert error <= impact.error_bound * exact.impulse.norm()


@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
def test_the_approach_speed_is_right_where_it_cancels(law):
    """A wheel of 2 * 10^9 m rolls on: what is left of the speed of its rim is 10^-10 of that."""
    for k in range(1, 40):
        spin, arm = -0.1 - k / 97, 1e9 + k / 3
        fall = float(Fraction(spin) * Fraction(arm)) - 0.01 * k
        exact = Fraction(spin) * Fraction(arm) - Fraction(fall)
        wheel = Body.dynamic(
            1.0, (1e18, 0, 0, 1e18, 0, 1e18), velocity=(0, 0, fall), angular_velocity=(0, spin, 0)
        )
        speeds = []
        contact = Contact.of((arm, 0, -0.5), (0, 0, 1), lambda v: speeds.append(v) or 0.5, 0.1)  # noqa: B023
        resolve(wheel, FLOOR, contact, ImpactModel(law))
        assert speeds == pytest.approx([float(exact)], rel=1e-15)


def test_a_function_answers_where_the_number_does():
    """With a restitution of 1, the impulse would exceed float64."""
    heavy = Body.dynamic(1.5e308, velocity=(0.0, 0.0, -0.9))
    assert resolve(heavy, FLOOR, contact_with(lambda v: 0.0)) == resolve(heavy, FLOOR, contact_with(0.0))


def test_the_threshold_acts_below_it_and_is_reported():
    slow = resolve(DROP, FLOOR, contact_with(0.5), ImpactModel(restitution_threshold=2.5))
    assert slow.normal_velocity_after == 0.0
    assert slow.contact.restitution == 0.0
    assert slow.adjustments == Adjustment.RESTITUTION_THRESHOLD
    fast = resolve(DROP, FLOOR, contact_with(0.5), ImpactModel(restitution_threshold=2.0))
    assert fast.normal_velocity_after == 1.0
    assert fast.adjustments == Adjustment.NONE


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
def test_an_approach_at_the_threshold_is_decided_exactly(law, friction):
    """Also one unit in the last place next to it. The slip of this box turns all the time, so more digits
    would not make its path exact.
    """
    pytest.importorskip("flint")  # the bound needs its digits
    box = Body.box(2.0, (1.0, 0.5, 2.0), position=(0.5, 0.25, 1.0), velocity=(1.0, -2.0, -3.0))
    for threshold in (3.0, math.nextafter(3.0, 0), math.nextafter(3.0, 4)):
        e = 0.5 if threshold <= 3.0 else 0.0
        for precision in (Precision.AUTO, Precision.EXTENDED):
            model = ImpactModel(law, precision=precision, restitution_threshold=threshold)
            contact = Contact.of((0, 0, 0), (0, 0, 2), 0.5, friction)
            impact = resolve(box, FLOOR, contact, model)
            decided = contact._replace(restitution=e), model._replace(restitution_threshold=0.0)
            plain = resolve(box, FLOOR, *decided)
            assert (impact.status, impact.contact.restitution) == (StatusCode.OK, e)
            assert (impact.model.law, impact.model.restitution_threshold) == (plain.model.law, threshold)
            acted = Adjustment.NONE if e else Adjustment.RESTITUTION_THRESHOLD
            assert impact.adjustments == plain.adjustments | acted
            assert impact.error_bound < 1e-9
            assert impact.impulse == pytest.approx(plain.impulse, rel=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("power", [-3, 0, 7])
@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
def test_an_approach_at_the_threshold_is_decided_also_if_its_terms_are_no_floats(law, power, friction):
    """Of the spin of this rod, (4, -1, -1)/9 acts: only fractions show that its contact approaches at 3.5."""
    two = 2.0**power
    inertia = (24.0, -6.0, -6.0, 15.0, -12.0, 15.0)
    velocity, spin = (-two, two, 3 * two), (two, two, two)
    rod = Body.dynamic(0.0625, inertia, (-1.5, -0.25, 0.0), None, velocity, spin)
    wall = Body.kinematic((2.0, -0.25, 0.0), (-1.5 * two, 0.0, 0.0))
    for threshold in (3.5, math.nextafter(3.5, 0), math.nextafter(3.5, 4)):
        e = 0.5 if threshold <= 3.5 else 0.0
        contact = Contact.of((2.0, 0.0, 0.5), (0, 0, 1), 0.5, friction)
        exact = resolve(wall, rod, contact._replace(restitution=e), ImpactModel(law))
        for precision in (Precision.DOUBLE, Precision.AUTO, Precision.EXTENDED):
            model = ImpactModel(law, precision=precision, restitution_threshold=threshold * two)
            impact = resolve(wall, rod, contact, model)
            away = (impact.impulse - exact.impulse).norm() / exact.impulse.norm()
            assert away <= impact.error_bound + exact.error_bound
            if precision is not Precision.DOUBLE:
                assert impact.contact.restitution == e
                assert impact.error_bound < 1e-9


EXTREME = {
    "an approach": (Body.dynamic(1.0, velocity=(0, 0, -1e308)), FLOOR, (0, 0, 1)),
    "a kinematic body": (DROP, Body.kinematic(velocity=(0, 0, 1e308)), (0, 0, 1)),
    "a light body": (
        Body.dynamic(1.0, velocity=(0.75, 0, -1)),
        Body.dynamic(1e-30, velocity=(-1e308, 0, -3)),
        (0, -0.75, -0.5),
    ),
    "slip": (DROP, Body.kinematic(velocity=(1e308, 0, 0)), (1e-3, 0, 1)),
    "a lever": (Body.sphere(1.0, 1.0, position=(0, 0, 1e308), angular_velocity=(3, 0, 0)), FLOOR, (0, 1, 1)),
}


@pytest.mark.parametrize("case", EXTREME)
@pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)
def test_a_threshold_far_below_the_speed_changes_nothing(law, case):
    """Neither an answer nor a refusal, at the end of the range of numbers."""
    body_a, body_b, normal = EXTREME[case]
    contact = Contact.of((0, 0, 0), normal, 0.5, 0.25)

    def what(threshold):
        try:
            impact = resolve(body_a, body_b, contact, ImpactModel(law, restitution_threshold=threshold))
        except ImpactError as error:
            return error.code, error.field
        return impact.status, impact.impulse

    assert what(0.5) == what(0.0)


ANY = st.floats(5e-324, sys.float_info.max)
EXPONENT = st.sampled_from([0.25, 1.0]) | st.floats(0, sys.float_info.max)


@given(value=st.floats(5e-324, 1), speed=ANY, v=ANY, exponent=EXPONENT)
@example(5e-324, 2.2e-311, 5e-324, 0.25)  # value and result are subnormal
@example(5e-324, 1e300, 1e-8, 1.0)  # the factor overflows, the result does not
@example(0.8, 1.0, 10.0, 1e308)  # the logarithm of the factor overflows
def test_a_power_law_does_not_overflow(value, speed, v, exponent):
    """Against 60 digits. The rounded logarithms are at most 745 each."""
    e = power_law(value, speed, exponent)(v)
    with mp.workdps(60):
        exact = min(mp.mpf(1), value * (mp.mpf(v) / speed) ** -mp.mpf(exponent))
        assert abs(e - exact) <= exact * 1e-12 + 5e-324
    assert 0 <= e <= 1


@pytest.mark.parametrize("exponent", [1e-320, 1e-6, 5e-4, 0.25, 1.0, 1e4, 1e300])
@pytest.mark.parametrize("speed", [5e-324, 1e-320, 1e-300, 1.0, 1e308])
@pytest.mark.parametrize("value", [5e-324, 1e-310, 0.5, 0.9, 1.0])
def test_a_power_law_has_its_value_at_its_speed(value, speed, exponent):
    e = power_law(value, speed, exponent)
    assert e(speed) == value
    assert e(0.0) == 1.0


@given(
    law=st.sampled_from([plastic, johnson, viscoelastic, lambda x: power_law(0.9, x, 0.25)]),
    constant=ANY,
    v=st.just(0.0) | ANY,
    ulps=st.integers(-50, 50),
)
def test_laws_stay_between_0_and_1_and_decrease(law, constant, v, ulps):
    """At any speed, and near the speed at which they begin to fall from 1."""
    e = law(constant)
    near = constant
    for _ in range(abs(ulps)):
        near = math.nextafter(near, math.copysign(math.inf, ulps))
    for speed in (v, min(max(near, 0.0), sys.float_info.max)):
        assert 0 <= e(speed) <= 1
        if speed < 1e300:
            assert e(speed * 2) <= e(speed) * (1 + 1e-12)


@pytest.mark.parametrize("yield_speed", [0.02, 0.1, 0.3, 1.0, 7.0])
def test_an_impact_just_above_the_yield_speed_is_answered(yield_speed):
    v = yield_speed
    for _ in range(300):
        v = math.nextafter(v, math.inf)
        impact = resolve(Body.dynamic(1.0, velocity=(0, 0, -v)), FLOOR, contact_with(plastic(yield_speed)))
        assert impact.contact.restitution == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("speed", [1e-300, 1.0])
def test_plastic_and_johnson_do_not_underflow(speed):
    """``q^(1/4)`` is a float even where ``q`` underflows."""
    v = sys.float_info.max
    root = math.sqrt(math.sqrt(speed)) / math.sqrt(math.sqrt(v))
    limit = math.sqrt(6 * math.sqrt(3) / 5) * (24 / 5) ** -0.125
    assert plastic(speed)(v) == pytest.approx(limit * root, rel=1e-12, abs=0)
    assert johnson(speed)(v) == pytest.approx(limit * root, rel=1e-12, abs=0)


def test_viscoelastic_falls_with_the_cube_at_extreme_speeds():
    """``e s^3`` tends to ``0.501086 / 0.532178``, here ``s = 1e100``."""
    assert viscoelastic(1e200)(1.0) == pytest.approx(0.501086 / 0.532178 * 1e-300, rel=1e-12, abs=0)


@given(
    points=st.lists(st.tuples(st.floats(0, 1), ANY), min_size=1, max_size=4, unique_by=lambda p: p[1]), v=ANY
)
def test_a_table_does_not_exceed_its_values(points, v):
    values, speeds = zip(*sorted(points, key=lambda p: p[1]), strict=True)
    assert 0 <= tabulated(speeds, values)(v) <= max(values)
    most = sys.float_info.max
    assert friction.tabulated(speeds, [most] * len(speeds))(v) <= most
