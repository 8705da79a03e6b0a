"""Contacts that part throughout an impact carry no load, and friction does not keep their velocities."""

from __future__ import annotations

import pytest
from scene_cases import Scene, distance

from collision_response import Body, Contact, Law

GROUND = Body.static()


def planar(mass: float, moment: float, position, velocity, spin: float) -> Body:
    return Body.dynamic(mass, (moment, 0, 0, moment, 0, moment), position, None, velocity, (0.0, 0.0, spin))


def a_body_that_jams(among=(0, 1, 2, 3, 4, 5)) -> Scene:
    """Contacts 2 and 4 carry its load. Any other two could as well, but they part."""
    body = planar(
        *(2.0, 0.2),
        *((0.4686818430327946, 0.8693242044242036, 0.0), (-0.7350214613150068, 0.3353150789990418, 0.0)),
        0.6363054307523801,
    )
    points = [
        (-0.27727819055932845, 0.4357405427808947),
        (-0.007657476362956439, 0.002168658643748156),
        (-0.636685718347173, -0.5178544670642522),
        (0.7278231021161092, 0.3189172145783823),
        (0.6302860729124347, 0.9554413583878985),
        (-0.8013463366484734, 0.622962299324932),
    ]
    normals = [
        (-0.5122483588547584, 0.2507457180898718),
        (-0.7419687079123976, 0.30533971793984205),
        (-0.8970970326665182, -0.5624605702350467),
        (0.42728983562930933, 0.47675106911201737),
        (0.5537583932713792, 0.7752848556928376),
        (-0.8445332423714449, 0.9137895068647139),
    ]
    contacts = [Contact.of((*points[i], 0.0), (*normals[i], 0.0), 0.5, 1.0) for i in among]
    return Scene([body, GROUND], [(0, 1)] * len(among), contacts)


def a_light_body_on_a_heavy_one(mass: float, count: int = 5) -> Scene:
    """The last contact parts, and the others carry the load."""
    heavy = planar(mass, mass, (3, 1, 0), (-1, 0, 0), -1.0)
    light = planar(0.5, 0.025, (-0.25, 0, 0), (-1, 1, 0), 0.5)
    touches = [
        ((2, 1), (3, 1, 0), (1, -1, 0), 5.0),
        ((1, 0), (3, -0.25, 0), (0, -1, 0), 0.0),
        ((1, 2), (-1, 0.5, 0), (1, 2, 0), 0.0),
        ((1, 0), (1, 0, 0), (1, -1, 0), 0.0),
        ((2, 1), (2, 2, 0), (2, 0.5, 0), 5.0),
    ][:count]
    pairs = [pair for pair, *_ in touches]
    contacts = [Contact.of(point, normal, 0.5, mu) for _, point, normal, mu in touches]
    return Scene([heavy, light, GROUND], pairs, contacts)


@pytest.mark.parametrize(
    ("scene", "without"),
    [
        (a_body_that_jams(), a_body_that_jams((2, 3, 4))),
        (a_body_that_jams((2, 3, 4, 5)), a_body_that_jams((2, 3, 4))),
        *(
            (a_light_body_on_a_heavy_one(mass), a_light_body_on_a_heavy_one(mass, 4))
            for mass in (1.0, 1e2, 1e3, 1e4, 1e5)
        ),
    ],
)
def test_contacts_that_part_change_nothing(scene, without):
    answer, expected = scene.resolve(Law.COULOMB), without.resolve(Law.COULOMB)
    assert distance(scene, answer, expected) <= answer.error_bound + expected.error_bound < 1e-5
    for contact in range(len(scene.contacts)):
        is_left_out = scene.contacts[contact] not in without.contacts
        assert not (is_left_out and any(answer.impulses[contact]))
