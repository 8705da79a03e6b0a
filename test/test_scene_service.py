"""The service for several simultaneous contacts, over DDS."""

from __future__ import annotations

import math
import threading
from typing import Any, NamedTuple

import pytest

pytest.importorskip("rclpy")

from ros_graph import DEADLINE, LATCHED, assign, balls_meet, state_of, wait_until

from collision_response import Body, Contact, ImpactModel, Law, StatusCode, resolve, resolve_scene
from collision_response.msg import BodyState, SceneResult
from collision_response.physics.mass_properties import box
from collision_response.ros import scenes
from collision_response.ros.scene_client import Touch, pack, pack_named
from collision_response.ros.scenes import NUMBERS
from collision_response.srv import ResolveScene

CUBE = Body.dynamic(
    1.0, box(1.0, (1.0, 1.0, 1.0)).inertia, position=(0.0, 0.0, 0.5), velocity=(0.25, 0.0, -1.0)
)
CORNERS = [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
CONTACTS = [Contact.of(corner, (0, 0, 1), 0.5, 0.3) for corner in CORNERS]
FLAT_BOX = [CUBE, Body.static()], [(0, 1)] * 4, CONTACTS
CRADLE = (
    [
        Body.dynamic(1.0, position=(float(i), 0.0, 0.0), velocity=(1.0 if i == 0 else 0.0, 0, 0))
        for i in range(3)
    ],
    [(0, 1), (1, 2)],
    [Contact.of((0.5 + i, 0, 0), (-1, 0, 0), 1.0) for i in range(2)],
)
SCENES = {"flat box": FLAT_BOX, "cradle": CRADLE}


def request_of(bodies, pairs, contacts, names=(), **model) -> ResolveScene.Request:
    """The request for a scene of the library."""
    request = pack(bodies, pairs, contacts, names=names, frame_id="world")
    for field, value in model.items():
        setattr(request.model, field, value)
    return request


def xyz(vector) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def test_a_scene_packed_by_names_equals_the_packed_scene():
    """The cube is given by name and the ground in full; names come in the order of first mention."""
    touches = [Touch("cube", "ground", corner, (0, 0, 1)) for corner in CORNERS]
    ground = Body.static()
    by_name = pack_named(touches, {"ground": ground}, restitution=0.5, friction=0.3, frame_id="world")
    pairs, contacts = [(1, 0)] * 4, FLAT_BOX[2]
    assert by_name == request_of([ground], pairs, contacts, ("ground", "cube"))

    in_full = pack_named(touches[:1], {"cube": CUBE, "ground": ground})
    open_ = Contact.of(CORNERS[0], (0, 0, 1), -1.0, -1.0)
    assert in_full == pack([CUBE, ground], [(0, 1)], [open_], names=["cube", "ground"])


@pytest.mark.parametrize("mass", [math.nan, -math.inf, -1.0])
def test_a_mass_that_is_no_mass_makes_no_wall(mass):
    """Only an infinite one does. The node refuses the others, as the library does."""
    request = pack([CUBE._replace(mass=mass), Body.static()], [(0, 1)], CONTACTS[:1])
    assert [*request.immovable] == [1]
    assert str(request.bodies[0]) == str(mass)


def test_pack_takes_iterators():
    bodies, pairs, contacts = FLAT_BOX
    assert pack(iter(bodies), iter(pairs), iter(contacts)) == pack(bodies, pairs, contacts)


def test_what_a_request_has_no_place_for_is_refused():
    hand = Body.articulated([[float(i == j) for j in range(6)] for i in range(6)])
    with pytest.raises(ValueError, match=r"^bodies\[1\].inverse_inertia: "):
        pack([Body.static(), hand], [(1, 0)], CONTACTS[:1])
    for name, value in (
        ("tangential_restitution", 0.0),
        *((x, lambda v: v) for x in ("restitution", "friction")),
    ):
        other = CONTACTS[0]._replace(**{name: value})
        with pytest.raises(ValueError, match=rf"^contacts\[1\].{name}: "):
            pack([CUBE, Body.static()], [(0, 1)] * 2, [CONTACTS[0], other])


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"bodies": [CUBE, None]}, TypeError, r"bodies\[1\]: must be a Body, is None"),
        ({"contacts": [(0, 1)]}, TypeError, r"contacts\[0\]: must be a Contact, is \(0, 1\)"),
        ({"pairs": [(0, 1)] * 2}, ValueError, "pairs: must be one for each contact; are 2 for 1 contacts"),
        ({"pairs": [(0,)]}, ValueError, r"pairs\[0\]: must be two indices of bodies, is \(0,\)"),
        ({"pairs": [0]}, ValueError, r"pairs\[0\]: must be two indices of bodies, is 0"),
        ({"pairs": CONTACTS[:1]}, ValueError, r"pairs\[0\]: must be two indices of bodies, is Contact"),
        ({"model": Law.COULOMB}, TypeError, "model: must be an ImpactModel, is .*Law.COULOMB"),
        ({"names": "cube"}, TypeError, "names: must be a sequence, is 'cube'"),
    ],
)
def test_arguments_of_another_kind_are_refused_by_name(change, error, says):
    given = {"bodies": [CUBE, Body.static()], "pairs": [(0, 1)], "contacts": CONTACTS[:1]} | change
    with pytest.raises(error, match=f"^{says}"):
        pack(**given)


@pytest.mark.parametrize("index", [-1, 0.5, 2**32])
def test_pairs_must_be_indices(index):
    with pytest.raises(
        ValueError, match=f"^pairs: must be indices of bodies, counted from 0; one is {index}"
    ):
        pack([CUBE, Body.static()], [(0, index)], CONTACTS[:1])


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("scene", SCENES)
def test_answers_over_dds_equal_the_library(shared_node, scene, law):
    response = shared_node.call(request_of(*SCENES[scene], law=law))
    assert response.success, response.result.status.message
    result, expected = response.result, resolve_scene(*SCENES[scene], ImpactModel(law))
    assert result.status.code == expected.status
    assert result.body_names == [f"body {i}" for i in range(len(SCENES[scene][0]))]
    assert [(xyz(twist.linear), xyz(twist.angular)) for twist in result.twists] == [
        (tuple(twist.linear), tuple(twist.angular)) for twist in expected.twists
    ]
    assert list(map(xyz, result.impulses)) == list(map(tuple, expected.impulses))
    assert tuple(result.normal_velocities_before) == expected.normal_velocities_before
    assert tuple(result.normal_velocities_after) == expected.normal_velocities_after
    assert tuple(result.regimes) == expected.regimes
    assert list(result.clusters) == [0] * len(SCENES[scene][1])
    for field in NUMBERS:
        assert getattr(result, field) == getattr(expected, field), field
    assert (result.model.law, result.adjustments) == (expected.model.law, expected.adjustments)
    assert [(c.restitution, c.friction) for c in result.contacts] == [c[2:4] for c in expected.contacts]


@pytest.fixture
def long_scenes(monkeypatch):
    """A semaphore that counts the scenes that have begun, and an event that ends them."""
    begun, end = threading.Semaphore(0), threading.Event()

    def resolve_later(*problem):
        begun.release()
        assert end.wait(DEADLINE)
        return resolve_scene(*problem)

    monkeypatch.setattr(scenes, "resolve_scene", resolve_later)
    monkeypatch.setattr(scenes, "MAX_AT_ONCE", 0)
    yield begun, end
    end.set()


def test_a_long_scene_keeps_nobody_else_waiting(graph, long_scenes):
    begun, end = long_scenes
    graph.serve()
    scene = graph.call_async(request_of(*FLAT_BOX))
    assert begun.acquire(timeout=DEADLINE)
    assert graph.call(balls_meet()).success
    assert not scene.done()
    next_scene = graph.call_async(request_of(*CRADLE))
    end.set()
    wait_until(lambda: scene.done() and next_scene.done())
    found = scene.result().result, next_scene.result().result
    for result, expected in zip(found, (FLAT_BOX, CRADLE), strict=True):
        twists = [(xyz(twist.linear), xyz(twist.angular)) for twist in result.twists]
        assert twists == [tuple(map(tuple, twist)) for twist in resolve_scene(*expected).twists]
    assert [result.sequence for result in found] == [2, 3]


def test_a_node_that_ends_completes_the_scene_that_it_computes(graph, long_scenes):
    begun, end = long_scenes
    node = graph.serve()
    scene = graph.call_async(request_of(*FLAT_BOX))
    assert begun.acquire(timeout=DEADLINE)
    graph.forget(node)
    ending = threading.Thread(target=node.shut_down)
    ending.start()
    end.set()
    ending.join(DEADLINE)
    wait_until(scene.done)
    assert scene.result().success


def test_a_scene_for_which_there_is_no_time_at_the_end_is_refused(graph, long_scenes):
    begun, end = long_scenes
    node = graph.serve(shutdown_timeout=1.0)
    scene = graph.call_async(request_of(*FLAT_BOX))
    assert begun.acquire(timeout=DEADLINE)
    graph.forget(node)
    ending = threading.Thread(target=node.shut_down)
    ending.start()
    wait_until(scene.done)
    end.set()
    ending.join(DEADLINE)
    assert scene.result().result.status.code == StatusCode.SHUTTING_DOWN


def test_bodies_may_be_received(graph):
    graph.serve()
    states = graph.publisher(BodyState, "body_states")
    (first, *others), pairs, contacts = CRADLE
    for stamp, name, body in zip((4, 5), ("middle", "last"), others, strict=True):
        state = state_of(body)
        state.name, state.header.stamp.sec = name, stamp
        states.publish(state)
    request = request_of([first], pairs, contacts, ["first", "middle", "last"])
    request.not_before.sec, request.header.stamp.sec = 4, 6
    result = graph.call(request).result
    assert result.status.code == StatusCode.OK, result.status.message
    assert result.body_names == ["first", "middle", "last"]
    request.names += "\n"  # which a block of YAML has at its end
    assert graph.call(request).result.twists == result.twists
    assert [twist.linear.x for twist in result.twists] == pytest.approx([0, 0, 1], abs=result.error_bound)
    assert list(result.state_ages) == [0.0, 2.0, 1.0]
    assert [stamp.sec for stamp in result.state_stamps] == [0, 4, 5]
    assert [(contact.body_a, contact.body_b) for contact in result.contacts] == [
        ("first", "middle"),
        ("middle", "last"),
    ]


def test_coefficients_are_filled_in_for_each_contact(graph):
    graph.serve(restitution=0.75, friction=0.125)
    states = graph.publisher(BodyState, "body_states")
    for i, (body, friction) in enumerate(zip(FLAT_BOX[0], (0.5, 0.25), strict=True)):
        state = state_of(body)
        state.name, state.friction, state.header.stamp.sec = f"body {i}", friction, 1
        states.publish(state)
    _, pairs, contacts = FLAT_BOX
    given = [contact._replace(restitution=-1.0, friction=-1.0) for contact in contacts]
    given[1] = given[1]._replace(restitution=0.25)
    request = request_of([], pairs, given, ["body 0", "body 1"], law=Law.MOREAU)
    request.not_before.sec = 1
    result = graph.call(request).result
    assert result.status.code == StatusCode.OK, result.status.message
    assert [contact.restitution for contact in result.contacts] == [0.75, 0.25, 0.75, 0.75]
    assert [contact.friction for contact in result.contacts] == [0.375] * 4
    told = result.FROM_PARAMETER, result.FROM_CONTACT, result.FROM_BODIES
    assert list(result.restitution_from) == [told[0], told[1], told[0], told[0]]
    assert list(result.friction_from) == [told[2]] * 4
    assert (result.restitution_rules, result.friction_rules) == ([""] * 4, ["average"] * 4)


MATERIALS = """
pairs:
  - materials: [rubber, steel]
    restitution: 0.5
    friction: 0.25
    tangential_restitution: 0.75
    source: a page
  - {materials: [steel, steel], friction: {static: 0.5, kinetic: 0.25, speed: 1.0}, stiffness_ratio: 0.5}
materials:
  steel: {restitution: 0.75}
"""


def test_coefficients_that_combine_beyond_float64_are_refused_by_name(graph, tmp_path):
    file = tmp_path / "materials.yaml"
    file.write_text("materials: {ice: {friction: 1.0e+200}}")
    graph.serve(materials_file=str(file), combine_friction="multiply")
    states = graph.publisher(BodyState, "body_states")
    for name, body in (("box", CUBE), ("floor", Body.static())):
        state = state_of(body)
        state.name, state.material, state.friction, state.header.stamp.sec = name, "ice", 1e200, 1
        states.publish(state)
    request = request_of([], [(0, 1)], [CONTACTS[0]._replace(friction=-1.0)], ["box", "floor"])
    request.not_before.sec = 1
    status = graph.call(request).result.status
    assert status.code == StatusCode.OUT_OF_RANGE
    rule = "exceeds float64 by the rule multiply"
    assert status.message == f"contacts[0].friction: {rule}: ice has 1e+200, ice has 1e+200"


@pytest.mark.parametrize("wrong", [0, 1])
def test_a_coefficient_of_a_body_is_refused_under_its_name(graph, wrong):
    graph.serve()
    states = graph.publisher(BodyState, "body_states")
    for i, body in enumerate((CUBE, Body.static())):
        state = state_of(body)
        state.name, state.header.stamp.sec, state.restitution = f"body {i}", 1, 2.0 if i == wrong else 0.5
        states.publish(state)
    contact = CONTACTS[0]._replace(restitution=-1.0)
    request = request_of([], [(0, 1)], [contact], ["body 0", "body 1"])
    request.not_before.sec = 1
    status = graph.call(request).result.status
    assert status.code == StatusCode.INVALID_COEFFICIENT
    assert status.message.startswith(f"names[{wrong}].restitution: must be"), status.message


def test_pairs_of_materials_apply_in_scenes(graph, tmp_path):
    """A single contact uses the tangential restitution of its pair; a cluster of two refuses it by name."""
    file = tmp_path / "materials.yaml"
    file.write_text(MATERIALS)
    graph.serve(materials_file=str(file), friction=0.125)
    states = graph.publisher(BodyState, "body_states")
    ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0, 0, 1), velocity=(0.5, 0.0, -1.0))
    for name, body, material in (
        ("ball", ball, "rubber"),
        ("bolt", ball, "steel"),
        ("floor", Body.static(), "steel"),
    ):
        state = state_of(body)
        state.name, state.material, state.header.stamp.sec = name, material, 1
        states.publish(state)
    up = Contact.of((0, 0, 0), (0, 0, 1), -1.0, -1.0)

    def ask(pairs, **model):
        request = request_of([], pairs, [up] * len(pairs), ["ball", "bolt", "floor"], **model)
        request.not_before.sec = 1
        return graph.call(request).result

    both = ask([(0, 2), (1, 2)])
    assert both.status.code == StatusCode.OK, both.status.message
    assert [(c.restitution, c.friction) for c in both.contacts] == [
        (0.5, 0.25),
        (0.75, 0.25 + 0.25 * math.exp(-0.5)),
    ]
    assert list(both.restitution_from) == [both.FROM_PAIR, both.FROM_MATERIALS]
    assert list(both.friction_from) == [both.FROM_PAIR] * 2
    assert both.restitution_rules == ["a page", "average"]
    alone = resolve(
        ball, Body.static(), up._replace(restitution=0.5, friction=0.25, tangential_restitution=0.75)
    )
    assert xyz(both.impulses[0]) == tuple(alone.impulse)
    assert list(both.tangential_restitutions) == [0.75, 0.0]
    with_own = ask([(0, 2)], tangential_restitution=0.125)
    alone = resolve(
        ball, Body.static(), up._replace(restitution=0.5, friction=0.25, tangential_restitution=0.125)
    )
    assert xyz(with_own.impulses[0]) == tuple(alone.impulse)
    assert list(with_own.tangential_restitutions) == [0.125]
    cluster = ask([(0, 2), (0, 1)])
    assert (cluster.status.code, cluster.status.message[:35]) == (
        StatusCode.INVALID_MODEL,
        "contacts[0].tangential_restitution:",
    )
    springs = ask([(1, 2)], law=Law.COMPLIANT, stiffness_ratio=0.0)
    assert springs.status.message.startswith(
        "model.stiffness_ratio: must be given in a scene: the materials of contacts[0] have 0.5"
    )
    assert ask([(0, 2)], law=Law.COMPLIANT, stiffness_ratio=1.0).status.code == StatusCode.OK
    with_own = ask([(1, 2)], law=Law.COMPLIANT, stiffness_ratio=1.0)
    assert with_own.status.message.startswith(
        "contacts[0].friction: COMPLIANT takes no friction that depends"
    )
    by_speed = ask([(0, 2), (1, 2)], law=Law.ROUTH_STRONGE)
    assert by_speed.status.message.startswith(
        "contacts[1].friction: depends on slip speed, which ROUTH_STRONGE"
    )


class Refused(NamedTuple):
    """One change to a good request, and the refusal it must meet."""

    code: StatusCode
    field: str
    at: tuple[int, int] | None
    value: Any
    says: str


REFUSALS = [
    Refused(StatusCode.INVALID_COEFFICIENT, "contacts", (7, 3), -0.5, "contacts[3].friction: must be"),
    Refused(StatusCode.INVALID_NORMAL, "contacts", (5, 2), 0.0, "contacts[2].normal: must not be 0"),
    Refused(StatusCode.NOT_FINITE, "contacts", (0, 1), math.nan, "contacts[1].position: must be finite"),
    Refused(StatusCode.INVALID_MASS, "bodies", (0, 0), 0.0, "bodies[0].inertia.m: must be positive"),
    Refused(StatusCode.NOT_FINITE, "bodies", (0, 0), math.inf, "bodies[0].inertia.m: must be finite"),
    Refused(StatusCode.NOT_FINITE, "bodies", (17, 0), math.nan, "bodies[0].twist.linear: must be finite"),
    Refused(
        StatusCode.INVALID_ORIENTATION, "bodies", (16, 1), 0.0, "bodies[1].pose.orientation: must not be 0"
    ),
    Refused(StatusCode.UNKNOWN_BODY, "pairs", (1, 2), 7, "pairs: must be indices of 2 bodies, from 0; those"),
    Refused(StatusCode.SAME_BODY, "pairs", (1, 2), 0, "contacts[2]: a body cannot strike itself"),
    Refused(StatusCode.UNKNOWN_BODY, "names", None, "a\nb\nghost", "names[2]: is 'ghost', but no state"),
    Refused(StatusCode.SAME_BODY, "names", None, "a\na", "names[1]: is 'a', the same as names[0]"),
    Refused(
        StatusCode.INVALID_TABLE, "names", None, "a", "names: must be empty, or have a line for each of the 2"
    ),
    Refused(StatusCode.INVALID_TABLE, "immovable", None, [0, 2], "immovable: must hold indices below 2"),
    Refused(StatusCode.INVALID_TABLE, "bodies", None, [1.0], "bodies: must hold 23 rows of equal length"),
    Refused(StatusCode.INVALID_TABLE, "contacts", None, [1.0], "contacts: must hold 8 rows of equal length"),
    Refused(StatusCode.INVALID_TABLE, "pairs", None, [1], "pairs: must hold two indices for each of 4"),
    Refused(StatusCode.INVALID_MODEL, "model.law", None, 77, "model.law: must be one of"),
    Refused(StatusCode.INVALID_MODEL, "model.law", None, Law.ROUTH_POISSON, "model.law: "),
]


def change(request, case):
    """Change one entry of a table, or a field."""
    if case.at is None:
        assign(request, case.field, case.value)
    else:
        row, column = case.at
        columns = {"contacts": 4, "pairs": 4}.get(case.field, 2)
        getattr(request, case.field)[row * columns + column] = case.value


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case.code.name}-{case.says[:12]}")
def test_a_refusal_names_the_body_or_the_contact(shared_node, case):
    request = request_of(*FLAT_BOX)
    request.header.frame_id, request.header.stamp.sec = "map", 7
    change(request, case)
    response = shared_node.call(request)
    assert not response.success
    assert response.result.header == request.header
    assert StatusCode(response.result.status.code) is case.code, response.result.status.message
    assert response.result.status.message.startswith(case.says), response.result.status.message
    assert response.result.error_bound == -1.0


def test_contacts_that_contradict_each_other_are_refused(shared_node):
    walls = [Body.kinematic((0, 0, -1), (0, 0, 1)), Body.kinematic((0, 0, 1), (0, 0, -1))]
    scene = (
        [Body.dynamic(1.0), *walls],
        [(0, 1), (0, 2)],
        [Contact.of((0, 0, -1), (0, 0, 1), 0.5), Contact.of((0, 0, 1), (0, 0, -1), 0.5)],
    )
    assert shared_node.call(request_of(*scene)).result.status.code == StatusCode.CONTRADICTORY_CONTACTS


def test_a_scene_of_too_many_contacts_is_refused_by_name(graph):
    graph.serve(budget__scene_contacts=3)
    status = graph.call(request_of(*FLAT_BOX)).result.status
    assert status.code == StatusCode.BUDGET_EXCEEDED
    assert status.message == "contacts: has 4 contacts; budget.scene_contacts is 3"
    assert graph.call(request_of(*CRADLE)).success


def test_a_scene_without_contacts_changes_nothing(shared_node):
    request = request_of([Body.dynamic(2.0, velocity=(3.0, 0.0, 0.0))], [], [])
    result = shared_node.call(request).result
    assert result.status.code == StatusCode.SEPARATING
    assert result.twists[0].linear.x == 3.0


def test_answers_and_refusals_are_published(graph):
    graph.serve()
    good, bad = request_of(*CRADLE), request_of(*CRADLE)
    bad.contacts[2 * 3] = 0.0  # the x of the first normal
    answers = [graph.call(request).result for request in (good, bad)]
    received = graph.listen(SceneResult, "collision_response/scene_result", LATCHED)
    wait_until(lambda: len(received) == 2)
    assert received == answers
    assert [result.sequence for result in received] == [1, 2]


def test_a_scene_is_recorded(graph, tmp_path):
    pytest.importorskip("rerun")
    from recordings import read, verify

    graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
    request = request_of(*FLAT_BOX)
    request.header.stamp.sec = 3
    result = graph.call(request).result
    bad = request_of(*FLAT_BOX)
    bad.contacts[4 * 5] = 0.0  # the z of the first normal
    graph.call(bad)
    graph.close()
    (path,) = tmp_path.glob("*.rrd")
    verify(path)
    ((_, _, points),) = read(path, "/world/contact", "Points3D:positions")
    assert [tuple(point) for point in points] == CORNERS
    ((_, _, normals),) = read(path, "/world/contact", "Arrows3D:vectors")
    assert len({tuple(normal) for normal in normals}) == 1 and len(normals) == 4
    ((_, _, labels),) = read(path, "/world/impulse", "Arrows3D:labels")
    assert labels == [f"{math.hypot(*xyz(impulse)):.3g} N s" for impulse in result.impulses]
    ((_, _, energies),) = read(path, "/impact/kinetic_energy", "Scalars:scalars")
    assert energies == [result.kinetic_energy_before, result.kinetic_energy_after]
    told = [words for _, _, (words,) in read(path, "/log", "TextLog:text")]
    assert told[0].startswith("4 contacts of 2 bodies at once: ")
    assert told[1].startswith("INVALID_NORMAL: contacts[0].normal")


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (
            lambda: pack([CUBE, Body.static()], [("cube", "floor")], [CONTACTS[0]]),
            ValueError,
            r"^pairs\[0\]: must be two indices",
        ),
        (
            lambda: pack([CUBE, Body.static()], [(0, 1)], [CONTACTS[0]._replace(friction="a")]),
            TypeError,
            r"^contacts\[0\]\.friction:",
        ),
        (
            lambda: pack([CUBE, Body.static()], [(0, 1)], [CONTACTS[0]._replace(friction=None)]),
            TypeError,
            r"^contacts\[0\]\.friction:",
        ),
        (
            lambda: pack([Body.dynamic(None), Body.static()], [(0, 1)], [CONTACTS[0]]),
            TypeError,
            r"^bodies\[0\]\.mass:",
        ),
        (
            lambda: pack([CUBE, Body.static()], [(0, 1)], [CONTACTS[0]._replace(normal=1)]),
            TypeError,
            r"^contacts\[0\]\.normal:",
        ),
        (lambda: pack_named([("a", "b", (0, 0, 0))]), TypeError, r"^touches\[0\]: must be a Touch"),
        (lambda: pack_named([], [CUBE]), TypeError, r"^bodies: must be a mapping"),
    ],
)
def test_packing_names_what_has_the_wrong_type(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_the_time_budget_does_not_stop_a_scene(graph):
    """The node reads a large one in several steps, between which it would stop other requests."""
    graph.serve(budget__time=1e-9)
    bodies = [CUBE._replace(position=(2.0 * i, 0.0, 0.5)) for i in range(200)]
    contact = CONTACTS[0]
    assert graph.call(request_of([*bodies, Body.static()], [(0, 200)], [contact])).success
