"""Many scenes from tables: each cluster gets the bits of ``resolve_scene``, unaffected by the others."""

from __future__ import annotations

import doctest
import math
import sys
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scene_cases import Scene, any_scene, box, random_scene, row_of_balls

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.batch import ScenesResult, body_rows, contact_rows, resolve_scenes
from collision_response.batch.result import ENERGIES, REPORTED_ADJUSTMENTS
from collision_response.physics.vector import ZERO

body_row, contact_row = body_rows(Geometry.SPATIAL, oriented=True), contact_rows(Geometry.SPATIAL)


def tables(scenes: list[Scene], *, floor: Body | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All scenes in one table of bodies and one of contacts; a common immovable body comes last."""
    bodies = [body for scene in scenes for body in scene.bodies] + ([] if floor is None else [floor])
    contacts = [contact for scene in scenes for contact in scene.contacts]
    starts = np.cumsum([0, *(len(scene.bodies) for scene in scenes)])
    pairs = [
        [start + i for i in pair]
        for scene, start in zip(scenes, starts, strict=False)
        for pair in scene.pairs
    ]
    table, touches = np.zeros((body_row.height, len(bodies))), np.zeros((contact_row.height, len(contacts)))
    for i, body in enumerate(bodies):
        table[body_row.mass, i], table[body_row.inertia, i] = body.mass, body.inertia
        table[body_row.position, i], table[body_row.velocity, i] = body.position, body.velocity
        table[body_row.angular_velocity, i] = body.angular_velocity
        table[body_row.orientation, i] = body.orientation or (0, 0, 0, 1)
    for i, contact in enumerate(contacts):
        touches[:, i] = (*contact.position, *contact.normal, contact.restitution, contact.friction)
    return table, touches, np.array(pairs, int).reshape(-1, 2).T


def clusters_of(scene: Scene) -> list[list[int]]:
    """Clusters by definition: contacts that share a movable body, also through other contacts."""
    left, found = list(range(len(scene.contacts))), []
    while left:
        own = [left.pop(0)]
        grown = True
        while grown:
            bodies = {b for i in own for b in scene.pairs[i] if scene.bodies[b].is_movable()}
            more = [i for i in left if bodies & set(scene.pairs[i])]
            own, left, grown = own + more, [i for i in left if i not in more], bool(more)
        found.append(sorted(own))
    return found


def cluster_scene(scene: Scene, own: list[int]) -> tuple[Scene, list[int]]:
    """A cluster as a scene of its own, and the indices of its bodies."""
    places = list(dict.fromkeys(b for i in own for b in scene.pairs[i]))
    pairs = [tuple(places.index(b) for b in scene.pairs[i]) for i in own]
    return Scene([scene.bodies[b] for b in places], pairs, [scene.contacts[i] for i in own]), places


def assert_same_as_single_scenes(scenes: list[Scene], model: ImpactModel, result: ScenesResult) -> list[int]:
    """Compare every cluster with ``resolve_scene``; return the status codes of all clusters."""
    codes, first_body, first_contact = [], 0, 0
    for scene in scenes:
        for own in clusters_of(scene):
            cluster = len(codes)
            contacts = [first_contact + i for i in own]
            assert set(result.cluster[contacts]) == {cluster}
            alone, places = cluster_scene(scene, own)
            moved = [(k, first_body + b) for k, b in enumerate(places) if scene.bodies[b].is_movable()]
            try:
                answer = resolve_scene(*alone, model)
            except ImpactError as error:
                codes.append(error.code)
                assert result.status[cluster] == error.code
                assert np.isnan(result.impulse[:, contacts]).all() and not result.regime[contacts].any()
                assert all(np.isnan(result.velocity[:, b]).all() for _, b in moved)
                assert all(np.isnan(getattr(result, name)[cluster]) for name in (*ENERGIES, "error_bound"))
                assert result.adjustments[cluster] == 0
                continue
            codes.append(answer.status)
            assert result.status[cluster] == answer.status
            for k, b in moved:
                assert tuple(result.velocity[:, b]) == tuple(answer.twists[k].linear)
                assert tuple(result.angular_velocity[:, b]) == tuple(answer.twists[k].angular)
            assert [tuple(P) for P in result.impulse[:, contacts].T] == [tuple(P) for P in answer.impulses]
            assert tuple(result.regime[contacts]) == answer.regimes
            assert [getattr(result, name)[cluster] for name in ENERGIES] == [
                getattr(answer, name) for name in ENERGIES
            ]
            assert result.error_bound[cluster] == answer.error_bound
            assert result.decision_margin[cluster] == answer.decision_margin
            assert result.adjustments[cluster] == answer.adjustments & REPORTED_ADJUSTMENTS
        first_body += len(scene.bodies)
        first_contact += len(scene.contacts)
    assert len(result.status) == len(codes)
    return codes


def without_com_offset(scene: Scene) -> Scene:
    """Tables have no centre of mass apart from the reference point."""
    return scene._replace(bodies=[body._replace(com=ZERO) for body in scene.bodies])


RANDOM = [without_com_offset(random_scene(seed)) for seed in range(120)]


@pytest.mark.parametrize(
    "model",
    [
        ImpactModel(Law.FRICTIONLESS),
        ImpactModel(Law.COULOMB),
        ImpactModel(Law.COULOMB, restitution_threshold=0.4),
        ImpactModel(Law.COULOMB, tolerance=1e-2),
        ImpactModel(Law.COULOMB, tolerance=1e-12),
        ImpactModel(Law.FRICTIONLESS, tolerance=1e-14),
        ImpactModel(Law.MOREAU),
        ImpactModel(Law.ROUTH_STRONGE),
        ImpactModel(Law.ROUTH_STRONGE, restitution_threshold=0.4, tolerance=1e-4),
    ],
)
def test_random_scenes_equal_resolve_scene(model):
    answer = resolved(RANDOM, model)
    codes = assert_same_as_single_scenes(RANDOM, model, answer)
    assert len(codes) > 150
    assert {StatusCode.OK, StatusCode.SEPARATING} <= set(codes)
    if model.restitution_threshold:
        assert Adjustment.RESTITUTION_THRESHOLD in answer.adjustments
    if model.law is Law.MOREAU:
        assert Adjustment.LAW_FALLBACK in answer.adjustments


def grazing_spheres(e: float, mu: float) -> list[Scene]:
    """A sphere that moves more and more along the floor, so that its approach loses more and more digits."""
    return [
        Scene(
            [Body.sphere(1.0, 0.5, velocity=(1.0, 1 / 3, -1 / 3)), Body.static()],
            [(0, 1)],
            [Contact.of((0.0, 0.0, 0.0), (1.0, 1.0, 4.0 + 2.0**-k), e, mu)],
        )
        for k in range(51)
    ]


@pytest.mark.parametrize("law", [Law.AUTO, Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("tolerance", [0.0, 0.5, 1e-9, 1e-15])
def test_single_contacts_use_the_precision_that_resolve_uses(law, tolerance):
    if tolerance == 1e-15:
        pytest.importorskip("flint")  # the bound needs its digits
    scenes = grazing_spheres(0.5, 0.3)
    model = ImpactModel(law, Geometry.SPATIAL, tolerance=tolerance)
    answer = resolved(scenes, model)
    assert set(assert_same_as_single_scenes(scenes, model, answer)) == {StatusCode.OK}
    assert answer.error_bound.max() <= (tolerance or 2.0**-20)
    taken = [resolve(*scene.bodies, *scene.contacts, model).model.precision for scene in scenes]
    assert Precision.EXTENDED in taken


def resolved(scenes: list[Scene], model: ImpactModel, **options: Any) -> ScenesResult:
    bodies, contacts, pairs = tables(scenes)
    return resolve_scenes(bodies, contacts, model, pairs=pairs, **options)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_structured_scenes(law):
    """Repeated contacts, chains, a ball between walls, contradictory walls, single contacts."""
    wall = Body.kinematic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    ball = Body.dynamic(1.0)
    left = Contact.of((-1.0, 0, 0), (1.0, 0, 0), 1.0, 0.0)
    right = Contact.of((1.0, 0, 0), (-1.0, 0, 0), 1.0, 0.0)
    moving = ball._replace(velocity=type(ball.velocity)(-1.0, 0.0, 0.0))
    doubled = box(e=0.5, mu=0.3, velocity=(0.2, 0, -1), spin=(0, 0.3, 0))
    doubled = Scene(doubled.bodies, [*doubled.pairs, (1, 0)], [
        *doubled.contacts, doubled.contacts[0]._replace(normal=-doubled.contacts[0].normal)
    ])  # fmt: skip
    scenes = [
        box(e=0.5, mu=0.3, velocity=(0.2, 0, -1)),
        box(velocity=(0, 0, 1)),
        row_of_balls([1.0, 0.0, 0.0], e=1.0, number=float),
        row_of_balls([1.0, 1.0, 1.0, 0.0, 0.0], e=0.5, number=float),
        row_of_balls([1.0, -1.0], e=0.25, number=float),
        doubled,
        Scene([moving, Body.static()], [(0, 1), (0, 1)], [left, right]),
        Scene([ball, wall, Body.static()], [(0, 1), (0, 2)], [left, right]),
    ]
    model = ImpactModel(law)
    codes = assert_same_as_single_scenes(scenes, model, resolved(scenes, model))
    assert StatusCode.CONTRADICTORY_CONTACTS in codes or law is Law.ROUTH_STRONGE
    assert codes.count(StatusCode.OK) >= 5


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_clusters_of_several_contacts_need_no_python(law, monkeypatch):
    boxes = [box((0.2, 0.1 * i, -1), (0.3, 0, 0), e=0.5, mu=0.3) for i in range(5)]
    expected = resolved(boxes, ImpactModel(law))
    monkeypatch.setattr(sys.modules["collision_response.batch.resolve_scenes"], "resolve_scene", pytest.fail)
    found = resolved(boxes, ImpactModel(law))
    assert found.status.tolist() == [StatusCode.OK] * 5
    np.testing.assert_array_equal(found.velocity, expected.velocity)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_tangential_restitution_that_the_law_ignores_costs_nothing(law, monkeypatch):
    boxes = [box((0.2, 0.1 * i, -1), (0.3, 0, 0), e=0.5, mu=0.3) for i in range(5)]
    expected = resolved(boxes, ImpactModel(law))
    monkeypatch.setattr(sys.modules["collision_response.batch.resolve_scenes"], "resolve_scene", pytest.fail)
    found = resolved(boxes, ImpactModel(law, tangential_restitution=0.5))
    np.testing.assert_array_equal(found.velocity, expected.velocity)


def test_laws_for_single_contacts_are_refused_cluster_by_cluster():
    scenes = [box(), row_of_balls([1.0, -1.0], number=float)]
    assert resolved(scenes, ImpactModel(Law.ROUTH_POISSON)).status.tolist() == [10, 1]
    assert resolved(scenes, ImpactModel(Law.COULOMB, tangential_restitution=0.5)).status.tolist() == [10, 1]


@pytest.mark.parametrize("workers", [2, 3])
def test_threads_give_the_same_bits(workers):
    alone, shared = (resolved(RANDOM * 3, ImpactModel(Law.COULOMB), workers=n) for n in (1, workers))
    for name, one, other in zip(ScenesResult._fields, alone, shared, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)


def test_boxes_on_one_floor():
    """Flat boxes leave with (0, 0, e) without spin; each corner takes a quarter of the impulse."""
    es = np.linspace(0, 1, 11)
    scenes = [
        Scene([scene.bodies[0]], scene.pairs, scene.contacts) for scene in (box(e=float(e)) for e in es)
    ]
    bodies, contacts, pairs = tables(scenes, floor=Body.static())
    pairs[1] = len(scenes)
    answer = resolve_scenes(bodies, contacts, pairs=pairs)
    assert answer.cluster.tolist() == np.repeat(np.arange(11), 4).tolist()
    np.testing.assert_allclose(answer.velocity[2, :-1], es, atol=1e-15)
    assert abs(answer.angular_velocity).max() < 1e-30 and abs(answer.velocity[:2]).max() < 1e-30
    np.testing.assert_allclose(answer.impulse[2], np.repeat(1 + es, 4) / 4, rtol=1e-15)
    np.testing.assert_allclose(answer.kinetic_energy_after, es**2 / 2, atol=1e-15)
    np.testing.assert_allclose(answer.energy_lost_restitution, (1 - es**2) / 2, atol=1e-15)


def test_cradles_agree_with_fractions():
    speeds = [(1, 0, 0), (1, 0, 0, 0, 0), (1, 1, 1, 0, 0), (3, -2, 1, -1), (1, 0)]
    answer = resolved(
        [row_of_balls(list(map(float, v)), e=0.5, number=float) for v in speeds],
        ImpactModel(Law.FRICTIONLESS),
    )
    exact = [resolve_scene(*row_of_balls(v, e=Fraction(1, 2)), ImpactModel(Law.FRICTIONLESS)) for v in speeds]
    expected = [twist.linear.x for one in exact for twist in one.twists]
    np.testing.assert_allclose(answer.velocity[0], [float(x) for x in expected], rtol=1e-15, atol=1e-16)


@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.PLANAR])
def test_point_and_planar_tables(geometry):
    body_row, contact_row = body_rows(geometry), contact_rows(geometry)
    bodies, contacts = np.zeros((body_row.height, 4)), np.zeros((contact_row.height, 3))
    bodies[body_row.mass], contacts[contact_row.restitution] = 1.0, 1.0
    bodies[body_row.inertia] = 0.4
    bodies[body_row.velocity][0, 0], contacts[contact_row.normal][0] = 1.0, -1.0
    answer = resolve_scenes(bodies, contacts, pairs=[[0, 1, 2], [1, 2, 3]])
    np.testing.assert_allclose(answer.velocity[0], [0, 0, 0, 1], atol=1e-30)
    assert answer.impulse.shape == (2 if geometry is Geometry.PLANAR else 3, 3)
    assert answer.angular_velocity.shape == (
        body_row.angular_velocity.stop - body_row.angular_velocity.start,
        4,
    )


def test_a_fault_affects_its_cluster_only():
    scenes = [box(e=0.5), box(e=0.5), box(e=0.5), row_of_balls([1.0, -1.0], number=float), box(e=0.5)]
    bodies, contacts, pairs = tables(scenes)
    contacts[contact_row.restitution, 5], bodies[body_row.velocity, 4] = 1.5, math.nan
    pairs = np.hstack(
        [pairs, [[0, -1, 6, 3, 1], [99, 6, 6, 1, 3]]]
    )  # unknown bodies, one body twice, two immovable bodies
    contacts = np.hstack([contacts, contacts[:, :5]])
    answer = resolve_scenes(bodies, contacts, pairs=pairs)
    code = StatusCode
    assert answer.status.tolist() == [
        code.OK, code.INVALID_COEFFICIENT, code.NOT_FINITE, code.OK, code.OK,
        code.UNKNOWN_BODY, code.UNKNOWN_BODY, code.SAME_BODY, code.NO_DYNAMIC_BODY, code.NO_DYNAMIC_BODY,
    ]  # fmt: skip
    np.testing.assert_array_equal(answer.velocity[2, [0, 8]], 0.5)
    assert np.isnan(answer.velocity[:, [2, 4]]).all()
    np.testing.assert_array_equal(answer.velocity[:, [1, 3, 5, 9]], 0.0)
    np.testing.assert_array_equal(answer.velocity[0, [6, 7]], [-1.0, 1.0])
    assert answer.cluster.tolist() == [0] * 4 + [1] * 4 + [2] * 4 + [3] + [4] * 4 + [5, 6, 7, 8, 9]


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
def test_a_body_that_is_unknown_twice_is_one_body(law):
    bodies, contacts, _ = tables([box()])
    answer = resolve_scenes(bodies, contacts[:, :1], ImpactModel(law), pairs=[[-1], [-1]])
    assert answer.status.tolist() == [StatusCode.SAME_BODY]
    np.testing.assert_array_equal(answer.velocity, bodies[body_row.velocity])


def test_no_contacts_and_no_bodies():
    bodies, contacts, _ = tables([box()])
    answer = resolve_scenes(bodies, contacts[:, :0], pairs=np.empty((2, 0), int))
    np.testing.assert_array_equal(answer.velocity, bodies[body_row.velocity])
    assert answer.status.shape == (0,)
    lost = resolve_scenes(bodies[:, :0], contacts[:, :2], pairs=[[0, 1], [1, 1]])
    assert lost.status.tolist() == [StatusCode.UNKNOWN_BODY, StatusCode.SAME_BODY]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"bodies": np.zeros((20, 2), np.float32)},
            "bodies, contacts: must both be float32 or float64; are float32",
        ),
        (
            {"contacts": np.zeros((9, 4))},
            "bodies, contacts: must be float64, and at most 8 rows of contacts; are float64, and 9 rows",
        ),
        ({"pairs": np.zeros((2, 4))}, "pairs: must be integers of shape (2, N), are float64 of (2, 4)"),
        ({"pairs": np.zeros((2, 5), int)}, "contacts: must be of shape (rows, 5), is (8, 4)"),
        ({"bodies": np.zeros((20, 2, 4))}, "bodies: must be of shape (4 or 7 or 16 or 20, B), is (20, 2, 4)"),
        ({"threshold": 1.0}, "threshold: must be "),
        ({"model": ImpactModel(precision=Precision.SINGLE)}, "model.precision: must be "),
        ({"model": ImpactModel(geometry=Geometry.PLANAR)}, "model.geometry: must be "),
    ],
)
def test_invalid_arguments_are_refused_by_name(change, message):
    bodies, contacts, pairs = tables([box()])
    with pytest.raises(ValueError) as refusal:
        resolve_scenes(**({"bodies": bodies, "contacts": contacts, "pairs": pairs} | change))
    assert str(refusal.value).startswith(message)


def test_the_docstring_examples_run():
    assert doctest.testmod(sys.modules["collision_response.batch.resolve_scenes"]).failed == 0


def test_friction_has_no_effect_on_frictionless():
    scenes = [without_com_offset(any_scene(seed)) for seed in range(30)]
    bodies, contacts, pairs = tables(scenes)
    twice, places = np.concatenate([contacts, contacts], axis=1), np.concatenate([pairs, pairs], axis=1)
    smooth, rough = twice.copy(), twice.copy()
    smooth[contact_row.friction] = 0.0
    rough[contact_row.friction, contacts.shape[1] :] += 0.25
    model = ImpactModel(Law.FRICTIONLESS)
    expected, found = (resolve_scenes(bodies, one, model, pairs=places) for one in (smooth, rough))
    for name, one, other in zip(expected._fields, expected, found, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=name)
