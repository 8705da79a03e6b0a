"""Nearly flat boxes: contacts that depend on each other up to some digits."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

pytest.importorskip("scipy")

from scene_cases import Scene, assert_within_bound, distance
from scipy.spatial.transform import Rotation

from collision_response import Body, Contact, Law, StatusCode

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
        assert distance(scene, answer, flat) <= answer.error_bound + flat.error_bound + 100 * off


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
