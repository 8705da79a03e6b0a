"""Mass properties from URDF and SDF."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest

from collision_response import Body, Contact, StatusCode, resolve
from collision_response.description import Description
from collision_response.physics import mass_properties
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

ROUNDING = 1e-14
"""A few operations on numbers of size 1."""


GROUND = "<joint name='ground' type='{kind}'><parent>world</parent><child>{child}</child></joint>"


def urdf(*parts: str) -> str:
    return f"<robot name='robot'>{''.join(parts)}</robot>"


def link(name: str, mass: float, moments=(0.0, 0.0, 0.0), xyz="0 0 0", rpy="0 0 0") -> str:
    xx, yy, zz = moments
    return (
        f"<link name='{name}'><inertial><origin xyz='{xyz}' rpy='{rpy}'/><mass value='{mass}'/>"
        f"<inertia ixx='{xx!r}' ixy='0' ixz='0' iyy='{yy!r}' iyz='0' izz='{zz!r}'/></inertial></link>"
    )


def joint(parent: str, child: str, kind="fixed", xyz="0 0 0", rpy="0 0 0") -> str:
    return (
        f"<joint name='{parent}-{child}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>"
        f"<origin xyz='{xyz}' rpy='{rpy}'/></joint>"
    )


def turned(xyzw: str, besides: str = "") -> str:
    """A link whose inertia is turned by a quaternion, as URDF 1.1 has it."""
    return (
        f"<link name='a'><inertial><origin xyz='1 2 3' quat_xyzw='{xyzw}' {besides}/><mass value='2'/>"
        "<inertia ixx='0.1' ixy='0' ixz='0' iyy='0.2' iyz='0' izz='0.25'/></inertial></link>"
    )


def sdf(*parts: str, before: str = "") -> str:
    return f"<sdf version='1.9'>{before}<model name='model'>{''.join(parts)}</model></sdf>"


def body_of(text: str, name: str, **options):
    return Description.read(text).mass_properties(name, **options)


def agree(found, expected):
    assert found.mass == pytest.approx(expected.mass, rel=ROUNDING)
    assert tuple(found.com) == pytest.approx(tuple(expected.com), abs=ROUNDING)
    assert tuple(found.inertia) == pytest.approx(tuple(expected.inertia), abs=ROUNDING)


def test_a_single_link():
    found = body_of(urdf(link("base", 2.0, (0.1, 0.2, 0.25), "0.1 0.2 0.3")), "base")
    assert found == (2.0, Vec3(0.1, 0.2, 0.3), Symmetric3(0.1, 0.0, 0.0, 0.2, 0.0, 0.25))


def test_roll_pitch_and_yaw_turn_in_that_order_about_fixed_axes():
    """A quarter turn about x takes y to z and z to -y; one about y takes z to x and x to -z."""
    found = body_of(urdf(link("base", 1.0, (1.0, 2.0, 2.5), rpy=f"{math.pi / 2} {math.pi / 2} 0")), "base")
    # roll: y -> z, z -> -y; pitch: z -> x, x -> -z: the principal axes x, y, z lie along -z, x, -y
    assert tuple(found.inertia) == pytest.approx((2.0, 0, 0, 2.5, 0, 1.0), abs=ROUNDING)
    yaw = body_of(urdf(link("base", 1.0, (1.0, 2.0, 2.5), rpy=f"0 0 {math.pi / 4}")), "base")
    assert tuple(yaw.inertia) == pytest.approx((1.5, -0.5, 0, 1.5, 0, 2.5), abs=ROUNDING)


def test_two_halves_joined_are_the_whole():
    """A box cut across x. Joints rotate and move its halves."""
    size = (0.4, 0.6, 0.2)
    half = mass_properties.box(1.5, (0.2, 0.6, 0.2)).inertia
    moments = half.xx, half.yy, half.zz
    turned = half.yy, half.xx, half.zz  # in the axes of a link that is a quarter turn about z ahead
    text = urdf(
        "<link name='corner'/>",
        link("left", 1.5, moments, xyz="0.1 0.3 0.1"),
        link("right", 1.5, turned),
        joint("corner", "left"),
        joint("left", "right", xyz="0.3 0.3 0.1", rpy=f"0 0 {math.pi / 2}"),
    )
    whole = mass_properties.box(3.0, size)
    agree(body_of(text, "corner"), whole._replace(com=Vec3(0.2, 0.3, 0.1)))
    agree(body_of(text, "left"), whole._replace(com=Vec3(0.2, 0.3, 0.1)))
    # from the right half's frame: x there is y of the box, y there is -x
    xx, _, _, yy, _, zz = whole.inertia
    agree(
        body_of(text, "right"), whole._replace(com=Vec3(0, 0.1, 0), inertia=Symmetric3(yy, 0, 0, xx, 0, zz))
    )


def test_links_on_movable_joints_belong_to_the_body_only_if_they_are_locked():
    text = urdf(
        "<link name='base_footprint'/>",
        link("base_link", 8.0),
        link("left_wheel", 1.0),
        link("right_wheel", 1.0),
        joint("base_footprint", "base_link", xyz="0 0 0.1"),
        joint("base_link", "left_wheel", "continuous", xyz="0 0.25 0"),
        joint("base_link", "right_wheel", "continuous", xyz="0 -0.25 0"),
    )
    assert body_of(text, "base_footprint").mass == 8.0
    assert body_of(text, "left_wheel").mass == 1.0
    robot = body_of(text, "base_footprint", locked=True)
    assert robot.mass == 10.0
    assert tuple(robot.com) == pytest.approx((0, 0, 0.1), abs=ROUNDING)
    assert tuple(robot.inertia) == pytest.approx((0.125, 0, 0, 0, 0, 0.125), abs=ROUNDING)
    assert body_of(text, "left_wheel", locked=True).com.y == pytest.approx(-0.25)


def test_mass_properties_make_a_body():
    found = body_of(urdf(link("base", 2.0, (0.1, 0.2, 0.25), "0.1 0 0")), "base")
    body = Body.dynamic(found.mass, found.inertia, com=found.com)
    assert (body.mass, body.com, body.inertia) == found


def test_links_of_an_sdf_are_placed_in_the_model():
    text = sdf(
        "<link name='a'><pose>0 0 1 0 0 0</pose><inertial><mass>1</mass></inertial></link>",
        "<link name='b'><pose degrees='true'>0 0 2 0 90 0</pose><inertial><pose>0 0 1 0 0 0</pose>"
        "<mass>1</mass><inertia><ixx>0.5</ixx></inertia></inertial></link>",
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
    )
    found = body_of(text, "a")  # b's mass lies one metre along its z axis, which is x
    assert (found.mass, *found.com) == pytest.approx((2.0, 0.5, 0.0, 0.5), abs=ROUNDING)
    # own: 1 and (1, 1, .5); of places half of (1, 0, 1) to either side: 1/2 times (1, 2, 1), xz -1/2
    assert tuple(found.inertia) == pytest.approx((2.5, 0, -0.5, 3.0, 0, 2.0), abs=ROUNDING)


def test_a_link_of_an_sdf_without_an_inertial_has_the_defaults_of_the_format():
    found = body_of(sdf("<link name='a'/>"), "a")
    assert (found.mass, tuple(found.com), tuple(found.inertia)) == (1.0, (0, 0, 0), (1, 0, 0, 1, 0, 1))


def test_sdf_poses_may_be_relative_to_frames_and_joints():
    text = sdf(
        "<frame name='f' attached_to='a'><pose>1 0 0 0 0 0</pose></frame>",
        "<link name='a'><pose relative_to='__model__'>0 1 0 0 0 0</pose></link>",
        "<link name='b'><pose relative_to='j' rotation_format='quat_xyzw'>0 0 1  0 0 1 0</pose></link>",
        "<joint name='j' type='fixed'><pose relative_to='f'/><parent>a</parent><child> b </child></joint>",
        "<joint name='ground' type='revolute'><parent>world</parent><child>a</child></joint>",
    )
    found = body_of(text, "a")
    assert (found.mass, *found.com) == pytest.approx((2.0, 0.5, 0.0, 0.5), abs=ROUNDING)
    joint, _ = Description.read(text).joints
    np.testing.assert_allclose(joint.pose[:3, :3], np.diag([-1.0, -1.0, 1.0]), atol=ROUNDING)


def test_a_link_may_share_its_name_with_a_joint_or_a_frame():
    """Old models do so; joints connect links."""
    text = sdf(
        "<link name='a'/><link name='b'><pose>1 0 0 0 0 0</pose></link>",
        "<joint name='b' type='fixed'><pose>5 0 0 0 0 0</pose><parent>a</parent><child>b</child></joint>",
        "<frame name='a'><pose>9 0 0 0 0 0</pose></frame>",
    )
    assert tuple(body_of(text, "a").com) == (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the description is not XML: no element found"),
        ("<robot", "the description is not XML"),
        ("<html/>", "must be a URDF <robot>, or an <sdf> with one <model>; is a <html> with 0"),
        (sdf(before="<model name='other'/>"), "is a <sdf> with 2"),
        (sdf("<link name='world'/>"), "link 'world' has a name that SDF reserves"),
        (sdf("<frame name='__model__'/>"), "frame '__model__' has a name that SDF reserves"),
        (
            sdf("<link name='a'/>", GROUND.format(kind="fixxed", child="a")),
            "joint 'ground': type must be one of fixed",
        ),
        (sdf(GROUND.format(kind="fixed", child="a")), "joint 'ground': the robot has no link 'a'"),
        (urdf(link("base", "${m}")), "mass of link 'base': must be a finite number, is '${m}'"),
        (urdf(link("base", math.inf)), "mass of link 'base': must be a finite number, is 'inf'"),
        (urdf(link("base", 1.0, xyz="0 0")), "xyz of link 'base': must be 3 finite numbers, is '0 0'"),
        (
            urdf(link("a", 3.0), link("b", -1.0), joint("a", "b")),
            "mass of link 'b': must be at least 0, is '-1.0'",
        ),
        (
            sdf("<link name='a'><inertial><mass>-1e-300</mass></inertial></link>"),
            "mass of link 'a': must be at least 0, is '-1e-300'",
        ),
        (urdf(link("a", 1.0), link("a", 2.0)), "link 'a' appears twice"),
        (urdf("<link/>"), "a <link> has no name"),
        (urdf(link("a", 1.0), link("b", 1.0), "<joint type='fixed'/>"), "a <joint> has no name"),
        (sdf("<link name='a'/><frame name='f'/><frame name='f'/>"), "frame 'f' appears twice"),
        ("<robot>\ud800</robot>", "the description is not XML: "),
        ("<!DOCTYPE r [<!ENTITY e SYSTEM 'file:///etc/passwd'>]><robot>&e;</robot>", "undefined entity"),
        (
            urdf("<link name='a'><inertial><mass value='1 2'/><inertia/></inertial></link>"),
            "mass of link 'a': ",
        ),
        (
            urdf("<link name='a'><inertial><mass/><inertia/></inertial></link>"),
            "mass of link 'a': must be a ",
        ),
        (sdf("<link name='a'/><link name='b'/><link name='a'/>"), "link 'a' appears twice"),
        (urdf(turned("1 0 0 0", "rpy='0 0 0'")), "origin of link 'a': must have rpy or quat_xyzw, not both"),
        (urdf(turned("0 0 1")), "quat_xyzw of link 'a': must be 4 finite numbers, is '0 0 1'"),
        (urdf(turned("0 0 0 0")), "quat_xyzw of link 'a': the quaternion must be finite and not 0"),
        (urdf("<link name='a'><inertial/></link>"), "link 'a' has no <mass>"),
        (urdf(link("a", 1.0), joint("a", "b")), "joint 'a-b': the robot has no link 'b'"),
        (urdf("<link name='a'><inertial/><inertial/></link>"), "link 'a' has 2 <inertial>"),
        (sdf("<link name='a'><inertial/><inertial/></link>"), "link 'a' has 2 <inertial>"),
        (urdf(link("a", 1.0).replace("<mass", "<mass value='2'/><mass")), "link 'a' has 2 <mass>"),
        (
            urdf(
                link("a", 1.0), link("b", 1.0), joint("a", "b").replace("<child", "<child link='a'/><child")
            ),
            "joint 'a-b' has 2 <child>",
        ),
        (
            urdf(link("a", 1.0), link("b", 1.0), link("arm", 95.0), joint("a", "b")),
            "robot 'robot' has more than one root: joints must connect all links; a, arm have no parent",
        ),
        (
            urdf(link("a", 1.0), link("b", 1.0), joint("a", "b", "Fixed")),
            "prismatic, floating, planar; is 'Fixed'",
        ),
        (
            sdf(
                "<link name='a'/><link name='b'/>",
                "<joint name='j'><parent>a</parent><child>b</child></joint>",
            ),
            "joint 'j': type must be one of fixed, revolute, ",
        ),
        (sdf("<include/>"), "model 'model': a <include> inside a model is not supported"),
        (sdf("<link name='a'><inertial auto='true'/></link>"), "link 'a': an inertial with auto='true'"),
        (
            sdf(
                "<frame name='f' attached_to='g'/><frame name='g' attached_to='f'/>",
                "<link name='a'><pose relative_to='f'/></link><link name='b'/>",
                "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
            ),
            "the pose of 'g' is relative to 'f', which has none",
        ),
        (
            sdf(
                "<link name='a'/><link name='b'/><frame name='f' attached_to='a'/>",
                "<joint name='j' type='fixed'><parent>f</parent><child>b</child></joint>",
            ),
            "joint 'j': 'f' is a <frame>: name its link instead",
        ),
        (
            sdf("<frame name='f'/><link name='a'><inertial><pose relative_to='f'/></inertial></link>"),
            "inertial of link 'a': relative_to is not supported",
        ),
        (sdf("<link name='a'><inertial auto='1'/></link>"), "link 'a': an inertial with auto='true'"),
        (sdf("<static>true</static><link name='a'/>"), "model 'model' is static: give it as a STATIC body"),
        (
            sdf(
                "<link name='a'><inertial><pose rotation_format='quat'>0 0 0 0 0 0 1</pose></inertial></link>"
            ),
            "pose of link 'a': rotation_format must be euler_rpy or quat_xyzw, is 'quat'",
        ),
        (
            sdf("<link name='a'><inertial><pose frame='b'>1 0 0 0 0 0</pose></inertial></link>"),
            "pose of link 'a': the attribute frame is not supported: SDF 1.7 has relative_to",
        ),
        (
            sdf(
                "<link name='a'/><frame name='a'/><link name='b'><pose relative_to='a'/></link>",
                "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
            ),
            "the pose of 'b' is relative to 'a', a name that two have",
        ),
        (
            urdf(link("a", 1.0), "<w:wheel xmlns:w='http://www.ros.org/wiki/xacro' name='b'/>"),
            "robot 'robot' has xacro elements: expand them with xacro first",
        ),
        (
            urdf(*(link(name, 1.0) for name in "abc"), joint("a", "c"), joint("b", "c")),
            "joint 'b-c': its child 'c' is the child of another joint too",
        ),
        (
            urdf(*(link(name, 1.0) for name in "abc"), joint("a", "b"), joint("b", "c"), joint("c", "a")),
            "joints connect links in a circle: ",
        ),
        (urdf(link("a", 1.0), joint("a", "a", xyz="1 0 0")), "joints connect links in a circle: a, a"),
        (
            sdf(
                "<link name='a'><inertial><pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose></inertial>",
                "</link>",
            ),
            "pose of link 'a': the quaternion must be finite and not 0, is (0.0, 0.0, 0.0, 0.0)",
        ),
    ],
)
def test_invalid_descriptions_are_refused_by_name(text, message):
    with pytest.raises(ValueError) as refusal:
        Description.read(text)
    assert message in str(refusal.value)


@pytest.mark.parametrize("length", [0.5, 1.0, 1e-200, 1e200])
def test_a_urdf_may_rotate_by_a_quaternion(length):
    """A third of a turn about (1, 1, 1) takes x to y, y to z, z to x; a quarter about z takes x to y."""
    found = body_of(urdf(turned(" ".join([str(length)] * 4))), "a")
    moments = Symmetric3(0.25, 0.0, 0.0, 0.1, 0.0, 0.2)
    agree(found, mass_properties.MassProperties(2.0, Vec3(1.0, 2.0, 3.0), moments))
    text = urdf(
        link("base", 1.0),
        link("arm", 1.0, xyz="1 0 0"),
        "<joint name='j' type='fixed'><parent link='base'/><child link='arm'/>",
        f"<origin xyz='0 0 1' quat_xyzw='0 0 {length} {length}'/></joint>",
    )
    assert body_of(text, "base").com == pytest.approx((0.0, 0.5, 0.5), abs=ROUNDING)


@pytest.mark.parametrize("length", [1.0, 1e-200, 1e200])
def test_a_quaternion_may_have_any_length(length):
    """A half turn about z, in an SDF."""
    pose = f"<pose rotation_format='quat_xyzw'>0 0 0  0 0 {length} 0</pose>"
    inertial = "<inertial><pose>1 0 0 0 0 0</pose></inertial>"
    text = sdf(
        f"<link name='a'/><link name='b'>{pose}{inertial}</link>",
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
    )
    assert body_of(text, "a").com == pytest.approx((-0.5, 0.0, 0.0), abs=ROUNDING)


@pytest.mark.parametrize("true", ["true", "True", "1", " true "])
def test_angles_of_an_sdf_may_be_in_degrees(true):
    text = sdf(
        f"<link name='a'/><link name='b'><pose degrees='{true}'>0 0 0 0 0 180</pose>"
        "<inertial><pose rotation_format='euler_rpy'>1 0 0 0 0 0</pose></inertial></link>",
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
    )
    assert body_of(text, "a").com == pytest.approx((-0.5, 0.0, 0.0), abs=ROUNDING)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "iso-8859-1", "utf-16"])
def test_a_file_may_have_any_encoding_that_it_declares(encoding):
    text = f"<?xml version='1.0' encoding='{encoding.removesuffix('-sig')}'?>{urdf(link('töne', 2.0))}"
    assert body_of(text.encode(encoding), "töne").mass == 2.0


@pytest.mark.parametrize("encoding", ["klingon", "hex", "big5", "undefined", "utf-16"])
def test_an_encoding_that_cannot_be_read_is_refused(encoding):
    with pytest.raises(ValueError):  # the texts are those of Python
        Description.read(f"<?xml version='1.0' encoding='{encoding}'?>{urdf(link('a', 1.0))}".encode())


@pytest.mark.parametrize("text", [None, 5, Path("robot.urdf"), ["<robot/>"]])
def test_a_description_is_text(text):
    with pytest.raises(TypeError, match=r"^text: must be the XML as text or bytes, is "):
        Description.read(text)


def test_a_chain_of_links_may_be_long():
    count = 3000
    links = (link(f"l{i}", 1.0) for i in range(count))
    text = urdf(*links, *(joint(f"l{i}", f"l{i + 1}", xyz="1 0 0") for i in range(count - 1)))
    middle = count // 2
    assert body_of(text, f"l{middle}").com.x == pytest.approx((count - 1) / 2 - middle, abs=1e-9)


@pytest.mark.parametrize("count", [1, 10_000])
def test_a_chain_of_frames_may_be_long(count):
    frames = [
        f"<frame name='f{i}' attached_to='f{i + 1}'><pose>0.5 0 0 0 0 0</pose></frame>" for i in range(count)
    ]
    text = sdf(
        f"<link name='a'/><link name='b'><pose relative_to='f0'/></link><frame name='f{count}'/>",
        *frames,
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
    )
    assert body_of(text, "a").com == Vec3(0.25 * count, 0.0, 0.0)


@pytest.mark.parametrize(
    "links",
    [
        (link("a", 1e308), link("b", 1e308)),
        (link("a", 1.0), link("b", 1e10, xyz="1e300 0 0")),
        (link("a", 1.0), link("b", 1.0, xyz="1e200 0 0")),
    ],
    ids=["mass", "centre of mass", "inertia"],
)
def test_masses_and_inertias_beyond_float64_are_refused_by_name(links):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        description = Description.read(urdf(*links, joint("a", "b")))
        with pytest.raises(
            ValueError, match="link 'a' of 'robot' has a mass or an inertia that exceeds float64"
        ):
            description.mass_properties("a")


def test_rods_on_a_line_have_no_inertia_about_it():
    rods = [
        link(name, mass, (0.01, 0.01, 0.0), f"0.3 0.2 {z}")
        for name, mass, z in (("a", 0.3, -1.0), ("b", 0.1, 0.0), ("c", 0.3, 1.0))
    ]
    robot = Description.read(urdf(*rods, joint("a", "b"), joint("b", "c")))
    inertia = robot.mass_properties("b").inertia
    assert (inertia.zz, inertia.xy, inertia.xz, inertia.yz) == (0.0, 0.0, 0.0, 0.0)
    assert inertia.xx == inertia.yy == pytest.approx(0.63)


@pytest.mark.parametrize(
    "wrong", ["ixx='-1' iyy='-1' izz='-1'", "ixx='1' iyy='1' izz='30'", "ixx='1' ixy='5' iyy='1' izz='1'"]
)
def test_an_impossible_inertia_is_not_hidden_by_that_of_another_link(wrong):
    bad = f"<link name='a'><inertial><mass value='1'/><inertia {wrong}/></inertial></link>"
    description = Description.read(urdf(bad, link("b", 5.0), joint("b", "a")))
    for name in "ab":
        with pytest.raises(
            ValueError, match=r"^the inertia of link 'a' of 'robot' is impossible: negative, or"
        ):
            description.mass_properties(name)


@pytest.mark.parametrize(("izz", "is_rounding"), [(0.667, True), (0.679, True), (0.681, False)])
def test_rounding_of_numbers_in_files_is_no_impossible_inertia(izz, is_rounding):
    """A plate has ixx + iyy = izz. Half of what izz is greater by may be a hundredth of it."""
    plate = f"<inertia ixx='0.333' iyy='0.333' izz='{izz}'/>"
    rounded = f"<link name='a'><inertial><mass value='1'/>{plate}</inertial></link>"
    robot = urdf(rounded, link("b", 5.0), joint("b", "a"))
    if is_rounding:
        assert body_of(robot, "a").mass == 6.0
    else:
        with pytest.raises(ValueError, match="inertia of link 'a' of 'robot' is impossible"):
            body_of(robot, "a")


ROUNDED = [
    "0.333 0.333 0.667",
    "0.333 0.333 0.6660000000001",
    "0.0833 0.08335 0",
    "1e-9 1.2 1.21",
    "2e-300 2e-300 4.01e-300",
]


@pytest.mark.parametrize("moments", ROUNDED)
@pytest.mark.parametrize("rpy", ["0 0 0", "0.3 -1.2 2.5"])
@pytest.mark.parametrize("has_footprint", [False, True])
def test_a_plate_and_a_rod_of_few_digits_are_resolved(has_footprint, rpy, moments):
    """Their inertia, which no body can have, is refused in a request."""
    numbers = " ".join(
        f"{name}='{x}'" for name, x in zip(("ixx", "iyy", "izz"), moments.split(), strict=True)
    )
    inertial = f"<inertial><mass value='1'/><origin rpy='{rpy}'/><inertia {numbers}/></inertial>"
    links = f"<link name='a'>{inertial}</link>", *(["<link name='f'/>", joint("f", "a")] * has_footprint)
    properties = body_of(urdf(*links), "a")
    body = Body.of(properties, velocity=(0, 0, -1))
    assert (
        resolve(body, Body.static(), Contact.of((0.1, 0.2, 0), (0, 0, 1), 0.5, 0.2)).status is StatusCode.OK
    )
    given = sorted(map(float, moments.split()))
    found = np.linalg.eigvalsh(np.array(properties.inertia.rows()))
    np.testing.assert_allclose(found, given, atol=0.01 * given[-1] + 5e-324)


@pytest.mark.parametrize("field", Symmetric3._fields)
@pytest.mark.parametrize("number", [1e308, -1e308, 1.7976931348623157e308])
def test_the_greatest_floats_are_read(field, number):
    expected = Symmetric3(*[0.0] * 6)._replace(**{field: number})
    numbers = " ".join(f"i{name}='{x!r}'" for name, x in expected._asdict().items())
    text = f"<link name='a'><inertial><mass value='1'/><inertia {numbers}/></inertial></link>"
    assert body_of(urdf(text), "a").inertia == expected


@pytest.mark.parametrize("name", ["ixx", "iyy", "izz"])
def test_a_moment_must_be_given(name):
    """A misspelt one would count as 0, as that of a thin rod."""
    text = urdf(link("base", 1.0, (1.0, 1.0, 1.0))).replace(name, name.upper())
    with pytest.raises(ValueError, match=f"{name} of link 'base': must be given"):
        Description.read(text)


@pytest.mark.parametrize(
    "text",
    [
        urdf("<link name='world'/>", link("a", 1.0), link("b", 1.0), joint("world", "a"), joint("a", "b")),
        sdf(
            "<link name='a'/><link name='b'/>",
            GROUND.format(kind="fixed", child="a"),
            "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>",
        ),
    ],
)
def test_a_body_that_is_fixed_to_the_world_is_refused(text):
    for name in ("a", "b"):
        with pytest.raises(ValueError, match=f"link '{name}' of '.*' is fixed to the world: give"):
            body_of(text, name)


def test_the_world_is_refused_where_a_body_is_fixed_to_it():
    text = urdf("<link name='world'/>", link("a", 1.0), joint("world", "a"))
    with pytest.raises(ValueError, match="link 'world' of 'robot' is fixed to the world: give"):
        body_of(text, "world")


@pytest.mark.parametrize(
    "text",
    [
        urdf("<link name='world'/>", link("a", 2.0), joint("world", "a", "floating")),
        urdf(link("world", 1.0), link("a", 1.0), joint("world", "a", "fixed")),
        sdf(
            "<link name='a'><inertial><mass>2</mass></inertial></link>",
            GROUND.format(kind="revolute", child="a"),
        ),
    ],
)
def test_a_body_that_moves_in_the_world_is_a_body(text):
    """So is one with a link that has a mass, whatever its name."""
    assert body_of(text, "a", locked=True).mass == 2.0


def test_unknown_and_massless_links_are_refused_by_name():
    description = Description.read(
        urdf("<link name='world'/>", link("base", 1.0), joint("world", "base", "floating"))
    )
    with pytest.raises(ValueError, match="'robot' has no link 'bass'; it has world, base"):
        description.mass_properties("bass")
    with pytest.raises(ValueError, match="link 'world' of 'robot' has no mass"):
        description.mass_properties("world")


def test_the_name_of_a_file_is_no_description():
    with pytest.raises(
        ValueError, match=r"^text: must be the XML itself, not the name of a file; is 'robot.urdf'"
    ):
        Description.read("robot.urdf")


def test_descriptions_with_equal_numbers_are_equal():
    joint = "<joint name='j' type='fixed'><parent link='a'/><child link='b'/>{}</joint>"
    links = f"<link name='a'/><link name='b'/>{joint}"
    one, same, other = (
        Description.read(f"<robot name='r'>{links.format(origin)}</robot>")
        for origin in ("", "<origin xyz='0 0 0'/>", "<origin xyz='0 0 1'/>")
    )
    assert one == same and one != other
