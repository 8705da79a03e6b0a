"""Decisions of scenes on their edge: whether contacts approach, and when reflections end."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction as F

import numpy as np
import pytest
from scene_cases import Scene, assert_within_bound, distance, row_of_balls, speeds

from collision_response import Adjustment, Body, Contact, ImpactModel, Law, StatusCode, resolve_scene
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.scene import frictionless
from collision_response.scene.rational_cluster import RationalCluster


@pytest.mark.parametrize(
    "speed", [0.0, -0.0, 5e-324, -5e-324, 1e-300, -1e-300, 1e-17, -1e-17, -1e-9, -(2.0**-30), 1e-9]
)
@pytest.mark.parametrize("threshold", [0, 2.0**-30])
def test_a_contact_on_the_edge_of_approaching(speed, threshold):
    """Also with a decision that is exactly a tie, which rationals decide."""
    scene = row_of_balls((1.0, 0.0, speed), number=float)
    answer = scene.resolve(Law.FRICTIONLESS, options={"threshold": threshold})
    exact = scene.in_fractions().resolve(Law.FRICTIONLESS, options={"threshold": threshold})
    assert_within_bound(scene, answer, exact)
    for mine, right in zip(speeds(answer), speeds(exact), strict=True):
        assert mine == pytest.approx(float(right), abs=1e-12)


def test_a_decision_at_the_threshold_is_made_exactly():
    """u equals -threshold to the last digit, with numbers that floats only approximate."""
    third = 1 / 3
    scene = row_of_balls((third, 0.0, -third * 2.0**-30), number=float)
    answer = scene.resolve(Law.FRICTIONLESS)
    exact = scene.in_fractions().resolve(Law.FRICTIONLESS)
    assert_within_bound(scene, answer, exact)
    assert exact.decision_margin == 0


@pytest.mark.parametrize(
    "kind", [np.float32, np.float16, np.longdouble, np.array, F], ids=lambda k: k.__name__
)
def test_a_threshold_of_another_number_type_decides_exactly_too(kind):
    plain = row_of_balls((1.0, 0.0, -0.25), number=float).resolve(
        Law.FRICTIONLESS, options={"threshold": 0.25}
    )
    other = row_of_balls((1.0, 0.0, -0.25), number=float).resolve(
        Law.FRICTIONLESS, options={"threshold": kind(0.25)}
    )
    assert plain.decision_margin == 0
    assert other == plain


def test_a_long_chain_is_within_the_budget():
    answer = row_of_balls((1, *(0,) * 99), number=float).resolve(Law.FRICTIONLESS)
    assert speeds(answer) == pytest.approx((*(0,) * 99, 1), abs=1e-12)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-10


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("e", [5e-324, 0.5, 1.0])
def test_a_light_body_rattling_under_a_heavy_one_does_not_rebound(e, law):
    """It needs more reflections than the budget, and its fractions grow without end."""
    mountain, grain = 2.0**40, 1e-6
    bodies = [
        Body.dynamic(
            mountain, (0.4 * mountain, 0, 0, 0.4 * mountain, 0, 0.4 * mountain), (0.5, 0.5, 1), None,
            (-0.5, -0.5, -0.5), (-1, 0, 0),
        ),
        Body.dynamic(grain, position=(0, 0, 1), velocity=(-0.5, 0, -0.5)),
        Body.static(),
    ]  # fmt: skip
    touches = [
        ((0, 1), (-0.5, 0, -0.5), (0, 0.6, 0.8)), ((0, 1), (0.5, 1, 0), (0, -1, 0)),
        ((1, 2), (0.5, 0, 1), (0, 0, 1)), ((0, 1), (0.5, 1, 1), (0, -1, 0)),
        ((0, 2), (1, 0.5, 0), (0, 0, 1)), ((2, 1), (-0.5, 0, -0.5), (0, 0.6, 0.8)),
        ((0, 1), (0.5 + 2.0**-30, 1, 0), (0, -1, 0)), ((1, 0), (1, 0, 0.5), (0, 0.6, 0.8)),
    ]  # fmt: skip
    contacts = [Contact.of(position, normal, e, 1.0) for _, position, normal in touches]
    pairs = [pair for pair, *_ in touches]
    answer = resolve_scene(bodies, pairs, contacts, ImpactModel(law))
    plastic = resolve_scene(bodies, pairs, [c._replace(restitution=0.0) for c in contacts], ImpactModel(law))
    assert answer.adjustments is Adjustment.NO_REBOUND and not plastic.adjustments
    assert answer.contacts == plastic.contacts
    scene = Scene(bodies, pairs, contacts)
    assert distance(scene, answer, plastic) <= answer.error_bound + plastic.error_bound + 1e-15


@pytest.mark.parametrize("kind", [float, F])
@pytest.mark.parametrize("walls", [0, 2])
@pytest.mark.parametrize("mass", [1e2, 1e4, 1e6, 1e9, 1e12])
def test_a_ball_that_rattles_takes_no_more_digits_than_the_budget(kind, walls, mass, monkeypatch):
    """Summed over all reflections, between a heavy body and the ground, also next to walls."""
    spent = []

    def violated(self, p, threshold, told=RationalCluster.violated):
        spent.append(len(p) ** 2 * max(x.denominator.bit_length() for x in p))
        return told(self, p, threshold)

    monkeypatch.setattr(RationalCluster, "violated", violated)
    bodies = [Body.dynamic(kind(1), velocity=(0, 0, 1)), Body.dynamic(mass), Body.static()]
    contacts = [Contact.of((0, 0, 0), n, 1.0) for n in ((0, 0, 1), (0, 0, 1), (0, 1, 0), (0, -1, 0))]
    answer = resolve_scene(bodies, [(1, 0), (0, 2), (0, 2), (0, 2)][: 2 + walls], contacts[: 2 + walls])
    if answer.adjustments:
        assert answer.adjustments is Adjustment.NO_REBOUND and mass > 1e4
        # Kernels reach the 10,000 reflections after which the law says so. Fractions give up long before,
        # unless the changes are so small that more of them do not matter.
        assert math.isinf(answer.error_bound) if spent and mass < 1e9 else answer.error_bound < 1e-3
        assert answer.kinetic_energy_after == pytest.approx(0.5 / (1 + mass), rel=1e-6)  # they move as one
    else:
        assert answer.kinetic_energy_after == pytest.approx(0.5, rel=1e-6)
        assert answer.error_bound < 1e-3
    assert sum(spent[:-1]) <= frictionless.DIGITS  # what goes beyond is not looked at again
    assert spent or not (walls or kind is F)


def projected(v: tuple[F, ...], *normals: tuple[F, ...]) -> tuple[F, ...]:
    """The velocity nearest to v that approaches neither of two walls at rest."""

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    def less(a, b, factor):
        return tuple(x - factor * y for x, y in zip(a, b, strict=True))

    n, m = normals
    along_both = less(m, n, dot(m, n) / dot(n, n))  # the part of m across n
    first = less(v, n, dot(v, n) / dot(n, n))
    candidates = [v, first, less(v, m, dot(v, m) / dot(m, m))]
    if any(along_both):
        candidates.append(less(first, along_both, dot(first, along_both) / dot(along_both, along_both)))
    allowed = [w for w in candidates if min(dot(w, n), dot(w, m)) >= 0]
    return min(allowed, key=lambda w: dot(less(w, v, 1), less(w, v, 1)))


@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize("velocity", [(1.0, 0.3, 0.2), (1.0, -0.3, 0.0), (-0.7, 0.0, 0.2), (-0.7, 0.4, 0.0)])
@pytest.mark.parametrize(
    "off", [0.0, *(sign * 10.0**-k for k in (8, 11, 12, 13, 14, 15, 16, 18) for sign in (1, -1))]
)
def test_between_walls_that_are_parallel_but_for_rounding_nothing_rebounds(e, velocity, off, monkeypatch):
    """As between the fingers of a gripper, whose normals are rounded. They close by 1e-16 or open by 1e-16.

    Reflections would go on for ever, and hardly change anything: hardly any digits are needed to know that.
    """
    monkeypatch.setattr(frictionless, "DIGITS", 2**14)
    normals = ((1.0, 0.0, 0.0), (-1.0, off, 0.0))
    bodies = [Body.dynamic(2.0, velocity=velocity), Body.static(), Body.static()]
    contacts = [Contact.of((0, 0, 0), n, e) for n in normals]
    answer = resolve_scene(bodies, [(0, 1), (0, 2)], contacts, ImpactModel(Law.FRICTIONLESS))
    assert answer.status is StatusCode.OK
    assert answer.adjustments is (Adjustment.NO_REBOUND if off else Adjustment.NONE)
    exact = projected(tuple(map(F, velocity)), *(tuple(map(F, n)) for n in normals))
    change = math.dist(exact, velocity)
    assert math.dist(answer.twists[0].linear, exact) <= answer.error_bound * change + 1e-16 <= 1e-6
    lost = answer.kinetic_energy_before - answer.kinetic_energy_after
    assert answer.energy_lost_restitution == pytest.approx(lost, abs=1e-9 + 2 * answer.error_bound)
    # The impulses do what the answer says, up to their own rounding: those of walls that close are 1e15 N s.
    P = [math.fsum(impulse[k] for impulse in answer.impulses) / 2.0 for k in range(3)]
    size = sum(impulse.norm() for impulse in answer.impulses)
    assert math.dist(P, answer.changes[0].linear) <= 1e-6 + 2.0**-50 * size


@pytest.mark.parametrize("corners", [1, 2, 3, 4])
def test_many_reflections_of_few_digits_are_within_the_budget_too(corners, monkeypatch):
    """A box between two walls that open slowly. Its velocities stay multiples of 2^-24.

    With an eighth of the usual budgets, of which 2 contacts use up the number of reflections.
    """
    monkeypatch.setattr(frictionless, "DIGITS", frictionless.DIGITS // 8)
    monkeypatch.setattr(frictionless, "REFLECTIONS", frictionless.REFLECTIONS // 8)
    looks = []
    violated = RationalCluster.violated
    monkeypatch.setattr(RationalCluster, "violated", lambda *given: looks.append(1) or violated(*given))
    points = [(y, z) for y in (-0.5, 0.5) for z in (-0.5, 0.5)][:corners]
    contacts = [Contact.of((-side / 2, *at), (side, 0, 0), 1.0) for side in (1, -1) for at in points]
    bodies = [
        Body.box(1.0, (1.0, 1.0, 1.0), velocity=(1.0, 0.0, 0.0)),
        Body.static(),
        Body.kinematic(velocity=(2.0**-24, 0.0, 0.0)),
    ]
    answer = resolve_scene(bodies, [(0, 1)] * corners + [(0, 2)] * corners, contacts)
    assert answer.adjustments is Adjustment.NO_REBOUND
    assert len(looks) <= frictionless.REFLECTIONS
    assert (len(looks) - 1) * len(contacts) ** 2 * frictionless.LEAST_DIGITS <= frictionless.DIGITS


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("velocity", [(1, 0, 0), (2.0**20, 0, 0), (1, 0, 2.0**-40), (0, 0, 0)])
@pytest.mark.parametrize("corners", [2, 4])
def test_bodies_that_do_not_approach_are_unchanged(law, velocity, corners):
    box = Body.box(1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=velocity)
    points = [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)][:corners]
    touches = [Contact.of(point, (0, 0, 1), 0.5, 0.5) for point in points]
    scene = resolve_scene([box, Body.static()], [(0, 1)] * corners, touches, ImpactModel(law))
    assert (scene.status, scene.error_bound) == (StatusCode.SEPARATING, 0)
    assert scene.twists[0].linear == velocity and not any(map(any, scene.impulses))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(
    "velocities", [(1, 1, 1), (-1, 0, 0), (-1, 0, 1, 1), (0.1, 0.1, 0.1), (0, 1e-300, 1)]
)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_bodies_that_move_together_do_not_approach(law, velocities, e):
    """With equal velocities there is no approach, to all digits."""
    scene = row_of_balls(velocities, e, number=float)
    answer = scene.resolve(law)
    assert (answer.status, answer.error_bound) == (StatusCode.SEPARATING, 0)
    assert speeds(answer) == list(velocities) and not any(map(any, answer.impulses))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("contacts", [2, 8, 9])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize("below", [-(2.0**-130), -(2.0**-300), 0.0, 2.0**-130])
def test_an_approach_below_double_double_precision_is_decided(law, contacts, friction, turning, below):
    """Double-doubles keep nothing of 1 + 2^-60 + below - 1 - 2^-60. As a spin, nothing is lost."""
    a = Body.dynamic(1.0, (1, 0, 0, 1, 0, 1), velocity=(1.0, 2.0**-60, 0.0 if turning else below))
    b = Body.dynamic(2.0, (1, 0, 0, 1, 0, 1), velocity=(1.0, 2.0**-60, 0.0))
    if turning:  # about z: of contacts on the x axis it moves only y
        a = a._replace(angular_velocity=Vec3(0.0, 0.0, below))
    places = [(1.0 + i, 0.0, 0.0) for i in range(contacts)]
    touches = [Contact.of(place, (1, 1, 1), 0.5, friction) for place in places]
    answer = resolve_scene([a, b], [(0, 1)] * contacts, touches, ImpactModel(law))
    if not below < 0:
        assert (answer.status, answer.error_bound) == (StatusCode.SEPARATING, 0)
        return
    in_rationals = contacts <= 8 and (
        law is Law.FRICTIONLESS or (not friction and law is not Law.ROUTH_STRONGE)
    )
    assert answer.error_bound < 1e-5
    scene = Scene([a, b], [(0, 1)] * contacts, touches)
    if not in_rationals:  # as for an observer who moves with body_b
        resting = [body._replace(velocity=body.velocity - b.velocity) for body in (a, b)]
        seen = scene._replace(bodies=resting).resolve(law)
        assert distance(scene, answer, seen) <= answer.error_bound + seen.error_bound
        return
    rational = Law.MOREAU if law is Law.MOREAU else Law.FRICTIONLESS
    bodies = [
        body._replace(
            mass=F(body.mass),
            inertia=Symmetric3(*map(F, body.inertia)),
            position=Vec3(*map(F, body.position)),
            velocity=Vec3(*map(F, body.velocity)),
            angular_velocity=Vec3(*map(F, body.angular_velocity)),
        )
        for body in (a, b)
    ]
    touches = [Contact.of(tuple(map(F, place)), (F(1), F(1), F(1)), F(1, 2), F(0)) for place in places]
    exact = resolve_scene(bodies, [(0, 1)] * contacts, touches, ImpactModel(rational))
    assert answer.error_bound < 1e-6
    assert distance(scene, answer, exact) <= answer.error_bound


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_bodies_that_move_together_need_no_fractions(law, monkeypatch):
    """A box on a lift."""
    monkeypatch.setattr("collision_response.scene.in_fractions._has_approach", pytest.fail)
    velocity, corners = (1.1, 0.3, -0.7), [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    box = Body.box(1.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=velocity)
    touches = [Contact.of(corner, (0.1, -0.3, 1.0), 0.5, 0.3) for corner in corners]
    answer = resolve_scene(
        [box, Body.kinematic((0, 0, 0), velocity)], [(0, 1)] * 4, touches, ImpactModel(law)
    )
    assert (answer.status, answer.error_bound) == (StatusCode.SEPARATING, 0)


def row_between_walls(masses, count: int, e: float, mu: float) -> Scene:
    """Balls of these masses in turn, between two walls at rest; the first one moves."""
    row = row_of_balls(
        [1.0] + [0.0] * (count - 1), e, [masses[i % len(masses)] for i in range(count)], number=float
    )
    ends = [Contact.of((-0.5, 0, 0), (1, 0, 0), e), Contact.of((count - 0.5, 0, 0), (-1, 0, 0), e)]
    scene = Scene(
        [*row.bodies, Body.static()], [*row.pairs, (0, count), (count - 1, count)], row.contacts + ends
    )
    return scene.with_contacts(friction=mu)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("masses", [(1.0,), (1.0, 3.0), (0.1, 1.0, 10.0), (1e-6, 1.0, 1e6)])
@pytest.mark.parametrize("count", [3, 7, 8, 9, 11, 21, 64, 65])
def test_a_row_between_walls_gains_no_energy(count, masses, law):
    """No velocities rebound from all contacts. More than eight contacts do not rebound at all."""
    for e, mu in itertools.product((0.0, 0.5, 1.0), (0.0, 0.3)):
        answer = row_between_walls(masses, count, e, mu).resolve(law)
        before, after = answer.kinetic_energy_before, answer.kinetic_energy_after
        assert 0 <= after <= before * (1 + 1e-12)
        if mu == 0:
            lost = answer.energy_lost_restitution + answer.energy_lost_friction
            assert before - after == pytest.approx(lost, rel=1e-9, abs=1e-9 * before)
            if e > 0 and count > 7:
                assert Adjustment.NO_REBOUND in answer.adjustments
                assert (Adjustment.LAW_FALLBACK in answer.adjustments) == (law is Law.MOREAU)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("options", [{}, {"orders": 1}], ids=["kernels", "python"])
@pytest.mark.parametrize(
    ("velocity", "normal"),
    [
        ((0.0, 0.0, -0.1), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, -0.1), (0.0, 0.0, 0.7)),
        ((-1 / 3, -2 / 3, -2 / 3), (1.0, 2.0, 2.0)),
        ((-0.1, -0.2, -0.3), (0.1, 0.2, 0.3)),
        ((-0.3, 0.7, -1e-9), (3e80, 1e80, 2e80)),
        ((-1e-300, 0.0, -3e-300), (1e-200, 0.0, 1e-200)),
    ],
)
@pytest.mark.parametrize("ulps", [-1, 0, 1])
def test_a_restitution_threshold_next_to_the_approach_speed(velocity, normal, ulps, options, law):
    """Exactly at the threshold there is restitution; below it by less than any rounding there is none."""
    square = F(sum(F(v) * F(n) for v, n in zip(velocity, normal, strict=True))) ** 2
    length_square = sum(F(n) ** 2 for n in normal)
    length = math.hypot(*normal)
    threshold = abs(sum(v * (n / length) for v, n in zip(velocity, normal, strict=True)))
    for _ in range(abs(ulps)):
        threshold = math.nextafter(threshold, math.inf * ulps)
    is_below = square < F(threshold) ** 2 * length_square
    ball = Body.dynamic(1.0, (0.5, 0, 0, 0.5, 0, 0.5), velocity=velocity)
    touches = [Contact.of((x, 0, 0), normal, 0.5) for x in (0.0, 0.25)]
    model = ImpactModel(law, restitution_threshold=threshold)
    answer = resolve_scene([ball, Body.static()], [(0, 1)] * 2, touches, model, **options)
    assert (Adjustment.RESTITUTION_THRESHOLD in answer.adjustments) == is_below
    assert {contact.restitution for contact in answer.contacts} == {0.0 if is_below else 0.5}
    if law is Law.COULOMB:  # has no answer in fractions
        return
    exact = Scene([ball, Body.static()], [(0, 1)] * 2, touches).in_fractions()
    assert exact.resolve(law, restitution_threshold=threshold).contacts == answer.contacts


@pytest.mark.parametrize("number", [float, F])
@pytest.mark.parametrize("slope", [2.0**-40, 2.0**-50])
def test_reflections_without_an_end_tell_their_margin(slope, number):
    """In a narrow wedge, a ball would be reflected too often."""
    ball = Body.dynamic(number(1), velocity=(1.0, 0, 0))
    wedge = [Contact.of((0, 0, 0), (x, -slope, 0)) for x in (1, -1)]
    answer = resolve_scene([ball, Body.static()], [(0, 1)] * 2, wedge, ImpactModel(Law.FRICTIONLESS))
    assert Adjustment.NO_REBOUND in answer.adjustments
    assert answer.decision_margin == pytest.approx(1.0)
