"""Scenes of floats only are answered by compiled code, with the same bits as without it."""

from __future__ import annotations

import gc
import sys
from threading import Lock, Thread

import numpy as np
import pytest
from random_impacts import RandomImpacts
from scene_cases import Scene, any_scene, box, row_of_balls

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    Twist,
    resolve,
    resolve_scene,
)
from collision_response.kernels import library
from collision_response.scene.frictionless import THRESHOLD

LAWS = [Law.AUTO, Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU]


@pytest.fixture
def both(monkeypatch):
    """Answer a scene by the compiled code, which must succeed, and without it."""

    def answers(scene: Scene, model: ImpactModel, threshold: float = THRESHOLD):
        found = []
        compiled = library.resolve_scene
        with monkeypatch.context() as patch:
            patch.setattr(library, "resolve_scene", lambda *args: found.append(compiled(*args)) or found[-1])
            one = resolve_scene(*scene, model, threshold=threshold)
            patch.setattr(library, "resolve_scene", lambda *_: None)
            other = resolve_scene(*scene, model, threshold=threshold)
        return one if found and found[-1] is not None else None, other

    return answers


def without_copies(scene: Scene) -> Scene:
    """The scene without contacts that are given before, and with two bodies that nothing touches."""
    kept = {
        (frozenset(pair), contact.position): i
        for i, (pair, contact) in enumerate(zip(*scene[1:], strict=True))
    }
    free = Body.sphere(
        2.0, 0.1, position=(50.0, 0.0, 0.0), velocity=(1.0, 2.0, -3.0), angular_velocity=(0.1, 0.0, 7.0)
    )
    return Scene(
        [*scene.bodies, free, Body.kinematic(velocity=(0.0, 0.0, 1.0))],
        [scene.pairs[i] for i in kept.values()],
        [scene.contacts[i] for i in kept.values()],
    )


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("restitution_threshold", [0.0, 0.4])
@pytest.mark.parametrize("threshold", [THRESHOLD, 0.0, 0.3])
def test_compiled_scenes_give_the_same_bits(both, law, restitution_threshold, threshold):
    compiled = 0
    for seed in range(30, 110):
        scene = without_copies(any_scene(seed))
        one, other = both(scene, ImpactModel(law, restitution_threshold=restitution_threshold), threshold)
        compiled += one is not None
        assert one is None or one == other
        assert one is None or (type(one), one.status, one.model) == (type(other), other.status, other.model)
    assert compiled > 60


def drops(*contacts: Contact, spin: float = 0.0) -> Scene:
    """Balls that each strike the ground at one contact, and a box that lands on four."""
    box_scene, count = box((1, 0.5, -1), e=0.5, mu=0.3), len(contacts)
    balls = [
        Body.sphere(
            2.0,
            0.1,
            position=(c.position[0], 0.0, 0.1),
            velocity=(0.3, 0.0, -1.0),
            angular_velocity=(0, 0, spin),
        )
        for c in contacts
    ]
    pairs = [(2 + i, 1) for i in range(count)]
    return Scene([*box_scene.bodies, *balls], pairs + box_scene.pairs, [*contacts, *box_scene.contacts])


GROUND = (0.0, 0.0, 1.0)
SINGLE_CONTACTS = {
    "frictionless": [Contact.of((9.0, 0.0, 0.0), GROUND, 0.5)],
    "with friction": [
        Contact.of((9.0, 0.0, 0.0), GROUND, 0.5, 0.3),
        Contact.of((7.0, 0.0, 0.0), GROUND, 1.0, 0.1),
    ],
    "separating": [Contact.of((9.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.5, 0.3)],
    "oblique": [Contact.of((9.0, 0.01, 0.0), (0.1, 0.2, 1.0), 0.9, 2.0)],
}


@pytest.mark.parametrize("name", SINGLE_CONTACTS)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize(
    "options",
    [{}, {"restitution_threshold": 1.5}, {"tolerance": 1e-15}, {"precision": Precision.EXTENDED}],
    ids=str,
)
def test_clusters_of_one_contact(both, law, name, options):
    one, other = both(drops(*SINGLE_CONTACTS[name], spin=3.0), ImpactModel(law, **options))
    assert one is not None
    assert one == other
    assert (one.status, one.model) == (other.status, other.model)


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_one_contact_is_as_exact_as_by_resolve(law, precision):
    """The wilder the magnitudes, the more digits it takes."""
    model, impacts = ImpactModel(law, precision=precision), RandomImpacts(f"{law.name}", 10.0)
    compared = 0
    while compared < 150:
        a, b, contact = impacts.collision()
        try:
            alone = resolve(a, b, contact, model)
        except ImpactError:
            continue
        answer = resolve_scene([a, b], [(0, 1)], [contact], model)
        assert (answer.status, answer.model, answer.error_bound) == (
            alone.status,
            alone.model,
            alone.error_bound,
        )
        assert (answer.impulses[0], answer.twists) == (alone.impulse, (alone.twist_a, alone.twist_b))
        compared += 1


@pytest.mark.parametrize("order", [1, -1])
def test_the_geometry_is_the_greatest_of_all_clusters(order):
    ball, floor, model = (
        Body.sphere(1.0, 0.5, velocity=(0, 0, -1)),
        Body.static(),
        ImpactModel(Law.FRICTIONLESS),
    )
    contacts = Contact.of((0, 0, -0.5), GROUND, 0.5), Contact.of((0.3, 0.1, -0.4), GROUND, 0.5)
    alone = [resolve(ball, floor, contact, model).model.geometry for contact in contacts]
    assert alone == [Geometry.POINT, Geometry.SPATIAL]
    answer = resolve_scene([ball, ball, floor], [(0, 2), (1, 2)], contacts[::order], model)
    assert answer.model.geometry is Geometry.SPATIAL


@pytest.mark.parametrize("law", Law)
@pytest.mark.parametrize("geometry", [Geometry.AUTO, Geometry.POINT, Geometry.SPATIAL])
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.DOUBLE])
def test_only_clusters_of_one_contact(both, law, geometry, precision):
    points = [Body.dynamic(1.0, position=(2.0 * i, 0.0, 0.0), velocity=(0.2, -0.1, -i)) for i in range(5)]
    contacts = [Contact.of(p.position, GROUND, 0.25 * i, 0.2 * i) for i, p in enumerate(points)]
    scene = Scene([Body.static(), *points], [(i + 1, 0) for i in range(5)], contacts)
    one, other = both(scene, ImpactModel(law, geometry, precision))
    assert one is not None
    assert one == other
    assert (one.status, one.model) == (other.status, other.model)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_every_adjustment_and_status_is_the_same(both, law):
    turned = box((1, 0.5, -1), e=0.5, mu=0.3)
    off_unit = [turned.bodies[0]._replace(orientation=(0.0, 0.0, 0.0, 2.0)), turned.bodies[1]]
    point = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0), angular_velocity=(1.0, 0.0, 0.0))
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.1 * x, 1.0), 0.5, 0.3) for x in (-1.0, 1.0)]
    gains = [c._replace(restitution=e) for c, e in zip(turned.contacts, (0.0, 1.0, 1.0, 0.0), strict=True)]
    scenes = [
        turned._replace(bodies=off_unit),
        Scene([point, Body.static()], [(0, 1)] * 2, contacts),
        box((1, 0, 1), mu=0.3),
        turned._replace(contacts=gains),
        box((1, 2, -1), (3, 2, 1), e=0.9, mu=0.4)._replace(contacts=gains),
        Scene([Body.kinematic(velocity=(0, 0, 1)), turned.bodies[0]], [(1, 0)] * 4, turned.contacts),
    ]
    for scene in scenes:
        for tolerance in (0.0, 1e-15):
            one, other = both(scene, ImpactModel(law, tolerance=tolerance))
            assert one is not None
            assert one == other


def with_body(**fields) -> Scene:
    scene = box((1, 0.5, -1), e=0.5, mu=0.3)
    return scene._replace(bodies=[scene.bodies[0]._replace(**fields), scene.bodies[1]])


@pytest.mark.parametrize(
    "scene",
    [
        box()._replace(pairs=[[0, 1]] * 4),
        box()._replace(pairs=np.array([(0, 1)] * 4)),
        box()._replace(pairs=[np.array((0, 1), np.uint8)] * 4),
        box()._replace(pairs=[(np.int32(0), 1)] * 4),
        box().with_contacts(friction=np.float32(0.3), restitution=np.float16(0.5)),
        box().with_contacts(friction=np.array(0.3)),
        with_body(velocity=np.array((1.0, 0.0, -1.0)), angular_velocity=[0, 1, 2.0]),
        with_body(position=np.array((0, 0, 0.5), np.float32), mass=np.float32(2)),
        with_body(inertia=np.array((1.0, 0, 0, 1.0, 0, 1.0)), orientation=np.array((0.0, 0.0, 0.5, 2.0))),
    ],
)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_numbers_of_numpy_are_read_as_floats(both, law, scene):
    one, other = both(scene, ImpactModel(law))
    assert one is not None
    assert one == other


@pytest.mark.parametrize("law", [*LAWS, Law.ROUTH_STRONGE], ids=lambda law: law.name)
@pytest.mark.parametrize("velocity", [(0, 0, 0), (1, 0.5, 0), (1, 0.5, 1)])
@pytest.mark.parametrize(("e", "mu"), [(0.0, 0.0), (0.5, 0.0), (0.5, 0.3)])
def test_scenes_in_which_nothing_approaches_are_compiled_for_every_law(both, law, velocity, e, mu):
    """Also those without a velocity that would separate all contacts, as of a ball between two walls."""
    ball = Body.sphere(1.0, 0.5, velocity=velocity)
    walls = [Body.kinematic(velocity=velocity)] * 2
    between = [Contact.of((0.0, 0.0, z), (0.0, 0.0, -2 * z), e, mu) for z in (0.5, -0.5)]
    for scene in (box(velocity, e=e, mu=mu), Scene([*walls, ball], [(2, 0), (2, 1)], between)):
        one, other = both(scene, ImpactModel(law))
        assert one is not None
        assert one == other
        assert one.status is StatusCode.SEPARATING
        assert one.twists == tuple(Twist(body.velocity, body.angular_velocity) for body in scene.bodies)
        assert one.error_bound == 0


def test_ctrl_c_while_a_number_is_read_is_not_lost():
    class Interrupted:
        def __float__(self):
            raise KeyboardInterrupt

        __index__ = __float__

    for scene in (
        box().with_contacts(friction=Interrupted()),
        box()._replace(pairs=[(0, Interrupted())] * 4),
    ):
        with pytest.raises(KeyboardInterrupt):
            resolve_scene(*scene)


@pytest.mark.parametrize(
    "unusual",
    [
        box().with_contacts(restitution=lambda _: 0.5),
        row_of_balls((1, 0, 0)),
        Scene(*box()[:2], [c._replace(tangential_restitution=0.0) for c in box().contacts]),
        Scene(box().bodies, [(0, 1)] * 5, [*box().contacts, box().contacts[0]]),
    ],
)
def test_unusual_scenes_are_left_to_python(both, unusual):
    one, other = both(unusual, ImpactModel())
    assert one is None
    assert len(other.contacts) == len(unusual.contacts)


def seen_beside(law, look):
    """What ``look`` returns in another thread while the library resolves a large cluster.

    Python's own interval for switching threads is made so long that only the library lets others run.
    """
    scene, gate, seen = row_of_balls([1.0] + [0.0] * 39, e=0.9, number=float), Lock(), []

    def wait_and_look() -> None:
        with gate:
            seen.append(look())

    gate.acquire()
    other = Thread(target=wait_and_look)
    other.start()
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)
    try:
        gate.release()
        assert not seen
        for _ in range(1000):  # the other thread may need time to wake up
            scene.resolve(law)
            if seen:
                break
        return seen
    finally:
        sys.setswitchinterval(interval)
        other.join()


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_large_cluster_leaves_other_threads_running(law):
    assert seen_beside(law, lambda: True) == [True]


def test_tuples_are_hidden_until_they_are_full():
    def count_incomplete() -> int:
        tuples = [one for one in gc.get_objects() if type(one) is tuple]
        return sum(len(gc.get_referents(one)) < len(one) for one in tuples)

    assert seen_beside(Law.COULOMB, count_incomplete) == [0]
