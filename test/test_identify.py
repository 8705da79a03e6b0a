"""Estimating coefficients from impacts that were measured, or computed with known coefficients."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

pytest.importorskip("scipy")

import numpy as np
from measured import KHARAZ, READING, falling
from refusals import refused
from scipy.spatial.transform import Rotation

from collision_response import Body, Contact, ImpactModel, Law, StatusCode, Twist, resolve
from collision_response.identify import Impacts, SphereReadings, compare, identify
from collision_response.identify.measurements import BODY
from collision_response.identify.plot import draw
from collision_response.physics.vector import Vec3

SOLVED = 1e-6
"""Error of a coefficient without noise: the root of 1e-10, at which least squares stop, with a margin."""


def cubes(count, e, mu, seed=1, *, tilt=0.0, speed=0.0, spin=0.0, law=Law.COULOMB, **of_model):
    """Corners of a cube that strike a floor, at random velocities and orientations.

    Args:
        tilt: standard deviation of the error of the reported normals [rad].
        speed, spin: standard deviation of the noise of the reported twists [m/s, rad/s].
    """
    rng = np.random.default_rng(seed)
    before, contacts, after = [], [], []
    while len(before) < count:
        turn = Rotation.from_quat(rng.normal(size=4))
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
    measured = cubes(30, 0.6, 0.15, speed=0.01, seed=3)
    sound = identify(measured, loss=loss, resamples=40)
    measured.after[:3, 0, 3] = wrong
    found = identify(measured, loss=loss, resamples=40)
    for name, right in (("restitution", 0.6), ("friction", 0.15)):
        value, low, high, formal = found.coefficients[name]
        assert low < right < high
        assert abs(value - sound.values[name]) < 3 * sound.coefficients[name].formal
        assert formal < 8 * sound.coefficients[name].formal  # the outlier would otherwise inflate the scale


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy", "arctan"])
@pytest.mark.parametrize(
    ("seed", "outliers", "size"), [(8, 3, 1e3), (25, 6, 100.0), (25, 12, 10.0), (0, 6, 1e3), (1, 3, 1e5)]
)
def test_far_outliers_decide_neither_the_noise_nor_where_the_search_ends(seed, outliers, size, loss):
    """Treated as all others, they would make it end where most impacts stick, and inflate the noise."""
    rng, measured = np.random.default_rng(seed), []
    touch = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.2)
    for i in range(60):
        v = (*(2 * rng.normal(size=2)).tolist(), -2 - rng.random())
        ball = Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=v)
        answer = resolve(ball, Body.static(), touch).twist_a
        speed, spin = 0.01 * rng.normal(size=3), 0.1 * rng.normal(size=3)
        if i < outliers:
            speed, spin = speed + size * rng.normal(size=3), spin + 10 * size * rng.normal(size=3)
        after = Twist(answer.linear + Vec3(*speed.tolist()), answer.angular + Vec3(*spin.tolist()))
        measured.append((ball, Body.static(), touch, after, Twist(Vec3(0, 0, 0), Vec3(0, 0, 0))))
    found = identify(Impacts.of(*zip(*measured, strict=True)), loss=loss, resamples=2)
    for name, right in (("restitution", 0.5), ("friction", 0.2)):
        value, _, _, formal = found.coefficients[name]
        assert abs(value - right) < 3 * formal < 0.006  # 0.01 m/s of noise, relative to 3 m/s, in 60 impacts


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


def random_impacts(seed, count, **coefficients):
    """Impacts of a turned body with a wall, with normals in all directions, by COMPLIANT."""
    random, told = np.random.default_rng(seed), []
    e, mu, kappa = (coefficients[name] for name in SPRINGS)
    while len(told) < count:
        n = random.normal(size=3)
        n /= np.linalg.norm(n)
        body = Body.dynamic(
            1.0,
            (0.2, 0.01, 0, 0.3, 0.02, 0.25),
            velocity=random.normal(size=3),
            angular_velocity=random.normal(0, 2, 3),
        )
        request = body, Body.static(), Contact.of(random.normal(0, 0.4, 3) - n, n, e, mu)
        impact = resolve(*request, ImpactModel(Law.COMPLIANT, stiffness_ratio=kappa))
        if impact.status is StatusCode.OK:
            told.append((*request, impact.twist_a, impact.twist_b))
    return Impacts.of(*zip(*told, strict=True))


@pytest.mark.parametrize("seed", range(4))
def test_a_search_that_ends_in_a_hollow_goes_on_from_the_bootstrap(seed):
    true = {"restitution": 0.6, "friction": 0.4, "stiffness_ratio": 15.0}
    found = identify(random_impacts(seed, 12, **true), Law.COMPLIANT, SPRINGS, resamples=10)
    for fitted in (found.values, *found.others.values()):
        assert fitted == pytest.approx(true, rel=1e-6)


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


@pytest.mark.parametrize(("speed", "spin"), [(0.01, 0.1), (0.05, 0.02), (0.002, 0.5)])
def test_noise_of_other_residuals_is_no_disagreement(speed, spin):
    """With a good gyroscope and a poor camera, linear residuals alone are far noisier than kinetic ones. Two
    kinds in three standard deviations are apart by chance once in 400 times, for two coefficients in 20 sets.
    """
    sets = (cubes(40, 0.5, 0.2, seed, speed=speed, spin=spin) for seed in range(20))
    notes = [identify(measured, resamples=2).notes for measured in sets]
    assert sum(any("other kinds" in note for note in some) for some in notes) <= 1, notes


@pytest.mark.parametrize("sliding", [1, 2, 3])
def test_intervals_include_what_few_impacts_tell(sliding):
    """Balls of which all but a few stick. All resamples that hold one of these few are nearly the same, yet
    few of 20 intervals may lie above the truth.
    """
    mass, radius, e, mu, above = 0.37, 0.05, 0.5, 0.3, 0
    floor, contact = Body.static(), Contact.of((0, 0, -radius), (0, 0, 1), e, mu)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        speed = rng.uniform(0.5, 2, 40)
        needed = np.where(np.arange(40) < sliding, rng.uniform(0.5, 0.8, 40), rng.uniform(0.02, 0.2, 40))
        slip, angle = needed * (1 + e) * speed * 3.5, rng.uniform(0, 2 * math.pi, 40)
        velocities = np.stack([slip * np.cos(angle), slip * np.sin(angle), -speed], axis=1)
        balls = [Body.sphere(mass, radius, velocity=v) for v in velocities.tolist()]
        answers = [resolve(ball, floor, contact).twist_a for ball in balls]
        after = [
            Twist(
                *(Vec3(*rng.normal(part, sd).tolist()) for part, sd in zip(twist, (0.01, 0.1), strict=True))
            )
            for twist in answers
        ]
        found = identify(Impacts.of(balls, [floor] * 40, [contact] * 40, after, after), resamples=50)
        above += found.coefficients["friction"].low > mu
    assert above <= 3


def test_sticking_impacts_only_bound_friction_from_below():
    measured = cubes(30, 0.5, 20.0, speed=0.001, spin=0.01)
    mu = identify(measured, resamples=20).coefficients["friction"]
    assert math.isnan(mu.value) and mu.high == math.inf
    twists = measured.predict(Law.COULOMB, {"restitution": 0.5, "friction": 1e3})
    impulses = 0.37 * (twists[:3, 0] - measured.bodies[BODY.velocity, 0])
    steepest = (np.hypot(*impulses[:2]) / impulses[2]).max()
    assert mu.low == pytest.approx(steepest, rel=0.05)  # noise moves a twist by 1e-3
    assert "friction >= " in str(identify(measured, resamples=2))


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("slip", [0.01, 0.1, 1.0])
def test_spheres_that_stick_bound_friction_from_below_by_every_law(law, e, slip):
    """Rounding makes some residuals of Routh's laws depend on friction; that is no effect of it."""
    before = [Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(slip, 0.2 * slip, -1.0))] * 5
    touch = Contact.of((0, 0, 0), (0, 0, 1), e, 10.0)
    after = [resolve(ball, Body.static(), touch, ImpactModel(law)).twist_a for ball in before]
    measured = Impacts.of(before, [Body.static()] * 5, [touch] * 5, after, after)
    found = identify(measured, law, resamples=2).coefficients
    assert math.isnan(found["friction"].value) and found["friction"].high == math.inf
    steepest = math.hypot(slip, 0.2 * slip) * (2 / 7) / (1 + e)
    assert found["friction"].low == pytest.approx(steepest, rel=1e-3)  # squares up to 1e-12 are no misfit
    assert found["restitution"].value == pytest.approx(e, abs=SOLVED)


@pytest.mark.parametrize("law", [Law.COULOMB, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("mu", [0.1, 0.1625, 0.25, 0.39, 0.41, 0.44, 0.6, 0.9, 1.3, 2.1])
def test_one_impact_that_slides_determines_friction(law, mu):
    """All others stick. From every friction that is too large, no search finds the one that slides."""
    slips = [4.0 * mu, *[0.3 * mu] * 11]  # over the approach speed; spheres slide above 3.5 mu (1 + e) / 1.5
    before = [Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(s, 0.0, -1.0)) for s in slips]
    touch = Contact.of((0, 0, 0), (0, 0, 1), 0.1, mu)
    after = [resolve(ball, Body.static(), touch, ImpactModel(law)).twist_a for ball in before]
    measured = Impacts.of(before, [Body.static()] * 12, [touch] * 12, after, after)
    assert identify(measured, law, resamples=2).values == pytest.approx(
        {"restitution": 0.1, "friction": mu}, abs=SOLVED
    )


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-10, 1e-8])
@pytest.mark.parametrize("e", [0.0, 1.0])
@pytest.mark.parametrize("mu", [0.004, 0.3])
def test_friction_is_determined_however_small_it_and_the_noise_are(loss, noise, e, mu):
    """Spheres that slide, but stick with a friction that is more than 8 / (3.5 (1 + e)) times as large."""
    rng = np.random.default_rng(0)
    before = [Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(8 * mu, 0.0, -1.0))] * 3
    touch = Contact.of((0, 0, 0), (0, 0, 1), e, mu)
    exact = resolve(before[0], Body.static(), touch).twist_a
    after = [Twist(*(part + Vec3(*noise * rng.normal(size=3)) for part in exact)) for _ in before]
    found = identify(
        Impacts.of(before, [Body.static()] * 3, [touch] * 3, after, after), loss=loss, resamples=2
    )
    assert found.coefficients["friction"].value == pytest.approx(mu, abs=SOLVED)
    assert found.values["restitution"] == pytest.approx(e, abs=SOLVED)


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_spins_that_only_rounding_changes_determine_nothing(spin):
    """Without friction, an impact of spheres changes no spin, but the normals are rounded."""
    rng = np.random.default_rng(0)
    normals = [n / np.linalg.norm(n) for n in rng.normal(size=(12, 3))]
    twists = [{"velocity": -n, "angular_velocity": spin * rng.normal(size=3)} for n in normals]
    before = [
        Body.sphere(1.0, 0.1, position=0.1 * n, **twist) for n, twist in zip(normals, twists, strict=True)
    ]
    contacts, walls = [Contact.of((0, 0, 0), n, 0.5) for n in normals], [Body.static()] * 12
    answers = [resolve(*one).twist_a for one in zip(before, walls, contacts, strict=True)]
    told = [Twist(Vec3(*[math.nan] * 3), twist.angular) for twist in answers]
    measured = Impacts.of(before, walls, contacts, told, told)
    if spin:  # COULOMB would change it, so the impacts are informative
        assert math.isnan(identify(measured, Law.FRICTIONLESS, resamples=2).coefficients["restitution"].value)
        return
    with refused(StatusCode.INVALID_TABLE, match="depends on the coefficients"):
        identify(measured, Law.FRICTIONLESS, resamples=2)


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


@pytest.mark.parametrize("gyration", [0.01, 0.4, 2 / 3])
@pytest.mark.parametrize("incidence", [(1, 2, 3), (10, 20, 30), (60, 70, 75)])
@pytest.mark.parametrize("e", [0.1, 0.5, 0.6])
def test_angles_do_not_tell_spheres_that_stick_from_spheres_without_friction(gyration, incidence, e):
    """``v_t+ = v_t / (1 + gyration)`` if they stick, so a larger restitution makes up for no friction."""
    table = [(a, math.degrees(math.atan(math.tan(math.radians(a)) / (1 + gyration) / e))) for a in incidence]
    readings = SphereReadings(2.0, 0.05, {"angle": table}, {"angle": 1.0}, gyration)
    found = identify(readings, resamples=2).coefficients
    assert math.isnan(found["friction"].value)
    assert (found["friction"].low, found["friction"].high) == (0.0, math.inf)
    low, high = found["restitution"][1:3]
    assert low <= e + SOLVED and high >= e * (1 + gyration) - SOLVED


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


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_laws_that_differ_by_rounding_cannot_be_told_apart(restitution):
    """Head-on impacts, a little beyond a limit of restitution: all laws give the same."""
    balls = [Body.dynamic(1.0, velocity=(0.0, 0.0, -v)) for v in (1.0, 1.3, 1.7, 2.1, 2.9, 3.3)]
    touch = Contact.of((0, 0, 0), (0, 0, 1))
    rebound = 1.02 * restitution or -0.02
    after = [Twist((0, 0, -rebound * ball.velocity.z), (0, 0, 0)) for ball in balls]
    still = [Twist((0, 0, 0), (0, 0, 0))] * 6
    measured = Impacts.of(balls, [Body.static()] * 6, [touch] * 6, after, still)
    found = compare(measured, resamples=2)
    assert {*found.candidates} == {*found.fits} and len(found.fits) > 4


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
@pytest.mark.parametrize("seed", range(2))
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


@pytest.mark.parametrize(("given", "fitted"), [("restitution", "friction"), ("friction", "restitution")])
def test_given_coefficients_are_not_fitted(given, fitted):
    true = {"restitution": 0.6, "friction": 0.15}
    found = identify(cubes(20, *true.values()), given={given: true[given] / 2}, resamples=2)
    assert found.coefficients.keys() == {fitted}
    assert found.values[given] == true[given] / 2
    assert found.misfit > 1e-3


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


def test_readings_of_a_vertical_fall_are_used_where_they_are_meaningful():
    tables = {"angle": [(0, 0.0), *KHARAZ["angle"]], "spin": [(0, 0.0), *KHARAZ["spin"]]}
    found = identify(SphereReadings(3.9, 0.0025, tables, READING), resamples=2)
    assert len(found.squares) == 8
    assert any(note.startswith("2 impacts are left out") for note in found.notes)


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
