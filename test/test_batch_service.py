"""The batch service over DDS: the answers of ``resolve_batch``, and what the service adds to them."""

from __future__ import annotations

import doctest
import math
from itertools import product
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip("rclpy")

from batch_cases import FIRST_FAULTY, N, assert_same, collision_at, columns, shared_batch
from ros_graph import LATCHED, assign, ball, balls_meet, publish_until_received, request_of, wait_until

from collision_response import Geometry, ImpactError, ImpactModel, Law, Precision, StatusCode
from collision_response.batch import resolve_batch
from collision_response.batch.plan import BatchRequest
from collision_response.batch.result import REPORTED_ADJUSTMENTS
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.msg import BodyState, CollisionResult
from collision_response.physics.centre_of_mass import moment_about_z, planar_spin, with_com_as_reference
from collision_response.ros import batch_client, batches
from collision_response.ros.batch_client import pack, unpack
from collision_response.ros.batches import write_codes
from collision_response.ros.convert import body_of, write_model
from collision_response.ros.tables import LAYOUTS, Request, Response
from collision_response.srv import ResolveCollision, ResolveScene

nan, inf = math.nan, math.inf
LAWS = [law for law in Law if law]
PAIRS = np.arange(2 * N).reshape(2, N)
"""The pairs of the shared batch: body_a of each contact, then body_b."""

xyz = attrgetter("x", "y", "z")


def packed(layout: int, model: ImpactModel, **options: Any) -> Request:
    """Request the shared batch in this layout."""
    bodies, contacts = shared_batch(LAYOUTS[layout].geometry, oriented=LAYOUTS[layout].oriented)
    return pack(bodies.reshape(len(bodies), 2 * N), PAIRS, contacts, model, **options)


def balls_in_a_row() -> Request:
    """Three point masses of 1, 2 and 3 kg on the x axis: the first runs into the second, the third is at
    rest.
    """
    body_row, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((body_row.height, 3)), np.zeros((contact_row.height, 2))
    bodies[body_row.mass] = [[1.0, 2.0, 3.0]]
    bodies[body_row.velocity][0] = [4.0, 1.0, 0.0]
    contacts[contact_row.normal][0], contacts[contact_row.restitution] = 1.0, 0.5
    return pack(bodies, [[1, 2], [0, 1]], contacts, frame_id="world")


# the answers


@pytest.mark.parametrize(("layout", "law"), list(product(LAYOUTS, LAWS)))
def test_answers_equal_resolve_batch(shared_node, layout, law):
    geometry, model = LAYOUTS[layout].geometry, ImpactModel(law)
    bodies, contacts = shared_batch(geometry, oriented=LAYOUTS[layout].oriented)
    response = shared_node.call(packed(layout, model))
    assert (response.success, response.code, response.message) == (True, StatusCode.OK, "")
    assert (response.model.law, response.model.geometry, response.model.precision) == (
        law,
        geometry,
        Precision.AUTO,
    )
    assert_same(unpack(response), resolve_batch(bodies, contacts, model))


@pytest.mark.parametrize("model", [ImpactModel(tolerance=1e-14), ImpactModel(precision=Precision.EXTENDED)])
def test_bounds_and_precisions_come_with_a_tolerance_or_extended(shared_node, model):
    response = shared_node.call(packed(Request.SPATIAL, model))
    assert (response.model.precision, response.model.tolerance) == (model.precision, model.tolerance)
    result = unpack(response)
    assert {Precision.EXTENDED} <= set(result.precision.tolist()) <= {Precision.DOUBLE, Precision.EXTENDED}
    assert_same(result, resolve_batch(*shared_batch(Geometry.SPATIAL), model))


@pytest.mark.parametrize("law", LAWS)
def test_regimes_and_energies_come_on_request(shared_node, law):
    response = shared_node.call(packed(Request.SPATIAL, ImpactModel(law), report=True))
    assert_same(
        unpack(response), resolve_batch(*shared_batch(Geometry.SPATIAL), ImpactModel(law), report=True)
    )
    one = shared_node.call(
        request_of(*collision_at(Geometry.SPATIAL, *shared_batch(Geometry.SPATIAL), 7), law=law)
    ).result
    assert response.regimes[7] == one.regime
    assert response.kinetic_energy_after[7] == one.kinetic_energy_after
    assert response.energy_lost_friction[7] == one.energy_lost_friction
    assert response.adjustments[7] == one.adjustments & REPORTED_ADJUSTMENTS
    without = shared_node.call(packed(Request.SPATIAL, ImpactModel(law)))
    assert not (without.regimes or without.kinetic_energy_before or without.energy_lost_restitution)
    assert not without.adjustments


@pytest.mark.parametrize("law", LAWS)
def test_answers_equal_those_of_the_service_for_single_impacts(shared_node, law):
    result = unpack(shared_node.call(packed(Request.SPATIAL_ORIENTED, ImpactModel(law))))
    bodies, contacts = shared_batch(Geometry.SPATIAL, oriented=True)
    for i in range(20):
        request = request_of(*collision_at(Geometry.SPATIAL, bodies, contacts, i), law=law)
        one = shared_node.call(request).result
        assert result.status[i] == one.status.code
        assert tuple(result.impulse[:, i]) == xyz(one.impulse)
        for lane, twist in enumerate((one.twist_a, one.twist_b)):
            assert tuple(result.velocity[:, lane, i]) == xyz(twist.linear)
            assert tuple(result.angular_velocity[:, lane, i]) == xyz(twist.angular)


def test_contacts_of_one_body_are_answered_independently(shared_node):
    request = balls_in_a_row()
    request.header.stamp.sec = 12
    response = shared_node.call(request)
    assert response.header == request.header
    result = unpack(response)
    # Reduced masses 2/3 and 6/5 kg, approach at 3 and 1 m/s, e = 0.5.
    np.testing.assert_allclose(result.impulse[0], [3.0, 1.8], rtol=1e-14)
    np.testing.assert_allclose(result.velocity[0], [[2.5, 0.6], [1.0, 0.1]], rtol=1e-14)


def test_ten_thousand_contacts(shared_node):
    some_bodies, some_contacts = (a[..., :FIRST_FAULTY] for a in shared_batch(Geometry.SPATIAL))
    bodies, contacts = some_bodies.reshape(16, -1), np.tile(some_contacts, 100)
    pairs = np.random.default_rng(0).integers(bodies.shape[1], size=(2, 10_000))
    result = unpack(shared_node.call(pack(bodies, pairs, contacts)))
    same = pairs[0] == pairs[1]
    assert (result.status[same] == StatusCode.SAME_BODY).all()
    assert_same(columns(result, ~same), columns(resolve_batch(bodies[:, pairs], contacts), ~same))


@pytest.mark.parametrize(
    "model", [ImpactModel(), ImpactModel(tolerance=1e-6), ImpactModel(precision=Precision.EXTENDED)], ids=repr
)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_no_contacts(shared_node, layout, model):
    request = Request(layout=layout)
    write_model(request.model, model)
    response = shared_node.call(request)
    assert response.success
    none = (a[..., :0] for a in shared_batch(LAYOUTS[layout].geometry))
    assert_same(unpack(response), resolve_batch(*none, model))


def test_without_contacts_a_report_is_empty_and_the_model_is_checked(shared_node):
    request = Request(layout=Request.POINT, report=True)
    assert unpack(shared_node.call(request)).regime is None
    request.model.geometry = int(Geometry.SPATIAL)
    assert shared_node.call(request).message.startswith("model.geometry: must be AUTO, POINT for a batch of ")


@pytest.mark.parametrize("row", (False, True), ids=["of the model", "of each contact"])
def test_tangential_restitution(shared_node, row):
    bodies, contacts = shared_batch(Geometry.SPATIAL)
    model = ImpactModel(Law.COULOMB, tangential_restitution=0.0 if row else 0.5)
    if row:
        contacts = np.concatenate([contacts, np.linspace(0, 1, N)[np.newaxis]])
    result = unpack(shared_node.call(pack(bodies.reshape(16, -1), PAIRS, contacts, model)))
    assert_same(result, resolve_batch(bodies, contacts, model))


def test_friction_decides_the_law(shared_node):
    request = balls_in_a_row()
    assert shared_node.call(request).model.law == Law.COULOMB
    del request.contacts[-2:]
    assert shared_node.call(request).model.law == Law.FRICTIONLESS


def test_the_node_parameters_apply_except_geometry(graph):
    graph.serve(law="frictionless", geometry="spatial", restitution_threshold=2.0)
    response = graph.call(balls_in_a_row())
    assert (response.model.law, response.model.geometry) == (Law.FRICTIONLESS, Geometry.POINT)
    assert response.model.restitution_threshold == 2.0
    np.testing.assert_allclose(unpack(response).impulse[0], [3.0, 1.2], rtol=1e-15)


def test_a_batch_is_not_published(graph):
    graph.serve()
    received = graph.listen(CollisionResult, "collision_response/result", LATCHED)
    assert graph.call(balls_in_a_row()).success
    one = graph.call(balls_meet()).result
    wait_until(lambda: received)
    assert received == [one]
    assert one.sequence == 1


# contacts that cannot be answered


def test_an_invalid_pair_affects_no_other_contact(shared_node):
    good = unpack(shared_node.call(packed(Request.SPATIAL, ImpactModel())))
    request = packed(Request.SPATIAL, ImpactModel())
    bad = {0: (5, 5, "SAME_BODY"), 7: (2 * N, 1, "UNKNOWN_BODY"), 20: (1, 2**32 - 1, "UNKNOWN_BODY")}
    for i, (a, b, _) in bad.items():
        request.pairs[i], request.pairs[N + i] = a, b
    response = shared_node.call(request)
    assert (response.success, response.code, response.message) == (True, StatusCode.OK, "")
    result = unpack(response)
    at = list(bad)
    assert [StatusCode(code).name for code in result.status[at]] == [name for _, _, name in bad.values()]
    for array in columns(result, at)[:3]:
        assert np.isnan(array).all()
    others = np.delete(np.arange(N), at)
    assert_same(columns(result, others), columns(good, others))


def test_the_code_of_body_a_comes_first_and_same_body_stays():
    mass, inertia, same = StatusCode.INVALID_MASS, StatusCode.INVALID_INERTIA, StatusCode.SAME_BODY
    status = np.array([0, 0, 0, same], np.uint8)
    write_codes(np.array([[0, 1, 2, 0], [1, 0, 1, 0]]), np.array([mass, inertia, 0], np.uint8), status)
    assert status.tolist() == [mass, inertia, inertia, same]


def test_a_table_without_bodies(shared_node):
    request = balls_in_a_row()
    del request.bodies[:]
    result = unpack(shared_node.call(request))
    assert (result.status == StatusCode.UNKNOWN_BODY).all()
    assert np.isnan(result.velocity).all()


# refusals


class Refused(NamedTuple):
    """One change to a good request, and the refusal it must meet."""

    code: StatusCode
    field: str
    value: Any
    says: str
    shown: str


def refused(code: StatusCode, field: str, value: Any, shown: str, says: str | None = None) -> Refused:
    return Refused(code, field, value, says or field, shown)


REFUSALS = [
    refused(StatusCode.INVALID_TABLE, "layout", 0, "is 0"),
    refused(StatusCode.INVALID_TABLE, "layout", 6, "is 6"),
    refused(StatusCode.INVALID_TABLE, "bodies", [1.0] * 13, "4 rows of equal length for POINT"),
    refused(StatusCode.INVALID_TABLE, "pairs", [0, 1, 2], "3"),
    refused(StatusCode.INVALID_TABLE, "contacts", [1.0] * 7, "4 to 6 rows of 2 for POINT"),
    refused(StatusCode.INVALID_TABLE, "contacts", [1.0] * 6, "holds 6"),
    refused(StatusCode.INVALID_TABLE, "contacts", [1.0] * 14, "holds 14"),
    refused(StatusCode.INVALID_TABLE, "contacts", [], "holds 0"),
    refused(StatusCode.INVALID_TABLE, "pairs", [], "0 for POINT", says="contacts"),
    refused(StatusCode.SAME_BODY, "names", "cup\ndish\ncup", "'cup', the same as names[0]", says="names[2]"),
    refused(StatusCode.INVALID_MODEL, "model.law", 77, "77"),
    refused(StatusCode.INVALID_MODEL, "model.geometry", Geometry.SPATIAL, "SPATIAL"),
    refused(StatusCode.INVALID_MODEL, "model.precision", Precision.SINGLE, "SINGLE"),
    refused(StatusCode.INVALID_MODEL, "model.tolerance", -0.125, "-0.125"),
    refused(StatusCode.NOT_FINITE, "model.restitution_threshold", nan, "nan"),
    refused(StatusCode.INVALID_COEFFICIENT, "model.tangential_restitution", -1.25, "-1.25"),
]


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case.code.name}-{case.field}-{case.shown}")
def test_a_refusal_names_the_field_and_its_value(shared_node, case):
    request = balls_in_a_row()
    assign(request, case.field, case.value)
    response = shared_node.call(request)
    assert StatusCode(response.code) is case.code, response.message
    assert response.message.startswith(f"{case.says}: ")
    assert case.shown in response.message
    assert not response.success
    assert response.header == request.header
    assert not response.status and not response.velocity
    with pytest.raises(ImpactError) as raised:
        unpack(response)
    assert (raised.value.code, str(raised.value)) == (case.code, response.message)


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: law.name)
def test_a_law_with_friction_needs_friction(shared_node, law):
    request = balls_in_a_row()
    request.model.law = int(law)
    del request.contacts[-2:]
    response = shared_node.call(request)
    assert response.code == StatusCode.INVALID_MODEL
    assert response.message == f"model.law: is {law.name}, but contacts has no row of friction"


def test_a_default_constructed_request_is_refused(shared_node):
    assert shared_node.call(Request()).code == StatusCode.INVALID_TABLE
    assert not Response().success and Response().code == StatusCode.UNSET


def test_a_frame_other_than_world_frame_is_refused(graph):
    graph.serve(world_frame="map")
    response = graph.call(balls_in_a_row())
    assert response.code == StatusCode.FRAME_MISMATCH
    assert response.message == "header.frame_id: is 'world', but the parameter world_frame is 'map'"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_immovable_bodies_can_be_listed_instead_of_having_infinite_mass(shared_node, layout):
    """JSON has no infinity."""
    infinite = packed(layout, ImpactModel())
    rows, of = len(infinite.bodies) // (2 * N), LAYOUTS[layout].bodies
    walls = list(range(N, 2 * N))  # every body_b
    table = np.asarray(infinite.bodies).reshape(rows, 2 * N)
    finite = packed(layout, ImpactModel())
    table[of.mass, N:], table[of.inertia, N:] = inf, 0.0
    finite.immovable = walls
    assert_same(unpack(shared_node.call(finite)), unpack(shared_node.call(infinite)))


def test_immovable_bodies_must_be_in_the_table(shared_node):
    request = balls_in_a_row()
    request.immovable = [0, 3]
    response = shared_node.call(request)
    assert response.code == StatusCode.INVALID_TABLE
    assert response.message == "immovable: must hold indices below 3, holds 3"


def test_an_internal_error_is_answered(shared_node, monkeypatch):
    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("a bolt is loose")

    with monkeypatch.context() as patch:
        patch.setattr(batches, "resolve_with_pauses", fail)
        response = shared_node.call(balls_in_a_row())
    assert (response.success, response.code) == (False, StatusCode.INTERNAL_ERROR)
    assert response.message == "RuntimeError: a bolt is loose"
    assert not response.status
    assert shared_node.call(balls_in_a_row()).success


# bodies that the node has received


def top() -> BodyState:
    """A rotated, spinning body whose centre of mass is offset from the origin of its frame."""
    state = ball(0.5, -1.0, name="top")
    state.inertia.ixx, state.inertia.iyy, state.inertia.izz = 0.2, 0.3, 0.4
    state.inertia.com.x, state.inertia.com.y = 0.1, -0.2
    q = state.pose.orientation
    q.x, q.y, q.z, q.w = 0.1, 0.7, -0.1, 0.5
    state.twist.linear.y = 0.5
    state.twist.angular.x, state.twist.angular.y, state.twist.angular.z = 1.0, -1.5, 2.0
    return state


def floor() -> BodyState:
    state = BodyState(name="floor", motion_type=BodyState.KINEMATIC)
    state.header.frame_id = "world"
    state.twist.linear.x, state.twist.angular.z = 3.0, 0.5
    return state


def ramp() -> BodyState:
    """A belt that moves up, about the same axis as it is turned."""
    state = floor()
    state.name, state.twist.linear.z = "ramp", 1.0
    state.pose.orientation.y = 0.5
    return state


def column(layout: int, state: BodyState) -> np.ndarray:
    """The column of a table that a client would write for a body in this state."""
    of, body = LAYOUTS[layout].bodies, with_com_as_reference(body_of("body", state))
    numbers = np.zeros(of.height)
    numbers[of.mass] = body.mass
    inertia, spin = body.inertia, body.angular_velocity
    if LAYOUTS[layout].geometry is Geometry.PLANAR:
        inertia, spin = [moment_about_z(body)], [planar_spin(body)]
    for rows, quantity in (
        (of.inertia, inertia),
        (of.position, body.position),
        (of.velocity, body.velocity),
        (of.angular_velocity, spin),
        (of.orientation, body.orientation or (0, 0, 0, 1)),
    ):
        width = rows.stop - rows.start
        numbers[rows] = quantity[len(quantity) - width :] if rows == of.angular_velocity else quantity[:width]
    return numbers


@pytest.fixture(scope="module")
def node_with_states(shared_node):
    other = ball(name="other", frame="map")
    broken = ball(name="broken")
    broken.inertia.m = -1.5
    odd, far, link, locked = ball(name="odd"), ball(1e308, name="far"), ball(name="link"), ball(name="locked")
    odd.inertia.izz = 7.0
    far.inertia.com.x = 1e308
    link.inverse_inertia, locked.inverse_inertia = [1.0, *[0.0] * 35], [0.0] * 36
    lying, still = ball(0.5, -1.0, name="lying"), BodyState(name="still", motion_type=BodyState.STATIC)
    lying.inertia.iyy, lying.pose.orientation.x = 0.3, 1.0
    still.header.frame_id = "world"
    usable = top(), floor(), ramp(), ball(0.5, -1.0, name="ball"), lying, still
    publish_until_received(shared_node, *usable, other, broken, odd, far, link, locked)
    return shared_node


def contacts_of(layout: int, n: int) -> np.ndarray:
    contact_row = LAYOUTS[layout].contacts
    contacts = np.full((contact_row.height, n), 0.25)
    contacts[contact_row.normal][0] = 1.0
    return contacts


@pytest.mark.parametrize("layout", LAYOUTS)
def test_bodies_by_name_follow_those_of_the_table(node_with_states, layout):
    turning = ball(0.5, -1.0, name="ball") if layout == Request.SPATIAL else top()
    table = np.array([column(layout, ball(-0.5, 3.0)), column(layout, ball(-0.4, 2.0))]).T
    contacts, pairs = contacts_of(layout, 3), np.array([[2, 2, 3], [0, 3, 1]])

    names = [turning.name, "floor"]
    response = node_with_states.call(pack(table, pairs, contacts, names=names, frame_id="world"))

    assert (response.success, response.message) == (True, "")
    in_full = np.column_stack([table, column(layout, turning), column(layout, floor())])
    result = unpack(response)
    assert (result.status[:2] == StatusCode.OK).all()
    assert_same(result, resolve_batch(in_full[:, pairs], contacts))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_an_immovable_body_by_name_may_be_rotated_in_every_layout(node_with_states, layout):
    """Its inertia is infinite about every axis."""
    contacts, none = contacts_of(layout, 1), np.empty((LAYOUTS[layout].bodies.height, 0))
    request = pack(none, [[0], [1]], contacts, names=["ball", "ramp"], frame_id="world")
    response = node_with_states.call(request)
    assert response.message == ""
    columns = np.column_stack([column(layout, ball(0.5, -1.0)), column(layout, ramp())])
    assert_same(unpack(response), resolve_batch(columns[:, [[0], [1]]], contacts))


def test_a_body_by_name_turns_in_the_plane_about_any_of_its_axes(node_with_states):
    """The y axis of the body is along z. Nothing leaves the plane, so PLANAR is the motion in space."""
    contacts = np.array([[0.25, 0.25, 0.0, 1.0, 0.25, 0.0, 0.5, 0.3]]).T
    in_space, in_plane = (
        unpack(
            node_with_states.call(
                pack(np.empty((height, 0)), [[0], [1]], rows, names=["lying", "still"], frame_id="world")
            )
        )
        for height, rows in ((20, contacts), (7, contacts[[0, 1, 3, 4, 6, 7]]))
    )
    np.testing.assert_allclose(in_plane.velocity, in_space.velocity[:2], rtol=1e-14)
    np.testing.assert_allclose(in_plane.angular_velocity, in_space.angular_velocity[2:], rtol=1e-14)


@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.PLANAR])
def test_bodies_by_name_are_reduced_to_the_layout_as_for_single_impacts(node_with_states, geometry):
    layout = getattr(Request, geometry.name)
    contacts = contacts_of(layout, 1)
    request = pack(
        np.empty((LAYOUTS[layout].bodies.height, 0)), [[0], [1]], contacts, names=["top", "floor"],
        frame_id="world",
    )  # fmt: skip
    result = unpack(node_with_states.call(request))
    one = ResolveCollision.Request(body_a=top(), body_b=floor())
    one.contact.header.frame_id, one.model.geometry = "world", geometry
    at, normal = one.contact.position, one.contact.normal
    at.x = at.y = normal.y = 0.25
    normal.x, normal.z = 1.0, 0.25 if geometry is Geometry.POINT else 0.0
    one.contact.restitution = one.contact.friction = 0.25
    expected = xyz(node_with_states.call(one).result.impulse)
    # The velocity of the centre of mass is rounded, and the error bound includes that.
    np.testing.assert_allclose(result.impulse[:, 0], expected[: len(result.impulse)], rtol=1e-13)


def test_only_bodies_by_name(node_with_states):
    table, contacts = np.empty((20, 0)), contacts_of(Request.SPATIAL_ORIENTED, 1)
    request = pack(table, [[0], [1]], contacts, names=["top", "floor"], frame_id="world")
    result = unpack(node_with_states.call(request))
    one = ResolveCollision.Request(body_a=top(), body_b=floor())
    one.contact.header.frame_id = "world"
    one.contact.position.x = one.contact.position.y = one.contact.position.z = 0.25
    one.contact.normal.x, one.contact.normal.y, one.contact.normal.z = 1.0, 0.25, 0.25
    one.contact.restitution = one.contact.friction = 0.25
    expected = node_with_states.call(one).result
    np.testing.assert_allclose(result.impulse[:, 0], xyz(expected.impulse), rtol=1e-13)
    np.testing.assert_allclose(result.angular_velocity[:, 0, 0], xyz(expected.twist_a.angular), rtol=1e-13)


@pytest.mark.parametrize(
    ("name", "layout", "code", "message"),
    [
        ("ghost", Request.POINT, StatusCode.UNKNOWN_BODY, "names[1]: is 'ghost', but no state"),
        ("", Request.POINT, StatusCode.UNKNOWN_BODY, "names[1]: is '', but no state"),
        ("other", Request.PLANAR, StatusCode.FRAME_MISMATCH, "names[1].header.frame_id: is 'map', but"),
        ("broken", Request.PLANAR, StatusCode.INVALID_MASS, "names[1].inertia.m: must be positive"),
        ("odd", Request.SPATIAL, StatusCode.INVALID_INERTIA, "names[1].inertia: must be positive semi"),
        ("far", Request.SPATIAL, StatusCode.OUT_OF_RANGE, "names[1].inertia.com: position or velocity of"),
        ("top", Request.SPATIAL, StatusCode.INVALID_ORIENTATION, "names[1].pose.orientation: is (0.1,"),
        ("link", Request.SPATIAL, StatusCode.INVALID_INERTIA, "names[1].inverse_inertia: is for ~/resolve_"),
        (
            "locked",
            Request.SPATIAL,
            StatusCode.INVALID_INERTIA,
            "names[1].inverse_inertia: is for ~/resolve_",
        ),
    ],
)
def test_an_unusable_received_body_affects_its_contacts_only(node_with_states, name, layout, code, message):
    contacts, table = contacts_of(layout, 3), column(layout, ball(-0.5, 3.0))[:, np.newaxis]
    request = pack(table, [[1, 2, 0], [0, 0, 2]], contacts, names=["ball", name], frame_id="world")
    response = node_with_states.call(request)
    assert (response.success, response.code) == (True, StatusCode.OK)
    assert response.message.startswith(message)
    result = unpack(response)
    assert result.status.tolist() == [StatusCode.OK, code, code]
    assert np.isnan(result.velocity[..., 1:]).all() and np.isfinite(result.velocity[..., 0]).all()


@pytest.mark.parametrize("w", [-1.0, 2.0])
def test_a_body_that_is_not_rotated_needs_no_layout_with_orientations(graph, w):
    graph.serve()
    state = ball(name="ball")
    state.pose.orientation.w = w
    publish_until_received(graph, state)
    contacts, table = contacts_of(Request.SPATIAL, 1), column(Request.SPATIAL, ball(-0.5, 3.0))[:, np.newaxis]
    response = graph.call(pack(table, [[1], [0]], contacts, names=["ball"], frame_id="world"))
    assert unpack(response).status.tolist() == [StatusCode.OK], response.message


def test_the_last_of_the_names_may_end_with_a_newline(node_with_states):
    contacts, table = contacts_of(Request.POINT, 1), column(Request.POINT, ball(-0.5, 3.0))[:, np.newaxis]
    request = pack(table, [[1], [0]], contacts, names=["ball"], frame_id="world")
    expected = node_with_states.call(request)
    request.names += "\n"
    assert request.names == "ball\n"
    assert node_with_states.call(request).velocity == expected.velocity
    request.names += "\n"
    assert node_with_states.call(request).message.startswith("names[1]: is ''")


def test_unusable_received_bodies_are_counted(node_with_states):
    request = Request(layout=Request.POINT, names="ghost\nball\nother")
    request.header.frame_id = "world"
    message = node_with_states.call(request).message
    assert message.startswith("names[0]: is 'ghost'")
    assert message.endswith("; 2 bodies in all cannot be used")


def test_a_stale_state_is_not_used(graph):
    graph.serve(max_state_age=1.0)
    state = ball(name="ball")
    state.header.stamp.sec = 1  # of 1970
    publish_until_received(graph, state)
    request = pack(
        column(Request.POINT, ball())[:, np.newaxis],
        [[0], [1]],
        np.ones((5, 1)),
        names=["ball"],
        frame_id="world",
    )
    response = graph.call(request)
    assert unpack(response).status.tolist() == [StatusCode.STALE_STATE]
    assert response.message.startswith("names[0].header.stamp: the last state of 'ball' is ")
    assert response.state_stamps[0].sec == 1 and response.state_ages[0] > 1e9


@pytest.mark.parametrize("law", [Law.ROUTH_STRONGE, Law.COMPLIANT])
def test_contacts_of_path_laws_are_computed_a_few_at_a_time(law):
    """One that has too many steps takes 20 ms, and others may come first that take 20 us."""
    rows, columns = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((rows.height, 2, 500)), np.zeros((columns.height, 500))
    bodies[rows.mass], bodies[rows.velocity, 0], contacts[columns.normal] = 1.0, 1.0, 1.0  # they separate
    request = BatchRequest.of(bodies, contacts, ImpactModel(law), None)
    out = request.plan.result_fields(500, False).mapped(lambda field: np.empty(*field))
    pauses = sum(1 for _ in batches.compute(request, out))
    assert pauses >= 500 // batches.MOST_OF_PATHS
    assert (out.status == StatusCode.SEPARATING).all()


# the client's side


@pytest.mark.filterwarnings("error::RuntimeWarning")  # NumPy must not warn
@pytest.mark.parametrize(
    ("message", "changes"),
    [
        ("bodies: must be of shape (4 or 7 or 16 or 20, B), is (5, 3)", {"bodies": np.zeros((5, 3))}),
        ("bodies: must be of shape (4 or 7 or 16 or 20, B), is (4,)", {"bodies": np.zeros(4)}),
        ("pairs: must be of shape (2, N), is (3, 2)", {"pairs": np.zeros((3, 2), int)}),
        ("contacts: must be of shape (4 to 6, 2), is (5, 3)", {"contacts": np.zeros((5, 3))}),
        ("contacts: must be of shape (4 to 6, 2), is (1, 2)", {"contacts": np.zeros((1, 2))}),
        ("contacts: must be of shape (4 to 6, 2), is (7, 2)", {"contacts": np.zeros((7, 2))}),
        ("bodies: must be numbers, some are masked", {"bodies": np.ma.masked_array(np.zeros((4, 3)), True)}),
        ("pairs: must be numbers, some are masked", {"pairs": np.ma.masked_array([[0, 1], [1, 2]], True)}),
        ("bodies: must be real numbers, is complex128", {"bodies": np.zeros((4, 3), complex)}),
        ("contacts: must be real numbers, is <U1", {"contacts": np.full((5, 2), "1")}),
        ("pairs: must be indices of bodies, counted from 0; one is -1", {"pairs": [[0, -1], [1, 2]]}),
        (
            "pairs: must be indices of bodies, counted from 0; one is 4294967296",
            {"pairs": [[2**32, 1], [1, 2]]},
        ),
        *(
            (f"pairs: must be indices of bodies, counted from 0; one is {x}", {"pairs": [[x, 1], [1, 2]]})
            for x in (0.5, np.nan, np.inf, 1e300)
        ),
        *(
            (f"names[1]: must be one line without a NUL character, is {odd!r}", {"names": ["a", odd, "b"]})
            for odd in ("b\n", "\0", "b\0c")
        ),
    ],
)
def test_pack_refuses_invalid_arrays_and_names(message, changes):
    with pytest.raises(ValueError) as raised:
        pack(
            **{"bodies": np.zeros((4, 3)), "pairs": [[0, 1], [1, 2]], "contacts": np.zeros((5, 2)), **changes}
        )
    assert str(raised.value) == message


@pytest.mark.parametrize("changes", [{"names": [1]}, {"frame_id": None}, {"frame_id": 1}])
def test_pack_refuses_what_is_no_text_by_name(changes):
    (field,) = changes
    with pytest.raises(TypeError, match=rf"^{field}(\[0\])?: must be text, is "):
        pack(np.zeros((4, 3)), [[0, 1], [1, 2]], np.zeros((5, 2)), **changes)


def test_pack_accepts_any_memory_layout_and_type():
    bodies = np.arange(12.0).reshape(3, 4).T
    request = pack(bodies.astype(np.float32), np.array([[0, 1], [1, 2]]).T.tolist(), np.ones((5, 2), int))
    assert request.bodies.tolist() == bodies.ravel().tolist()
    assert request.pairs.tolist() == [0, 1, 1, 2]
    assert request.contacts.tolist() == [1.0] * 10


def test_the_docstring_examples_run():
    assert doctest.testmod(batch_client) == (0, 8)


def test_the_response_of_another_service_is_not_unpacked():
    with pytest.raises(
        TypeError, match=r"^response: must be of ResolveCollisionBatch, is ResolveScene_Response"
    ):
        unpack(ResolveScene.Response())
