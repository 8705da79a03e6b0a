"""Scenes built to break the answer: ties, cancellation, undecidable cases, opposite magnitudes in one
cluster.
"""

from __future__ import annotations

import itertools
import math
import random
from fractions import Fraction as F

import pytest
from refusals import refused
from scene_cases import (
    Scene,
    any_scene,
    assert_within_bound,
    box,
    change_norm,
    distance,
    random_scene,
    row_of_balls,
    speeds,
)

from collision_response import (
    Adjustment,
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    StatusCode,
    resolve_scene,
)
from collision_response.physics.orientation import Quaternion
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.scene import reflections
from collision_response.scene.rational_cluster import RationalCluster


@pytest.mark.parametrize("masses", list(itertools.permutations((1e-12, 1.0, 1e12))))
@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_masses_of_opposite_range(masses, e):
    scene = row_of_balls((1, 0, -0.5), e, masses, float)
    answer = scene.resolve(Law.FRICTIONLESS)
    assert_within_bound(scene, answer, scene.in_fractions().resolve(Law.FRICTIONLESS))
    assert answer.error_bound < 4e-9  # the root of what double-double leaves where 1e12 cancels


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(
    ("law", "mass", "speed"),
    [
        (Law.FRICTIONLESS, 1e300, 1.2e4),  # that of MOREAU is infinite
        *(
            (law, *scene)
            for law in (Law.FRICTIONLESS, Law.MOREAU)
            for scene in ((1e300, 1e-140), (1e-300, 1e-18), (1e-300, 1e-12))
        ),
    ],
)
def test_energies_and_impulses_at_the_end_of_float64(law, mass, speed, e):
    """The square of a change overflows or underflows, or an impulse has few digits left."""
    scene = box((0.3 * speed, 0, -speed), (0.1 * speed, 0.2 * speed, 0), e=e, mass=mass)
    answer = scene.resolve(law)
    assert_within_bound(scene, answer, scene.in_fractions().resolve(law))


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("mass", [1e-12, 1e12])
def test_a_box_of_any_mass(mass, law):
    one = box((1, 0.5, -1), e=0.5, mu=0.3).resolve(law)
    other = box((1, 0.5, -1), e=0.5, mu=0.3, mass=mass).resolve(law)
    assert other.twists[0].linear == pytest.approx(one.twists[0].linear, abs=1e-7)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_a_box_of_any_size(size):
    scene = box((1, 0.5, -1), e=0.5, mu=0.3, size=(size, size, size))
    assert scene.resolve().twists[0].linear == pytest.approx(
        box((1, 0.5, -1), e=0.5, mu=0.3).resolve().twists[0].linear, abs=1e-7
    )


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_normals_of_any_length(law):
    scene = box((1, 0.5, -1), (0.3, -0.2, 0.1), e=0.5, mu=0.3)
    lengths = (1e-9, 0.3, 7.0, 1e9)
    odd = Scene(
        scene.bodies,
        scene.pairs,
        [c._replace(normal=c.normal * k) for c, k in zip(scene.contacts, lengths, strict=True)],
    )
    one, other = scene.resolve(law), odd.resolve(law)
    assert distance(scene, one, other) < 1e-7
    for P, Q in zip(one.impulses, other.impulses, strict=True):
        assert pytest.approx(P, abs=1e-6) == Q
    assert other.normal_velocities_after == pytest.approx(one.normal_velocities_after, abs=1e-7)


def test_a_flat_box_in_any_orientation():
    """Its four contacts depend on each other; their numbers are rounded now."""
    for k in range(12):
        q = Quaternion(math.sin(k), math.cos(2 * k), math.sin(3 * k + 1), 1.0)
        flat = box(e=0.7)
        turned = Scene(
            [
                flat.bodies[0]._replace(
                    orientation=q,
                    velocity=q.rotation().to_world(flat.bodies[0].velocity),
                    position=q.rotation().to_world(flat.bodies[0].position),
                ),
                flat.bodies[1],
            ],
            flat.pairs,
            [
                c._replace(position=q.rotation().to_world(c.position), normal=q.rotation().to_world(c.normal))
                for c in flat.contacts
            ],
        )
        answer = turned.resolve()
        assert answer.error_bound < 1e-12
        assert change_norm(turned, answer) == pytest.approx(1.7, abs=1e-12)
        for P in answer.impulses:
            assert P.norm() == pytest.approx(1.7 / 4, abs=1e-9)


@pytest.mark.parametrize("first", range(1, 200, 50))
def test_a_table_on_many_legs_is_not_pressed(first):
    """Its inertia is small for legs so far apart. Two of them may carry much more than its weight."""
    places = [(x / 2, y / 6, 0.0) for x in (-1, 0, 1) for y in (-3, -1, 1, 3)]
    contacts = [Contact.of(place, (0.0, 0.0, 1.0), 0.5) for place in places]
    for side in range(first, first + 50):
        table = Body.box(1.0, (side / 100,) * 3, velocity=(0.0, 0.0, -1.0))
        answer = resolve_scene([table, Body.static()], [(0, 1)] * 12, contacts)
        assert answer.twists[0].linear.z == pytest.approx(0.5, abs=1e-9), side
        assert answer.error_bound < 1e-9
        assert not answer.adjustments


@pytest.mark.parametrize("masses", [(0.02, 1e-6, 1e5), (0.1, 1e-6, 1e5), (1.0, 1e-5, 1e6), (1.0, 1e-3, 1e9)])
def test_a_light_box_between_heavy_ones_does_not_hide_how_loads_are_shared(masses):
    """To doubles, the contacts on both sides of it depend on each other."""
    pairs, contacts = [], []
    for level in range(3):
        for corner, e in zip(box().contacts, (0.0, 0.5, 1.0, 0.5), strict=True):
            pairs.append((level, level - 1 if level else 3))
            contacts.append(corner._replace(position=corner.position + Vec3(0.0, 0.0, level), restitution=e))
    bodies = [
        Body.box(mass, (1.0, 1.0, 1.0), position=(0.0, 0.0, level + 0.5), velocity=(0.0, 0.0, speed))
        for level, (mass, speed) in enumerate(zip(masses, (0.0, -1.0, 1.0), strict=True))
    ]
    for seed in range(5):
        order = random.Random(seed).sample(range(12), 12)
        shuffled = [contacts[i] for i in order]
        answer = resolve_scene([*bodies, Body.static()], [pairs[i] for i in order], shuffled)
        assert answer.contacts[0].restitution == pytest.approx(0.5)
        assert answer.error_bound < 1e-7
        assert [tuple(change.angular) for change in answer.changes] == [
            pytest.approx((0, 0, 0), abs=1e-9)
        ] * 4


@pytest.mark.parametrize("seed", range(10))
def test_many_contacts_of_unequal_restitution_share_their_load(seed):
    """Which share each has follows from impulses that have no effect, to the last of 32 digits."""
    rng = random.Random(seed)
    places = [(x / 8, y / 8) for x in (-3, -1, 0, 1, 3) for y in (-3, -1, 1, 3)]
    contacts = [
        Contact.of((x, y, -0.5), (rng.choice([0.0, 0.0, 0.125]), 0.0, length), rng.choice([0.0, 0.5, 1.0]))
        for (x, y), length in zip(rng.sample(places, 11), rng.choices([1.0, 0.25, 7.0], k=11), strict=True)
    ]
    table = Body.box(1.0, (2.0, 2.0, 1.0), velocity=(0.25, 0.0, -1.0), angular_velocity=(0.5, 0.0, 0.0))
    scene = Scene([table, Body.static()], [(0, 1)] * 11, contacts)
    answer, exact = scene.resolve(), scene.in_fractions().resolve()
    assert answer.error_bound < 1e-9
    assert_within_bound(scene, answer, exact)
    assert answer.contacts[0].restitution == pytest.approx(float(exact.contacts[0].restitution), abs=1e-9)
    assert answer.regimes == exact.regimes


@pytest.mark.parametrize("tilt", [1e-300, 1e-17, 1e-15, 1e-12, 1e-9, 1e-6])
def test_contacts_that_almost_depend_on_each_other(tilt):
    """The fourth normal differs slightly from the others."""
    scene = box((0.1, 0, -1), (0.2, 0.1, 0), e=0.6)
    contacts = [*scene.contacts[:3], scene.contacts[3]._replace(normal=Vec3(tilt, 0.0, 1.0))]
    almost = Scene(scene.bodies, scene.pairs, contacts)
    answer = almost.resolve(Law.FRICTIONLESS)
    assert_within_bound(almost, answer, almost.in_fractions().resolve(Law.FRICTIONLESS))
    assert min(answer.normal_velocities_after) >= -1e-12


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


def test_massless_spin_does_not_change():
    rod = Body.dynamic(
        1.0, (0.0, 0.0, 0.0, 1 / 12, 0.0, 1 / 12), (0.0, 0.0, 0.1), None, (0.0, 0.0, -1.0), (9.0, 0.0, 0.0)
    )
    point = Body.dynamic(2.0, position=(0.4, 0.0, 0.3), velocity=(0.0, 0.0, -2.0))
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.2) for x in (-0.5, 0.5)]
    contacts.append(Contact.of((0.4, 0.1, 0.2), (0.0, 0.2, 1.0), 0.5, 0.2))
    scene = Scene([rod, Body.static(), point], [(0, 1), (0, 1), (2, 0)], contacts)
    for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE):
        answer = scene.resolve(law)
        assert answer.adjustments.name == "MASSLESS_SPIN"
        assert answer.changes[0].angular.x == 0
        assert answer.changes[2].angular == (0, 0, 0)
        assert min(answer.normal_velocities_after) > -1e-9
    answers = (one.resolve(Law.FRICTIONLESS) for one in (scene, scene.in_fractions()))
    assert_within_bound(scene, *answers)


def test_an_offset_centre_of_mass_is_the_same_body():
    scene = box((1, 0.5, -1), (0.3, -0.2, 0.5), e=0.5, mu=0.3)
    body, c = scene.bodies[0], Vec3(0.3, -0.1, 0.2)
    moved = body._replace(
        com=c,
        position=body.position - c,
        velocity=Vec3(*body.velocity) - Vec3(*body.angular_velocity).cross(c),
    )
    one, other = scene.resolve(), Scene([moved, scene.bodies[1]], *scene[1:]).resolve()
    angular = other.twists[0].angular
    assert angular == pytest.approx(one.twists[0].angular, abs=1e-9)
    assert other.twists[0].linear + angular.cross(c) == pytest.approx(one.twists[0].linear, abs=1e-9)
    for P, Q in zip(one.impulses, other.impulses, strict=True):
        assert pytest.approx(P, abs=1e-6) == Q


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_extremely_large_and_small_friction(law):
    for mu, like in ((1e300, 1e6), (1e-300, 0.0)):
        one, other = box((1, 0, -1), e=0.5, mu=mu).resolve(law), box((1, 0, -1), e=0.5, mu=like).resolve(law)
        assert one.twists[0].linear == pytest.approx(other.twists[0].linear, abs=1e-5)


def test_a_moving_wall_may_add_energy_but_contacts_lose_it():
    """A lift carries a box upwards: the kinetic energy grows by the work of the lift."""
    scene = box((0, 0, -1), e=0.5, mu=0.3)
    lift = Scene([scene.bodies[0], Body.kinematic(velocity=(0.2, 0.0, 3.0))], *scene[1:])
    for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE):
        answer = lift.resolve(law)
        assert answer.twists[0].linear.z == pytest.approx(
            5.0, abs=1e-6 if law is not Law.ROUTH_STRONGE else 0.01
        )
        assert answer.kinetic_energy_after > answer.kinetic_energy_before
        assert answer.energy_lost_restitution + answer.energy_lost_friction > 0


def test_contacts_on_a_rotating_wall_are_not_interchangeable():
    """The same impulse elsewhere on the wall would do different work."""
    body = Body.dynamic(1.0, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, -1.0))
    wall = Body.kinematic((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.5, 0.0))
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0) for x in (-0.2, -0.1, 0.0, 0.1)]
    answer = resolve_scene([body, wall], [(0, 1)] * 4, contacts)
    lost = -sum(
        P.z * (u + w) / 2
        for P, u, w in zip(
            answer.impulses, answer.normal_velocities_before, answer.normal_velocities_after, strict=True
        )
    )
    assert lost == pytest.approx(answer.energy_lost_restitution, abs=1e-12)
    assert lost >= -1e-12


@pytest.mark.parametrize("number", [2, 3, 8, 20])
def test_stacks_come_to_rest_and_bounce_as_one(number):
    """Boxes on boxes on a floor, all falling: at e = 0 all stop, with the load of a stack on each contact."""
    flat = box(e=0.0, mu=0.5)
    bodies = [flat.bodies[0]._replace(position=Vec3(0.0, 0.0, k + 0.5)) for k in range(number)] + [
        Body.static()
    ]
    pairs, contacts = [], []
    for k in range(number):
        below = k - 1 if k else number
        pairs += [(k, below)] * 4
        contacts += [c._replace(position=c.position._replace(z=float(k))) for c in flat.contacts]
    scene = Scene(bodies, pairs, contacts)
    for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU):
        answer = scene.resolve(law)
        for k in range(number):
            assert answer.twists[k].linear == pytest.approx((0, 0, 0), abs=1e-7)
            for P in answer.impulses[4 * k : 4 * k + 4]:
                assert P.z == pytest.approx((number - k) / 4, abs=1e-5)
    elastic = scene.with_contacts(restitution=1.0, friction=0.0).resolve()
    assert elastic.kinetic_energy_after == pytest.approx(elastic.kinetic_energy_before, rel=1e-9)
    assert elastic.error_bound < 1e-9


def test_a_long_chain_is_within_the_budget():
    answer = row_of_balls((1, *(0,) * 99), number=float).resolve(Law.FRICTIONLESS)
    assert speeds(answer) == pytest.approx((*(0,) * 99, 1), abs=1e-12)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-10


def reordered(scene: Scene, turn: int) -> Scene:
    """The same contacts in another order, some with their bodies swapped."""
    count = len(scene.pairs)
    order = [(i * 7 + turn) % count for i in range(count)] if count % 7 else list(reversed(range(count)))
    pairs, contacts = [], []
    for place, i in enumerate(order):
        (a, b), contact = scene.pairs[i], scene.contacts[i]
        other_side = place % 2 == 0
        pairs.append((b, a) if other_side else (a, b))
        contacts.append(contact._replace(normal=-Vec3(*contact.normal)) if other_side else contact)
    return Scene(scene.bodies, pairs, contacts)


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
def test_large_friction_has_one_answer_in_any_order(law):
    """At mu = 3 Coulomb's law has several solutions; always the same one must be found."""
    for seed in (16, 133, 400, *range(600, 630)):
        scene = random_scene(seed, mu=3.0, contacts=30)
        assert distance(scene, scene.resolve(law), reordered(scene, seed).resolve(law)) < 1e-6


def test_impulses_with_friction_have_the_least_norm():
    """A box that slides and turns: four corners share six equations."""
    numpy = pytest.importorskip("numpy")
    for velocity, spin, mu in (((1, 0.5, -1), (0, 0, 0), 0.3), ((0.1, 0.02, -1), (0, 0, 0.1), 3.0)):
        scene = box(velocity, spin, e=0.5, mu=mu)
        answer = scene.resolve(Law.COULOMB)
        sticks = mu == 3.0
        columns = []
        for contact, impulse in zip(scene.contacts, answer.impulses, strict=True):
            arm = contact.position - scene.bodies[0].position
            axes = (
                [Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)] if sticks else [impulse * (1 / impulse.norm())]
            )
            columns += [[*axis, *arm.cross(axis)] for axis in axes]
        matrix = numpy.array(columns).T
        own = numpy.array(answer.impulses)
        given = own.ravel() if sticks else numpy.linalg.norm(own, axis=1)
        least = numpy.linalg.pinv(matrix) @ (matrix @ given)
        assert given == pytest.approx(least, abs=1e-5)


def rod_on_supports(least: float, offset: float, mu: float, coupled: bool) -> Scene:
    """A body that hardly resists turning about z, or about an axis in the plane x = 0, on three contacts."""
    s, c = (0.6, 0.8) if coupled else (0.0, 1.0)
    inertia = (1.0, 0.0, 0.0, c * c + s * s * least, s * c * (1 - least), s * s + c * c * least)
    rod = Body.dynamic(1.0, inertia, (0, 0, 1), None, (1.0, 0.5, -1.0), (0.0, 0.0, 1.0))
    contacts = [
        Contact.of(
            (offset * math.cos(k), offset * math.sin(k), 0.1 * k), (0.0, 0.1 * math.sin(k), 1.0), 0.5, mu
        )
        for k in range(3)
    ]
    return Scene([rod, Body.static()], [(0, 1)] * 3, contacts)


@pytest.mark.parametrize(
    ("least", "coupled"),
    [*((least, False) for least in (1e-6, 1e-12, 1e-14, 1e-16, 1e-18, 1e-20)), (1e-6, True), (1e-12, True)],
)
@pytest.mark.parametrize("offset", [1e-8, 1e-4, 0.1])
def test_the_bound_includes_turning_about_an_axis_of_little_inertia(least, offset, coupled):
    """A small error of an impulse changes the spin about that axis by much more."""
    smooth = rod_on_supports(least, offset, 0.0, coupled)
    answer, exact = smooth.resolve(), smooth.in_fractions().resolve()
    if answer.error_bound < math.inf:
        assert_within_bound(smooth, answer, exact)
    for mu in (0.3, 1.0):
        rough = rod_on_supports(least, offset, mu, coupled)
        answers = [
            Scene(rough.bodies, rough.pairs, list(order)).resolve()
            for order in itertools.permutations(rough.contacts)
        ]
        bound = max(answer.error_bound for answer in answers)
        for other in answers[1:] if bound < 1 else []:
            assert distance(rough, answers[0], other) <= 2 * bound


@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 1e6, 1e12])
def test_friction_in_a_chain_of_extreme_masses(ratio):
    """Balls that rub along each other: energy is lost, and no contact approaches afterwards."""
    bodies = [
        Body.dynamic(
            ratio**k, (0.4 * ratio**k, 0, 0, 0.4 * ratio**k, 0, 0.4 * ratio**k), (2.0 * k, 0, 0), None,
            (1.0 - k, 0.3 * k, 0.0),
        )
        for k in range(3)
    ]  # fmt: skip
    contacts = [Contact.of((2.0 * k + 1, 0, 0), (-1, 0, 0), 0.5, 0.3) for k in range(2)]
    answer = Scene(bodies, [(0, 1), (1, 2)], contacts).resolve(Law.COULOMB)
    assert answer.energy_lost_friction >= -1e-12 * answer.kinetic_energy_before
    assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + 1e-12)
    assert min(answer.normal_velocities_after) >= -1e-9


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
def test_frictionless_contacts_next_to_rough_ones(law):
    """Two corners slide and two would stick: the smooth ones get no tangential impulse."""
    scene = box((1, 0.5, -1), e=0.5)
    mixed = scene._replace(
        contacts=[c._replace(friction=mu) for c, mu in zip(scene.contacts, (0.0, 3.0, 0.0, 3.0), strict=True)]
    )
    answer = mixed.resolve(law)
    for contact, impulse in zip(answer.contacts, answer.impulses, strict=True):
        assert math.hypot(impulse.x, impulse.y) <= contact.friction * impulse.z * (1 + 1e-9)
    assert answer.energy_lost_friction > 0


@pytest.mark.parametrize("speed", [1e-150, 1e150])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_units_of_speed_do_not_matter(speed, law):
    one = box((1, 0.5, -1), (0.3, -0.2, 0.1), e=0.5, mu=0.3).resolve(law)
    other = box(
        (speed, 0.5 * speed, -speed), (0.3 * speed, -0.2 * speed, 0.1 * speed), e=0.5, mu=0.3
    ).resolve(law)
    assert other.twists[0].linear * (1 / speed) == pytest.approx(one.twists[0].linear, abs=1e-7)


def in_units(scene: Scene, mass: int, length: int, time: int) -> Scene:
    """The same scene in units that are powers of two of the old ones."""
    m, d, t = 2.0**mass, 2.0**length, 2.0**time
    bodies = [
        body._replace(
            mass=body.mass * m,
            inertia=type(body.inertia)(*(x * m * d * d for x in body.inertia)),
            position=body.position * d,
            velocity=Vec3(*body.velocity) * (d / t),
            angular_velocity=Vec3(*body.angular_velocity) * (1 / t),
            com=Vec3(*body.com) * d,
        )
        for body in scene.bodies
    ]
    return Scene(bodies, scene.pairs, [c._replace(position=Vec3(*c.position) * d) for c in scene.contacts])


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("units", [(2, 0, 0), (40, 0, 0), (0, 6, 0), (0, 0, 7), (20, -10, -8)])
def test_units_that_are_powers_of_two_change_no_bit(law, units):
    """Even powers for mass, whose root is taken."""
    mass, length, time = (2.0**k for k in units)
    for seed in range(60, 80):
        scene = any_scene(seed)
        one, other = scene.resolve(law), in_units(scene, *units).resolve(law)
        assert [t.linear * (length / time) for t in one.changes] == [t.linear for t in other.changes]
        assert [P * (mass * length / time) for P in one.impulses] == list(other.impulses)
        assert (one.regimes, one.error_bound, one.model, one.adjustments) == (
            other.regimes,
            other.error_bound,
            other.model,
            other.adjustments,
        )
        energy = mass * (length / time) ** 2
        for field in ("kinetic_energy_after", "energy_lost_restitution", "energy_lost_friction"):
            assert getattr(one, field) * energy == getattr(other, field)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize(
    "units", [(0, 0, -485), (400, 0, -285), (800, 0, -85), (0, 0, 450), (-400, 0, 100), (-600, 0, 300)]
)
@pytest.mark.parametrize("restitution", [None, 0.5, 1.0])
def test_units_change_no_bit_at_the_end_of_float64(law, units, restitution):
    """Energies would overflow with a factor of two more, or are 0; velocities and impulses are in range."""
    for seed in range(60, 80):
        scene = any_scene(seed)
        if restitution is not None:
            scene = scene.with_contacts(restitution=restitution, friction=0.0)
        one, other = scene.resolve(law), in_units(scene, *units).resolve(law)
        assert [t.linear * 2.0 ** -units[2] for t in one.changes] == [t.linear for t in other.changes]
        assert (one.regimes, one.error_bound, one.model) == (other.regimes, other.error_bound, other.model)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_the_largest_energy_has_a_bound(law, e):
    """2^1021 J for a box that lands flat. The inverse of its mass has few digits beyond those of a float."""
    answer = in_units(box(e=e), 1000, 0, -11).resolve(law)
    assert answer.twists[0].linear == (0, 0, e * 2.0**11)
    assert answer.error_bound < 1e-8


@pytest.mark.parametrize("units", [(0, 0, -485), (800, 0, -85), (0, 0, 450), (-400, 0, 200), (-600, 0, 300)])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_stronge_does_not_depend_on_units(units, friction):
    """Squares of small speeds and impulses decide when a spring rests and when a contact sticks.

    The same path is followed, so changes differ by some roundings at most.
    """
    for seed in (60, 62, 64, 66, 67, 70):
        scene = any_scene(seed).with_contacts(restitution=0.5, friction=friction)
        one, other = scene.resolve(Law.ROUTH_STRONGE), in_units(scene, *units).resolve(Law.ROUTH_STRONGE)
        assert other.error_bound == pytest.approx(one.error_bound, rel=1e-6)
        size = max((t.linear.norm() for t in one.changes), default=0.0)
        for x, y in zip(one.changes, other.changes, strict=True):
            assert tuple(y.linear * 2.0 ** units[2]) == pytest.approx(tuple(x.linear), abs=1e-12 * size)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("power", range(1010, 1091, 8))
def test_impulses_below_float64_are_refused(law, power):
    """A ball in a corner with 2^-power kg m/s; the smallest impulse is 2^-1074, and just above it a bound is
    given.
    """
    ball = Body.dynamic(math.ldexp(1.0, -power // 2), velocity=[-math.ldexp(1.0, power // 2 - power)] * 3)
    contacts = [Contact.of((0, 0, 0), n, 0.5) for n in ((1, 0, 0), (0, 1, 0))]
    scene = [ball, Body.static()], [(0, 1)] * 2, contacts, ImpactModel(law)
    if power > 1075:
        with refused(StatusCode.OUT_OF_RANGE):
            resolve_scene(*scene)
        return
    answer = resolve_scene(*scene)
    v = answer.twists[0].linear * math.ldexp(1.0, power - power // 2)
    assert math.hypot(v.x - 0.5, v.y - 0.5) <= answer.error_bound * 1.5 * math.sqrt(2)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("tilt", [0.0, 1e-300, 1e-17, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-3])
@pytest.mark.parametrize("e", [0.0, 1.0])
def test_a_ball_between_walls_that_almost_lock(law, tilt, e):
    """Nearly opposite normals: no energy is created, and the answer says where doubles cannot decide."""
    ball = Body.dynamic(1.0, (0.1, 0, 0, 0.1, 0, 0.1), velocity=(0.0, 0.0, -1.0))
    contacts = [Contact.of((-x, 0, 0), (x, 0.0, tilt), e, 0.3) for x in (1.0, -1.0)]
    answer = resolve_scene([ball, Body.static()], [(0, 1)] * 2, contacts, ImpactModel(law))
    assert answer.kinetic_energy_after <= 0.5 * (1 + 1e-9)
    assert -1 <= answer.twists[0].linear.z <= 1
    assert answer.twists[0].linear.x == pytest.approx(0, abs=1e-9)
    if law is Law.FRICTIONLESS and answer.error_bound < 1e-3 and tilt:
        assert answer.twists[0].linear.z == pytest.approx(e, abs=answer.error_bound + 1e-12)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("again", [[0], [0, 0], [0, 3], [0, 1, 2, 3], [0, 0, 1, 1, 2, 2, 3, 3]])
def test_repeated_corners_change_no_bit(law, again):
    """Copies share the impulse of their corner."""
    scene = box((1, 0.5, -1), (0.3, -0.2, 0.1), e=0.5, mu=0.3)
    copies = [scene.contacts[i] for i in again]
    more = Scene(scene.bodies, [(0, 1)] * (4 + len(again)), [*scene.contacts, *copies])
    one, other = scene.resolve(law), more.resolve(law)
    assert one.twists == other.twists
    total = [sum((other.impulses[4 + k].z for k, i in enumerate(again) if i == c), other.impulses[c].z)
             for c in range(4)]  # fmt: skip
    assert sum(total) == pytest.approx(sum(P.z for P in one.impulses), rel=1e-9)
    for place, i in enumerate(again):
        assert other.impulses[4 + place] == other.impulses[i]


@pytest.mark.parametrize("off", [1e-12, -1e-12, 1e-15, -1e-15])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU])
def test_a_cradle_with_slight_differences(law, off):
    """A slight change of masses, speeds and restitution changes the answer slightly."""
    even = row_of_balls((1, 0, 0), 0.5, None, float)
    odd = row_of_balls((1 + off, 0, off), 0.5, (1, 1 + off, 1 - off), float)
    odd = odd._replace(contacts=[odd.contacts[0], odd.contacts[1]._replace(restitution=0.5 + off)])
    assert speeds(odd.resolve(law)) == pytest.approx(speeds(even.resolve(law)), abs=1e-10)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_energy_losses_account_for_the_change_of_energy(law):
    """Without moving walls, on random scenes."""
    for seed in range(60, 160):
        scene = any_scene(seed)
        walls = [body for body in scene.bodies if not body.is_movable()]
        if any(x for wall in walls for x in (*wall.velocity, *wall.angular_velocity)):
            continue
        answer = scene.resolve(law)
        lost = answer.energy_lost_restitution + answer.energy_lost_friction
        size = answer.kinetic_energy_before + change_norm(scene, answer) ** 2
        assert abs(answer.kinetic_energy_before - answer.kinetic_energy_after - lost) <= 1e-12 * size


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
    assert answer.error_bound < 1e-3
    if answer.adjustments:
        assert answer.adjustments is Adjustment.NO_REBOUND and mass > 1e4
        assert answer.kinetic_energy_after == pytest.approx(0.5 / (1 + mass), rel=1e-6)  # they move as one
    else:
        assert answer.kinetic_energy_after == pytest.approx(0.5, rel=1e-6)
    assert sum(spent[:-1]) <= reflections.DIGITS  # what goes beyond is not looked at again
    assert spent or not (walls or kind is F)


@pytest.mark.parametrize("corners", [1, 2, 3, 4])
def test_many_reflections_of_few_digits_are_within_the_budget_too(corners, monkeypatch):
    """A box between two walls that open slowly. Its velocities stay multiples of 2^-24.

    With an eighth of the usual budgets, of which 2 contacts use up the number of reflections.
    """
    monkeypatch.setattr(reflections, "DIGITS", reflections.DIGITS // 8)
    monkeypatch.setattr(reflections, "REFLECTIONS", reflections.REFLECTIONS // 8)
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
    assert len(looks) <= reflections.REFLECTIONS
    assert (len(looks) - 1) * len(contacts) ** 2 * reflections.LEAST_DIGITS <= reflections.DIGITS


LENGTHS = (2.0**-1000, 2.0**-660, 2.0**-101, 2.0**101, 2.0**660, 2.0**1000)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("contacts", [2, 3])
@pytest.mark.parametrize("slip", [0.0, 1e-15, 1.0])
def test_normals_may_have_any_length(law, contacts, slip):
    """Two balls above a floor and one on the other; the lengths must not change a bit."""
    bodies = [
        Body.dynamic(1.0, velocity=(slip, 0, -1)),
        Body.dynamic(2.0, velocity=(0, 0, -2)),
        Body.static(),
    ]
    pairs = [(0, 2), (1, 2), (0, 1)][:contacts]

    def answer(length: float):
        touch = Contact.of((0, 0, 0), (0, 0, length), 0.5, 0.5)
        return resolve_scene(bodies, pairs, [touch] * contacts, ImpactModel(law))

    usual = answer(1.0)
    assert usual.status is StatusCode.OK
    for length in LENGTHS:
        other = answer(length)
        assert (other.status, other.twists, other.impulses) == (usual.status, usual.twists, usual.impulses)


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
@pytest.mark.parametrize("contacts", [2, 3])
def test_an_energy_beyond_float64_is_refused(law, contacts):
    bodies = [Body.dynamic(m * 1e200, velocity=(0, 0, -m * 1e150)) for m in (1, 2)]
    touches = [Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.5)] * contacts
    with refused(StatusCode.OUT_OF_RANGE):
        pairs = [(0, 2), (1, 2), (0, 1)][:contacts]
        resolve_scene([*bodies, Body.static()], pairs, touches, ImpactModel(law))


BEYOND = {
    "a floor that comes fast": ((1, 1), {"velocity": Vec3(0.0, 0.0, 1e308)}),
    "a floor that slides fast": ((1, 1), {"velocity": Vec3(1e308, 0.0, 0.0)}),
    "a floor that turns fast": ((1, 1), {"angular_velocity": Vec3(1e308, 1e308, 0.0)}),
    "a floor far away that turns": (
        (1, 1),
        {"position": Vec3(1e200, 0.0, 0.0), "angular_velocity": Vec3(0.0, 1e200, 0.0)},
    ),
    "a body far away": ((1, 0), {"position": Vec3(1e308, 0.0, 0.5)}),
    "a body that hardly resists turning": ((1, 0), {"inertia": (1e-320, 0.0, 0.0, 1e-320, 0.0, 1e-320)}),
    "a contact far away": ((2, 3), {"position": Vec3(1e308, 0.0, 0.0)}),
}


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("beyond", BEYOND)
@pytest.mark.parametrize("options", [{}, {"exponent": 1.0}], ids=["in kernels", "in Python"])
def test_intermediate_results_beyond_float64_are_refused(law, beyond, options):
    scene = box((1, 0, -1), (0.1, 0.2, 0), e=0.5, mu=0.3)
    bodies = [*map(Body._make, scene.bodies[:1]), Body.kinematic()]
    (table, place), change = BEYOND[beyond]
    tables = {1: bodies, 2: list(scene.contacts)}
    tables[table][place] = tables[table][place]._replace(**change)
    with pytest.raises(ImpactError) as refused:
        resolve_scene(bodies, scene.pairs, tables[2], ImpactModel(law), **options)
    codes = [StatusCode.OUT_OF_RANGE, *[StatusCode.PATH_TOO_LONG] * (law is Law.ROUTH_STRONGE)]
    assert refused.value.code in codes  # a path may notice first


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("others", ["touch", "do not"])
def test_energies_whose_sum_is_beyond_float64_are_refused(law, others):
    scene = box((1, 0, -1), e=0.5, mu=0.3)
    heavy = Body.box(1e300, (1, 1, 1), position=(0, 0, 0.5), velocity=(0, 0, -1.2e4))
    bodies = [heavy, scene.bodies[1], heavy._replace(), heavy._replace()]
    pairs = [*scene.pairs, *([(place, 1) for place in (2, 3) for _ in range(4)] if others == "touch" else ())]
    with refused(StatusCode.OUT_OF_RANGE):
        resolve_scene(bodies, pairs, scene.contacts * (len(pairs) // 4), ImpactModel(law))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("power", [-1000, -500, 500, 1000])
def test_quaternions_may_have_any_length(law, power):
    """A power of two changes no bit of the answer."""
    scene = box((1, 0.5, -1), (0.1, 0.2, 0), e=0.5, mu=0.3)
    turn = Quaternion(0.1, -0.7, 0.3, 0.4)
    answers = [
        resolve_scene(
            [scene.bodies[0]._replace(orientation=q), scene.bodies[1]],
            scene.pairs,
            scene.contacts,
            ImpactModel(law),
        )
        for q in (turn, Quaternion(*(math.ldexp(x, power) for x in turn)))
    ]
    assert answers[0] == answers[1]


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
def test_an_approach_below_double_double_precision_is_decided_or_unbounded(
    law, contacts, friction, turning, below
):
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
    if not in_rationals:
        assert (answer.error_bound < math.inf) is turning
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
    scene = Scene([a, b], [(0, 1)] * contacts, touches)
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


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_rounding_reverses_no_slip(law, turned):
    """Friction is just enough: in any order of the contacts the final slip is 0."""
    velocity, spin = ((0, 0, -1), (0, turned, 0)) if turned else ((0.5, 0, -1), (0, 0, 0))
    scene = box(velocity, spin, e=0.5, mu=0.5)
    light = scene.bodies[0]._replace(inertia=Symmetric3(0.125, 0.0, 0.0, 0.125, 0.0, 0.125))
    seen = set()
    for order in itertools.permutations(range(4)):
        for sign in (1.0, -1.0):
            contacts = [scene.contacts[i]._replace(normal=scene.contacts[i].normal * sign) for i in order]
            pairs = [(0, 1) if sign > 0 else (1, 0)] * 4
            answer = resolve_scene([light, scene.bodies[1]], pairs, contacts, ImpactModel(law))
            seen.add(tuple(answer.regimes[order.index(i)] for i in range(4)))
    assert len(seen) == 1 and Regime.REVERSED not in seen.pop()


TURNS = [Quaternion(0.0, 0.0, 0.0, 1.0), Quaternion(0.1, -0.7, 0.3, 0.4), Quaternion(1.0, 1.0, 1.0, 0.0)]


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("mu", [0.3, 1.0, 1e3, 1e4, 1e5, 1e6, 1e9, 1e12])
def test_friction_of_a_light_load_matters(law, turn, mu):
    """A point lands on a smooth floor and grazes a rough wall, whose P_n is its approach to the wall."""
    axes = turn.rotation()
    for load in (1.0, 1e-3, 1e-6, 2e-9, 9.9e-10, 1e-12, 1e-15, 1e-20):
        point = Body.dynamic(1.0, velocity=axes.to_world(Vec3(-load, 1.0, -1.0)))
        floor, wall = (axes.to_world(Vec3(*n)) for n in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
        contacts = [Contact.of((0, 0, 0), floor, 0.0), Contact.of((0, 0, 0), wall, 0.0, mu)]
        answer = resolve_scene([point, Body.static()], [(0, 1)] * 2, contacts, ImpactModel(law), threshold=0)
        right = Vec3(0.0, max(0.0, 1 - mu * load), 0.0)
        off = (answer.twists[0].linear - axes.to_world(right)).norm()
        change = (right - Vec3(-load, 1.0, -1.0)).norm()
        given = (
            1e-15 * mu if turn is not TURNS[0] else 0.0
        )  # the load is a rounded number, where axes are turned
        assert off <= answer.error_bound * change + given + 1e-15
        if mu <= 1e3 and law is Law.COULOMB:
            assert answer.error_bound < 1e-3 or load < 1e-9
        if law is Law.COULOMB and turn is TURNS[0] and answer.error_bound < 1e-3 and 1e-9 < mu * load < 0.5:
            assert answer.regimes[1] is Regime.SLIDING


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("mu", [0.3, 1.0, 100.0])
@pytest.mark.parametrize("mass, speed", [(1.0, 1.0), (1e6, 1.0), (1e12, 1.0), (1e12, 1e3)])
def test_friction_next_to_a_far_greater_impact(law, mu, mass, speed):
    """A ball grazes a wall while a heavy body falls past it onto the floor, in one cluster."""
    mountain = Body.dynamic(mass, velocity=(0.0, 0.0, -speed))
    ball = Body.dynamic(1.0, velocity=(-1e-3, 1.0, -speed))
    up = Contact.of((0, 0, 0), (0, 0, 1), 0.0)
    contacts = [up, Contact.of((0, 0, 0), (1, 0, 0), 0.0, mu), up]
    scene = [mountain, ball, Body.static()], [(0, 2), (1, 2), (1, 0)], contacts
    answer = resolve_scene(*scene, ImpactModel(law), threshold=0)
    right = Vec3(0.0, max(0.0, 1 - mu * 1e-3), 0.0)
    size = max(math.sqrt(mass) * speed, 1.0)
    assert (answer.twists[1].linear - right).norm() <= answer.error_bound * size * (1 + 1e-9)


@pytest.mark.parametrize("belt", [0.0, 1.0, 1e3, 1e5, 1e7, 1e8, 1e9, 1e12, 1e15])
@pytest.mark.parametrize("normal", [(1, 1, 1), (0, 1, 0), (0, 0, 1), (1, 0, 0)])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_the_speed_of_a_smooth_belt_does_not_matter(belt, normal, e):
    """By MOREAU, next to a rough wall."""
    ball = Body.dynamic(1.0, velocity=(0.0, 1.0, 0.0))
    contacts = [Contact.of((0, 0, 0), normal, e, 1.0), Contact.of((0, 0, 0), (0.0, -3.0, -4.0), e)]

    def answer(speed):
        bodies = [ball, Body.static(), Body.kinematic(velocity=(speed, 0.0, 0.0))]
        return resolve_scene(bodies, [(0, 1), (0, 2)], contacts, ImpactModel(Law.MOREAU))

    one, other = answer(0.0), answer(belt)
    assert (one.model.law, other.error_bound < math.inf) == (other.model.law, one.error_bound < math.inf)
    size = one.changes[0].linear.norm() * (1 + one.error_bound)
    distance = (one.twists[0].linear - other.twists[0].linear).norm()
    assert distance <= (one.error_bound + other.error_bound) * size
    assert min(other.normal_velocities_after) >= -1e-6


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("belt", [1e3, 1e5, 1e6, 1e8, 1e10, 1e12])
@pytest.mark.parametrize("mu", [1e-9, 1e-3, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_rough_belt_drags_with_mu_times_the_load_at_any_speed(law, belt, mu, e):
    ball = Body.dynamic(1.0, velocity=(0.0, 1.0, -1.0))
    contacts = [Contact.of((0, 0, 0), (0, 0, 1), e, mu), Contact.of((0, 0, 0), (0, 1, 0), e, 1.0)]
    bodies = [ball, Body.kinematic(velocity=(belt, 0.0, 0.0)), Body.static()]
    answer = resolve_scene(bodies, [(0, 1), (0, 2)], contacts, ImpactModel(law))
    slip = Vec3(belt, -1.0, 0.0)
    right = Vec3(0.0, 1.0, e) + slip * (mu * (1 + e) / slip.norm())
    size = (right - Vec3(0.0, 1.0, -1.0)).norm()
    assert (answer.twists[0].linear - right).norm() <= answer.error_bound * size + 1e-15


@pytest.mark.parametrize("vz", [-(10.0**-k) for k in (3, 6, 9, 12, 15, 17)])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.1, 0.3])
@pytest.mark.parametrize("offset", [0.0, 1e-12, 1e-8])
def test_a_box_that_slides_far_faster_than_it_comes_down(offset, mu, e, vz):
    """All corners slip the same way: the change of velocity is (1 + e) |vz| (-mu t, n)."""
    scene = box((1, 0, vz), e=e, mu=mu, size=(1, 0.6, 0.2))
    corners = [
        c._replace(position=c.position + Vec3(0.0, 0.0, k * offset)) for k, c in enumerate(scene.contacts)
    ]
    scene = scene._replace(contacts=corners)
    answer = scene.resolve(Law.COULOMB)
    impulse = sum(answer.impulses, Vec3(0.0, 0.0, 0.0))
    right = Vec3(-mu, 0.0, 1.0) * ((1 + e) * -vz)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-5
    assert (impulse - right).norm() <= (answer.error_bound + 1e-9) * right.norm()


def test_a_box_that_slides_and_spins_far_faster_than_it_comes_down():
    """The impulse in the limit of no approach; for this approach it differs by about 1e-12."""
    vz = -1e-12
    scene = box((1, 0.3, vz), (0, 0, 0.5), e=0.5, mu=0.3, size=(1, 0.6, 0.4))
    answer = scene.resolve(Law.COULOMB)
    impulse = sum(answer.impulses, Vec3(0.0, 0.0, 0.0)) * (1 / -vz)
    right = Vec3(-0.413984665491, -0.133048208429, 1.5)
    assert answer.error_bound < 1e-5
    assert (impulse - right).norm() <= answer.error_bound * right.norm() + 1e-9


UNEQUAL = (0.0, 1.0, 0.0, 0.5)


def uneven_box(tilts, again: int = 0) -> Scene:
    """A flat box whose corners have different restitution and normals that are off by ``tilts``; some corners
    are given again, a little apart.
    """
    flat = box()
    contacts = [
        c._replace(normal=Vec3(*tilt, 1.0), restitution=e)
        for c, tilt, e in zip(flat.contacts, tilts, UNEQUAL, strict=True)
    ]
    contacts += [c._replace(position=c.position + Vec3(0.25, 0.0, 0.0)) for c in contacts[:again]]
    return Scene(flat.bodies, [(0, 1)] * len(contacts), contacts)


def small_tilts(size: float, seed: int) -> list[tuple[float, float]]:
    rng = random.Random(seed)
    return [(rng.gauss(0, size), rng.gauss(0, size)) for _ in UNEQUAL]


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("power", [*range(10, 50, 4), 44, *range(50, 86, 6)])
@pytest.mark.parametrize("which", ["one", "two", "all"])
def test_unequal_restitutions_of_nearly_dependent_contacts(which, power, law):
    """Normals that are off by 2^-power decide how the corners share the load, and so the restitution."""
    size = 2.0**-power
    level = (0.0, 0.0)
    tilts = {
        "one": [level, level, level, (0.0, size)],
        "two": [(size, 0.0), level, (0.0, -size), level],
        "all": small_tilts(size, power),
    }[which]
    scene = uneven_box(tilts)
    exact = scene.in_fractions().resolve(Law.FRICTIONLESS)
    for turn in range(4):
        answer = reordered(scene, turn).resolve(law)
        assert_within_bound(scene, answer, exact)
        assert answer.contacts[0].restitution == pytest.approx(float(exact.contacts[0].restitution), rel=1e-9)


@pytest.mark.parametrize("power", [20, 40, 44, 50, 60, 80])
@pytest.mark.parametrize("seed", range(3))
def test_the_restitution_of_many_nearly_dependent_contacts_is_in_the_bound_if_there_is_one(power, seed):
    """Eight corners and a second box: too many for fractions."""
    one = uneven_box(small_tilts(2.0**-power, seed), again=4)
    top = box(mass=2.0)
    upper = top.bodies[0]._replace(position=Vec3(0.0, 0.0, 1.5))
    contacts = [c._replace(position=c.position + Vec3(0, 0, 1)) for c in top.contacts]
    scene = Scene([*one.bodies, upper], one.pairs + [(2, 0)] * 4, one.contacts + contacts)
    exact = scene.in_fractions().resolve(Law.FRICTIONLESS)
    answer = scene.resolve(Law.FRICTIONLESS)
    if answer.error_bound < math.inf:
        assert_within_bound(scene, answer, exact)


@pytest.mark.parametrize("size", [(1, 1, 1), (0.3, 0.7, 0.1), (1.1, 5.3, 0.03)])
@pytest.mark.parametrize("levels", [1, 2, 5])
@pytest.mark.parametrize("lift", [0.0, 0.3])
def test_unequal_restitutions_of_flat_boxes_are_decided_in_double_double(size, levels, lift, monkeypatch):
    """Parallel normals depend on each other to all digits, wherever the corners are."""
    monkeypatch.setattr("collision_response.scene.in_fractions._in_fractions", None)
    x, y, z = size
    bodies = [
        Body.box(0.37 * (i + 1), size, position=(0.1 * i, 0, (i + 0.5) * z), velocity=(0, 0, -1))
        for i in range(levels)
    ]
    floor = Body.kinematic(velocity=(0.0, 0.0, lift)) if lift else Body.static()
    contacts = [
        Contact.of((0.1 * i + a * x / 2, b * y / 2, i * z), (0, 0, 1), UNEQUAL[a + (1 + b) // 2])
        for i in range(levels)
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    pairs = [(i, i - 1 if i else levels) for i in range(levels) for _ in range(4)]
    answer = resolve_scene([*bodies, floor], pairs, contacts, ImpactModel(Law.FRICTIONLESS))
    assert answer.status is StatusCode.OK
    assert answer.error_bound < 1e-7


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


DIRECTIONS = {
    "a line": [(1, 0, 0), (-1, 0, 0)],
    "a square": [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)],
    "a tetrahedron": [(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)],
    "an octahedron": [tuple(s * (i == k) for i in range(3)) for k in range(3) for s in (-1, 1)],
    "a cube": list(itertools.product((-1, 1), repeat=3)),
}


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("name", DIRECTIONS)
@pytest.mark.parametrize("moment", [0.0, 0.1])
def test_balls_that_strike_one_from_symmetric_sides_rebound_alike(name, moment, law):
    """The ball in the middle stays at rest, whatever the coefficients."""
    for e, mu, mass in itertools.product((0.0, 0.5, 1.0), (0.0, 0.3, 5.0), (1.0, 1e3)):
        inertia = (moment, 0, 0, moment, 0, moment)
        bodies, contacts = [Body.dynamic(1.0, inertia)], []
        for direction in (Vec3(*map(float, d)) for d in DIRECTIONS[name]):
            bodies.append(Body.dynamic(mass, [mass * x for x in inertia], direction, None, direction * -1.0))
            contacts.append(Contact.of(direction * 0.5, direction * -1.0, e, mu))
        pairs = [(0, i + 1) for i in range(len(contacts))]
        answer = resolve_scene(bodies, pairs, contacts, ImpactModel(law))
        length = bodies[1].position.norm()
        off = 1e-12 + (4 * answer.error_bound if answer.model.law is Law.COULOMB else 0)
        assert answer.twists[0].linear.norm() <= off * mass * length
        for impulse, twist, contact in zip(answer.impulses, answer.twists[1:], answer.contacts, strict=True):
            expected = contact.normal * (mass * (1 + e))  # the normal is as long as the speed
            assert (impulse - expected).norm() <= off * mass * length
            assert (twist.linear + contact.normal * e).norm() <= off * length
