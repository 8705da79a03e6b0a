"""Input of ``identify``: what is refused, by the field or the number of the impact."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction as F

import pytest

pytest.importorskip("scipy")
import numpy as np
from measured import READING, falling
from refusals import refused

from collision_response import Body, Contact, ImpactError, Law, StatusCode, Twist
from collision_response.identify import Impacts, SphereReadings, compare, identify
from collision_response.physics.vector import ZERO, Vec3


@pytest.mark.parametrize(
    ("measured", "options", "code", "field"),
    [
        (falling(), {}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(), {"kind": "contact"}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(), {"kind": "linear"}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(1.0, 2.0), {}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(-1.0, -2.0, -3.0), {}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(1.0, 2.0, 3.0, after=math.nan), {}, StatusCode.INVALID_TABLE, "impacts"),
        (falling(1.0, 2.0, 3.0), {"law": Law.AUTO}, StatusCode.INVALID_MODEL, "law"),
        (falling(1.0, 2.0, 3.0), {"fit": ["bounce"]}, StatusCode.INVALID_MODEL, "fit"),
        (falling(1.0, 2.0, 3.0), {"kind": "spin"}, StatusCode.INVALID_MODEL, "kind"),
        (falling(1.0, 2.0, 3.0), {"loss": "least"}, StatusCode.INVALID_MODEL, "loss"),
        (
            falling(1.0, 2.0, 3.0),
            {"given": {"friction": -1.0}},
            StatusCode.INVALID_COEFFICIENT,
            "given.friction",
        ),
        (falling(1.0, 2.0, 3.0), {"fit": ["friction"] * 2}, StatusCode.INVALID_MODEL, "fit"),
        (
            falling(1.0, 2.0, 3.0),
            {"fit": ["friction"], "given": {"friction": 0.1}},
            StatusCode.INVALID_MODEL,
            "given",
        ),
        (
            falling(1.0, 2.0, 3.0),
            {"law": Law.FRICTIONLESS, "given": {"restitution": 0.5}},
            StatusCode.INVALID_MODEL,
            "fit",
        ),
        (falling(1.0, 2.0, 3.0), {"resamples": 1}, StatusCode.INVALID_MODEL, "resamples"),
    ],
)
def test_invalid_requests_are_refused_by_name(measured, options, code, field):
    with refused(code, field):
        identify(measured, **options)


def test_a_comparison_of_no_laws_is_refused_by_name():
    with refused(StatusCode.INVALID_MODEL, "laws"):
        compare(falling(1.0, 2.0, 3.0), [])
    with refused(StatusCode.INVALID_MODEL, "fit"):  # no law has a coefficient left
        compare(falling(1.0, 2.0, 3.0), given={"restitution": 0.5, "friction": 0.1})


@pytest.mark.parametrize("count", [2.5, "3", None, math.nan])
def test_resamples_must_be_an_integer(count):
    with pytest.raises(TypeError, match=r"^resamples: must be a whole number, is "):
        identify(falling(1.0, 2.0, 3.0), Law.FRICTIONLESS, resamples=count)


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("restitution", 0.0, 1.0),
        ("friction", 0.0, 1e300),
        ("tangential_restitution", -1.0, 1.0),
        ("stiffness_ratio", 1e-6, 1e6),
    ],
)
def test_a_coefficient_may_be_given_in_the_whole_range_of_the_model(name, least, most):
    """Also where a fit would not search for it."""
    measured = falling(1.0, 2.0, 3.0, 4.0)
    for value in (least, most):
        fit = ["friction" if name == "restitution" else "restitution"]
        assert identify(measured, fit=fit, given={name: value}, resamples=2).values[name] == value
    for value in (math.nextafter(least, -math.inf), math.nextafter(most, math.inf) if most < 1e300 else -1.0):
        with refused(StatusCode.INVALID_COEFFICIENT, f"given.{name}"):
            identify(measured, given={name: value}, resamples=2)


@pytest.mark.parametrize("side", ["a", "b"])
@pytest.mark.parametrize("part", ["linear", "angular"])
@pytest.mark.parametrize("infinite", [math.inf, -math.inf])
def test_infinite_measurements_are_refused_by_their_field(side, part, infinite):
    """For a movable body; those of an immovable body are ignored."""
    ball, other = Body.sphere(1.0, 0.1), Body.sphere(1.0, 0.1)
    still, touch = Vec3(0.0, 0.0, 0.0), Contact.of((0, 0, 0), (0, 0, 1))
    wrong = Twist(still, still)._replace(**{part: Vec3(0.0, infinite, math.nan)})
    twists = {"a": (wrong, Twist(still, still)), "b": (Twist(still, still), wrong)}[side]
    with refused(StatusCode.NOT_FINITE, f"impacts[0].after_{side}.{part}"):
        Impacts.of([ball], [other], [touch], *([twist] for twist in twists))
    immovable = {"a": (Body.static(), ball), "b": (ball, Body.static())}[side]
    measured = Impacts.of(*([body] for body in immovable), [touch], *([twist] for twist in twists))
    assert np.isfinite(measured.after).all()


SPHERE = {"speed": 3.9, "radius": 0.0025, "tables": {"ratio": [(40, 0.8), (50, 0.85)]}, "errors": READING}


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        *(({name: x}, name) for name in ("speed", "radius") for x in (0.0, -1.0, math.nan, math.inf)),
        *(({"gyration": x}, "gyration") for x in (0.0, -0.4, 0.67, math.nan, math.inf)),
        *(({"errors": {"ratio": x}}, "errors['ratio']") for x in (0.0, -1.0, math.nan, math.inf)),
        ({"errors": {}}, "errors['ratio']"),
        ({"errors": {"ratio": 1.0, "speed": 1.0}}, "errors"),
        ({"errors": {"angle": 1.0}}, "errors['ratio']"),
        ({"tables": {}}, "tables"),
        ({"tables": {"ratio": []}}, "tables"),
        ({"tables": {"bounce": [(40, 0.8)]}}, "tables"),
        *(({"tables": {"spin": [(40, 1.0), (x, 1.0)]}}, "tables['spin'][1]") for x in (math.nan, math.inf)),
        *(({"tables": {"angle": [(40, 1.0), (40, x)]}}, "tables['angle'][1]") for x in (math.nan, -math.inf)),
        ({"tables": {"ratio": [(40, 1.0), (0, 1.0)]}}, "tables['ratio'][1]"),
    ],
)
def test_readings_out_of_range_are_refused_by_name(wrong, field):
    with pytest.raises(ImpactError) as refusal:
        SphereReadings(**(SPHERE | wrong))
    assert refusal.value.field == field
    assert refusal.value.code in (StatusCode.INVALID_TABLE, StatusCode.NOT_FINITE)


@pytest.mark.parametrize("wrong", [None, "x", 1.0, True, [1.0], {1.0: None}, np.array(1.0)], ids=repr)
@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda x: {"speed": str(x)}, "speed"),
        (lambda x: {"gyration": [x]}, "gyration"),
        (lambda x: {"tables": [x]}, "tables"),
        (lambda x: {"tables": {"ratio": [x]}}, r"tables\['ratio'\]\[0\]"),
        (lambda x: {"tables": {"ratio": [(30, 0.5), ("1", x)]}}, r"tables\['ratio'\]\[1\]"),
        (lambda x: {"errors": [x]}, "errors"),
        (lambda x: {"errors": {"ratio": [x]}}, r"errors\['ratio'\]"),
    ],
)
def test_readings_of_the_wrong_type_are_refused_by_name(make, field, wrong):
    with pytest.raises(TypeError, match=f"^{field}: must be "):
        SphereReadings(**(SPHERE | make(wrong)))


REQUESTS = {
    "bodies_a": [Body.dynamic(1.0, velocity=(0.0, 0.0, -v)) for v in (1.0, 2.0, 3.0)],
    "bodies_b": [Body.static()] * 3,
    "contacts": [Contact.of((0, 0, 0), (0, 0, 1))] * 3,
    "after_a": [Twist(Vec3(0.0, 0.0, v / 2), ZERO) for v in (1.0, 2.0, 3.0)],
    "after_b": [Twist(ZERO, ZERO)] * 3,
}


@pytest.mark.parametrize("name", REQUESTS)
def test_sequences_of_impacts_may_be_generators_of_one_length(name):
    found, expected = Impacts.of(**{key: iter(one) for key, one in REQUESTS.items()}), Impacts.of(**REQUESTS)
    assert np.array_equal(found.bodies, expected.bodies) and len(found) == 3
    with pytest.raises(ValueError, match=r"^bodies_a, .*: must be of one length; have \[[23, ]+\]$"):
        Impacts.of(**REQUESTS | {name: REQUESTS[name][:2]})
    with pytest.raises(TypeError, match=f"^{name}: must be a sequence, is None"):
        Impacts.of(**REQUESTS | {name: None})


def test_one_name_is_no_sequence_of_names():
    with pytest.raises(TypeError, match=r"^fit: must be a sequence, is 'restitution'"):
        identify(Impacts.of(**REQUESTS), Law.FRICTIONLESS, fit="restitution")


@pytest.mark.parametrize("fit", [identify, compare])
@pytest.mark.parametrize("wrong", [1.5, True, 10**5000], ids=["1.5", "True", "huge"])
@pytest.mark.parametrize("name", ["measured", "fit", "given"])
def test_arguments_of_the_wrong_type_are_refused_by_name(fit, wrong, name):
    with pytest.raises(TypeError, match=f"^{name}: must be "):
        fit(**{"measured": falling(1.0, 2.0, 3.0), name: wrong})


def test_generators_of_names_and_laws_are_compared_as_lists_are():
    laws, fit = [Law.COULOMB, Law.ROUTH_STRONGE], ["restitution"]
    found, expected = (compare(falling(1.0, 2.0, 3.0), x(laws), x(fit), resamples=2) for x in (iter, list))
    assert str(found) == str(expected)


def test_a_name_of_the_wrong_type_is_refused_by_code():
    for name, value in (("loss", ["linear"]), ("fit", [["friction"]]), ("loss", 10**5000)):
        with refused(StatusCode.INVALID_MODEL, name):
            identify(falling(1.0, 2.0, 3.0), **{name: value})


@pytest.mark.parametrize("side", ["body_a", "body_b"])
def test_articulated_bodies_are_refused(side):
    link = Body.articulated([[float(i == j) for j in range(6)] for i in range(6)], velocity=(0, 0, -1))
    ball, touch = Body.dynamic(1.0), Contact.of((0, 0, 0), (0, 0, 1))
    still = Twist(ball.velocity, ball.angular_velocity)
    pair = {"body_a": (link, ball), "body_b": (ball, link)}[side]
    with refused(StatusCode.INVALID_INERTIA, f"impacts[0].{side}.inverse_inertia"):
        Impacts.of([pair[0]], [pair[1]], [touch], [still], [still])


@pytest.mark.parametrize("other", [None, (1.0, 2.0), "ball", np.ones(3)])
@pytest.mark.parametrize("argument", ["body_a", "body_b", "contact", "after_a", "after_b"])
def test_other_types_are_refused_by_name(argument, other):
    ball = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
    still = Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    given = {
        "body_a": ball,
        "body_b": Body.static(),
        "contact": Contact.of((0, 0, 0), (0, 0, 1)),
        "after_a": still,
        "after_b": still,
    }
    first, second = given.values(), (given | {argument: other}).values()
    with pytest.raises(TypeError, match=rf"^impacts\[1\]\.{argument}: must be a (Body|Contact|Twist), is "):
        Impacts.of(*zip(first, second, strict=True))


@pytest.mark.parametrize(
    "wrong",
    [None, "x", True, 1j, [1.0], np.array(True), np.timedelta64(1, "s"), np.ones(2), Decimal("sNaN")],
    ids=repr,
)
@pytest.mark.parametrize(
    ("argument", "field"),
    [
        ("body_a", "velocity"),
        ("body_b", "mass"),
        ("contact", "normal"),
        ("after_a", "linear"),
        ("after_b", "angular"),
    ],
)
def test_what_is_no_number_is_refused_with_the_number_of_the_impact(argument, field, wrong):
    ball = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
    still, touch = Twist(ZERO, ZERO), Contact.of((0, 0, 0), (0, 0, 1))
    given = {
        "body_a": ball,
        "body_b": Body.dynamic(1.0),
        "contact": touch,
        "after_a": still,
        "after_b": still,
    }
    part = given[argument]
    value = wrong if field == "mass" else Vec3(0.0, 0.0, wrong)
    second = given | {argument: part._replace(**{field: value})}
    with pytest.raises(TypeError, match=rf"^impacts\[1\]\.{argument}\.{field}.*: must be a real number, is "):
        Impacts.of(*zip(given.values(), second.values(), strict=True))


@pytest.mark.parametrize("nan", [math.nan, np.float32("nan"), np.longdouble("nan"), Decimal("nan")], ids=repr)
@pytest.mark.parametrize("great", [10**400, F(10) ** 400, Decimal("1e400"), np.longdouble("1e400")], ids=repr)
def test_a_measurement_beyond_float64_is_refused_and_a_missing_one_is_nan(great, nan):
    ball, touch = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0)), Contact.of((0, 0, 0), (0, 0, 1))
    found = Impacts.of([ball], [Body.static()], [touch], [Twist(Vec3(0, 0, nan), ZERO)], [Twist(ZERO, ZERO)])
    assert np.isnan(found.after).sum() == 1
    with refused(StatusCode.NOT_FINITE, "impacts[0].after_a.linear"):
        Impacts.of([ball], [Body.static()], [touch], [Twist(Vec3(0, nan, great), ZERO)], [Twist(ZERO, ZERO)])


def test_an_invalid_impact_is_refused_with_its_number():
    balls = [Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0)), Body.dynamic(-1.0)]
    twists = [Twist(Vec3(0.0, 0.0, 1.0), Vec3(0.0, 0.0, 0.0))] * 2
    with refused(StatusCode.INVALID_MASS, "impacts[1].body_a.mass"):
        Impacts.of(balls, [Body.static()] * 2, [Contact.of((0, 0, 0), (0, 0, 1))] * 2, twists, twists)


@pytest.mark.parametrize("law", [2, np.array([1, 2]), "COULOMB", None, [Law.COULOMB]], ids=repr)
def test_a_law_of_another_type_is_refused_by_name(law):
    ball, touch = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0)), Contact.of((0, 0, 0), (0, 0, 1))
    measured = Impacts.of([ball], [Body.static()], [touch], [Twist(ZERO, ZERO)], [Twist(ZERO, ZERO)])
    with refused(StatusCode.INVALID_MODEL, "law"):
        identify(measured, law)


@pytest.mark.parametrize("incidence", [91.0, -95.0])
def test_an_incidence_from_behind_the_target_is_refused(incidence):
    with refused(StatusCode.INVALID_TABLE, "tables['ratio'][1]", "the incidence must be in "):
        SphereReadings(1.0, 0.1, {"ratio": [(10.0, 0.5), (incidence, 0.5)]}, {"ratio": 0.01})
