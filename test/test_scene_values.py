"""Known answers for several simultaneous contacts; rational ones exactly."""

from __future__ import annotations

import math
import random
from fractions import Fraction as F

import pytest
from scene_cases import Scene, box, row_of_balls, speeds

from collision_response import Adjustment, Body, Contact, ImpactModel, Law, Regime, StatusCode, resolve_scene
from collision_response.physics.vector import Vec3
from collision_response.scene.frictionless import THRESHOLD

GR, LCP, LZB = Law.FRICTIONLESS, Law.MOREAU, Law.ROUTH_STRONGE


@pytest.mark.parametrize(
    ("velocities", "e", "masses", "law", "expected"),
    [
        pytest.param((1, 0, 0), 1, None, GR, (0, 0, 1), id="cradle of 3"),
        pytest.param((1, 0, 0), 1, None, LCP, (F(-1, 3), F(2, 3), F(2, 3)), id="cradle of 3, LCP"),
        pytest.param((1, 0, 0, 0, 0), 1, None, GR, (0, 0, 0, 0, 1), id="cradle of 5"),
        pytest.param((1, 0, 0, 0, 0), 1, None, LCP, (F(-3, 5), *(F(2, 5),) * 4), id="cradle of 5, LCP"),
        pytest.param((1, 1, 1, 0, 0), 1, None, GR, (0, 0, 1, 1, 1), id="three of 5 move"),
        pytest.param(
            (1, 1, 1, 0, 0), 1, None, LCP, (*(F(1, 5),) * 3, *(F(6, 5),) * 2), id="three of 5 move, LCP"
        ),
        pytest.param((1, 0, 0), 1, (1, 1, 2), GR, (F(-1, 3), 0, F(2, 3)), id="the last is heavy"),
        pytest.param((1, 0, 0), F(1, 2), None, GR, (F(1, 6), F(1, 6), F(2, 3)), id="cradle of 3, e = 1/2"),
        pytest.param((1, 0, 0), 0, None, GR, (F(1, 3),) * 3, id="cradle of 3, e = 0"),
    ],
)  # fmt: skip
def test_a_row_of_balls(velocities, e, masses, law, expected):
    answer = row_of_balls(velocities, e, masses).resolve(law)
    assert tuple(speeds(answer)) == expected
    assert answer.error_bound == 0
    in_floats = row_of_balls(velocities, e, masses, float).resolve(law)
    for speed, exact in zip(speeds(in_floats), expected, strict=True):
        assert abs(speed - exact) <= in_floats.error_bound * 2
    assert in_floats.error_bound < 1e-13


@pytest.mark.parametrize("collisions", [3, 31, 314, 3141])
def test_a_ball_between_a_wall_and_a_heavy_ball_counts_the_digits_of_pi(collisions):
    """Galperin, "Playing pool with pi", Regul. Chaotic Dyn. 8 (2003): unfolded, the path is straight."""
    heavy = 100.0 ** (len(str(collisions)) - 1)
    wedge = math.atan(heavy**-0.5)
    assert math.ceil(math.pi / wedge) - 1 == collisions
    bodies = [
        Body.sphere(heavy, 0.5, position=(1, 0, 0), velocity=(-1, 0, 0)),
        Body.sphere(1.0, 0.5),
        Body.static(),
    ]
    contacts = [Contact.of((x, 0, 0), (1, 0, 0), 1.0) for x in (0.5, -0.5)]
    answer = Scene(bodies, [(0, 1), (1, 2)], contacts).resolve(GR)
    unfolded = collisions + collisions % 2
    angle = abs(math.pi - unfolded * wedge)
    expected = math.cos(angle), math.sin(angle) * heavy**0.5
    assert speeds(answer)[:2] == pytest.approx(expected, abs=1e-12)  # pi and the angle are rounded
    assert answer.error_bound < 1e-15
    assert answer.kinetic_energy_after == pytest.approx(answer.kinetic_energy_before, rel=1e-14)


@pytest.mark.parametrize(
    ("exponent", "expected"),
    [
        (1.5, (-0.070952353651, 0.07640303907, 0.994549314581)),
        (1.0, (-0.130261695064, 0.150229569434, 0.98003212563)),
    ],
)
def test_a_cradle_of_springs_disperses(exponent, expected):
    answer = row_of_balls((1, 0, 0), number=float).resolve(
        LZB, tolerance=1e-10, options={"exponent": exponent}
    )
    assert speeds(answer) == pytest.approx(expected, abs=1e-11)
    assert answer.status is StatusCode.OK
    assert answer.error_bound <= 1e-10
    assert answer.kinetic_energy_after == pytest.approx(0.5, abs=1e-10)


def test_a_cradle_of_springs_loses_energy():
    answer = row_of_balls((1, 0, 0), 0.5, number=float).resolve(LZB)
    assert speeds(answer) == pytest.approx((0.209235, 0.218779, 0.571985), abs=1e-6)


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [(1e-8, (-1 / 3, 2 / 3, 2 / 3)), (1e8, (0, 0, 1))],
    ids=["soft first", "stiff first"],
)
def test_the_stiffness_ratio_leads_from_simultaneous_to_successive_impacts(ratio, expected):
    options = {"stiffness": [ratio, 1.0]}
    answer = row_of_balls((1, 0, 0), number=float).resolve(LZB, options=options)
    assert speeds(answer) == pytest.approx(expected, abs=2e-2)


def test_ten_balls_by_springs():
    """Converged; the first-order steps of Siconos' stored reference end at .1469234 and .9859561."""
    answer = row_of_balls((1, *(0,) * 9), number=float).resolve(LZB)
    assert speeds(answer)[-2:] == pytest.approx((0.1473903, 0.9858659), abs=1e-6)


def cue_on_two(e: float) -> Scene:
    """One ball strikes two along x, at 30 degrees to either side."""
    c, s = 3**0.5 / 2, 0.5
    bodies = [
        Body.dynamic(1.0, velocity=(1.0, 0.0, 0.0)),
        Body.dynamic(1.0, position=(c, s, 0.0)),
        Body.dynamic(1.0, position=(c, -s, 0.0)),
    ]
    contacts = [Contact.of((c / 2, y / 2, 0.0), (-c, -y, 0.0), e) for y in (s, -s)]
    return Scene(bodies, [(0, 1), (0, 2)], contacts)


@pytest.mark.parametrize("law", [GR, LCP, LZB])
@pytest.mark.parametrize(("e", "cue", "x", "y"), [(1.0, -0.2, 0.6, 0.34641016), (0.5, 0.1, 0.45, 0.2598076)])
def test_one_ball_on_two(law, e, cue, x, y):
    twists = cue_on_two(e).resolve(law).twists
    assert twists[0].linear == pytest.approx((cue, 0, 0), abs=1e-7)
    assert twists[1].linear == pytest.approx((x, y, 0), abs=1e-7)
    assert twists[2].linear == pytest.approx((x, -y, 0), abs=1e-7)


@pytest.mark.parametrize("law", [GR, LCP])
def test_a_flat_box_does_not_spin(law):
    answer = box(number=F).resolve(law)
    assert answer.twists[0].linear == (0, 0, 1)
    assert answer.twists[0].angular == (0, 0, 0)
    assert [tuple(impulse) for impulse in answer.impulses] == [(0, 0, F(1, 2))] * 4
    assert answer.regimes == (Regime.SLIDING,) * 4


@pytest.mark.parametrize("law", [GR, LCP, LZB])
def test_a_flat_block_on_two_corners_does_not_spin(law):
    scene = box(size=(1, 1, 0.5))
    two = Scene(
        scene.bodies,
        scene.pairs[:2],
        [c._replace(position=c.position._replace(y=0.0)) for c in scene.contacts[::2]],
    )
    answer = two.resolve(law)
    assert answer.twists[0].linear == pytest.approx((0, 0, 1), abs=1e-9)
    assert answer.twists[0].angular == pytest.approx((0, 0, 0), abs=1e-9)


@pytest.mark.parametrize(("rows", "expected"), [(2, F(3, 5)), (3, F(54, 95)), (4, None)])
def test_a_rack(rows, expected):
    """A cue ball breaks a triangle of balls. Root 3 only scales y, so the equations are rational."""
    c, s = 3**0.5 / 2, 0.5
    at = [(c * (i + 1), s * (2 * j - i)) for i in range(rows) for j in range(i + 1)]
    at.insert(0, (0.0, 0.0))
    bodies = [
        Body.dynamic(1.0, position=(x, y, 0.0), velocity=(float(i == 0), 0.0, 0.0))
        for i, (x, y) in enumerate(at)
    ]
    pairs, contacts = [], []
    for i, (x, y) in enumerate(at):
        for j, (z, w) in enumerate(at[:i]):
            if abs((x - z) ** 2 + (y - w) ** 2 - 1) < 1e-6:
                pairs.append((j, i))
                contacts.append(Contact.of(((x + z) / 2, (y + w) / 2, 0.0), (z - x, w - y, 0.0)))
    # the cue ball strikes the first one head on
    bodies[0] = bodies[0]._replace(position=bodies[0].position._replace(x=c - 1))
    pairs.insert(0, (0, 1))
    contacts.insert(0, Contact.of((c - 0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)))
    answer = Scene(bodies, pairs, contacts).resolve(GR)
    far = [answer.twists[-rows].linear, answer.twists[-1].linear]
    assert far[0].x == pytest.approx(far[1].x, abs=1e-13)
    assert far[0].y == pytest.approx(-far[1].y, abs=1e-13)
    value = 0.539065974796 if expected is None else float(expected)
    assert far[0].x == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("number", [F, float])
def test_reflections_jump_where_a_contact_begins_to_approach(number):
    """A gap that closes extremely slowly is struck at the same time as the first contact."""
    scene = row_of_balls((1, 0, number(F(-1, 10**12))), number=number)
    at_once = speeds(scene.resolve(GR, options={"threshold": 0}))
    assert at_once == pytest.approx((-1 / 3, 2 / 3, 2 / 3), abs=1e-11)
    answer = scene.resolve(GR)
    assert speeds(answer) == pytest.approx((0, 0, 1), abs=1e-11)
    assert answer.decision_margin < 1e-9


def falling_pair(t, number, lengths=(1, 1), still: int = 0) -> Scene:
    """A ball falls onto the floor, and a second onto the first, faster by t; ``still`` more balls touch the
    first.
    """
    zero, one = number(0), number(1)
    balls = [
        Body.dynamic(one, velocity=(zero, zero, -one)),
        Body.dynamic(one, velocity=(zero, zero, -one - number(t))),
    ]
    others = [Body.dynamic(one) for _ in range(still)]
    up = [Contact.of((zero,) * 3, (zero, zero, number(length)), one) for length in lengths]
    level = [Contact.of((zero, one, number(i)), (one, zero, zero), one) for i in range(still)]
    pairs = [(0, 2), (1, 0), *((0, 3 + i) for i in range(still))]
    return Scene([*balls, Body.static(), *others], pairs, [*up, *level])


@pytest.mark.parametrize("lengths", [(1, 1), (4, 2)])
@pytest.mark.parametrize(
    ("number", "t"),
    [
        *((F, F(1, k)) for k in (2, 3, 4, 7, 10**6)),
        *((number, t) for number in (F, float) for t in (F(3, 4), F(1, 2), F(1, 64), F(1, 2**30))),
    ],
)
def test_an_approach_at_the_threshold_counts(number, t, lengths):
    """Together they both reverse their velocities. The first alone would be struck again and leave with the
    second.
    """
    scene, little = falling_pair(t, number, lengths), F(1, 2**45)
    both, joined = [1, 1 + t], [1 + t / 2, 1 + t / 2]
    for threshold, expected in ((0, both), (t - little, both), (t, both), (t + little, joined)):
        answer = scene.resolve(GR, options={"threshold": number(threshold)})
        assert [twist.linear.z for twist in answer.twists[:2]] == [number(z) for z in expected]
        assert answer.status is StatusCode.OK
        assert answer.decision_margin == number(min(abs(t - threshold), 1 - threshold))


@pytest.mark.parametrize("number", [F, float])
@pytest.mark.parametrize("t", [F(1, 8), F(1, 2), F(3, 4)])
@pytest.mark.parametrize("walls", [((1, 1, 0), (1, -1, 0)), ((1, 2, 0), (2, -1, 0)), ((1, 0, 3), (3, 0, -1))])
@pytest.mark.parametrize("lengths", [(1, 1), (1, 3), (3, 7), (F(5, 8), 7), (1, F(1, 2**70))])
def test_a_threshold_is_exact_where_the_lengths_of_normals_are_irrational(number, t, walls, lengths):
    """A ball comes to two perpendicular walls, to the second slower by the factor t. If that is ignored, the
    second wall stops it.
    """
    first, second = (Vec3(*map(F, wall)) for wall in walls)
    both, one = first + second * t, first
    ball = Body.dynamic(number(1), velocity=tuple(number(-x) for x in both))
    contacts = [
        Contact.of([number(0)] * 3, [number(x * length) for x in wall], number(1))
        for wall, length in zip(walls, lengths, strict=True)
    ]
    scene = Scene([ball, Body.static()], [(0, 1)] * 2, contacts)
    for threshold, expected in ((t, both), (t + F(1, 2**40), one)):
        answer = scene.resolve(GR, options={"threshold": number(threshold)})
        assert answer.twists[0].linear == pytest.approx(tuple(map(float, expected)), abs=1e-14)
        assert answer.error_bound < 1e-13
        assert (answer.decision_margin == 0) is (threshold == t)


def test_an_approach_at_the_default_threshold_counts():
    """In the kernels as in fractions; in a cluster too large for fractions, without a bound."""
    t, floats = F(THRESHOLD), (float(1), float(1 + F(THRESHOLD)))
    for still in (0, 3, 9):
        answer = falling_pair(t, float, still=still).resolve(GR)
        assert tuple(twist.linear.z for twist in answer.twists[:2]) == floats
        assert (answer.error_bound < math.inf) == (still < 7)


def test_contacts_that_do_not_approach_do_not_lower_the_restitution():
    """A ball falls on a box at rest, whose own contacts have e = 0."""
    flat = box(velocity=(0, 0, 0), e=0.0)
    ball = Body.dynamic(1.0, position=(0.0, 0.0, 1.5), velocity=(0.0, 0.0, -1.0))
    contact = Contact.of((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.8)
    answer = Scene([*flat.bodies, ball], [*flat.pairs, (2, 0)], [*flat.contacts, contact]).resolve(GR)
    assert {c.restitution for c in answer.contacts} == {0.8}
    assert answer.twists[2].linear.z == pytest.approx(0.8, abs=1e-12)


@pytest.mark.parametrize("number", [float, F])
def test_moreau_may_create_energy_within_rounding(number):
    """2^-60 of the work, by a body so light that it affects only its own spin."""
    spins = (-0.125, -1.0, 1.0), (0.0, -0.5, 0.375), (0.875, -0.25, -0.75)
    bodies = [
        Body.dynamic(
            number(2), (2, 0, 0, 2, 0, 3), (-0.75, -0.5, 0.125), None, (0.75, 0.625, 0.125), spins[0]
        ),
        Body.dynamic(
            1.0, (1e9, 0, 0, 1e9, 0, 1.5e9), (0.75, 0.25, -1), None, (0.125, 0.625, -0.125), spins[1]
        ),
        Body.dynamic(
            2.0, (2e-18, 0, 0, 2e-18, 0, 2e-18), (-0.875, 0.25, 1), None, (1, -0.5, 0.875), spins[2]
        ),
    ]
    contacts = [Contact.of(at, (1, 0, 0), 1.0) for at in ((0.25, -0.5, 0.5), (0.375, -1.0, 0.75))]
    answer = resolve_scene(bodies, [(1, 0), (0, 2)], contacts, ImpactModel(Law.MOREAU))
    assert answer.adjustments is Adjustment.NONE
    assert float(answer.normal_velocities_after[1]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
def test_restitution_is_averaged_over_the_contacts_that_are_struck(law):
    own = (0.25, 0.75)
    for velocities, expected in (((0, 1, 2), own), ((2, 1, 1), own[:1] * 2), ((1, 1, 0), own[1:] * 2)):
        scene = row_of_balls(velocities, number=float)
        contacts = [c._replace(restitution=e) for c, e in zip(scene.contacts, own, strict=True)]
        answer = scene._replace(contacts=contacts).resolve(law)
        assert tuple(contact.restitution for contact in answer.contacts) == expected


def in_a_groove(slope, count, law, pair, *, turned):
    """The answer for a point that falls between flanks of ``count`` contacts each, and its error.

    The flanks share the load evenly, so the point rebounds with the mean restitution.
    """
    mu = 0.0 if law is Law.FRICTIONLESS else 1e-30
    flanks = [(side * slope, e) for side, e in zip((-1, 1), pair, strict=True) for _ in range(count)]
    contacts = [Contact.of((i, 0, 0), (x, 0, 1), e, mu) for i, (x, e) in enumerate(flanks)]
    point = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
    pairs = [(0, 1)] * len(contacts)
    order = contacts[::-1] if turned else contacts
    answer = resolve_scene([point, Body.static()], pairs, order, ImpactModel(law))
    mean = sum(pair) / 2
    return answer, abs(answer.twists[0].linear.z - mean) / (1 + mean)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("pair", [(0.5, 1.0), (0.0, 1.0), (1.0, 0.25), (0.0, 0.5)])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("slope", [2.0**-k for k in (3, 10, 17, 20, 24, 30, 36, 40, 43)])
def test_nearly_parallel_flanks_share_a_load_evenly(slope, count, law, pair, turned):
    """At any angle for up to eight contacts, which are decided in rationals."""
    answer, error = in_a_groove(slope, count, law, pair, turned=turned)
    assert error <= answer.error_bound + 1e-16  # the mean and the velocity are rounded
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-6
    assert answer.contacts[0].restitution == pytest.approx(sum(pair) / 2, rel=1e-7)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("slope", [2.0**-k for k in (3, 10, 17, 18, 19, 20, 21, 22, 24, 30, 36, 40)])
def test_an_undecided_load_is_in_the_bound(slope, law):
    """Ten contacts are too many for rationals."""
    answer, error = in_a_groove(slope, 5, law, (0.5, 1.0), turned=False)
    assert error <= answer.error_bound + 1e-16
    assert (answer.status is StatusCode.OK) == (answer.error_bound < 1e-6)


@pytest.mark.parametrize("pair", [(0.5, 1.0), (0.0, 1.0), (1.0, 0.25)])
@pytest.mark.parametrize("power", range(0, 26, 2))
def test_a_light_body_between_two_contacts_of_a_heavy_ball_does_not_turn_it(power, pair):
    """The contact at half the distance from the middle carries twice the load and has twice the weight."""
    ball = Body.dynamic(1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    mass = 10.0**-power
    grain = Body.dynamic(mass, position=(0.0, 0.0, -1.0), velocity=(0.0, 0.0, 1.0))
    contacts = [Contact.of((x, 0.0, 0.0), (0, 0, 1), e) for x, e in zip((0.5, -0.25), pair, strict=True)]
    answer = resolve_scene([ball, grain], [(0, 1)] * 2, contacts, ImpactModel(GR))
    e = (F(pair[0]) + 2 * F(pair[1])) / 3
    impulse = (1 + e) / (1 + 1 / F(mass))
    for change, inverse_mass in zip(answer.changes, (1, -1 / F(mass)), strict=True):
        error = abs(F(change.linear.z) - impulse * inverse_mass) / abs(impulse * inverse_mass)
        assert error <= answer.error_bound
    assert answer.error_bound < 1e-6
    assert answer.contacts[1].restitution == pytest.approx(float(e), rel=1e-9)


@pytest.mark.parametrize("count", [9, 12, 16])
@pytest.mark.parametrize("spread", [1e-8, 1e-7, 3e-7, 1e-6, 3e-6, 1e-5])
def test_many_nearly_parallel_normals_hold_nothing(spread, count):
    """Like those of a floor in float32. A point that falls on them must rebound as in fractions."""
    rng = random.Random(0)
    normals = [(rng.uniform(-spread, spread), rng.uniform(-spread, spread), 1.0) for _ in range(count)]
    answers = []
    for number in (float, F):
        point = Body.dynamic(number(1), velocity=(number(0.25), number(0), number(-1)))
        contacts = [
            Contact.of((number(i), number(0), number(0)), map(number, normal), number(0.5), number(0))
            for i, normal in enumerate(normals)
        ]
        pairs = [(0, 1)] * count
        answers.append(resolve_scene([point, Body.static()], pairs, contacts, ImpactModel(GR)))
    found, exact = (answer.changes[0].linear for answer in answers)
    off = math.dist(found, map(float, exact)) / math.hypot(*map(float, exact))
    assert off <= answers[0].error_bound + 1e-15  # the expected values are rounded to floats
    assert answers[0].status is StatusCode.OK
    assert answers[0].error_bound < 1e-6
