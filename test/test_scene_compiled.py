"""Scenes of floats only are answered by compiled code, with the same bits as without it."""

from __future__ import annotations

import math

import pytest
from scene_cases import Scene, any_scene, box, row_of_balls

from collision_response import Body, Contact, ImpactError, ImpactModel, Law, resolve_scene
from collision_response.kernels import library

LAWS = [Law.AUTO, Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU]


@pytest.fixture
def both(monkeypatch):
    """Answer a scene by the compiled code, which must succeed, and without it."""

    def answers(scene: Scene, model: ImpactModel):
        found = []
        compiled = library.resolve_scene
        with monkeypatch.context() as patch:
            patch.setattr(library, "resolve_scene", lambda *args: found.append(compiled(*args)) or found[-1])
            one = resolve_scene(*scene, model)
            patch.setattr(library, "resolve_scene", lambda *_: None)
            other = resolve_scene(*scene, model)
        return one if found and found[-1] is not None else None, other

    return answers


def contacts_of_larger_clusters(scene: Scene) -> Scene:
    """The contacts of clusters of several, without repetitions, and the bodies that they touch."""
    kept = []
    for cluster in scene.resolve(Law.FRICTIONLESS).clusters:
        own = list({(scene.pairs[i], scene.contacts[i]): i for i in cluster}.values())
        kept += own if len(own) > 1 else []
    places = sorted({b for i in kept for b in scene.pairs[i]})
    return Scene(
        [scene.bodies[b] for b in places],
        [(places.index(scene.pairs[i][0]), places.index(scene.pairs[i][1])) for i in kept],
        [scene.contacts[i] for i in kept],
    )


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("threshold", [0.0, 0.4])
def test_compiled_scenes_give_the_same_bits(both, law, threshold):
    compiled = 0
    for seed in range(30, 110):
        scene = contacts_of_larger_clusters(any_scene(seed))
        one, other = both(scene, ImpactModel(law, restitution_threshold=threshold))
        compiled += one is not None
        assert one is None or one == other
        assert one is None or (type(one), one.status, one.model) == (type(other), other.status, other.model)
    assert compiled > 60


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


@pytest.mark.parametrize(
    "unusual",
    [
        box().with_contacts(restitution=lambda _: 0.5),
        box()._replace(pairs=[[0, 1]] * 4),
        row_of_balls((1, 0, 0)),
        Scene(*box()[:2], [c._replace(tangential_restitution=0.0) for c in box().contacts]),
        Scene(box().bodies, [(0, 1)] * 5, [*box().contacts, box().contacts[0]]),
        Scene([*box().bodies, Body.dynamic(1.0)], *box()[1:]),
        Scene(box().bodies, [(0, 1)], box().contacts[:1]),
    ],
)
def test_unusual_scenes_are_left_to_python(both, unusual):
    one, other = both(unusual, ImpactModel())
    assert one is None
    assert len(other.contacts) == len(unusual.contacts)


@pytest.mark.parametrize("field, value", [("friction", -1.0), ("friction", math.nan), ("restitution", 2.0)])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_invalid_values_are_refused_by_name(law, field, value):
    scene = box(e=0.5, mu=0.3)
    contacts = [*scene.contacts[:3], scene.contacts[3]._replace(**{field: value})]
    if law is Law.FRICTIONLESS and field == "friction" and value < 0:
        return  # it is not looked at
    with pytest.raises(ImpactError, match=rf"contacts\[3\].{field}"):
        scene._replace(contacts=contacts).resolve(law)
