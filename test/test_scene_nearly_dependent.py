"""Nearly flat boxes: contacts that depend on each other up to some digits."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest
from scene_cases import Scene, any_scene, assert_within_bound, box, change_norm, distance, reordered, shuffled

from collision_response import Body, Contact, ImpactModel, Law, StatusCode, resolve_scene
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

CORNERS = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
LAWS = [(Law.FRICTIONLESS, 0.0), (Law.COULOMB, 0.3), (Law.COULOMB, 1.0)]


def stack(count: int, off: float, seed: int, mu: float = 0.0, sideways: float = 0.0) -> Scene:
    """Cubes on each other fall on a floor; corners, normals and velocities have errors of size ``off``."""
    rng = random.Random(seed)

    def near(*numbers: float) -> tuple[float, ...]:
        return tuple(x + rng.gauss(0, off) for x in numbers)

    bodies = [
        Body.box(1.0, (1, 1, 1), position=(0, 0, i + 0.5), velocity=near(sideways, 0, -1))
        for i in range(count)
    ]
    pairs = [(i, i - 1 if i else count) for i in range(count) for _ in CORNERS]
    contacts = [Contact.of(near(x, y, i), near(0, 0, 1), 0.5, mu) for i in range(count) for x, y in CORNERS]
    return Scene([*bodies, Body.static()], pairs, contacts)


@pytest.mark.parametrize("count, seed", [(1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (3, 1)])
@pytest.mark.parametrize("off", [1e-14, 1e-13, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5])
def test_double_doubles_decide_dependence(off, count, seed):
    """No scene is refused, and the answer is within the bound of the one in fractions."""
    scene = stack(count, off, seed)
    answer = scene.resolve(Law.FRICTIONLESS)
    assert answer.status is StatusCode.OK
    assert_within_bound(scene, answer, scene.in_fractions().resolve(Law.FRICTIONLESS))
    assert answer.error_bound < 2.0**-43  # the root of the rounding in 32 digits, for some terms


@pytest.mark.parametrize("law, mu", LAWS)
@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("off", [1e-14, 1e-13, 1e-11, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5])
def test_small_errors_change_velocities_by_as_little(off, count, law, mu):
    """Loads are shared as if the box were flat. The threshold keeps reflections from reacting to small
    approaches.
    """
    flat, scene = (stack(count, by, 1, mu, sideways=0.5) for by in (0.0, off))
    exact, answer = (one.resolve(law, options={"threshold": 1e-3}) for one in (flat, scene))
    assert answer.status is StatusCode.OK
    assert answer.error_bound < max(1e-4, 200 * off)  # a root of rounding, or proportional to ``off``
    assert answer.kinetic_energy_after <= answer.kinetic_energy_before
    assert min(answer.normal_velocities_after) >= -answer.error_bound * 10
    for one, other in zip(answer.twists, exact.twists, strict=True):
        size = (answer.error_bound + exact.error_bound + 100 * off) * 10
        assert (one.linear - other.linear).norm() <= size


@pytest.mark.parametrize("seed", range(60))
def test_the_order_of_contacts_changes_nothing_beyond_the_bound(seed):
    """Although it decides which of the nearly dependent contacts are kept."""
    rng = random.Random(seed)
    count, mu = rng.choice([1, 2, 3]), rng.choice([0.1, 0.3, 1.0, 3.0])
    sideways = rng.choice([0.0, 0.3, 20.0])
    scene = stack(count, 10.0 ** rng.uniform(-14, -3), seed, mu, sideways)
    order = rng.sample(range(len(scene.pairs)), len(scene.pairs))
    other = scene._replace(pairs=[scene.pairs[i] for i in order], contacts=[scene.contacts[i] for i in order])
    answers = [one.resolve(Law.COULOMB, options={"threshold": 1e-2}) for one in (scene, other)]
    assert distance(scene, *answers) <= answers[0].error_bound + answers[1].error_bound
    for answer in answers:
        assert answer.kinetic_energy_after <= answer.kinetic_energy_before


@pytest.mark.parametrize("seed", range(1, 11))
@pytest.mark.parametrize("off", [1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-5])
def test_a_load_at_the_edge_of_a_patch_is_shared_along_the_edge(off, seed):
    """A table on a dozen legs, of which the three on one side strike first."""
    rng = random.Random(seed)
    table = Body.box(
        0.5,
        (0.5, 0.1, 2.0),
        position=(0.0, 0.0, 0.5),
        velocity=(-1.5, 0.5, -0.5),
        angular_velocity=(1.0, 0.0, 1.0),
    )
    normals = [(off * rng.uniform(-1, 1), off * rng.uniform(-1, 1), 1.0) for _ in range(12)]
    places = [(x / 2, y / 6, 0.0) for x in (-1, 0, 1) for y in (-3, -1, 1, 3)]
    contacts = [Contact.of(place, normal, 1.0, 3.0) for place, normal in zip(places, normals, strict=True)]
    scene = Scene([table, Body.static()], [(0, 1)] * 12, contacts)
    flat = scene.with_contacts(normal=(0.0, 0.0, 1.0)).resolve()
    for _ in range(4):
        answer = scene._replace(contacts=rng.sample(contacts, 12)).resolve()
        assert answer.error_bound < 0.05
        if (off, seed) != (1e-5, 7):  # legs part faster than the least velocity that counts
            assert distance(scene, answer, flat) <= answer.error_bound + flat.error_bound + 100 * off


def uneven_rebounds(seed: int) -> Scene:
    """A stack of up to three boxes. Contacts differ much in restitution, and hardly in normals and points."""
    rng = random.Random(seed)
    count = rng.randint(1, 3)
    bodies = [
        Body.box(
            rng.choice((1, 1, 1e-6, 1e6, 0.3)),
            (1, 1, 1),
            position=(0, 0, k + 0.5),
            velocity=(rng.choice((0, 0, 1, 1e3)), rng.choice((0, 0, 0.5)), rng.choice((-1, -1, 0, -1e-9))),
            angular_velocity=rng.choice(((0, 0, 0), (0, 0, 0), (0.5, 0, 0), (0, 0, 3), (1e-12, 0, 0))),
        )
        for k in range(count)
    ]
    wall = Body.static()
    if rng.random() >= 0.6:
        velocity = rng.choice(((0, 0, 0.5), (1, 0, 0), (0, 0, -0.3)))
        wall = Body.kinematic((0, 0, 0), velocity, rng.choice(((0, 0, 0), (0, 0, 1))))
    patches = (
        CORNERS,
        [(-0.5, 0), (0, 0), (0.5, 0)],
        [(-0.5, -0.5), (0.5, 0.5), (0, 0), (0.5, -0.5)],
        [(-0.5, -0.5), (-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5)],
    )
    pairs, contacts = [], []
    for k in range(count):
        for x, y in rng.choice(patches):
            normal = rng.choice(((0, 0, 1), (0, 0, 1), (0, 0, 2), (0, 1e-12, 1), (0, 1e-5, 1)))
            point = (x, y, k + rng.choice((0, 0, 1e-10)))
            pairs.append((k, k - 1 if k else count))
            contacts.append(
                Contact.of(point, normal, rng.choice((0, 0.5, 0.5, 1)), rng.choice((0, 0.3, 0.3, 1, 1e6)))
            )
    if rng.random() < 0.3:
        pairs.append((0, count))
        contacts.append(Contact.of((0.5, 0, 0.5), (-1, 0, 0), 0.5, 0.3))
    return Scene([*bodies, wall], pairs, contacts)


UNEVEN = [
    *range(60),
    *(77, 98, 152, 325, 343, 899, 929, 1135, 1182, 1216),
    *(1220, 1387, 1574, 1693, 2141, 2240, 2326, 2866, 3863, 5256),
    *(20374, 20461, 21338, 21562, 21577, 30061, 30434, 41116, 41404, 41431, 42093, 50458, 52036),
    *(70547, 70730, 71016, 71285),
]


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("seed", UNEVEN)
def test_uneven_rebounds_have_one_answer_in_any_order(seed, law):
    scene = uneven_rebounds(seed)
    other, place = shuffled(scene, seed)
    one, again = scene.resolve(law), other.resolve(law)
    again = again._replace(changes=[again.changes[k] for k in place])
    assert distance(scene, one, again) <= one.error_bound + again.error_bound


def test_a_contact_that_only_rounding_loads_takes_no_part():
    """Here least norm leaves loads of 1e-25 at two of 29 contacts: friction then did a quarter more."""
    scene = any_scene(617566)
    other, place = shuffled(scene, 617566)
    one, again = scene.resolve(Law.COULOMB), other.resolve(Law.COULOMB)
    again = again._replace(changes=[again.changes[k] for k in place])
    assert distance(scene, one, again) <= one.error_bound + again.error_bound


def tilted_corners(tilt: float, walls: int, shift: tuple[float, float, float]) -> Scene:
    """A box on a floor; next to a moving wall if ``walls`` > 0; that turns if > 1, and is also below if 3."""
    moved = Vec3(*shift)
    bodies = (
        Body.box(
            1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=(0.5, 0.25, -1), angular_velocity=(0.5, 0, 0)
        ),
        Body.kinematic(),
        Body.kinematic((0.5, 0, 0.5), (-0.5, 0.25, 0), (0, 0, 0.5 if walls > 1 else 0)),
    )
    normals = [(tilt, 0, 1), (0, tilt, 1), (0, -tilt, 1), (0, 0, 1)]
    coefficients = [(0.5, 1), (0.5, 0.3), (0.25, 0), (0, 0.5)]
    pairs = [(0, 1)] * 4
    contacts = [
        Contact.of((*xy, 0), n, *of) for xy, n, of in zip(CORNERS, normals, coefficients, strict=True)
    ]
    on_wall = [((0.5, 0, 0), (-1, tilt, 0)), ((0.5, 0, 1), (-1, 0, 0)), ((0.5, 0.5, 0), (0, 0, 1))]
    for point, normal in on_wall[: (0, 2, 2, 3)[walls]]:
        pairs.append((0, 2))
        contacts.append(Contact.of(point, normal, 0.5, 0.3))
    return Scene([body._replace(velocity=body.velocity + moved) for body in bodies], pairs, contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("walls", range(4))
@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, 2.0**-20, 2.0**-13, 2.0**-10, 2.0**-7])
def test_tilted_corners_look_the_same_to_every_observer(tilt, walls, law):
    """How nearly contacts share a load does not depend on the work that an observer sees a wall do."""
    at_rest = tilted_corners(tilt, walls, (0, 0, 0)).resolve(law)
    for shift in ((1, 2, -4), (0.5, 0, 0), (0, 0, 64)):
        scene = tilted_corners(tilt, walls, shift)
        moving = scene.resolve(law)
        rounding = 2.0**-46  # of velocities up to 64
        assert distance(scene, at_rest, moving) <= at_rest.error_bound + moving.error_bound + rounding


def noisy_stack(boxes: int, noise: float, seed: int) -> Scene:
    """Boxes on one another, as a detector of contacts sees them: each number is off by up to ``noise``."""
    rng = random.Random(seed)

    def off() -> float:
        return rng.uniform(-noise, noise)

    bodies = [
        Body.box(1.0, (1, 1, 1), position=(0, 0, k + 0.5), velocity=(rng.choice((0, 1)), 0, -1))
        for k in range(boxes)
    ]
    contacts = [
        Contact.of((x + off(), y + off(), k + off()), (off(), off(), 1), (0.5, 0.3, 0.7)[k % 3], 0.3)
        for k in range(boxes)
        for x, y in CORNERS
    ]
    pairs = [(k, k - 1 if k else boxes) for k in range(boxes) for _ in CORNERS]
    return Scene([*bodies, Body.static()], pairs, contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise", [1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 1e-5])
@pytest.mark.parametrize("boxes", [3, 10, 20])
def test_the_noise_of_a_detector_does_not_cost_the_bound(boxes, noise, seed, law):
    """Without noise, the bounds are below 1e-6 with friction, and 1e-14 without. With noise, the latter grow
    as the square of the number of contacts.
    """
    scene = noisy_stack(boxes, noise, seed)
    other, place = shuffled(scene, seed)
    one, again = scene.resolve(law), other.resolve(law)
    again = again._replace(changes=[again.changes[k] for k in place])
    assert one.error_bound < (1e-6 if law is Law.COULOMB else 1e-13 * boxes**2)
    assert distance(scene, one, again) <= one.error_bound + again.error_bound


TOLERANCES = [10.0**-k for k in range(1, 13)]
"""With friction, the first takes a few steps in doubles, the last most digits of double-double."""


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-5, 1e-3])
@pytest.mark.parametrize("boxes", [1, 3, 10])
def test_a_tolerance_is_met_with_the_answer_of_the_least_tolerance(boxes, noise):
    scene = noisy_stack(boxes, noise, boxes)
    *others, finest = (scene.resolve(Law.COULOMB, tolerance=tolerance) for tolerance in TOLERANCES)
    for tolerance, answer in zip(TOLERANCES, others, strict=False):
        # LeastWork::left_out is up to 2e-9. In the noisiest stack contacts part: the bound is an estimate.
        assert answer.error_bound <= max(tolerance, 5e-7 if (boxes, noise) == (10, 1e-3) else 1e-8)
        assert distance(scene, answer, finest) <= answer.error_bound + finest.error_bound


@pytest.mark.parametrize("seed", [*range(40), 122, 21577, 42093])
def test_uneven_rebounds_have_one_answer_for_any_tolerance(seed):
    scene = uneven_rebounds(seed)
    *others, finest = (scene.resolve(Law.COULOMB, tolerance=tolerance) for tolerance in TOLERANCES[1::2])
    for answer in others:
        assert distance(scene, answer, finest) <= answer.error_bound + finest.error_bound
        is_missed = answer.error_bound > answer.model.tolerance
        assert (answer.status is StatusCode.TOLERANCE_NOT_MET) == is_missed


LEGS = {
    "grid": [(x / 2, y / 6, 0.0) for x in (-1, 0, 1) for y in (-3, -1, 1, 3)],
    "circle": [(math.cos(k), math.sin(k), 0.0) for k in range(7)],
    "line": [(k / 11, 0.0, 0.0) for k in range(-6, 6)],
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("legs", LEGS)
@pytest.mark.parametrize("off", [1e-8, 1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 1e-2])
def test_a_table_on_uneven_legs_slides_the_same_in_any_order_of_them(off, legs, seed):
    """No threshold decides which legs carry it: some differences are on the edge of any."""
    rng = random.Random(seed)
    table = Body.box(
        1.0,
        [rng.choice([0.1, 0.5, 2.0]) for _ in range(3)],
        position=(0.0, 0.0, 0.5),
        velocity=(rng.choice([-1.5, 0.5]), rng.choice([0.5, 10.0]), rng.choice([-1.0, -0.01])),
        angular_velocity=[rng.choice([-1.0, 0.0, 0.3]) for _ in range(3)],
    )
    e, mu = rng.choice([0.0, 0.5, 1.0]), rng.choice([0.1, 1.0, 3.0])
    contacts = [
        Contact.of(place, (off * rng.uniform(-1, 1), off * rng.uniform(-1, 1), 1.0), e, mu)
        for place in LEGS[legs]
    ]
    scene = Scene([table, Body.static()], [(0, 1)] * len(contacts), contacts)
    one = scene.resolve()
    assert one.error_bound < 1e-4 or (off > 3e-4 and seed == 2)  # it slips 1000 times faster than it falls
    for _ in range(3):
        other = scene._replace(contacts=rng.sample(contacts, len(contacts))).resolve()
        assert distance(scene, one, other) <= one.error_bound + other.error_bound


@pytest.mark.parametrize("count", [4, 6, 8])
@pytest.mark.parametrize("off", [1e-12, 1e-8, 1e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("mu", [0.3, 1e3])
def test_a_box_on_uneven_contacts_is_braked_as_on_even_ones(mu, off, count):
    """But for the difference in the normals times the slip, and 1e-6 that contacts of a small part give."""
    rng = random.Random(count)
    places = [*CORNERS, *((rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)) for _ in range(count - 4))]
    normals = [(rng.gauss(0, off), rng.gauss(0, off), 1.0) for _ in places]
    box = Body.box(1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=(1.0, 0.0, -1.0))
    contacts = [Contact.of((*at, 0.0), normal, 0.0, mu) for at, normal in zip(places, normals, strict=True)]
    answer = Scene([box, Body.static()], [(0, 1)] * count, contacts).resolve()
    right = (0.7, 0.0, 0.0) if mu < 1 else (0.0, 0.0, 0.0)
    assert answer.twists[0].linear == pytest.approx(right, abs=20 * off + 1e-6 + 10 * answer.error_bound)


@pytest.mark.parametrize("law, mu", LAWS)
@pytest.mark.parametrize("seed", range(12))
def test_corners_rounded_to_float32(seed, law, mu):
    """A rotated box on a slope, with corners and normal as physics engines give them."""
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    down, q = -rotation[:, 2], Rotation.from_matrix(rotation).as_quat().tolist()
    box = Body.box(1.0, (1, 1, 1), orientation=q, velocity=tuple(down + 0.5 * rotation[:, 0]))
    single = [np.float32(rotation @ (x, y, -0.5)).astype(float) for x, y in CORNERS]
    normal = np.float32(rotation[:, 2]).astype(float)
    contacts = [Contact.of(tuple(corner), tuple(normal), 0.5, mu) for corner in single]
    scene = Scene([box, Body.static()], [(0, 1)] * 4, contacts)
    answer = scene.resolve(law)
    assert answer.status is StatusCode.OK
    assert answer.error_bound < (2.0**-43 if law is Law.FRICTIONLESS else 1e-3)
    if law is Law.FRICTIONLESS:
        assert_within_bound(scene, answer, scene.in_fractions().resolve(Law.FRICTIONLESS))
    assert np.dot(answer.twists[0].linear, -down) == pytest.approx(0.5, abs=1e-3)


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
        others = [contacts[i] for i in order]
        answer = resolve_scene([*bodies, Body.static()], [pairs[i] for i in order], others)
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
    monkeypatch.setattr("collision_response.scene.in_fractions.cluster_in_fractions", None)
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


TILTS = [(-3.2, -3.1), (1.1, -0.5), (-9.7, -6.7)]


@pytest.mark.parametrize("tilt", [0.0, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6])
def test_friction_that_creeps_between_tilted_corners_decides_nothing(tilt):
    """A cube lands on three corners, and one parts. Friction of the others shifts for a slip of 1e-11."""
    cube = Body.box(
        1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=(1.84, 1.8, -1.0), angular_velocity=(1.66, 0.84, 1.14)
    )
    contacts = [
        Contact.of((x, y, 0), (p * tilt, q * tilt, 1), 0.5, 1.0)
        for (x, y), (p, q) in zip([(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5)], TILTS, strict=True)
    ]
    for order in itertools.permutations(contacts):
        answer = resolve_scene([cube, Body.static()], [(0, 1)] * 3, order)
        assert answer.kinetic_energy_after == pytest.approx(1.86241239, abs=1e-5)
        assert answer.error_bound < 1e-5


def assert_lands_as_if_flat(seed: int, corners: int, tilt: float, e: float, mu: float) -> None:
    rng = random.Random(seed)
    size = [rng.uniform(0.3, 2) for _ in range(3)]
    velocity = (rng.gauss(0, 1.5), rng.gauss(0, 1.5), -2 * rng.random())
    spin = tuple(rng.gauss(0, 1.5) for _ in range(3))
    body = Body.box(1.0, size, position=(0, 0, size[2] / 2), velocity=velocity, angular_velocity=spin)
    places = [(x * size[0], y * size[1], 0) for x, y in CORNERS[:corners]]
    tilts = [(rng.gauss(0, tilt), rng.gauss(0, tilt)) for _ in places]

    def landed(by: float) -> Scene:
        normals = [(by * x, by * y, 1) for x, y in tilts]
        contacts = [Contact.of(at, normal, e, mu) for at, normal in zip(places, normals, strict=True)]
        return Scene([body, Body.static()], [(0, 1)] * corners, contacts)

    flat, tilted = landed(0.0).resolve(), landed(1.0).resolve()
    assert distance(landed(0.0), flat, tilted) <= flat.error_bound + tilted.error_bound + 100 * tilt


@pytest.mark.parametrize("tilt", [1e-13, 1e-12, 1e-11])
@pytest.mark.parametrize("seed", range(40))
def test_three_corners_that_are_tilted_by_rounding_are_flat(tilt, seed):
    assert_lands_as_if_flat(seed, 3, tilt, 0.5, 1.0)


@pytest.mark.parametrize(
    ("tilt", "e", "mu"), [(1e-12, 0.0, 0.5), (1e-12, 0.5, 1.0), (1e-11, 0.5, 0.5), (1e-8, 0.0, 1.0)]
)
@pytest.mark.parametrize("first", range(0, 100, 20))
def test_four_corners_that_are_tilted_by_rounding_are_flat(tilt, e, mu, first):
    """A corner without a load may carry one, or keep the velocities of the others. No tilt decides that."""
    for seed in range(first, first + 20):
        assert_lands_as_if_flat(seed, 4, tilt, e, mu)


@pytest.mark.parametrize("seed", [21, 92, 171, 264])
def test_much_friction_creeps_farther_between_tilted_corners(seed):
    assert_lands_as_if_flat(seed, 3, 1e-9, 0.5, 6.0)
