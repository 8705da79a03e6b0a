"""Answers as markers and wrenches."""

from __future__ import annotations

import math
import warnings
from itertools import count
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("visualization_msgs")

from geometry_msgs.msg import WrenchStamped
from rclpy.parameter import Parameter
from ros_graph import balls_meet, wait_until
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from collision_response import Body, Contact, StatusCode
from collision_response.msg import CollisionResult, SceneResult
from collision_response.physics.vector import ZERO, Vec3
from collision_response.ros.markers import (
    ContactMarkers,
    Drawing,
    DrawnContact,
    contacts_of,
    markers_of,
    wrench_of,
)
from collision_response.ros.scene_client import pack

DRAWING = Drawing(metres_per_newton_second=0.5, size=0.25, lifetime=1.5)
SLIDES = DrawnContact(Vec3(1.0, 2.0, 3.0), Vec3(0.0, 0.6, 0.8), 0.75, Vec3(-3.0, 2.4, 3.2))
"""4 N s along the normal and 3 N s across: on the edge of the cone for a friction of 3/4."""


def drawn(*touches: DrawnContact) -> dict[str, Marker]:
    markers = markers_of(Header(frame_id="world"), touches, DRAWING, count()).markers
    return {marker.ns: marker for marker in markers}


def points(marker: Marker) -> np.ndarray:
    return np.array([(p.x, p.y, p.z) for p in marker.points])


def test_arrows_show_normal_and_impulse():
    markers = drawn(SLIDES)
    np.testing.assert_allclose(points(markers["point"]), [(1, 2, 3)])
    np.testing.assert_allclose(points(markers["normal"]), [(1, 2, 3), (1, 2.15, 3.2)])
    np.testing.assert_allclose(points(markers["impulse"]), [(1, 2, 3), (-0.5, 3.2, 4.6)])
    assert {marker.header.frame_id for marker in markers.values()} == {"world"}
    assert {(marker.lifetime.sec, marker.lifetime.nanosec) for marker in markers.values()} == {
        (1, 500_000_000)
    }
    assert all(
        marker.color.a > 0 and marker.scale.x > 0 for marker in markers.values()
    )  # otherwise invisible
    assert all(marker.pose.orientation.w == 1.0 for marker in markers.values())


@pytest.mark.parametrize("normal", [(0.0, 0.6, 0.8), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
@pytest.mark.parametrize("friction", [1e-3, 0.75, 1000.0])
def test_the_rim_of_the_cone_is_where_an_impulse_that_slides_ends(normal, friction):
    touch = SLIDES._replace(normal=Vec3(*normal), friction=friction)
    triangles = points(drawn(touch)["friction cone"]).reshape(-1, 3, 3) - np.array(touch.position)
    apex, rim = triangles[:, 0], triangles[:, 1]
    np.testing.assert_array_equal(apex, 0.0)
    along = rim @ np.array(normal)
    across = np.linalg.norm(rim - np.outer(along, normal), axis=1)
    np.testing.assert_allclose(across / along, friction, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), 2.5)
    np.testing.assert_allclose(triangles[:, 2], np.roll(rim, -1, axis=0), atol=1e-12)  # it is closed
    np.testing.assert_allclose(rim.mean(axis=0), along.mean() * np.array(normal), atol=1e-12)


def test_without_impulse_or_friction_there_is_no_cone():
    assert drawn(SLIDES._replace(friction=0.0)).keys() == {"point", "normal", "impulse"}
    assert drawn(SLIDES._replace(impulse=Vec3(0.0, 0.0, 0.0))).keys() == {"point", "normal"}


def test_each_contact_has_its_own_marker_id():
    numbers = count(2**31 - 1)
    markers = markers_of(Header(), [SLIDES, SLIDES], DRAWING, numbers).markers
    assert [marker.id for marker in markers] == [2**31 - 1] * 4 + [0] * 4


def test_a_refusal_has_no_markers_and_a_normal_may_have_any_length():
    result = CollisionResult()
    assert contacts_of(result) == []
    result.status.code = int(StatusCode.SEPARATING)
    result.contact.normal.y = -1e-200
    assert contacts_of(result)[0].normal == (0, -1, 0)


def answered(**fields) -> CollisionResult:
    result = CollisionResult(**fields)
    result.status.code = int(StatusCode.OK)
    result.contact.normal.z = result.impulse.z = 1.0
    return result


def test_invalid_results_have_no_markers():
    """Any node may publish results."""
    result = answered()
    result.status.code = 55
    assert contacts_of(result) == []
    for vector in "contact.position", "contact.normal", "impulse":
        result = answered()
        attrgetter(vector)(result).z = math.nan
        assert contacts_of(result) == []
    result = answered()
    result.contact.normal.z = 0.0
    assert contacts_of(result) == []
    scene = SceneResult(contacts=[answered().contact] * 2, impulses=[answered().impulse])
    assert contacts_of(scene) == []
    scene.status.code = int(StatusCode.OK)
    assert len(contacts_of(scene)) == 1


@pytest.mark.parametrize("length", [1e-200, 1e160, 1e300])
def test_impulses_of_any_length_are_drawn(length):
    touch = SLIDES._replace(position=ZERO, impulse=Vec3(0.0, 0.0, length), normal=Vec3(0.0, 0.0, 1.0))
    rim = points(drawn(touch)["friction cone"]).reshape(-1, 3, 3)[:, 1]
    np.testing.assert_allclose(np.hypot(np.hypot(*rim.T[:2]), rim[:, 2]), 0.5 * length)


def test_arrows_beyond_float64_are_not_drawn():
    far = SLIDES._replace(impulse=Vec3(1e308, 1e308, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        markers = markers_of(Header(), [far], DRAWING._replace(metres_per_newton_second=1e9), count()).markers
    assert [marker.ns for marker in markers] == ["point", "normal"]


@pytest.fixture
def shown(graph):
    """A node, and the wrenches that it publishes."""
    node, wrenches = ContactMarkers(context=graph.context, namespace=graph.namespace), []
    node._wrenches = SimpleNamespace(publish=wrenches.append)
    yield node, wrenches
    node.destroy_node()


def test_a_wrench_beyond_float64_is_left_out(shown, capfd):
    node, wrenches = shown
    node.set_parameters([Parameter("contact_duration", value=0.5**29)])
    for impulse in 1.0, 1e305:
        result = answered()
        result.impulse.z = impulse
        node._show(result)
    assert [wrench.wrench.force.z for wrench in wrenches] == [2.0**29]
    assert capfd.readouterr().err.count("a wrench beyond float64 is not published") == 1


def test_the_lifetime_must_fit_a_duration_message(shown):
    node, _ = shown
    (too_long,) = node.set_parameters([Parameter("lifetime", value=1e10)])
    (longest,) = node.set_parameters([Parameter("lifetime", value=1e9)])
    assert (too_long.successful, longest.successful) == (False, True)
    node._show(answered())


@pytest.mark.parametrize(("lifetime", "nanoseconds"), [(0.0, 0), (1e-12, 1), (1.6e-9, 2), (0.1, 10**8)])
def test_only_a_lifetime_of_0_is_forever(lifetime, nanoseconds):
    drawing = DRAWING._replace(lifetime=lifetime)
    for marker in markers_of(Header(), [SLIDES], drawing, count()).markers:
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, nanoseconds)


def test_the_wrench_is_about_the_origin_of_the_frame():
    """Force P/T, torque x cross P/T."""
    wrench = wrench_of(Header(frame_id="world"), SLIDES, 0.5)
    assert (wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z) == (-6.0, 4.8, 6.4)
    torque = wrench.wrench.torque.x, wrench.wrench.torque.y, wrench.wrench.torque.z
    assert torque == pytest.approx((2 * (2 * 3.2 - 3 * 2.4), 2 * (-9 - 3.2), 2 * (2.4 + 6)))
    assert wrench.header.frame_id == "world"


TOPICS = "result", "scene_result", "markers", "wrench"


def test_answers_are_shown_over_dds(graph):
    """A frictionless impact gives three markers and a wrench; a scene the markers of each contact."""
    graph.serve()
    graph.add(
        ContactMarkers(
            context=graph.context,
            namespace=graph.namespace,
            parameter_overrides=[Parameter("contact_duration", value=0.25)],
        )
    )
    said = graph.log()
    names = (f"{graph.namespace}/collision_response/{topic}" for topic in TOPICS)
    line = "showing {}, {} as markers on {} and wrenches on {}".format(*names)
    wait_until(lambda: line in said)
    shown = graph.listen(MarkerArray, "collision_response/markers")
    wrenches = graph.listen(WrenchStamped, "collision_response/wrench")

    def ask(request, heard):
        graph.call(request)
        return heard[-1] if heard else None

    request = balls_meet()  # 2 kg each, 4 m/s, e = 1/2: 6 N s
    markers = wait_until(lambda: ask(request, shown)).markers
    assert [marker.ns for marker in markers] == ["point", "normal", "impulse"]
    assert markers[0].header.frame_id == "world"
    np.testing.assert_allclose(points(markers[2])[1], (0.6, 0, 0))
    wrench = wait_until(lambda: ask(request, wrenches))
    assert (wrench.header.frame_id, wrench.wrench.force.x) == ("world", 24.0)

    cube = Body.box(1.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=(0.0, 0.0, -1.0))
    corners = [Contact.of((x, y, 0), (0, 0, 1), 0.5, 0.3) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    shown.clear(), wrenches.clear()
    scene = pack([cube, Body.static()], [(0, 1)] * 4, corners, frame_id="world")
    wait_until(lambda: ask(scene, shown) and any(len(array.markers) == 16 for array in shown))
    array = next(array for array in shown if len(array.markers) == 16)
    tips = [points(marker)[1] - points(marker)[0] for marker in array.markers if marker.ns == "impulse"]
    assert math.fsum(tip[2] for tip in tips) == pytest.approx(0.1 * 1.5)
