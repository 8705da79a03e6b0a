"""Estimating coefficients from impacts that were measured, or computed with known coefficients."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction as F
from pathlib import Path

import pytest

pytest.importorskip("scipy")

import numpy as np
from refusals import refused
from scipy.spatial.transform import Rotation

from collision_response import Body, Contact, ImpactModel, Law, StatusCode, Twist, resolve
from collision_response.identify import Impacts, SphereReadings, compare, identify
from collision_response.identify.__main__ import main
from collision_response.identify.from_table import impacts_from_rows, read_rows
from collision_response.identify.measurements import BODY, CONTACT
from collision_response.identify.plot import draw
from collision_response.physics.vector import ZERO, Vec3
from collision_response.recording import BodyRecord, Record, Recorder

SOLVED = 1e-6
"""Error of a coefficient without noise: the root of 1e-10, at which least squares stop, with a margin."""

KHARAZ = {
    "ratio": [(30.2218, 0.6883), (39.3031, 0.7719), (49.5459, 0.8469), (59.8416, 0.9019)],
    "angle": [(30.3767, 21.7809), (39.6233, 32.5455), (49.7831, 45.1051), (60.0571, 57.3652)],
    "spin": [(31.0947, 612.6481), (39.0283, 595.4843), (50.2214, 452.9444), (60.2460, 381.3185)],
}
"""Readings from 30 degrees on: Kharaz, Gorham & Salman, Powder Technology 120 (2001) 281-291."""
READING = {"ratio": 0.008, "angle": 0.84, "spin": 44.0}


def cubes(count, e, mu, seed=1, *, tilt=0.0, speed=0.0, spin=0.0, law=Law.COULOMB, **of_model):
    """Corners of a cube that strike a floor, at random velocities and orientations.

    Args:
        tilt: standard deviation of the error of the reported normals [rad].
        speed, spin: standard deviation of the noise of the reported twists [m/s, rad/s].
    """
    rng = np.random.default_rng(seed)
    before, contacts, after = [], [], []
    while len(before) < count:
        turn = Rotation.random(rng=rng)
        corners = turn.apply(np.array(np.meshgrid(*[[-0.05, 0.05]] * 3)).reshape(3, -1).T)
        r = corners[np.argmin(corners[:, 2])]
        velocity = (*rng.normal(0, 0.8, 2), -rng.uniform(0.7, 2))
        cube = Body.dynamic(
            0.37, (8.1e-4, 0, 0, 8.1e-4, 0, 8.1e-4), -r, turn.as_quat(), velocity, rng.normal(0, 3, 3)
        )
        touch = Contact.of((0.0, 0.0, 0.0), (0, 0, 1), e, mu)
        model = ImpactModel(law, **of_model)
        answer = resolve(cube, Body.static(), touch, model)
        if answer.status is not StatusCode.OK:
            continue

        def noisy(vector, sigma):
            return Vec3(*np.add(vector, rng.normal(0, sigma, 3)).tolist())

        before.append(
            cube._replace(
                velocity=noisy(cube.velocity, speed), angular_velocity=noisy(cube.angular_velocity, spin)
            )
        )
        contacts.append(touch._replace(normal=Vec3(*rng.normal(0, tilt, 2).tolist(), 1.0)))
        after.append(Twist(noisy(answer.twist_a.linear, speed), noisy(answer.twist_a.angular, spin)))
    return Impacts.of(before, [Body.static()] * count, contacts, after, after)


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
def test_coefficients_are_recovered_from_clean_data(law):
    found = identify(cubes(20, 0.6, 0.15, law=law), law, resamples=2)
    assert found.values["restitution"] == pytest.approx(0.6, abs=SOLVED)
    assert found.values["friction"] == pytest.approx(0.15, abs=SOLVED)
    assert found.misfit < SOLVED


@pytest.mark.parametrize(
    ("law", "e"),
    [(Law.COULOMB, 0.0), (Law.MOREAU, 0.95), (Law.ROUTH_POISSON, 0.95), (Law.ROUTH_STRONGE, 0.5)],
)
def test_coefficients_are_found_where_most_impacts_stick(law, e):
    """Where all impacts stick, friction has no effect, and a search that starts there stays there."""
    found = identify(cubes(12, e, 0.8, seed=2, law=law), law, resamples=2)
    assert [*found.values.values()] == pytest.approx([e, 0.8], abs=SOLVED)
    assert found.misfit < SOLVED


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy", "arctan"])
@pytest.mark.parametrize("wrong", [3.0, 30.0, 1e3])
def test_one_outlier_hides_no_coefficient(wrong, loss):
    """It must not inflate the estimated noise of the other readings either."""
    measured = cubes(30, 0.6, 0.15, speed=0.01)
    sound = identify(measured, loss=loss, resamples=40)
    measured.after[:3, 0, 3] = wrong
    found = identify(measured, loss=loss, resamples=40)
    for name, right in (("restitution", 0.6), ("friction", 0.15)):
        value, low, high, formal = found.coefficients[name]
        assert low < right < high
        assert abs(value - sound.values[name]) < 3 * sound.coefficients[name].formal
        assert formal < 8 * sound.coefficients[name].formal  # the outlier would otherwise inflate the scale


def test_tangential_restitution_is_found_where_friction_is_known():
    measured = cubes(20, 0.6, 5.0, tangential_restitution=0.3)
    names = ("restitution", "tangential_restitution")
    found = identify(measured, Law.COULOMB, names, {"friction": 5.0}, resamples=2)
    assert found.values["tangential_restitution"] == pytest.approx(0.3, abs=SOLVED)


SPRINGS = ("restitution", "friction", "stiffness_ratio")


@pytest.mark.parametrize(("e", "mu", "kappa"), [(0.6, 0.15, 1.0), (0.9, 0.4, 2.5), (1.0, 0.4, 0.7)])
def test_the_stiffness_ratio_of_compliant_is_found(e, mu, kappa):
    measured = cubes(8, e, mu, law=Law.COMPLIANT, stiffness_ratio=kappa)
    found = identify(measured, Law.COMPLIANT, SPRINGS, resamples=2)
    assert [found.values[name] for name in SPRINGS] == pytest.approx([e, mu, kappa], abs=SOLVED)
    assert found.misfit < SOLVED


def test_intervals_for_compliant_contain_the_true_values():
    """Four sets of 20 noisy impacts. With 95 % intervals, one such test in seventy would miss twice."""
    holds = dict.fromkeys(SPRINGS, 0)
    for seed in range(4):
        measured = cubes(20, 0.5, 0.5, seed, speed=0.01, spin=0.1, law=Law.COMPLIANT, stiffness_ratio=0.8)
        found = identify(measured, Law.COMPLIANT, SPRINGS, loss="linear", resamples=20, seed=seed)
        for name, true in zip(SPRINGS, (0.5, 0.5, 0.8), strict=True):
            low, high = found.coefficients[name][1:3]
            holds[name] += low <= true <= high
    assert min(holds.values()) >= 3, holds


def test_noisy_normals_mislead_the_formal_interval_but_not_the_bootstrap():
    """Friction is 0.2, and normals are off by 2 degrees. Count how many intervals contain 0.2, for 20 sets of
    60 impacts.
    """
    holds = {"formal": 0, "bootstrap": 0}
    for seed in range(20):
        measured = cubes(60, 0.5, 0.2, seed, tilt=math.radians(2), speed=0.01, spin=0.1)
        mu = identify(measured, loss="linear", resamples=40, seed=seed).coefficients["friction"]
        holds["formal"] += abs(mu.value - 0.2) <= 1.96 * mu.formal
        holds["bootstrap"] += mu.low <= 0.2 <= mu.high
    assert holds["formal"] < 16 <= holds["bootstrap"], holds


def test_sticking_impacts_only_bound_friction_from_below():
    measured = cubes(30, 0.5, 20.0, speed=0.001, spin=0.01)
    mu = identify(measured, resamples=20).coefficients["friction"]
    assert math.isnan(mu.value) and mu.high == math.inf
    twists = measured.predict(Law.COULOMB, {"restitution": 0.5, "friction": 1e3})
    impulses = 0.37 * (twists[:3, 0] - measured.bodies[BODY.velocity, 0])
    steepest = (np.hypot(*impulses[:2]) / impulses[2]).max()
    assert mu.low == pytest.approx(steepest, rel=0.05)  # noise moves a twist by 1e-3
    assert "friction >= " in str(identify(measured, resamples=2))


def test_a_coefficient_without_effect_is_not_determined():
    """All impacts slide, so the tangential restitution has no effect."""
    found = identify(
        cubes(20, 0.5, 0.001),
        fit=("restitution", "tangential_restitution"),
        given={"friction": 0.001},
        resamples=2,
    )
    assert math.isnan(found.coefficients["tangential_restitution"].value)
    assert found.values["restitution"] == pytest.approx(0.5, abs=SOLVED)


@pytest.mark.parametrize("quantity", ["ratio", "spin"])
def test_one_table_of_a_sliding_sphere_determines_a_product_only(quantity):
    """v_t+ = v_t - mu (1 + e) v_n and w+ = 5/2 mu (1 + e) v_n / R: e occurs only in that product."""
    table = KHARAZ[quantity][1:]  # the first sticks by COULOMB
    readings = SphereReadings(3.9, 0.0025, {quantity: table}, READING)
    found = identify(readings, resamples=2, loss="linear")
    assert all(math.isnan(one.value) for one in found.coefficients.values())
    angles = np.radians([angle for angle, _ in table])
    read = np.array([reading for _, reading in table])
    if quantity == "ratio":  # 1 - product / tan
        slope, offset = -1 / np.tan(angles), 1.0
    else:
        slope, offset = 2.5 * 3.9 * np.cos(angles) / 0.0025, 0.0
    by_hand = (slope * (read - offset)).sum() / (slope * slope).sum()
    assert found.combination.value == pytest.approx(by_hand, rel=1e-5)


def test_the_interval_of_a_product_may_reach_to_infinity():
    """Resamples of only the reading at 90 degrees approach at 1e-16 m/s: any friction fits."""
    readings = SphereReadings(
        3.0, 0.01, {"ratio": [(90, 0.5), (20, 0.6), (30, 0.7), (45, 0.8)]}, {"ratio": 0.01}
    )
    found = identify(readings)
    assert found.combination is not None
    assert found.combination.low <= found.combination.value < found.combination.high == math.inf


def test_three_tables_of_a_sliding_sphere_determine_both_coefficients():
    found = identify(SphereReadings(3.9, 0.0025, KHARAZ, READING), resamples=2, loss="linear")
    assert found.values["friction"] == pytest.approx(0.0926, abs=5e-4)
    assert found.values["restitution"] == pytest.approx(1.0, abs=SOLVED)  # at its limit
    assert any("limit" in note for note in found.notes)


def test_laws_that_agree_cannot_be_told_apart_but_others_can():
    """For central impacts of point masses, COULOMB and ROUTH_STRONGE agree, and FRICTIONLESS does not."""
    balls = [Body.dynamic(1.0, velocity=(vx, 0.0, -1.0)) for vx in np.linspace(0.5, 3.0, 12)]
    touch = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    after = [resolve(ball, Body.static(), touch).twist_a for ball in balls]
    rng = np.random.default_rng(1)
    after = [
        Twist(Vec3(*np.add(twist.linear, rng.normal(0, 0.01, 3)).tolist()), twist.angular) for twist in after
    ]
    measured = Impacts.of(balls, [Body.static()] * 12, [touch] * 12, after, after)
    found = compare(measured, [Law.FRICTIONLESS, Law.COULOMB, Law.ROUTH_STRONGE], resamples=2)
    assert set(found.candidates) == {Law.COULOMB, Law.ROUTH_STRONGE}
    assert "cannot tell" in str(found) and "FRICTIONLESS" in str(found).splitlines()[-1]


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy", "arctan"])
@pytest.mark.parametrize("wrong", [0.0, 3.0, 30.0, 1e3])
def test_one_outlier_hides_no_difference_between_laws(wrong, loss):
    """The outlier is nearer to FRICTIONLESS: it is faster than without friction."""
    balls = [Body.dynamic(1.0, velocity=(vx, 0.0, -1.0)) for vx in np.linspace(0.5, 3.0, 30)]
    touch = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    after = [resolve(ball, Body.static(), touch).twist_a for ball in balls]
    measured = Impacts.of(balls, [Body.static()] * 30, [touch] * 30, after, after)
    measured.after[:3] += np.random.default_rng(1).normal(0, 0.01, (3, 2, 30))
    measured.after[0, 0, 7] += wrong
    found = compare(measured, [Law.FRICTIONLESS, Law.COULOMB], loss=loss, resamples=2)
    assert found.candidates == (Law.COULOMB,)


@pytest.mark.parametrize(
    ("options", "left_out"),
    [
        ({"given": {"restitution": 0.5}}, {Law.FRICTIONLESS}),
        ({"given": {"restitution": 0.5}, "fit": ["friction"]}, set()),
        ({"given": {"friction": 0.1}}, set()),
        ({"fit": ["restitution"]}, set()),
        ({}, set()),
    ],
)
def test_a_comparison_leaves_out_laws_of_which_every_coefficient_is_given(options, left_out):
    found = compare(falling(1.0, 2.0, 3.0, 4.0), **options, resamples=2)
    assert set(Law) - {Law.AUTO} - found.fits.keys() == left_out


def falling(*speeds, after=0.5):
    """Point masses on a floor."""
    n = len(speeds)
    twists = [Twist(Vec3(0.0, 0.0, after * speed), Vec3(0.0, 0.0, 0.0)) for speed in speeds]
    balls = [Body.dynamic(1.0, velocity=(0.0, 0.0, -speed)) for speed in speeds]
    return Impacts.of(balls, [Body.static()] * n, [Contact.of((0, 0, 0), (0, 0, 1))] * n, twists, twists)


def rolling(sticking, sliding, seed=0):
    """Spheres with e = 0.5, friction 0.3 and tangential restitution -0.3, of which some slide to the end."""
    rng, touch = np.random.default_rng(seed), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)
    slips = np.repeat([0.2, 5.0], [sticking, sliding]) * rng.uniform(0.9, 1.1, sticking + sliding)
    balls = [Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(slip, 0.0, -1.0)) for slip in slips]
    model = ImpactModel(Law.COULOMB, tangential_restitution=-0.3)
    after = [resolve(ball, Body.static(), touch, model).twist_a for ball in balls]
    measured = Impacts.of(balls, [Body.static()] * len(balls), [touch] * len(balls), after, after)
    measured.after[:] += rng.normal(0, 0.01, measured.after.shape)
    return measured


@pytest.mark.parametrize("sticking", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_an_interval_is_open_at_both_ends_if_few_impacts_determine_the_coefficient(sticking, seed):
    """Only sticking contacts depend on tangential restitution. Of 12 impacts drawn from 12, none sticks with
    probability (1 - sticking / 12)^12: 35, 11 and 3 %, which is more than 2.5 % at either end.
    """
    measured = rolling(sticking, 12 - sticking, seed)
    names = ("restitution", "tangential_restitution")
    found = identify(measured, fit=names, given={"friction": 0.3}, resamples=1000, seed=seed)
    open_resamples = np.isnan(found.resampled).sum(axis=0)
    assert open_resamples.tolist() == pytest.approx([0, 1000 * (1 - sticking / 12) ** 12], abs=50)
    whole = found.coefficients["tangential_restitution"]
    assert (whole.low, whole.high) == ((-1.0, 1.0) if open_resamples[1] > 25 else (whole.low, whole.high))
    assert found.coefficients["restitution"].high < 0.52


def test_separating_impacts_are_ignored():
    found = identify(falling(1.0, 2.0, 3.0, -1.0), Law.FRICTIONLESS, resamples=2)
    assert found.values["restitution"] == pytest.approx(0.5, abs=SOLVED)
    assert found.squares.shape == (3,)
    assert any(note.startswith("1 impacts separate") for note in found.notes)


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


@pytest.mark.parametrize(("given", "fitted"), [("restitution", "friction"), ("friction", "restitution")])
def test_given_coefficients_are_not_fitted(given, fitted):
    true = {"restitution": 0.6, "friction": 0.15}
    found = identify(cubes(20, *true.values()), given={given: true[given] / 2}, resamples=2)
    assert found.coefficients.keys() == {fitted}
    assert found.values[given] == true[given] / 2
    assert found.misfit > 1e-3


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


@pytest.mark.parametrize("turn", [None, (0.5, 0.5, 0.5, 0.5), (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("unknown", range(3))
def test_only_velocities_that_depend_on_an_unknown_spin_are_dropped(turn, axis, unknown):
    """The velocity of the centre of mass is v + w x c. With c along one axis, an unknown component of w
    affects at most one component of it.
    """
    com = Vec3(*(0.1 * (i == axis) for i in range(3)))
    ball = Body.sphere(1.0, 0.1, velocity=(0, 0, -1))._replace(
        com=com, orientation=turn and Body.dynamic(1.0, orientation=turn).orientation
    )
    along = np.eye(3) if turn is None else Rotation.from_quat(turn).as_matrix()
    direction = along[:, axis]
    twist = Twist(Vec3(1.0, 2.0, 3.0), Vec3(*(math.nan if i == unknown else 5.0 + i for i in range(3))))
    measured = Impacts.of([ball], [Body.static()], [Contact.of((0, 0, 0), (0, 0, 1))], [twist], [twist])
    where = int(np.argmax(abs(direction)))
    lost = set() if unknown == where else {3 - unknown - where}
    assert set(np.flatnonzero(np.isnan(measured.after[:3, 0, 0]))) == lost
    known = [i for i in range(3) if i not in lost]
    by_hand = np.add(twist.linear, np.cross(np.nan_to_num(twist.angular), 0.1 * direction))
    assert measured.after[known, 0, 0] == pytest.approx(by_hand[known])


SPHERE = {"speed": 3.9, "radius": 0.0025, "tables": {"ratio": [(40, 0.8), (50, 0.85)]}, "errors": READING}


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        *(({name: x}, name) for name in ("speed", "radius") for x in (0.0, -1.0, math.nan, math.inf)),
        *(({"gyration": x}, "gyration") for x in (0.0, -0.4, 0.67, math.nan, math.inf)),
        *(({"errors": {"ratio": x}}, "errors['ratio']") for x in (0.0, -1.0, math.nan, math.inf)),
        ({"errors": {}}, "errors['ratio']"),
        ({"tables": {}}, "tables"),
        ({"tables": {"ratio": []}}, "tables"),
        ({"tables": {"bounce": [(40, 0.8)]}}, "tables"),
        *(({"tables": {"spin": [(40, 1.0), (x, 1.0)]}}, "tables['spin'][1]") for x in (math.nan, math.inf)),
        *(({"tables": {"angle": [(40, 1.0), (40, x)]}}, "tables['angle'][1]") for x in (math.nan, -math.inf)),
        ({"tables": {"ratio": [(40, 1.0), (0, 1.0)]}}, "tables['ratio'][1]"),
    ],
)
def test_readings_out_of_range_are_refused_by_name(wrong, field):
    with pytest.raises(ValueError) as refusal:
        SphereReadings(**(SPHERE | wrong))
    assert str(refusal.value).startswith(f"{field}: ")


def test_readings_of_a_vertical_fall_are_used_where_they_are_meaningful():
    tables = {"angle": [(0, 0.0), *KHARAZ["angle"]], "spin": [(0, 0.0), *KHARAZ["spin"]]}
    found = identify(SphereReadings(3.9, 0.0025, tables, READING), resamples=2)
    assert len(found.squares) == 8
    assert any(note.startswith("2 impacts are left out") for note in found.notes)


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
    "wrong", [None, "x", True, 1j, [1.0], np.array(True), np.timedelta64(1, "s")], ids=repr
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


@pytest.mark.parametrize("sticking", [12, 11, 6, 0])
@pytest.mark.parametrize(
    "names",
    [["friction"], ["restitution"], ["friction", "tangential_restitution"], ["restitution", "friction"]],
)
def test_a_picture_leaves_out_fits_of_the_bootstrap_without_a_value(tmp_path: Path, sticking, names):
    true = {"restitution": 0.5, "friction": 0.3, "tangential_restitution": -0.3}
    given = {name: value for name, value in true.items() if name not in names}
    measured = rolling(sticking, 12 - sticking)
    draw(identify(measured, fit=names, given=given, resamples=20), measured, tmp_path / "fit.png")
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")


TABLE = "vx,vz,vx_after,vz_after,note\n1,-1,.85,.5,a\n2,-1,1.85,.5,b\n1,-2,.7,1,\n2,-2,1.7,1,\n"


def test_the_command_reads_a_table_and_plots(tmp_path: Path, capsys):
    """A point mass that slides: e = 0.5, mu (1 + e) = 0.15."""
    table, picture = tmp_path / "impacts.csv", tmp_path / "fit.png"
    table.write_text(TABLE)
    assert main([str(table), "--set", "m=2", "nz=1", "--resamples", "20", "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "restitution = 0.5 " in out and "friction = 0.1 " in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main([str(table), "--set", "m=2", "nz=1", "--resamples", "2", "--compare"]) == 0
    assert "cannot tell" in capsys.readouterr().out


def test_the_command_reads_tables_as_papers_print_them(tmp_path: Path, capsys):
    table = tmp_path / "sphere.csv"
    table.write_text("incidence,ratio\n" + "".join(f"{a},{r}\n" for a, r in KHARAZ["ratio"]))
    options = ["--speed", "3.9", "--radius", ".0025", "--errors", "ratio=.008", "--resamples", "2"]
    assert main([str(table), *options]) == 0
    assert "friction (1 + restitution) = 0.18" in capsys.readouterr().out
    assert main([str(table)]) == 1
    assert "--speed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("vz,vz_after\n-1,x\n", "rows[0].vz_after: must be a number, is 'x' (INVALID_TABLE)"),
        ("vz,vz_after\n", "rows: there are none"),
        ("vz,vz_after\n-1,1\n", "columns: must have m; nx or ny or nz"),
        ("m,nz,vz,vz_after\n1,1,,1\n", "impacts[0].body_a.velocity: must be finite"),
        ("m,nz,vz,vz_after\n1,1,-1,inf\n", "impacts[0].after_a.linear: must be finite"),
        ("m,nz,vz,vz,vz_after\n1,1,-1,-9,1\n", "columns: vz is there 2 times"),
        ("m,nz, vz,vz ,vz_after\n1,1,-1,-9,1\n", "columns: vz is there 2 times"),
        (
            "m,nz,vz,vz_after\n1,1,-1,0.5\n1,1,-1,0,5\n",
            "rows[1]: must have 4 cells, as there are columns; has 5",
        ),
        ("m,nz,vz,vz_after,note\n1,1,-1,1," + "x" * 200_000, "line 1: field larger than field limit"),
        ("incidence,ratio\n0,1\n", "readings of a sphere need --speed"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path: Path, capsys, text, told):
    table = tmp_path / "impacts.csv"
    table.write_text(text)
    assert main([str(table)]) == 1
    err = capsys.readouterr().err
    assert told in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--given", "restitution=abc"], "argument --given: restitution must be a number, is 'abc'"),
        (["--errors", "ratio"], "argument --errors: must be NAME=VALUE, is 'ratio'"),
        (["--compare", "--plot", "fit.png"], "--plot draws one law: not with --compare"),
    ],
)
def test_invalid_arguments_are_refused_by_the_parser(capsys, options, told):
    with pytest.raises(SystemExit):
        main(["impacts.csv", *options])
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("name", ["fit.xyz", "no such folder/fit.png"])
def test_a_picture_that_cannot_be_written_is_named(tmp_path: Path, capsys, name):
    table, picture = tmp_path / "impacts.csv", tmp_path / name
    table.write_text(TABLE)
    options = ["--set", "m=2", "nz=1", "--resamples", "2"]
    assert main([str(table), *options, "--plot", str(picture)]) == 1
    said = capsys.readouterr()
    assert "friction = 0.1 " in said.out
    *_, last = said.err.splitlines()
    assert last.startswith(f"{picture}: ")


@pytest.mark.parametrize(
    "options",
    [
        {"--set": ["m=2", "nz=1"]},
        {"--set": ["m=2", "nz=1"], "--fit": ["restitution", "friction"]},
        {"--set": ["m=2", "nz=1"], "--given": ["restitution=0.5", "tangential_restitution=0.1"]},
        {"--speed": ["3.9"], "--radius": [".0025"], "--errors": ["ratio=.008", "angle=.84"]},
    ],
)
def test_an_option_may_be_repeated_for_each_value(tmp_path: Path, capsys, options):
    """The last one must not replace the others."""
    table = tmp_path / "impacts.csv"
    readings = "incidence,ratio,angle\n30,.69,21.8\n39,.77,32.5\n50,.85,45.1\n60,.90,57.4\n"
    table.write_text(readings if "--errors" in options else TABLE)
    together = [word for name, values in options.items() for word in (name, *values)]
    repeated = [word for name, values in options.items() for value in values for word in (name, value)]
    told = []
    for words in (together, repeated):
        assert main([str(table), *words, "--resamples", "2"]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]


def test_a_misspelt_column_is_refused(tmp_path: Path, capsys):
    table = tmp_path / "impacts.csv"
    table.write_text(TABLE)
    assert main([str(table), "--set", "m=2", "nz=1", "vy_afte=0"]) == 1
    assert "columns: vy_afte is unknown" in capsys.readouterr().err


def test_the_command_does_not_fit_what_is_given(tmp_path: Path, capsys):
    table = tmp_path / "impacts.csv"
    table.write_text(TABLE)
    options = [str(table), "--set", "m=2", "nz=1", "--resamples", "2"]
    assert main([*options, "--given", "restitution=0.5"]) == 0
    out = capsys.readouterr().out
    assert "friction = 0.1 " in out and "restitution" not in out
    assert main([*options, "--fit", "restitution", "restitution"]) == 1
    assert "fit: has restitution twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "unused"),
    [
        ("vx,vz,vx_after,vz_after", ""),
        ("Vx,vz,vx_after,vz_after", "Vx"),
        ("vx_before,vz,vx_after,vz_after,note, b_mass ,", "vx_before, note, b_mass"),
        ("speed,vz,vx_after,vz_after", ""),
        ("\N{BYTE ORDER MARK}vx,vz,vx_after,vz_after,n", "n"),
    ],
)
def test_the_command_names_the_columns_that_it_leaves_out(tmp_path: Path, capsys, names, unused):
    """A misspelt column would count as 0."""
    table = tmp_path / "impacts.csv"
    table.write_text(f"{names}\n1,-1,.85,.5\n2,-1,1.85,.5\n1,-2,.7,1\n", encoding="utf-8")
    assert main([str(table), "--set", "m=2", "nz=1", "wx=speed" if "speed" in names else "wx=0"]) == 0
    told = f"{table}: columns that are left out: {unused}\n" if unused else ""
    assert capsys.readouterr().err == told


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_byte_order_mark_is_not_part_of_a_name(tmp_path: Path, encoding):
    table = tmp_path / "impacts.csv"
    table.write_text("vz,note,note\n-1,a,b\n", encoding=encoding)
    assert read_rows(table, {}) == ([{"vz": -1.0}], ["note", "note"])


@pytest.mark.parametrize(
    "text",
    ["vz,vx\n-1,\n", " vz, vx\n-1,\n", "vz ,vx \r\n -1 , \r\n", "vz\t,\tvx\n\t-1,\t\n", "vz,vx\n-1,,\n"],
)
def test_blanks_are_not_part_of_a_name_or_a_number(tmp_path: Path, text):
    """A name with blanks would be unknown, and its numbers would count as 0."""
    table = tmp_path / "impacts.csv"
    table.write_bytes(text.encode())
    assert [[name, str(x)] for row in read_rows(table, {})[0] for name, x in row.items()] == [
        ["vz", "-1.0"],
        ["vx", "nan"],
    ]


@pytest.mark.parametrize("there", ["x", "y", "z", "xy", "yz", "xyz", ""])
def test_missing_components_of_a_contact_position_are_0(there):
    """If all are missing, the contact is at the lever arm from the origin of body_a."""
    row = {"m": 1.0, "nz": 1.0, "vz": -1.0, "vz_after": 0.5, "x": 7.0, "ry": 8.0}
    measured = impacts_from_rows([row | {f"c{axis}": 3.0 for axis in there}])
    expected = [3.0 * (axis in there) for axis in "xyz"] if there else [7.0, 8.0, 0.0]
    assert measured.contacts[CONTACT.position, 0].tolist() == expected


@pytest.mark.parametrize("there", ["x", "y", "z", "w", "xw", "yz", "xyzw", ""])
def test_missing_components_of_a_quaternion_are_those_of_the_identity(there):
    row = {"m": 1.0, "nz": 1.0, "vz": -1.0, "vz_after": 0.5} | {f"q{axis}": 0.5 for axis in there}
    turned = impacts_from_rows([row]).bodies[BODY.orientation, 0, 0]
    expected = np.array([0.5 if axis in there else float(axis == "w") for axis in "xyzw"])
    assert turned == pytest.approx(expected)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("left", "says"),
    [
        (0, "Failed to read"),
        (4, "Failed to read"),
        (100, "{path} is not complete, "),
        (0.5, "{path} is not complete, "),
        (-1, "{path} is not complete, "),
    ],
)
def test_a_truncated_recording_is_refused_in_one_line(tmp_path: Path, capsys, left, says):
    whole = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, []).read_bytes()
    path = tmp_path / "b.rrd"
    path.write_bytes(whole[: left if isinstance(left, int) else int(left * len(whole))])
    assert main([str(path)]) == 1
    err = capsys.readouterr().err
    assert err.startswith(f"{path}: {says.format(path=path)}") and err.count("\n") == 1


def test_a_table_named_like_a_recording_is_refused_in_one_line(tmp_path: Path, capsys):
    pytest.importorskip("rerun")
    path = tmp_path / "a.rrd"
    path.write_text(TABLE)
    assert main([str(path)]) == 1
    err = capsys.readouterr().err
    assert "Not an RRD file" in err and err.count("\n") == 1


def recording(path, answers, received, floor=None, name="ball"):
    """A recording of balls that strike a floor at whole seconds, and of received states of the ball.

    Args:
        path: the file.
        answers: speed and restitution of each impact, and its stamp [ns] if it is not at a whole second.
        received: stamp [ns] and vertical velocity of each state.
        floor: the floor; static by default.
        name: the name of the ball.
    """
    pytest.importorskip("rerun")
    recorder = Recorder(path.parent, pytest.fail, name=path.name)
    ball = Body.dynamic(2.0, (0.2, 0, 0, 0.2, 0, 0.2), (0.0, 0.0, 0.25))
    for i, (speed, e, *stamp) in enumerate(answers, start=1):
        falling = ball._replace(velocity=Vec3(0.0, 0.0, -speed))
        request = falling, floor or Body.static(), Contact.of((0, 0, 0), (0, 0, 1), e), ImpactModel()
        recorder.add(Record(*(stamp or [i * 10**9]), i, name, "floor", *request, resolve(*request)))
    for stamp, velocity in received:
        recorder.add(BodyRecord(stamp, name, ball._replace(velocity=Vec3(0.0, 0.0, velocity))))
    recorder.close()
    return path


def test_the_command_uses_the_states_received_after_an_impact(tmp_path: Path, capsys):
    """The node was given e = 0.9, but the balls bounce with 0.5. One state comes too late, and one before its
    impact.
    """
    received = [(10**9 - 1, -1.0), (10**9 + 10**7, 0.5), (10**9 + 2 * 10**7, 9.0)]
    received += [(2 * 10**9 + 10**7, 1.0), (3 * 10**9 + 10**7, 1.5), (4 * 10**9 + 10**8, 9.0)]
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9), (2.0, 0.9), (3.0, 0.9), (4.0, 0.9)], received)
    options = [str(path), "--law", "frictionless", "--resamples", "2"]
    assert main(options) == 0
    assert "restitution = 0.5 " in capsys.readouterr().out
    assert main([*options, "--within", "0"]) == 0
    assert "restitution = 0.9 " in capsys.readouterr().out


@pytest.mark.parametrize("pause", [0, 1, 5 * 10**6])
def test_a_state_after_a_second_impact_is_no_measurement_of_the_first(tmp_path: Path, capsys, pause):
    """Each two impacts are at one time or soon after each other; after the second one e is 0.5."""
    answers, received = [], []
    for i in (1, 2, 3):
        answers += [(4.0 * i, 0.9, i * 10**9), (1.0 * i, 0.9, i * 10**9 + pause)]
        received.append((i * 10**9 + 10**7, 0.5 * i))
    path = recording(tmp_path / "a.rrd", answers, received)
    assert main([str(path), "--law", "frictionless", "--resamples", "2"]) == 0
    said = capsys.readouterr().out
    assert "FRICTIONLESS, 3 impacts" in said and "restitution = 0.5 " in said


@pytest.mark.parametrize(
    "name", ["robot1/base link", "ball ", " ", "**", "- /world/**", "\\/", "a\nb", "Kugel ü 🙂"]
)
def test_the_states_of_a_body_are_found_under_any_name(tmp_path: Path, capsys, name):
    received = [(i * 10**9 + 10**7, 0.5 * i) for i in (1, 2, 3)]
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9), (2.0, 0.9), (3.0, 0.9)], received, name=name)
    assert main([str(path), "--law", "frictionless", "--resamples", "2"]) == 0
    assert "restitution = 0.5 " in capsys.readouterr().out


def test_a_recording_without_body_states_is_refused(tmp_path: Path, capsys):
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, [])
    assert main([str(path)]) == 1
    assert "no state of a body was received within 0.05 s" in capsys.readouterr().err


def test_a_recording_of_articulated_bodies_is_refused(tmp_path: Path, capsys):
    """Its infinite mass must not be taken for an immovable body."""
    link = Body.articulated(np.eye(6).tolist())
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, [], link)
    assert main([str(path), "--within", "0"]) == 1
    assert "impacts[0].body_b.inverse_inertia" in capsys.readouterr().err


@pytest.mark.parametrize(
    "columns", [{}, {"request_a": [1.0]}, {"regime": ["STICKING"], "twist_a_after": [1.0]}]
)
def test_a_recording_of_another_program_is_refused_in_one_line(tmp_path: Path, capsys, columns):
    rr = pytest.importorskip("rerun")
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    if columns:
        rows = rr.DynamicArchetype.columns(archetype="Impact", components=columns)
        stream.send_columns("/impacts", [rr.TimeColumn("answer", sequence=[1])], rows)
    stream.disconnect()
    assert main([str(tmp_path / "a.rrd")]) == 1
    err = capsys.readouterr().err
    assert "is not a recording of this node" in err and err.count("\n") == 1


def test_a_recording_without_impacts_is_refused(tmp_path: Path, capsys):
    assert main([str(recording(tmp_path / "a.rrd", [], [(10**9, 1.0)]))]) == 1
    assert "/impacts: there are none in" in capsys.readouterr().err
