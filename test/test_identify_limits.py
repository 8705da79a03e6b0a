"""Estimates near the limits of coefficients, in any units, and from bodies that stop."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("scipy")

import numpy as np
from collisions import random_collision
from refusals import refused

from collision_response import Body, Contact, ImpactModel, Law, StatusCode, Twist, resolve
from collision_response.identify import Impacts, SphereReadings, compare, identify
from collision_response.identify.estimates import Estimate
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

NOTHING = Vec3(math.nan, math.nan, math.nan)
WALL = Body.static()
SLIDING = 3.0
"""Ratio of tangential to normal speed at which a sphere slides to the end, for mu up to 0.4."""

PLACES = [(0.0, 0.1), (1e-4, 0.1), (0.9999, 0.1), (1.0, 0.1), (0.5, 0.0), (0.5, 1e-4), (0.0, 0.0), (1.0, 0.0)]
"""Restitution and friction, at limits and near them."""


def spheres(count, e, mu, *, mass=1.0, speed=1.0, floor=(0.0, 0.0, 0.0)):
    """Spheres without spin, floors and contacts; all bodies also move with the velocity ``floor``."""
    rng = np.random.default_rng(4)
    slow = speed * rng.uniform(1.0, 2.0, count)
    before = [
        Body.sphere(mass, 0.1, position=(0, 0, 0.1), velocity=np.add((SLIDING * v, 0.0, -v), floor).tolist())
        for v in slow
    ]
    return before, [Body.kinematic(velocity=floor)] * count, [Contact.of((0, 0, 0), (0, 0, 1), e, mu)] * count


def computed(before, floors, contacts, told=lambda twist: twist, law=Law.COULOMB):
    """Impacts as a law computes them; ``told`` turns exact twists into readings."""
    model = ImpactModel(law)
    answers = [resolve(*one, model).twist_a for one in zip(before, floors, contacts, strict=True)]
    after = [told(twist) for twist in answers]
    return Impacts.of(before, floors, contacts, after, after)


def mapped(function):
    """Apply a function to every component of a twist."""
    return lambda twist: Twist(*(Vec3(*map(function, vector)) for vector in twist))


def noise_of(sigma):
    rng = np.random.default_rng(5)
    return mapped(lambda x: x + sigma * rng.normal())


@pytest.mark.parametrize(("e", "mu"), [(0.62, 0.2), (1.0, 0.1), (0.5, 0.0)])
def test_units_do_not_matter(e, mu):
    """The same impacts with other units of mass and speed."""

    def fitted(mass, speed):
        rng = np.random.default_rng(1)
        impacts = spheres(12, e, mu, mass=mass, speed=speed)
        return identify(computed(*impacts, mapped(lambda x: x + speed * 0.01 * rng.normal())), resamples=5)

    here = fitted(1.0, 1.0)
    small, large = [(1e-12, 1.0), (1.0, 1e-12), (1e-12, 1e-12)], [(1e12, 1.0), (1.0, 1e12), (1e12, 1e12)]
    for factors in (*small, (1e-3, 1e-2), *large):
        there = fitted(*factors)
        for name, estimate in here.coefficients.items():
            assert there.coefficients[name] == pytest.approx(estimate, rel=1e-6, abs=1e-9), (name, factors)
        assert there.misfit == pytest.approx(here.misfit), factors
        assert there.notes == here.notes, factors


@pytest.mark.parametrize("moving", [1.0, 1e3])
def test_the_frame_does_not_matter(moving):
    """Floor and spheres move together. Larger numbers have larger rounding, which SciPy divides by steps of
    1.5e-8.
    """
    here, there = (
        identify(computed(*spheres(12, 0.6, 0.2, floor=(v, 0.0, -v)), noise_of(0.01)), resamples=20)
        for v in (0.0, moving)
    )
    for name, estimate in here.coefficients.items():
        assert there.coefficients[name] == pytest.approx(estimate, rel=1e-7 * moving), name


def two_bodies(*, length=1.0, exchanged=False, order=range(16)):
    """Noisy impacts of two rotating bodies with e = 0.55 and friction 0.3.

    Args:
        length: how many units of length a metre has.
        exchanged: whether body_a is called body_b, and the other way round.
        order: the impacts, in this order.
    """
    rng, rows = np.random.default_rng(3), []
    for seed in range(16):
        *bodies, contact = random_collision(seed, friction=0.3, off_centre=True)
        contact = contact._replace(restitution=0.55)
        answer = resolve(*bodies, contact)
        twists = [mapped(lambda x: x + 0.01 * rng.normal())(one) for one in (answer.twist_a, answer.twist_b)]
        twists = [one._replace(linear=one.linear * length) for one in twists]
        bodies = [
            one._replace(
                inertia=one.inertia * length**2,
                position=one.position * length,
                velocity=one.velocity * length,
                com=one.com * length,
            )
            for one in bodies
        ]
        contact = contact._replace(position=contact.position * length)
        if exchanged:
            bodies, twists = bodies[::-1], twists[::-1]
            contact = contact._replace(normal=-contact.normal)
        rows.append((*bodies, contact, *twists))
    return Impacts.of(*zip(*(rows[i] for i in order), strict=True))


@pytest.mark.parametrize("kind", Impacts.kinds)
@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
@pytest.mark.parametrize(
    "told", [{"length": 1e3}, {"length": 1e-3}, {"exchanged": True}, {"order": range(15, -1, -1)}]
)
def test_how_impacts_are_told_does_not_matter(kind, loss, told):
    """The search ends at relative changes of 1e-10, where the sum of squares is flat to its last digit."""
    here, there = (
        identify(two_bodies(**how), kind=kind, loss=loss, resamples=2).coefficients for how in ({}, told)
    )
    for name, estimate in here.items():
        assert there[name].value == pytest.approx(estimate.value, rel=1e-7)
        assert there[name].formal == pytest.approx(estimate.formal, rel=1e-4)


@pytest.mark.parametrize("law", [Law.COULOMB, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(("e", "mu"), PLACES)
def test_clean_coefficients_near_a_limit_are_found_with_their_intervals(e, mu, law):
    measured = computed(*spheres(12, e, mu), law=law)
    found = identify(measured, law, resamples=5)
    for name, true in (("restitution", e), ("friction", mu)):
        assert found.coefficients[name] == pytest.approx((true, true, true, 0.0), abs=1e-9), name
        assert all(values[name] == pytest.approx(true, abs=1e-8) for values in found.others.values())
    limits = [true for true in (e, mu) if true in (0.0, 1.0)]
    assert len([note for note in found.notes if "limit" in note]) == len(limits) == len(found.notes)


@pytest.mark.parametrize(
    ("seed", "mu"),
    [(1060, 0.5), (1204, 2.0), (1544, 0.83), (1552, 0.5), (1600, 2.0), (1660, 2.0), (2128, 0.2)],
)
def test_the_law_that_falls_back_is_found_where_no_energy_is_lost(seed, mu):
    """Where MOREAU falls back, its answer jumps. At e = 1 it does so most often, and jumps stop a search."""
    rows = []
    for i in range(12):
        *bodies, contact = random_collision(seed + i, friction=mu, off_centre=True)
        contact = contact._replace(restitution=1.0)
        answer = resolve(*bodies, contact, ImpactModel(Law.MOREAU))
        rows.append((*bodies, contact, answer.twist_a, answer.twist_b))
    found = identify(Impacts.of(*zip(*rows, strict=True)), Law.MOREAU, resamples=2)
    assert (found.values["restitution"], found.values["friction"]) == pytest.approx((1.0, mu), abs=1e-8)


@pytest.mark.parametrize("told", [mapped(lambda x: float(f"{x:.6g}")), *map(noise_of, (1e-7, 1e-6, 1e-4))])
@pytest.mark.parametrize(("e", "mu"), PLACES)
def test_noisy_coefficients_near_a_limit_are_as_accurate_as_others(e, mu, told):
    """Speeds are at least 1 m/s: formal deviations stay below the noise, and intervals near it."""
    measured, exact = computed(*spheres(12, e, mu), told), computed(*spheres(12, e, mu))
    noise = float(abs(measured.after - exact.after).max())
    found = identify(measured, resamples=20)
    for name, true in (("restitution", e), ("friction", mu)):
        value, low, high, formal = found.coefficients[name]
        assert abs(value - true) <= 5 * formal + 1e-10, name
        assert low - 2 * formal - 1e-10 <= true <= high + 2 * formal + 1e-10, name
        assert formal <= noise and high - low <= 5 * noise, name


def test_estimates_are_clipped_at_a_limit():
    """At e = 0, unconstrained least squares would be negative for half of the data sets. There the estimate
    is exactly 0.
    """
    rng = np.random.default_rng(7)
    told = [mapped(lambda x: x + 1e-3 * rng.normal()) for _ in range(16)]
    values = [
        identify(computed(*spheres(12, 0.0, 0.0), one), Law.FRICTIONLESS, resamples=2).values["restitution"]
        for one in told
    ]
    at_limit = values.count(0.0)
    assert 3 <= at_limit <= 13  # a fair coin fails this once in 200 times
    assert all(1e-9 < value < 1e-3 for value in values if value)


def drops(*after, mass=1.0):
    """Point masses that fall at 1, 2, ... m/s, and their measured twists."""
    balls = [Body.dynamic(mass, velocity=(0.0, 0.0, -1.0 - i)) for i in range(len(after))]
    touch = Contact.of((0, 0, 0), (0, 0, 1))
    return Impacts.of(balls, [WALL] * len(after), [touch] * len(after), after, after)


def up(speed, spin=NOTHING):
    return Twist(Vec3(math.nan, math.nan, speed), spin)


@pytest.mark.parametrize("kind", Impacts.kinds)
def test_zero_velocity_is_a_measurement(kind):
    found = identify(drops(*[up(0.0)] * 12), Law.FRICTIONLESS, kind=kind)
    assert found.coefficients["restitution"] == (0.0, 0.0, 0.0, 0.0)
    assert found.misfit == 0.0
    assert found.others == {one: {"restitution": 0.0} for one in Impacts.kinds if one != kind}


def test_a_frame_in_which_all_bodies_stop_changes_nothing():
    """The floor approaches at 0.5 m/s, so e = 0.5."""
    ball, floor = Body.dynamic(1.0, velocity=(0, 0, -1.5)), Body.kinematic(velocity=(0, 0, -0.5))
    n, stops = 4, Twist(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
    touch = Contact.of((0, 0, 0), (0, 0, 1))
    measured = Impacts.of([ball] * n, [floor] * n, [touch] * n, [stops] * n, [stops] * n)
    assert identify(measured, Law.FRICTIONLESS).values["restitution"] == pytest.approx(0.5, abs=1e-9)


def test_point_masses_that_stop_altogether_bound_friction_from_below():
    """At e = 0 the ratio of tangential to normal impulse is v_x / v_z, at most 1."""
    balls = [Body.dynamic(1.0, velocity=(1.0, 0.0, -1.0 - i)) for i in range(12)]
    impacts = balls, [WALL] * 12, [Contact.of((0, 0, 0), (0, 0, 1), 0.0, 2.0)] * 12
    found = identify(computed(*impacts), resamples=20)
    assert found.coefficients["restitution"] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert math.isnan(found.coefficients["friction"].value)
    assert found.coefficients["friction"].low == pytest.approx(
        1.0, rel=1e-4
    )  # limited by the tolerance NEGLIGIBLE_SQUARES
    assert found.misfit < 1e-12


def test_laws_are_not_told_apart_by_bodies_that_stop():
    found = compare(drops(*[up(0.0)] * 4), [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU], resamples=2)
    assert len(found.candidates) == 3
    assert all(excess == pytest.approx((0.0, 0.0, 0.0)) for excess in found.excess.values())


@pytest.mark.parametrize("exponent", [-1000, 1000])
def test_the_length_of_a_quaternion_does_not_matter(exponent):
    """A power of two changes no digit."""
    before, floors, contacts = spheres(6, 0.6, 0.1)
    found = []
    for length in (1.0, 2.0**exponent):
        orientation = Quaternion(0.0, 0.3 * length, 0.1 * length, length)
        turned = [ball._replace(orientation=orientation) for ball in before]
        found.append(identify(computed(turned, floors, contacts), resamples=2).values)
    assert found[0] == found[1]


def scaled(speed: float, length: float) -> Impacts:
    """Impacts with all speeds, and the normals, times powers of two."""
    before, floors, contacts = spheres(6, 0.6, 0.1)
    before = [ball.with_twist(Twist(ball.velocity * speed, ball.angular_velocity * speed)) for ball in before]
    return computed(before, floors, [each._replace(normal=each.normal * length) for each in contacts])


def test_neither_the_unit_of_speeds_nor_the_length_of_the_normals_matters():
    usual, small = (
        identify(scaled(*units), resamples=2).values for units in ((1.0, 1.0), (2.0**-330, 2.0**-830))
    )
    assert small == pytest.approx(usual, rel=1e-9)  # a search ends at 1e-10


def test_measurements_whose_squares_vanish_are_refused():
    for fit in (identify, compare):
        with refused(StatusCode.OUT_OF_RANGE, "impacts", "too small"):
            fit(scaled(2.0**-550, 1.0))


@pytest.mark.parametrize("speed", [1e160, 1e300])
def test_measurements_whose_squares_are_beyond_float64_are_refused(speed):
    impacts = computed(*spheres(6, 0.6, 0.1))
    impacts.after[1, 0, 2] = speed
    for fit in (identify, compare):
        with refused(StatusCode.OUT_OF_RANGE, "impacts"):
            fit(impacts)


def test_zero_readings_are_measurements():
    """A sphere that keeps no tangential velocity: only the spin of a shell could do that, not friction."""
    readings = SphereReadings(1.0, 0.1, {"angle": [(a, 90.0) for a in (30, 40, 50, 60)]}, {"angle": 1.0})
    found = identify(readings, Law.FRICTIONLESS)
    assert found.values["restitution"] == 0.0
    spins = SphereReadings(1.0, 0.1, {"spin": [(a, 0.0) for a in (30, 40, 50, 60)]}, {"spin": 1.0})
    found = identify(spins, fit=["friction"], given={"restitution": 0.5})
    assert found.coefficients["friction"] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("unmeasured", [0, 1, 8])
def test_impacts_without_measurements_do_not_count(unmeasured):
    """Neither for the fit, nor for its bootstrap, nor for the number of impacts in the notes."""
    told = [up(0.5 * (1 + i) + 0.01 * (-1) ** i) for i in range(4)]
    alone = identify(drops(*told), Law.FRICTIONLESS)
    with_more = identify(drops(*told, *[up(math.nan)] * unmeasured), Law.FRICTIONLESS)
    assert with_more.coefficients == alone.coefficients
    assert with_more.squares.tolist() == alone.squares.tolist()
    assert with_more.resampled.tolist() == alone.resampled.tolist()
    others = [note for note in with_more.notes if note not in alone.notes]
    assert [note.split()[0] for note in others] == [str(unmeasured)] * bool(unmeasured)
    assert any(note.startswith("4 impacts are too few") for note in with_more.notes)


def test_impacts_without_measurements_do_not_satisfy_the_minimum():
    with refused(StatusCode.INVALID_TABLE, "impacts", "1 of these are informative"):
        identify(drops(up(0.5), up(math.nan), up(math.nan)), Law.FRICTIONLESS)


def test_spins_alone_have_no_linear_residuals():
    impacts = spheres(6, 0.5, 0.1)
    after = [Twist(NOTHING, resolve(*one).twist_a.angular) for one in zip(*impacts, strict=True)]
    measured = Impacts.of(*impacts, after, after)
    assert not measured.is_measured("linear").any()
    with refused(StatusCode.INVALID_TABLE, "impacts", "by residuals linear"):
        identify(measured, kind="linear")
    assert identify(measured, resamples=2).combination.value == pytest.approx(0.15, abs=1e-9)


@pytest.mark.parametrize("told", [lambda x: x, lambda x: x + 1e-3 * math.sin(1e4 * x)])
def test_a_kind_of_residual_omits_coefficients_without_effect(told):
    """With v_z and w_y alone, linear residuals do not depend on friction, and must not warn about it."""
    impacts = spheres(12, 0.5, 0.1)
    twists = [resolve(*one).twist_a for one in zip(*impacts, strict=True)]
    after = [up(told(one.linear.z), Vec3(math.nan, told(one.angular.y), math.nan)) for one in twists]
    found = identify(Impacts.of(*impacts, after, after), resamples=20)
    assert found.others["linear"].keys() == {"restitution"}
    assert found.others["contact"].keys() == {"restitution", "friction"}
    assert not any("other kinds" in note for note in found.notes)


@pytest.mark.parametrize("mass", [1.0, 7.0])
@pytest.mark.parametrize(("kind", "weighted"), [("kinetic", True), ("linear", True), ("contact", False)])
def test_the_mass_of_an_impact_is_its_weight(kind, weighted, mass):
    """Drops of mass 1 with e = 0.4 and of another mass with e = 0.6, all at 1 m/s: the estimate is their
    mean, weighted by mass.
    """
    balls = [Body.dynamic(m, velocity=(0.0, 0.0, -1.0)) for m in (1.0, 1.0, mass, mass)]
    after = [up(e) for e in (0.4, 0.4, 0.6, 0.6)]
    measured = Impacts.of(balls, [WALL] * 4, [Contact.of((0, 0, 0), (0, 0, 1))] * 4, after, after)
    found = identify(measured, Law.FRICTIONLESS, kind=kind, loss="linear", resamples=2)
    weight = mass if weighted else 1.0
    assert found.values["restitution"] == pytest.approx((0.4 + weight * 0.6) / (1 + weight), abs=1e-9)


@pytest.mark.parametrize("mark", [1e20, 9.969209968386869e36])
def test_a_mark_for_a_missing_number_is_noted(mark):
    bodies, floors, contacts = spheres(20, 0.6, 0.1)
    good = computed(bodies, floors, contacts)
    assert not identify(good, resamples=2).notes
    after = [
        resolve(*one, ImpactModel(Law.COULOMB)).twist_a for one in zip(bodies, floors, contacts, strict=True)
    ]
    after[7] = Twist(Vec3(0.0, 0.0, mark), after[7].angular)
    notes = identify(Impacts.of(bodies, floors, contacts, after, after), resamples=2).notes
    assert any(
        note.startswith("1 impacts seem to change the motion 1,000,000 times as much") for note in notes
    )


# --- What an estimate says, and its notes


def restitutions(*values, speeds=None, mass=None, **options):
    """The fit of FRICTIONLESS to point masses that fall, at 1 m/s by default, with these restitutions."""
    n = len(values)
    speeds, mass = speeds or [1.0] * n, mass or [1.0] * n
    balls = [Body.dynamic(m, velocity=(0.0, 0.0, -v)) for m, v in zip(mass, speeds, strict=True)]
    after = [up(e * v) for e, v in zip(values, speeds, strict=True)]
    measured = Impacts.of(balls, [WALL] * n, [Contact.of((0, 0, 0), (0, 0, 1))] * n, after, after)
    return identify(measured, Law.FRICTIONLESS, **{"kind": "contact", "loss": "linear"} | options)


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        ((0.5, 0.4, 0.6, 0.01), "= 0.5  [0.4, 0.6]  (formal ± 0.02)"),
        ((math.nan, 0.4, math.inf, math.inf), ">= 0.4: these impacts tell only a lower bound"),
        ((math.nan, 0.0, math.inf, math.inf), "in [0, inf]: not determined by these impacts"),
        ((math.nan, 0.4, 1.0, math.inf), "in [0.4, 1]: not determined by these impacts"),
    ],
)
def test_an_estimate_is_shown_with_intervals_of_95_percent(estimate, text):
    assert str(Estimate(*estimate)) == text


def test_the_interval_of_the_bootstrap_leaves_out_5_of_200_fits_at_either_end():
    found = restitutions(*(0.5 + 0.01 * math.sin(i * i) for i in range(20)))
    fits = sorted(found.resampled[:, 0])
    assert found.coefficients["restitution"][1:3] == (fits[4], fits[194])


@pytest.mark.parametrize(("fast", "factor"), [(4, None), (6, "2.1"), (8, "2.5")])
def test_a_formal_interval_less_than_half_as_long_as_the_other_is_noted(fast, factor):
    """Restitution grows with the speed of one impact, whose residual is the largest."""
    e, v = [0.5 + 0.01 * (-1) ** i for i in range(15)] + [0.5 + 0.01 * fast], [1.0] * 15 + [float(fast)]
    found = restitutions(*e, speeds=v)
    value, _, _, formal = found.coefficients["restitution"]
    square = sum(x * x for x in v)
    best = sum(x * x * y for x, y in zip(v, e, strict=True)) / square
    variance = sum((x * (y - best)) ** 2 for x, y in zip(v, e, strict=True)) / 15
    assert (value, formal) == pytest.approx((best, math.sqrt(variance / square)), rel=1e-6)  # of the search
    notes = (f"restitution: the formal interval is {factor} times too small",) if factor else ()
    assert found.notes == notes


def test_an_upper_limit_that_one_impact_tells_is_noted():
    """Only the last impact slips, by 0.3 (1 + 0.5) 1 m/s."""
    before = [(0.0, 0.0, -1.0 - i) for i in range(20)] + [(3.0, 0.0, -1.0)]
    after = [Twist(Vec3(0.85 * x, 0.0, -0.5 * z), NOTHING) for x, _, z in before]
    balls = [Body.dynamic(1.0, velocity=velocity) for velocity in before]
    contacts = [Contact.of((0, 0, 0), (0, 0, 1))] * 21
    found = identify(Impacts.of(balls, [WALL] * 21, contacts, after, after))
    assert found.coefficients["friction"].high == math.inf
    assert found.notes == (
        "friction: too few impacts tell how large it may be; without them, no upper limit is known",
    )


@pytest.mark.parametrize(("count", "is_noted"), [(9, True), (10, False)])
def test_less_than_ten_impacts_are_noted(count, is_noted):
    notes = restitutions(*(0.5 + 0.01 * (-1) ** i for i in range(count)), resamples=2).notes
    assert notes == ((f"{count} impacts are too few for reliable intervals",) if is_noted else ())


@pytest.mark.parametrize(("repeats", "is_noted"), [(6, False), (8, True)])
def test_kinds_of_residuals_that_disagree_by_three_formal_deviations_are_noted(repeats, is_noted):
    """Weighted by mass, restitution is 0.55 +- (0.0075 / (4 repeats - 1))^(1/2), else 0.5."""
    e, mass = [0.4, 0.4, 0.6, 0.6] * repeats, [1.0, 1.0, 3.0, 3.0] * repeats
    found = restitutions(*e, mass=mass, kind="kinetic", resamples=2)
    formal = math.sqrt(0.0075 / (4 * repeats - 1))
    assert found.coefficients["restitution"][::3] == pytest.approx((0.55, formal), rel=1e-6)  # of the search
    expected = "restitution: other kinds of residuals lead to a value 0.05 away, which is 3 formal standard"
    assert [note.startswith(expected) for note in found.notes] == [True] * is_noted


@pytest.mark.parametrize(("times", "is_noted"), [(0.9e6, False), (1.1e6, True)])
def test_a_change_a_million_times_as_large_as_the_others_is_noted(times, is_noted):
    notes = restitutions(*[0.5] * 12, 1.5 * times - 1, resamples=2).notes
    assert any(note.startswith("1 impacts seem to change the motion") for note in notes) == is_noted


@pytest.mark.parametrize("count", [4, 10])
def test_a_lower_bound_is_where_the_squares_are_too_large_for_chance(count):
    """Point masses of slip 1 m/s that stick from mu = 1 on, measured with an error of 0.01 m/s. The bound is
    where the sum of squares is larger by 3.84 times the variance of a residual.
    """
    balls = [Body.dynamic(1.0, velocity=(1.0, 0.0, -1.0))] * count
    after = [Twist(Vec3(0.01 * (-1) ** i, 0.0, 0.0), NOTHING) for i in range(count)]
    measured = Impacts.of(balls, [WALL] * count, [Contact.of((0, 0, 0), (0, 0, 1))] * count, after, after)
    options = {"fit": ["friction"], "given": {"restitution": 0.0}, "loss": "linear", "resamples": 2}
    friction = identify(measured, **options).coefficients["friction"]
    assert math.isnan(friction.value) and friction.high == math.inf
    bound = 1 - 0.01 * math.sqrt(3.84 / (count - 1))
    assert friction.low == pytest.approx(bound, abs=3e-6)  # 20 halvings of 2 or so


def test_the_formal_deviation_of_a_product_is_that_of_its_line():
    """Spins of spheres that slide are mu (1 + e) v_n 2.5 / R."""
    before, floors, contacts = spheres(12, 0.5, 0.1)
    slopes = np.array([ball.velocity[2] * -25.0 for ball in before])
    spins = 0.15 * slopes + 0.02 * np.sin(np.arange(12) ** 2)
    after = [Twist(NOTHING, Vec3(math.nan, spin, math.nan)) for spin in spins.tolist()]
    measured = Impacts.of(before, floors, contacts, after, after)
    value, low, high, formal = identify(measured, kind="kinetic", loss="linear").combination
    best = slopes @ spins / (slopes @ slopes)
    variance = ((spins - best * slopes) ** 2).sum() / (12 - 2)
    assert (value, formal) == pytest.approx((best, math.sqrt(variance / (slopes @ slopes))), rel=1e-4)
    assert low < value < high
