"""Contacts whose normal impulses act along one line, as on the seam between two floors.

They can share a load in any way. If their friction differs, the motion depends on it: no bound is then known.
"""

from __future__ import annotations

import itertools

import pytest
from scene_cases import Scene, distance, shuffled

from collision_response import Body, Contact, Law, StatusCode
from collision_response.physics.vector import Vec3

ON_ONE_LINE = [0.0, 1e-300, 1e-16, 1e-14, -1e-14]
"""The distance between the lines of two contacts: so small that rounding decides which one has the load."""


def seam(apart: float, frictions, belts=(0.0, 0.0), e: float = 0.0, speed: float = 2.0) -> Scene:
    """A ball that strikes two floors, each with its friction and the speed of its belt."""
    ball = Body.sphere(1.0, 0.5, position=(0, 0, 0.5), velocity=(speed, 0, -1.0))
    floors = [Body.kinematic(velocity=(belt, 0.0, 0.0)) for belt in belts]
    contacts = [
        Contact.of((x, 0, 0), (0, 0, 1), e, mu) for x, mu in zip((0.0, apart), frictions, strict=True)
    ]
    return Scene([ball, *floors], [(0, 1), (0, 2)], contacts)


def turned(scene: Scene, normal: Vec3) -> Scene:
    """The scene with ``normal`` in place of z."""
    across = normal.cross(Vec3(0.6, 0.0, 0.8))
    across = across / across.norm()

    def to(v: Vec3) -> Vec3:
        return across * v.x + normal * v.z

    bodies = [b._replace(position=to(b.position), velocity=to(b.velocity)) for b in scene.bodies]
    contacts = [c._replace(position=to(c.position), normal=to(c.normal)) for c in scene.contacts]
    return Scene(bodies, scene.pairs, contacts)


def swapped(scene: Scene) -> Scene:
    """The second contact, from its other body."""
    pairs, contacts = list(scene.pairs), list(scene.contacts)
    pairs[1], contacts[1] = pairs[1][::-1], contacts[1]._replace(normal=-contacts[1].normal)
    return Scene(scene.bodies, pairs, contacts)


@pytest.mark.parametrize("apart", ON_ONE_LINE)
@pytest.mark.parametrize("e", [0.0, 0.5])
@pytest.mark.parametrize(
    "scene_of",
    [
        lambda apart, e: seam(apart, (0.125, 0.5), e=e),
        lambda apart, e: swapped(seam(apart, (0.125, 0.5), e=e)),
        lambda apart, e: turned(seam(apart, (0.125, 0.5), e=e), Vec3(0.0, 0.6, 0.8)),
        lambda apart, e: seam(apart, (0.0, 0.5), e=e),
        lambda apart, e: seam(apart, (0.25, 0.25), belts=(2.0, -2.0), e=e, speed=0.0),
    ],
    ids=["floors", "swapped", "turned", "one floor without friction", "belts"],
)
def test_moreau_knows_no_bound_where_the_share_of_a_load_decides_the_motion(scene_of, e, apart):
    scene = scene_of(apart, e)
    for one in (scene, shuffled(scene, 1)[0]):
        answer = one.resolve(Law.MOREAU)
        assert answer.status is StatusCode.TOLERANCE_NOT_MET
        assert answer.error_bound == float("inf")


@pytest.mark.parametrize("apart", [0.0, 1e-14])
@pytest.mark.parametrize("height", [-1.0, 0.1, 1e-2, 1e-3, 1e-6, 1e-9])
def test_moreau_covers_every_share_of_a_load_between_contacts_at_other_heights(height, apart):
    """Their friction has other lever arms. Either of them alone may have the load."""
    body = Body.dynamic(1.0, (1.0, 0, 0, 1.0, 0, 1.0), (0.5, 0, 3.0), None, (0.25, 0, 0), (0, -1.0, 0))
    contacts = [
        Contact.of((0.25, 0, 0.5), (0, 0, 1), 0.5, 0.25),
        Contact.of((0.25 + apart, 0, 0.5 + height), (0, 0, 1), 0.5, 0.25),
    ]
    scene = Scene([body, Body.static()], [(0, 1)] * 2, contacts)
    answer = scene.resolve(Law.MOREAU)
    for contact in contacts:
        alone = Scene(scene.bodies, [(0, 1)], [contact]).resolve(Law.MOREAU)
        assert distance(scene, answer, alone) <= answer.error_bound + alone.error_bound


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1])
def test_moreau_knows_no_bound_where_pairs_of_contacts_near_each_other_share_a_load(apart):
    """At each edge of a box that slides, one contact is three times as rough as the other."""
    box = Body.box(1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=(2.0, 0, -1.0))
    contacts = [
        Contact.of((x + offset, 0, 0), (0, 0, 1), 0.0, mu)
        for x in (-0.5, 0.5)
        for offset, mu in ((0, 0.1), (apart, 0.3))
    ]
    scene = Scene([box, Body.static()], [(0, 1)] * 4, contacts)
    for one in (scene, shuffled(scene, 3)[0]):
        assert one.resolve(Law.MOREAU).error_bound == float("inf")


@pytest.mark.parametrize("apart", [1e-9, 1e-6, 1e-3])
def test_moreau_finds_the_contact_that_friction_presses(apart):
    """Friction turns the ball forward: the contact in front has all of the load."""
    for sign, mu in ((1, 0.5), (-1, 0.125)):
        answer = seam(sign * apart, (0.125, 0.5)).resolve(Law.MOREAU)
        assert answer.error_bound < 1e-9
        assert answer.twists[0].linear.x == pytest.approx(2.0 - mu, abs=2 * apart)


@pytest.mark.parametrize("apart", ON_ONE_LINE)
@pytest.mark.parametrize(
    ("frictions", "belts"), [((0.25, 0.25), (0.0, 0.0)), ((0.25, 0.25), (0.0, 0.5)), ((0.0, 0.0), (0.0, 3.0))]
)
def test_moreau_has_a_small_bound_where_every_share_leads_to_the_same_motion(frictions, belts, apart):
    answer = seam(apart, frictions, belts).resolve(Law.MOREAU)
    assert answer.error_bound < 1e-9
    assert answer.twists[0].linear.x == pytest.approx(2.0 - frictions[0])


@pytest.mark.parametrize("tilt", [0.0, 1e-14, 1e-8])
def test_coulomb_takes_least_work_where_contacts_on_one_line_share_a_load(tilt):
    """Tilted by 1e-5, the same contacts have several solutions next to each other, too."""
    mass = Body.dynamic(0.5, velocity=(1.0, 0, 1.0))

    def resolved(tilt: float):
        contacts = [
            Contact.of((0, 0, 0), normal, 0.5, mu)
            for normal, mu in (((-1.0, 0, 0), 0.25), ((3.0, 0, 4.0), 0.5), ((-1.0, 0, tilt), 0.5))
        ]
        scene = Scene([mass, Body.static()], [(0, 1)] * 3, contacts)
        return scene, scene.resolve(Law.COULOMB)

    (scene, answer), (_, reference) = resolved(tilt), resolved(1e-5)
    assert distance(scene, answer, reference) < 1e-4


def test_answers_do_not_depend_on_the_order_of_contacts_on_one_line():
    for frictions, apart in itertools.product([(0.125, 0.5), (0.5, 0.125), (0.3, 0.3)], [0.0, 1e-14, 1e-9]):
        scene = seam(apart, frictions)
        for law in (Law.COULOMB, Law.MOREAU):
            other, place = shuffled(scene, 2)
            answer, again = (one.resolve(law) for one in (scene, other))
            again = again._replace(changes=[again.changes[k] for k in place])
            assert distance(scene, answer, again) <= answer.error_bound + again.error_bound
