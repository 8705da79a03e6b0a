"""Fractions in, fractions out: FRICTIONLESS is exact; other laws count the rounding to floats."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction as F

import numpy as np
import pytest
from refusals import refused

from collision_response import (
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.numbers.operations import square_root

FLOOR = Body.static()
BOX = Body.dynamic(F(1), (F(1, 6), 0, 0, F(1, 6), 0, F(1, 6)), velocity=(F(1, 3), 0, -1))
CORNER = Contact.of((F(1, 3), 0, F(-1, 2)), (0, 0, 1), F(1, 2))


def test_an_answer_to_fractions_is_exact():
    """K = 1 + (1/3)^2 6 = 5/3, so P = (1 + 1/2) 3/5."""
    impact = resolve(BOX, FLOOR, CORNER)
    assert impact.impulse == (0, 0, F(9, 10))
    assert impact.twist_a.linear == (F(1, 3), 0, F(-1, 10))
    assert impact.twist_a.angular == (0, F(-9, 5), 0)
    assert impact.kinetic_energy_before - impact.kinetic_energy_after == impact.energy_lost_restitution
    assert (impact.normal_velocity_after, impact.effective_mass) == (F(1, 2), F(3, 5))
    assert (impact.error_bound, impact.model.law) == (0, Law.FRICTIONLESS)
    assert isinstance(impact.impulse.z, F)


def test_one_fraction_makes_the_answer_exact():
    impact = resolve(
        Body.dynamic(1.0, velocity=(0.0, 0.0, F(-1, 3))), FLOOR, Contact.of((0, 0, 0), (0, 0, 1))
    )
    assert impact.twist_a.linear.z == F(1, 3)


@pytest.mark.parametrize(
    "tenth", [Decimal("0.1"), np.longdouble("0.1"), np.array(np.longdouble("0.1"))], ids=repr
)
def test_numbers_beyond_float64_stay_exact_next_to_a_fraction(tenth):
    exact = F(*tenth.item().as_integer_ratio()) if hasattr(tenth, "item") else F(tenth)
    impact = resolve(
        Body.dynamic(tenth, velocity=(0, 0, F(-1))), FLOOR, Contact.of((0, 0, 0), (0, 0, 1), tenth)
    )
    assert exact != F(float(tenth))
    assert impact.impulse.z == exact * (1 + exact)


def large_request(integer):
    """Products of these integers are beyond int64."""
    m, v = integer(3_000_000_019), integer(-3_000_000_019)
    body_a = Body.dynamic(m, velocity=(m, integer(0), v), angular_velocity=(integer(0),) * 3)
    normal = (integer(0), integer(0), integer(4_000_000_007))
    return (
        body_a,
        Body.dynamic(integer(4_000_000_007)),
        Contact.of((integer(0),) * 3, normal, F(integer(1), 2)),
    )


def test_integers_of_numpy_do_not_overflow():
    request, expected = large_request(np.int64), large_request(int)
    assert resolve(*request) == resolve(*expected)
    assert resolve(request[1], request[0], request[2]).status is StatusCode.SEPARATING
    found, scene = (resolve_scene([a, b], [(0, 1)], [contact]) for a, b, contact in (request, expected))
    assert found == scene


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
def test_integers_of_numpy_may_have_friction_that_is_a_function(law):
    model, functions = ImpactModel(law), {"friction": lambda v: 0.3, "restitution": lambda v: 0.5}
    found, expected = (
        resolve(a, b, c._replace(**functions), model) for a, b, c in map(large_request, (np.int64, int))
    )
    assert found._replace(contact=None) == expected._replace(contact=None)


NORMALS = [(0, 1, 1), (1, 0, 1), (1, 2, 3), (127, 0, 0), (100, 127, 3)]


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("integer", [np.int8, np.uint8, np.uint64, np.array])
@pytest.mark.parametrize("normal", NORMALS)
def test_friction_that_is_a_function_takes_normals_of_integers_without_a_sign(normal, integer, law):
    """Minus an unsigned 1 is 255 in NumPy."""
    body = Body.dynamic(1.0, velocity=(0.5, -1.0, -2.0))
    found, expected = (
        resolve(
            body,
            FLOOR,
            Contact.of((0, 0, 0), tuple(map(kind, normal)), 0.5, lambda v: 0.1 * v),
            ImpactModel(law),
        )
        for kind in (integer, float)
    )
    assert found._replace(contact=None) == expected._replace(contact=None)
    assert found.contact.friction == expected.contact.friction


WITH_A_LONG_DECIMAL = {
    "body": lambda x: (BOX._replace(velocity=(x, 0, -1)), CORNER, 0),
    "contact": lambda x: (BOX, Contact.of((x, 0, 0), (0, 0, 1)), 0),
    "restitution": lambda x: (BOX, CORNER._replace(restitution=x), 0),
    "friction": lambda x: (BOX, CORNER._replace(friction=x), 0),
    "threshold": lambda x: (BOX, CORNER, x),
}


@pytest.mark.parametrize("place", WITH_A_LONG_DECIMAL)
def test_a_decimal_of_too_many_places_for_a_fraction_is_refused(place):
    """Else it would take minutes: 1e-99999999 has 100 million digits."""
    for exponent, is_possible in ((-10_000, True), (-10_001, False), (-99_999_999, False)):
        body, contact, threshold = WITH_A_LONG_DECIMAL[place](Decimal(f"1e{exponent}"))
        request = [body, FLOOR, contact, ImpactModel(Law.FRICTIONLESS, restitution_threshold=threshold)]
        if is_possible:
            assert resolve(*request).error_bound == 0
            continue
        with refused(StatusCode.OUT_OF_RANGE, "decimal", "at most 10,000 places"):
            resolve(*request)
        with refused(StatusCode.OUT_OF_RANGE, "decimal", "at most 10,000 places"):
            resolve_scene([body, FLOOR], [(0, 1)], [contact], request[3])


def test_zero_and_great_decimals_may_have_any_exponent():
    for zero in ("0e-99999999", "0e99999999"):
        assert resolve(BOX, FLOOR, CORNER._replace(friction=Decimal(zero))).impulse.z == F(9, 10)
    with refused(StatusCode.NOT_FINITE, "contact.friction"):
        resolve(BOX, FLOOR, CORNER._replace(friction=Decimal("1e99999999")))


@pytest.mark.parametrize("great", [F(10) ** 400, 10**400, Decimal("1e400"), np.longdouble("1e400")], ids=repr)
@pytest.mark.parametrize("field", ["mass", "inertia", "position", "velocity", "angular_velocity", "com"])
def test_a_number_beyond_float64_is_refused_next_to_fractions(field, great):
    """By one impact, by scenes, and by friction that is a function."""
    value = getattr(BOX, field)
    body = BOX._replace(**{field: great if field == "mass" else type(value)(great, *value[1:])})
    calls = {
        "body_a": lambda: resolve(body, FLOOR, CORNER),
        "bodies[0]": lambda: resolve_scene(
            [body, FLOOR], [(0, 1)] * 2, [CORNER, CORNER._replace(position=(0, 0, 0))]
        ),
        "body_a ": lambda: resolve(
            body, FLOOR, CORNER._replace(friction=lambda v: 0.5), ImpactModel(Law.ROUTH_STRONGE)
        ),
    }
    for owner, call in calls.items():
        with refused(StatusCode.NOT_FINITE, f"{owner.strip()}.{field}"):
            call()


def test_friction_is_evaluated_at_the_slip_speed_of_fractions():
    """A tenth and two tenths, which as floats add up to more than the float for three."""
    speeds = []
    body_a, body_b = (Body.dynamic(1, velocity=(F(v, 10), 0, v)) for v in (1, -2))
    contact = Contact.of((0, 0, 0), (0, 0, -1), F(1, 2), lambda speed: speeds.append(speed) or 0.5)
    resolve(body_a, body_b, contact)
    assert set(speeds) == {0.3}


def test_the_length_of_a_normal_need_not_be_rational():
    slanted = resolve(BOX, FLOOR, CORNER._replace(normal=(0, F(3), F(4))))
    assert slanted.normal_velocity_before == F(-4, 5)
    odd = resolve(BOX, FLOOR, CORNER._replace(normal=(0, 1, 1)))
    assert abs(odd.normal_velocity_before**2 - F(1, 2)) < F(1, 2**60)
    assert isinstance(odd.impulse.y, F)


@pytest.mark.parametrize("x", [F(0), F(4, 9), F(1, 3), F(10**40, 3), F(3, 10**40), F(2**400 + 1)])
def test_roots_of_fractions(x):
    root = square_root(x)
    assert abs(root * root - x) <= x / 2**60
    assert square_root(x * x) == x


def test_an_irrational_law_counts_the_rounding():
    impact = resolve(BOX, FLOOR, CORNER._replace(friction=F(1, 3)))
    assert isinstance(impact.impulse.z, float)
    assert 0 < impact.error_bound < 1e-12


def test_invalid_fractions_are_refused_by_name():
    with refused(StatusCode.INVALID_MASS, "body_a.mass"):
        resolve(BOX._replace(mass=F(-1)), FLOOR, CORNER)


@pytest.mark.parametrize(
    "two", [2.0, 2, F(2), Decimal(2), np.float32(2), np.longdouble(2), np.int64(2), np.array(2.0)], ids=repr
)
def test_thresholds_of_every_type_apply_to_fractions(two):
    model = ImpactModel(restitution_threshold=two)
    one, scene = (
        resolve(BOX, FLOOR, CORNER, model),
        resolve_scene([BOX, FLOOR], [(0, 1)] * 2, [CORNER] * 2, model),
    )
    assert one.contact.restitution == 0
    assert one.adjustments.name == scene.adjustments.name == "RESTITUTION_THRESHOLD"
    assert scene.twists[0] == one.twist_a


def test_an_answer_beyond_float64_is_shown():
    fast = resolve(Body.dynamic(F(10) ** 300, velocity=(0, 0, -(F(10) ** 300))), FLOOR, CORNER)
    assert fast.impulse.z == 3 * F(10) ** 600 / 2
    assert "1.50000e+600" in repr(fast)
    assert "energy 5.00000e+899 -> 1.25000e+899 J" in str(fast)


def test_a_function_of_a_speed_beyond_float64_is_refused():
    speed = F(17 * 10**307)
    bodies = [Body.dynamic(F(1), velocity=(side * speed, 0, -side * speed)) for side in (1, -1)]
    for field in ("restitution", "friction"):
        with refused(StatusCode.OUT_OF_RANGE):
            resolve(*bodies, CORNER._replace(**{field: lambda v: 0.5}))
    with refused(StatusCode.OUT_OF_RANGE):
        resolve_scene(bodies, [(0, 1)] * 2, [CORNER._replace(restitution=lambda v: 0.5)] * 2)


def test_functions_apply_to_fractions():
    assert resolve(BOX, FLOOR, CORNER._replace(restitution=lambda v: v / 2)).impulse == (0, 0, F(9, 10))


def test_a_scene_of_one_contact_equals_resolve():
    one, scene = resolve(BOX, FLOOR, CORNER), resolve_scene([BOX, FLOOR], [(0, 1)], [CORNER])
    assert (scene.twists[0], scene.impulses[0]) == (one.twist_a, one.impulse)
    assert scene.decision_margin == math.inf


def test_repeated_contacts_share_the_impulse_exactly():
    turned = CORNER._replace(normal=(0, 0, -1))
    scene = resolve_scene([BOX, FLOOR], [(0, 1), (0, 1), (1, 0)], [CORNER, CORNER, turned])
    assert [impulse.z for impulse in scene.impulses] == [F(3, 10), F(3, 10), F(-3, 10)]


@pytest.mark.parametrize("power", [100, 154, 155, 200, 300])
def test_a_wall_may_move_at_any_speed(power):
    """Its kinetic energy counts as 0; that of infinite mass is not computed."""
    speed = F(10) ** power
    ball, wall = Body.dynamic(F(1), velocity=(0, 0, F(-1))), Body.kinematic(velocity=(0, 0, speed))
    impact = resolve(ball, wall, Contact.of((0, 0, 0), (0, 0, F(1)), F(1, 2)))
    assert impact.twist_a.linear.z == -1 + F(3, 2) * (1 + speed)
    assert impact.kinetic_energy_before == F(1, 2)


@pytest.mark.parametrize("law", Law)
@pytest.mark.parametrize("power", [100, 150, 154, 155, 200, 300])
def test_a_wall_of_any_speed_is_answered_in_floats_or_refused(law, power):
    ball, wall = Body.dynamic(1.0), Body.kinematic(velocity=(0.0, 0.0, 10.0**power))
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.3)
    for precision in Precision:
        try:
            impact = resolve(ball, wall, contact, ImpactModel(law, precision=precision))
        except ImpactError as error:
            assert error.code is StatusCode.OUT_OF_RANGE
            assert power > 150 or precision is Precision.SINGLE
        else:
            assert impact.twist_a.linear.z == pytest.approx(1.5 * 10.0**power, rel=1e-6)
