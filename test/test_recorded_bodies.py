"""How a recording draws bodies: where they were, and as the solid that has their inertia."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("rerun")

from recordings import impact, read, recorded, verify

from collision_response import Body, Contact, ImpactModel, resolve
from collision_response.physics.mass_properties import box, rod, sphere
from collision_response.physics.orientation import Quaternion
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.recording import BodyRecord, Record
from collision_response.recording.equivalent_solid import EquivalentSolid

EIGEN = 1e-12
"""Relative error of half sizes from the eigenvalues of a 3x3 tensor: tens of roundings."""


def test_a_body_is_drawn_between_its_impacts(tmp_path):
    ball = Body.dynamic(2.0, sphere(2.0, 0.5).inertia, (3.0, 0.0, 0.5), velocity=(0.0, 2.0, 0.0))
    path = recorded(tmp_path, [impact(1), BodyRecord(1_500_000_000, "ball/1", ball), impact(2)])
    verify(path)
    # on the timeline of answers there are impacts only
    entity = r"/world/bodies/ball\/1"
    assert [sequence for _, sequence, _ in read(path, entity, "Transform3D:translation")] == [1, 2]
    assert rows_outside_answers(path, entity, "Transform3D:translation") == [
        (1_500_000_000, [[3.0, 0.0, 0.5]])
    ]
    ((_, [velocity, _]),) = rows_outside_answers(path, r"/world/velocities/ball\/1", "Arrows3D:vectors")
    assert velocity == pytest.approx([0.0, 0.2, 0.0], rel=1e-6)


@pytest.mark.parametrize("length", [1e-200, 1.0, 1e200])
def test_a_body_is_drawn_at_its_centre_of_mass(tmp_path, length):
    """Its frame starts 2 m below and is rotated by 90 degrees; the quaternion has any length."""
    ball = Body.dynamic(
        2.0,
        sphere(2.0, 0.5).inertia,
        (1.0, -2.0, 0.5),
        (0.0, 0.0, length, length),
        (-3.0, 0.0, -3.0),
        (0.0, 0.0, -1.5),
        (2.0, 0.0, 0.0),
    )
    floor, contact = Body.static(), Contact.of((1.0, 0.0, 0.0), (0.0, 0.0, length), 0.5)
    request = ball, floor, contact, ImpactModel()
    answer = resolve(*request)
    path = recorded(tmp_path, [Record(2, 1, "ball", "floor", *request, answer), BodyRecord(1, "ball", ball)])
    verify(path)
    entity = "/world/bodies/ball"
    velocities = "/world/velocities/ball"
    for component, place in (("Transform3D:translation", entity), ("Arrows3D:origins", velocities)):
        for rows in (read(path, place, component), rows_outside_answers(path, place, component)):
            assert rows[0][-1][0] == pytest.approx([1.0, 0.0, 0.5], abs=1e-6)
    ((_, [turn]),) = rows_outside_answers(path, entity, "Transform3D:quaternion")
    assert turn == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], rel=1e-6)
    # the centre of mass falls straight down
    ((_, _, [after, spin_after, before, spin_before]),) = read(path, velocities, "Arrows3D:vectors")
    assert before == pytest.approx([0.0, 0.0, -0.3], abs=1e-7)
    assert after == pytest.approx([0.0, 0.0, 0.15], abs=1e-7)
    gyration = 0.5 * math.sqrt(3 / 5)  # <r^2> of a solid sphere
    assert spin_before == pytest.approx([0.0, 0.0, -0.15 * gyration], rel=1e-6)
    assert spin_after == pytest.approx([0.1 * gyration * w for w in answer.twist_a.angular], abs=1e-7)
    ((_, _, [normal]),) = read(path, "/world/contact", "Arrows3D:vectors")
    assert normal == pytest.approx([0.0, 0.0, 0.1], rel=1e-6)


def rows_outside_answers(path, entity, component):
    """Rows of an entity that belong to no answer: stamp [ns], value."""
    return read(path, entity, component, timelines=("ros_time",))


def test_a_ball_is_drawn_in_its_size():
    solid = EquivalentSolid.of(Body.dynamic(3.0, sphere(3.0, 0.25).inertia))
    assert solid.is_ball
    assert solid.half_sizes == pytest.approx([0.25] * 3, rel=EIGEN)


def test_a_rod_is_drawn_in_its_size():
    solid = EquivalentSolid.of(Body.dynamic(3.0, rod(3.0, 2.0).inertia))
    assert not solid.is_ball
    assert sorted(solid.half_sizes) == pytest.approx([0.0, 0.0, 1.0], rel=EIGEN, abs=EIGEN)
    assert direction(solid, 1.0) == pytest.approx([1.0, 0.0, 0.0], abs=EIGEN)


def test_a_thin_body_gets_a_visible_thickness():
    columns = EquivalentSolid.of(Body.rod(3.0, 2.0)).columns()
    (drawn,) = (
        column.as_arrow_array().to_pylist()
        for column in columns
        if "half_sizes" in str(column.component_descriptor())
    )
    assert sorted(drawn[0][0]) == pytest.approx([0.02, 0.02, 1.0], rel=1e-6)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, 0, -2), (1, 0, 0), (1, -2, 3), (1e-9, 0, -1)])
def test_a_friction_cone_stands_on_the_normal_and_holds_the_impulse(tmp_path, normal):
    """The axis of the cone is the normal; its height is the normal part of the impulse arrow."""
    n = Vec3(*normal) / math.sqrt(sum(x * x for x in normal))
    request = (
        Body.dynamic(2.0, velocity=n * -3.0),
        Body.static(),
        Contact.of((0, 0, 0), normal, 0.5, 0.25),
        ImpactModel(),
    )
    path = recorded(tmp_path, [Record(2, 1, "ball", "floor", *request, resolve(*request))])
    ((_, _, [turn]),) = read(path, "/world/friction_cone", "InstancePoses3D:quaternions")
    axis = Quaternion(*turn).rotation().to_world(Vec3(0.0, 0.0, 1.0))
    assert axis == pytest.approx(n, abs=1e-6)  # a float of 32 bits
    ((_, _, [scale]),) = read(path, "/world/friction_cone", "InstancePoses3D:scales")
    assert scale == pytest.approx([0.25 * 0.45, 0.25 * 0.45, 0.45], rel=1e-6)
    ((_, _, regime),) = read(path, "/impact/regime", "StateChange:state")
    assert regime == ["STICKING"]


@pytest.mark.parametrize(("friction", "drawn"), [(2.75, 2.75), (3.25, 3.0), (1e300, 3.0)])
def test_a_friction_cone_is_drawn_up_to_a_slope_of_3(tmp_path, friction, drawn):
    request = (
        Body.dynamic(2.0, velocity=(0.0, 0.0, -3.0)),
        Body.static(),
        Contact.of((0, 0, 0), (0, 0, 1), 0.5, friction),
        ImpactModel(),
    )
    path = recorded(tmp_path, [Record(2, 1, "ball", "floor", *request, resolve(*request))])
    ((_, _, [scale]),) = read(path, "/world/friction_cone", "InstancePoses3D:scales")
    assert scale == pytest.approx([drawn * 0.45, drawn * 0.45, 0.45], rel=1e-6)  # a float of 32 bits


def test_a_box_in_rotated_axes_is_drawn_in_its_size():
    size, turn = (1.0, 2.0, 4.0), math.radians(30)
    about_z = Quaternion(0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))
    inertia = box(6.0, size).inertia
    turned_by = about_z.rotation()
    columns = [turned_by.to_world(inertia @ turned_by.to_body(axis)) for axis in AXES]
    turned = Symmetric3(*columns[0], columns[1].y, columns[1].z, columns[2].z)
    solid = EquivalentSolid.of(Body.dynamic(6.0, turned))
    assert sorted(solid.half_sizes) == pytest.approx([0.5, 1.0, 2.0], rel=EIGEN)
    for axis, edge in zip(AXES, size, strict=True):
        expected = turned_by.to_world(axis)
        along = direction(solid, edge / 2)
        assert abs(along.dot(expected)) == pytest.approx(1.0, rel=EIGEN)


AXES = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)


def direction(solid, half_size):
    """The direction of the edge with this half size in body axes, up to its sign."""
    (axis,) = (axis for axis, h in zip(AXES, solid.half_sizes, strict=True) if abs(h - half_size) < 1e-6)
    along = Quaternion(*solid.axes).rotation().to_world(axis)
    return along if along.x >= 0 else -along


@pytest.mark.parametrize("body", [Body.dynamic(1.0), Body.static()], ids=["point mass", "static"])
def test_a_body_without_inertia_has_no_solid(body):
    assert EquivalentSolid.of(body) is None
