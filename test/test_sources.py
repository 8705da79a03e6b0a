"""Body states from odometry, TF and robot descriptions."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import types
from functools import partial
from itertools import count
from operator import attrgetter
from pathlib import Path

import pytest

pytest.importorskip("nav_msgs")

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_graph import DEADLINE, wait_until
from std_msgs.msg import String

from collision_response import StatusCode
from collision_response.msg import BodyState
from collision_response.physics.mass_properties import MassProperties
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3
from collision_response.ros.process import StartError
from collision_response.ros.sources import DESCRIPTION_QOS, BodyStatePublisher, from_odometry, from_transforms
from collision_response.ros.throttled_warnings import MAX_SUBJECTS, WARNING_INTERVAL, ThrottledWarnings
from collision_response.srv import ResolveCollision

MATTER = MassProperties(2.0, Vec3(0.5, 0.0, 0.0), Symmetric3(0.1, 0.01, 0.02, 0.2, 0.03, 0.25))
ROUNDING = 1e-14
"""A few operations on numbers of size 1."""

ROBOT = """
<robot name="robot">
  <link name="base_footprint"/>
  <link name="base_link">
    <inertial><origin xyz="0.25 0 0"/><mass value="9"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
  </link>
  <link name="wheel"><inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0"/></inertial></link>
  <joint name="fixed" type="fixed"><parent link="base_footprint"/><child link="base_link"/></joint>
  <joint name="axle" type="continuous"><parent link="base_link"/><child link="wheel"/></joint>
</robot>
"""


def components(message) -> tuple[float, ...]:
    return tuple(getattr(message, name.lstrip("_")) for name in message.__slots__ if name != "_check_fields")


def fill(message, *numbers: float) -> None:
    for axis, number in zip("xyzw", numbers, strict=False):
        setattr(message, axis, float(number))


def odometry(*, turn=(0, 0, 0, 1), linear=(0, 0, 0), angular=(0, 0, 0), child="base_footprint") -> Odometry:
    message = Odometry(child_frame_id=child)
    message.header.frame_id, message.header.stamp.sec = "odom", 7
    message.pose.pose.position.x = 3.0
    fill(message.pose.pose.orientation, *turn)
    fill(message.twist.twist.linear, *linear)
    fill(message.twist.twist.angular, *angular)
    return message


def transform(
    seconds: float, place=(0, 0, 0), angle: float = 0.0, axis=(0, 0, 1), sign=1
) -> TransformStamped:
    message = TransformStamped(child_frame_id="tool")
    message.header.frame_id = "map"
    message.header.stamp.sec, rest = int(seconds), seconds % 1
    message.header.stamp.nanosec = round(rest * 1e9)
    fill(message.transform.translation, *place)
    s, c = sign * math.sin(angle / 2), sign * math.cos(angle / 2)
    fill(message.transform.rotation, *(s * x for x in axis), c)
    return message


@pytest.mark.parametrize("length", [1.0, 2.0, 1e-300, 1e-162, 1e-160, 1e154, 1e300])
def test_a_twist_in_axes_of_the_robot_becomes_one_in_axes_of_the_world(length):
    """A quarter turn about z by a quaternion of any length: x becomes y, y becomes -x."""
    h = length * math.sqrt(0.5)
    state = from_odometry(odometry(turn=(0, 0, h, h), linear=(1, 2, 3), angular=(4, 5, 6)), MATTER)
    assert components(state.twist.linear) == pytest.approx((-2, 1, 3), abs=ROUNDING)
    assert components(state.twist.angular) == pytest.approx((-5, 4, 6), abs=ROUNDING)
    assert (state.header.frame_id, state.header.stamp.sec) == ("odom", 7)
    assert (state.name, state.motion_type) == ("base_footprint", BodyState.DYNAMIC)
    assert (state.pose.position.x, state.pose.orientation.z) == (3.0, h)
    assert (state.restitution, state.friction) == (-1.0, -1.0)


def test_mass_and_inertia_are_filled_in():
    inertia = from_odometry(odometry(), MATTER, "robot").inertia
    assert (inertia.m, inertia.com.x) == (2.0, 0.5)
    assert tuple(getattr(inertia, f"i{x}") for x in Symmetric3._fields) == MATTER.inertia


@pytest.mark.parametrize("turn", [(0, 0, 0, 0), (0, 0, 0, math.nan), (math.inf, 0, 0, 1)])
def test_an_odometry_without_orientation_is_refused(turn):
    with pytest.raises(ValueError, match="the quaternion must be finite and not 0"):
        from_odometry(odometry(turn=turn), MATTER)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(wrong):
    for place in ("pose.pose.position", "twist.twist.linear", "twist.twist.angular"):
        broken = odometry()
        attrgetter(place)(broken).y = wrong
        with pytest.raises(ValueError, match="position and twist must be finite"):
            from_odometry(broken, MATTER)
    with pytest.raises(ValueError, match="position and twist must be finite"):
        from_transforms(transform(1.0), transform(1.5, (0, wrong, 0)), MATTER)
    with pytest.raises(ValueError, match="position and twist must be finite"):
        from_transforms(transform(1.0, (0, wrong, 0)), transform(1.5), MATTER)


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, -3.0])
def test_two_transforms_give_the_mean_twist_between_them(angle, signs):
    """A quaternion and its opposite are one orientation."""
    axis = (0.48, -0.6, 0.64)
    earlier = transform(1.5, (1, 2, 3), 0.7, axis, signs[0])
    later = transform(2.0, (1, 2.5, 3), 0.7 + angle, axis, signs[1])
    state = from_transforms(earlier, later, MATTER)
    assert components(state.twist.linear) == pytest.approx((0, 1, 0), abs=ROUNDING)
    spin = tuple(2 * angle * x for x in axis)
    assert components(state.twist.angular) == pytest.approx(spin, abs=10 * ROUNDING)
    assert (state.name, state.header, state.pose.position.y) == ("tool", later.header, 2.5)
    assert state.pose.orientation == later.transform.rotation


def test_the_axis_of_a_rotation_is_in_world_axes():
    """A quarter turn about z, then one about x of the world, which is y of the body."""
    h = math.sqrt(0.5)
    earlier, later = transform(0.0, (), math.pi / 2), transform(1.0)
    fill(later.transform.rotation, 0.5, -0.5, 0.5, 0.5)  # (h, 0, 0, h) times (0, 0, h, h)
    assert h * h == pytest.approx(0.5)
    spin = components(from_transforms(earlier, later, MATTER).twist.angular)
    assert spin == pytest.approx((math.pi / 2, 0, 0), abs=ROUNDING)


def test_transforms_at_one_time_are_refused():
    with pytest.raises(ValueError, match="must be later than the first; it is 0"):
        from_transforms(transform(1.0), transform(1.0), MATTER)


@pytest.mark.parametrize("pause", [1.001, 60.0])
def test_the_twist_after_a_pause_of_tf_is_unknown(pause):
    """The mean twist over the pause would have a fresh stamp, and be anything."""
    with pytest.raises(ValueError, match=f"no transform in the {pause:g} s before, so the twist is unknown"):
        from_transforms(transform(100.0), transform(100.0 + pause, (1, 0, 0)), MATTER)


def test_a_pause_is_longer_than_the_transforms_are_apart():
    state = from_transforms(transform(100.0), transform(104.0, (1, 0, 0)), MATTER, longest=5.0)
    assert state.twist.linear.x == pytest.approx(0.25)


@pytest.fixture
def start(graph):
    """Start the node under test; what it publishes is in ``heard``."""

    def start(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return graph.add(
            BodyStatePublisher(
                context=graph.context, namespace=graph.namespace, parameter_overrides=overrides
            )
        )

    start.heard = graph.listen(BodyState, "body_states")
    return start


def test_a_robot_drives_against_a_wall(graph, start):
    """From odometry and description to the twist after: the mass of all links, including the wheel."""
    graph.serve()
    start()
    description = graph.user.create_publisher(String, "robot_description", DESCRIPTION_QOS)
    odom = graph.publisher(Odometry, "odom")
    h = math.sqrt(0.5)
    driving = odometry(turn=(0, 0, h, h), linear=(2, 0, 0), child="robot1/base_footprint")

    def ask():
        odom.publish(driving)
        request = ResolveCollision.Request()
        request.contact.body_a = "robot1/base_footprint"
        request.body_b.header.frame_id = request.contact.header.frame_id = "odom"
        request.body_b.motion_type = BodyState.STATIC
        fill(request.contact.position, 3, 0.25 * 0.9 + 1, 0)
        request.contact.normal.y, request.contact.restitution = -1.0, 0.5
        result = graph.call(request).result
        return result if result.status.code != StatusCode.UNKNOWN_BODY else None

    assert ask() is None  # without a description there is no mass
    description.publish(String(data=ROBOT))
    result = wait_until(ask)
    assert components(result.twist_a.linear) == pytest.approx((0, -1, 0), abs=ROUNDING)
    assert components(result.impulse) == pytest.approx((0, -30, 0), abs=1e-12)
    assert result.effective_mass == pytest.approx(10.0)


def test_a_description_may_be_a_file_and_the_body_have_another_name(graph, start, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "box.sdf").write_text(
        "<sdf version='1.9'><model name='box'><link name='link'>"
        "<inertial><mass>3</mass></inertial></link></model></sdf>"
    )
    start(description_file="~/box.sdf", name="crate")
    odom = graph.publisher(Odometry, "odom")
    wait_until(lambda: odom.publish(odometry(child="box/link")) or start.heard)
    assert (start.heard[0].name, start.heard[0].inertia.m) == ("crate", 3.0)


def test_a_description_from_before_the_start_and_best_effort_odometry_are_used(graph, start):
    graph.user.create_publisher(String, "robot_description", DESCRIPTION_QOS).publish(String(data=ROBOT))
    start()
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    odom = graph.publisher(Odometry, "odom", best_effort)
    wait_until(lambda: odom.publish(odometry(child="base_link")) or start.heard)
    assert start.heard[0].inertia.m == 10.0


def test_another_description_has_other_masses(start):
    source = start()
    for mass in ("9", "10"):
        source._on_description(String(data=ROBOT.replace('<mass value="9"/>', f'<mass value="{mass}"/>')))
        source._on_odometry(odometry(child="base_link"))
    wait_until(lambda: len(start.heard) == 2)
    assert start.heard[1].inertia.m == start.heard[0].inertia.m + 1


def test_each_omitted_body_is_named(graph, start):
    source = start()
    said = []
    source._warn = ThrottledWarnings(said.append, lambda: 0.0)
    odom = graph.publisher(Odometry, "odom")

    def publish():
        for frame in ("left", "right", "left"):
            odom.publish(odometry(child=frame))

    wait_until(lambda: publish() or len(said) >= 2)
    no_description = "is not published: no robot_description has been received"
    assert sorted(said) == [f"{frame!r} {no_description}" for frame in ("left", "right")]


def test_mass_properties_are_kept_once_for_each_link(start, tmp_path):
    """Anybody may publish frames with ever new prefixes."""
    file = tmp_path / "robot.urdf"
    file.write_text(ROBOT)
    source = start(description_file=str(file))
    for i in range(100):
        source._on_odometry(odometry(child=f"robot{i}/base_link"))
        source._on_odometry(odometry(child=f"robot{i}/a/wheel"))
    wait_until(lambda: start.heard)
    assert len(source._mass_properties) == 2


@pytest.mark.parametrize("things", [1, 2, MAX_SUBJECTS, MAX_SUBJECTS + 1, 3 * MAX_SUBJECTS])
def test_warnings_are_throttled_by_subject_and_in_total(things):
    now, said = 0.0, []
    warn = ThrottledWarnings(said.append, lambda: now)
    for now in (0.0, 0.5 * WARNING_INTERVAL, WARNING_INTERVAL, 1.5 * WARNING_INTERVAL):
        for thing in range(things):
            warn(f"about {thing}", partial("{} at {}".format, thing, now))
    assert said == [
        f"{thing} at {now}" for now in (0.0, WARNING_INTERVAL) for thing in range(min(things, MAX_SUBJECTS))
    ]


@pytest.fixture
def tf2_ros(monkeypatch):
    """tf2_ros, or a minimal substitute where it is not installed. Its latest buffer is ``buffers[-1]``."""
    try:
        import tf2_ros
    except ImportError:
        tf2_ros = types.ModuleType("tf2_ros")
        tf2_ros.TransformException = type("TransformException", (Exception,), {})

        class Buffer:
            def __init__(self, node):
                self.latest = {}

            def set_transform(self, transform, authority):
                self.latest[transform.header.frame_id, transform.child_frame_id] = transform

            def lookup_transform(self, target, source, time):
                if (target, source) not in self.latest:
                    raise tf2_ros.TransformException(f"no {source} in {target}")
                return self.latest[target, source]

        tf2_ros.Buffer, tf2_ros.TransformListener = Buffer, lambda buffer, node: None
        monkeypatch.setitem(sys.modules, "tf2_ros", tf2_ros)
    buffers = []

    def make(node):
        buffers.append(Buffer(node=node))
        return buffers[-1]

    Buffer = tf2_ros.Buffer
    monkeypatch.setattr(tf2_ros, "Buffer", make)
    tf2_ros.buffers = buffers
    return tf2_ros


def test_a_tf_frame_is_a_link_with_all_that_is_fixed_to_it(graph, start, tf2_ros, tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(ROBOT.replace("base_footprint", "tool"))
    start(description_file=str(file), frames=["tool", "lost"], world_frame="map", rate=1000.0)
    (buffer,) = tf2_ros.buffers

    steps = count()

    def move():
        i = next(steps)
        buffer.set_transform(transform(1 + 0.001 * i, (0.002 * i, 0, 0), 0.004 * i), "test")

    wait_until(lambda: move() or len(start.heard) >= 5)
    for state in start.heard:
        assert (state.name, state.inertia.m, state.inertia.com.x) == ("tool", 9.0, 0.25)
        assert components(state.twist.linear) == pytest.approx((2, 0, 0), abs=1e-9)
        assert components(state.twist.angular) == pytest.approx((0, 0, 4), abs=1e-9)  # over a millisecond
        seconds = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        assert state.pose.position.x == pytest.approx(2 * (seconds - 1))


def test_the_rate_is_how_often_tf_is_looked_up(start, tf2_ros, tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(ROBOT)
    source = start(description_file=str(file), frames=["tool"], world_frame="map", rate=4.0)
    assert 0.25e9 in [timer.timer_period_ns for timer in source.timers]


def test_a_static_tf_frame_is_warned_about(graph, start, tf2_ros, tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(ROBOT.replace("base_footprint", "tool"))
    logged = graph.log()
    start(description_file=str(file), frames=["tool"], world_frame="map", rate=1000.0)
    (buffer,) = tf2_ros.buffers
    buffer.set_transform(transform(0.0, (1, 0, 0)), "test")
    told = "the TF frame tool is static and is not published: give it as a STATIC body"
    wait_until(lambda: told in logged)
    assert not start.heard


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"frames": ["tool"]}, "frames needs world_frame"),
        ({"description_file": "/nowhere.urdf"}, "description_file: .*No such file"),
        ({"description_file": __file__}, "description_file: the description is not XML"),
    ],
)
def test_an_invalid_start_is_explained(start, parameters, message):
    with pytest.raises(StartError, match=message):
        start(**parameters)


def test_without_tf2_ros_it_says_what_to_install(start, monkeypatch):
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    with pytest.raises(StartError, match=r"frames needs tf2_ros, .* apt install"):
        start(frames=["tool"], world_frame="map")


def run(*arguments: str) -> subprocess.Popen:
    script = Path(__file__).resolve().parent.parent / "scripts" / "collision_response_states"
    command = [sys.executable, str(script), "--ros-args", *arguments]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def test_the_process_ends_on_a_signal(graph):
    process = run("-r", f"__ns:={graph.namespace}")
    wait_until(
        lambda: ("collision_response_states", graph.namespace) in graph.user.get_node_names_and_namespaces()
    )
    process.send_signal(signal.SIGINT)
    (line,) = process.communicate(timeout=DEADLINE)[1].splitlines()
    assert process.returncode == 0
    topics = (f"{graph.namespace}/{name}" for name in ("body_states", "odom", "robot_description"))
    says = "publishing body states on {}: motion from {}; mass and inertia from {}"
    assert line.endswith(says.format(*topics))


def test_a_start_that_fails_ends_with_1_and_one_line(ros_domain):
    process = run("-p", "frames:=[tool]")
    message = "frames needs world_frame: the inertial frame in which to publish the bodies"
    assert process.communicate(timeout=DEADLINE)[1] == f"collision_response: {message}\n"
    assert process.returncode == 1
