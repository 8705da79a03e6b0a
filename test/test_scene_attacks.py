"""Scenes built to break friction: many solutions, light loads, fast belts, stacks and turning walls."""

from __future__ import annotations

import itertools
import math

import pytest
from scene_cases import (
    Scene,
    any_scene,
    assert_within_bound,
    box,
    change_norm,
    distance,
    random_scene,
    reordered,
    row_of_balls,
    speeds,
    tower,
)

from collision_response import Body, Contact, ImpactModel, Law, Regime, StatusCode, resolve_scene
from collision_response.physics.orientation import Quaternion
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3


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
    scene = tower(number, mu=0.5)
    for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU):
        answer = scene.resolve(law)
        for k in range(number):
            assert answer.twists[k].linear == pytest.approx((0, 0, 0), abs=1e-7)
            for P in answer.impulses[4 * k : 4 * k + 4]:
                assert P.z == pytest.approx((number - k) / 4, abs=1e-5)
    elastic = scene.with_contacts(restitution=1.0, friction=0.0).resolve()
    assert elastic.kinetic_energy_after == pytest.approx(elastic.kinetic_energy_before, rel=1e-9)
    assert elastic.error_bound < 1e-9


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


@pytest.mark.parametrize("off", [0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-5, -1e-5, 1e-3, -1e-3])
def test_no_order_decides_whether_friction_unloads_a_contact(off):
    """A tie: least work leaves the left contact without a load, just so. If it pulls, it parts."""
    box = Body.dynamic(
        1.0, (1, 0, 0, 1 / 6, 0, 1), (0, 0, 0.5), velocity=(1, 0, -1), angular_velocity=(0, 1 + off, 0)
    )
    left, right = (Contact.of((x, 0, 0), (0, 0, 1), 0.5, 2.0) for x in (-0.5, 0.5))
    one, other = (
        resolve_scene([box, Body.static()], [(0, 1)] * 2, contacts, ImpactModel(Law.COULOMB))
        for contacts in ([left, right], [right, left])
    )
    apart = abs(one.twists[0].angular.y - other.twists[0].angular.y)
    assert apart <= 10 * (one.error_bound + other.error_bound)


def test_a_ball_struck_from_all_sides_has_a_bound():
    """Of 150 balls: the budget of the first programme is used up, and double-double goes on."""
    count, bodies, contacts = 150, [Body.sphere(1.0, 1.0)], []
    for i in range(count):
        angle, z = 14 * math.pi * i / count, -0.9 + 1.8 * (i + 0.5) / count
        r = math.sqrt(1 - z * z)
        d = Vec3(r * math.cos(angle), r * math.sin(angle), z)
        bodies.append(Body.sphere(1.0, 0.05, position=d * 1.05, velocity=-d))
        contacts.append(Contact.of(d, d, 0.5, 0.2))
    answer = resolve_scene(bodies, [(i + 1, 0) for i in range(count)], contacts, ImpactModel(Law.COULOMB))
    assert answer.error_bound < 1e-6
    momentum = sum((twist.linear for twist in answer.twists), Vec3(0.0, 0.0, 0.0))
    before = sum((body.velocity for body in bodies), Vec3(0.0, 0.0, 0.0))
    assert math.dist(momentum, before) < 1e-12


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("passing", [0.0, 1e3, 1e7])
def test_a_contact_that_slides_does_so_beside_a_faster_one(law, passing):
    """A ball slides on the floor. Another one passes it without friction, which changes nothing."""
    ball = Body.sphere(1.0, 0.5, velocity=(1.0, 0, -1.0))
    other = Body.sphere(1.0, 0.5, position=(1, 0, 0), velocity=(0.5, passing, 0))
    contacts = [Contact.of((0, 0, -0.5), (0, 0, 1), 0.5, 0.05), Contact.of((0.5, 0, 0), (-1, 0, 0), 0.5, 0)]
    answer = resolve_scene([ball, other, Body.static()], [(0, 2), (0, 1)], contacts, ImpactModel(law))
    assert answer.regimes == (Regime.SLIDING, Regime.SLIDING)


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


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("tilt", [math.cos(math.pi / 2), 1e-15, 1e-13, 1e-10, 1e-7, 1e-5])
def test_walls_that_face_each_other_hold_a_body(tilt, law):
    """Their normals are opposite up to rounding, so that impulses of 1e16 would drive the body out."""
    held = Body.dynamic(1.0, (0.1, 0, 0, 0.1, 0, 0.1), velocity=(-0.3, 0, -0.5))
    fork = Body.dynamic(2.0, (0.2, 0, 0, 0.2, 0, 0.2), (1, 0, 0), None, (-1, 0, 0), (0, 2, 0))
    contacts = [Contact.of((x, 0, 0.5), (n, 0, tilt), 0.3, 2.0) for x, n in ((-0.5, 1), (0.5, -1))]
    answer = resolve_scene([held, fork], [(0, 1)] * 2, contacts, ImpactModel(law))
    assert min(answer.normal_velocities_after) > -1e-15
    assert answer.kinetic_energy_after < answer.kinetic_energy_before


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
def test_no_contact_approaches_where_the_error_is_large(law):
    """A point between two walls that nearly face each other, and beside a third: friction drives it there."""
    point = Body.dynamic(1.0, velocity=(1, 0, -1))
    turntable = Body.kinematic((1, 0, 0), (0, 0, 0), (0, 0, 1))
    contacts = [
        Contact.of((0.5, 0.5, 0), (0, 1.0000001, 0), 1.0, 1.0),
        Contact.of((0, 0, 0.5), (-1, 0, 1), 1.0, 1.0),
        Contact.of((0, -0.5, 0), (1.0000001, 0, 1e-7), 1.0, 1.0),
        Contact.of((0.5, 0.5, 0), (0, 1e-7, 1.0000001), 0.5),
    ]
    answer = resolve_scene([point, turntable], [(0, 1)] * 4, contacts, ImpactModel(law))
    assert min(answer.normal_velocities_after) > -1e-9


@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("power", range(3, 19))
def test_a_ball_before_a_wall_that_a_light_one_strikes(power, exponent):
    """Elastic springs, masses far apart: one impact after the other. The heavy ball approaches the wall so
    slowly that it nearly counts as at rest.
    """
    light = 10.0**-power
    bodies = [Body.dynamic(1.0), Body.static(), Body.dynamic(light, velocity=(-1.0, 0.0, 0.0))]
    scene = Scene(bodies, [(0, 1), (2, 0)], [Contact.of((0, 0, 0), (1, 0, 0))] * 2)
    answer = scene.resolve(Law.ROUTH_STRONGE, options={"exponent": exponent})
    heavy, back = 2 * light / (1 + light), (1 - light) / (1 + light)
    off = math.hypot(answer.twists[0].linear.x - heavy, math.sqrt(light) * (answer.twists[2].linear.x - back))
    size = math.hypot(heavy, math.sqrt(light) * (back + 1))
    # For light balls that are not light enough, the heavy one moves while they touch.
    assert off <= (answer.error_bound + 10 * math.sqrt(light)) * size
    assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + answer.error_bound)
