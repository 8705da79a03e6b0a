"""States of bodies from what robots publish: odometry or TF, and the robot's description.

A node of its own, one for each robot or model, so that the service knows nothing of all that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import String

from ..description import Description, quaternion
from ..msg import BodyState
from ..physics.body import Twist
from ..physics.mass_properties import MassProperties
from ..physics.orientation import Quaternion
from ..physics.vector import ZERO, Vec3
from .convert import twist_message, vector_message, vector_of
from .parameters import Declaration, declare
from .process import StartError, run
from .serialized import nanoseconds
from .throttled_warnings import ThrottledWarnings

DECLARATIONS = (
    Declaration("name", "", "Of the body from odometry. Empty: its child_frame_id.", read_only=True),
    Declaration(
        "description_file",
        "",
        "URDF or SDF file with the inertias. Empty: the topic robot_description.",
        read_only=True,
    ),
    Declaration("frames", [""], "Frames of TF that are bodies; '' for none.", read_only=True),
    Declaration("world_frame", "", "Inertial frame in which bodies from TF are given.", read_only=True),
    Declaration("rate", 50.0, "How often TF is looked up [1/s].", 0.001, 10_000.0, True),
)

DESCRIPTION_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As robot descriptions are published: whoever comes late gets the last one."""

ODOMETRY_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""It takes publishers of either kind."""


def body_state(header: Any, name: str, matter: MassProperties) -> BodyState:
    """The state of a body at rest at the origin: pose and twist are to be filled in.

    Args:
        header: stamp, and inertial frame.
        name: of the body.
        matter: of the body, in axes of its frame.
    """
    state = BodyState(header=header, name=name)
    inertia = state.inertia
    inertia.m, inertia.com = matter.mass, vector_message(matter.com)
    inertia.ixx, inertia.ixy, inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz = matter.inertia
    return state


def from_odometry(odometry: Odometry, matter: MassProperties, name: str = "") -> BodyState:
    """The state of the body whose origin is that of ``child_frame_id``.

    The twist of an odometry is in axes of the child frame, that of a state in those of ``header.frame_id``.

    Args:
        odometry: its pose must have a quaternion of length other than 0.
        matter: of the body, in axes of the child frame.
        name: of the body; empty: its ``child_frame_id``.

    Raises:
        ValueError: the quaternion is 0, or not finite.
    """
    turn, twist = odometry.pose.pose.orientation, odometry.twist.twist
    rotation = _nonzero(turn).rotation()
    linear, angular = (rotation.to_world(vector_of(v)) for v in (twist.linear, twist.angular))
    state = body_state(odometry.header, name or odometry.child_frame_id, matter)
    state.pose = odometry.pose.pose
    state.twist = twist_message(Twist(linear, angular))
    return state


def from_transforms(earlier: TransformStamped, later: TransformStamped, matter: MassProperties) -> BodyState:
    """The state at the later of two transforms; its twist is the mean one between them.

    The mean is the twist of half their interval ``T`` before, and so wrong by ``T/2`` times the acceleration.
    Of a rotation by more than half a turn it takes the shorter way.

    Args:
        earlier: of the body's frame in the inertial one.
        later: the same, at another stamp.
        matter: of the body, in axes of its frame.

    Raises:
        ValueError: a quaternion is 0 or not finite, or the second stamp is not after the first.
    """
    t = (nanoseconds(later.header.stamp) - nanoseconds(earlier.header.stamp)) * 1e-9
    if not t > 0:
        raise ValueError(f"the transforms must be some time apart, not {t} s")
    before, after = earlier.transform, later.transform
    place = vector_of(after.translation)
    way = place - vector_of(before.translation)
    state = body_state(later.header, later.child_frame_id, matter)
    state.pose.position.x, state.pose.position.y, state.pose.position.z = place
    state.pose.orientation = after.rotation
    spin = _turn(_nonzero(before.rotation), _nonzero(after.rotation)) / t
    state.twist = twist_message(Twist(way / t, spin))
    return state


def _turn(before: Quaternion, after: Quaternion) -> Vec3:
    """The rotation vector in world axes, at most half a turn: of ``after before^-1 = (v, w)``."""
    p, q = Vec3(*before[:3]), Vec3(*after[:3])
    v, w = q * before.w - p * after.w - q.cross(p), after.w * before.w + q.dot(p)
    length = v.norm()
    if not length:
        return ZERO
    if w < 0:
        v, w = -v, -w
    return v * (2 * math.atan2(length, w) / length)


def _nonzero(q: Any) -> Quaternion:
    return quaternion((q.x, q.y, q.z, q.w), "orientation")


class BodyStatePublisher(Node):
    """Publishes the states of one robot's bodies.

    Interfaces (all may be remapped):
        subscription ``odom``: the robot as one body, its joints held at 0.
        subscription ``robot_description``: its mass and inertia, unless a file has them.
        ``/tf`` and ``/tf_static``, if ``frames`` are asked for: links, each with what is fixed to it.
        publisher ``body_states``: where the service listens.

    Args:
        options: those of :class:`rclpy.node.Node`.

    Raises:
        StartError: TF is asked for and is not installed, or the description cannot be read.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "collision_response_states", automatically_declare_parameters_from_overrides=True, **options
        )
        declare(self, DECLARATIONS)
        start = {declaration.name: self.get_parameter(declaration.name).value for declaration in DECLARATIONS}
        self._report = ThrottledWarnings(self.get_logger().warning)
        self._name: str = start["name"]
        self._description: Description | None = None
        self._matter: dict[tuple[str, bool], MassProperties] = {}
        self._publisher = self.create_publisher(BodyState, "body_states", 10)
        if start["description_file"]:
            try:
                self._describe(Path(start["description_file"]).read_text())
            except (OSError, ValueError) as error:
                raise StartError(f"description_file: {error}") from None
        else:
            self.create_subscription(String, "robot_description", self._hear_description, DESCRIPTION_QOS)
        self.create_subscription(Odometry, "odom", self._hear_odometry, ODOMETRY_QOS)
        frames = [frame for frame in start["frames"] if frame]
        if frames:
            self._follow(frames, start["world_frame"], start["rate"])

    def _follow(self, frames: list[str], world: str, rate: float) -> None:
        if not world:
            raise StartError("frames needs world_frame: the inertial frame in which the bodies are given")
        try:
            import tf2_ros
        except ImportError:
            raise StartError(
                "frames needs tf2_ros, which is not installed: apt install ros-$ROS_DISTRO-tf2-ros-py"
            ) from None
        buffer = tf2_ros.Buffer(node=self)  # whose clock empties it when it is set back
        self._listener = tf2_ros.TransformListener(buffer, self)
        latest: dict[str, TransformStamped] = {}

        def look() -> None:
            for frame in frames:
                try:
                    found = buffer.lookup_transform(world, frame, Time())
                except tf2_ros.TransformException as error:
                    self._report(f"transforms of {frame}", str(error))
                    continue
                before, latest[frame] = latest.get(frame), found
                if before is not None and nanoseconds(found.header.stamp) > nanoseconds(before.header.stamp):
                    self._publish(frame, False, partial(from_transforms, before, found))

        self.create_timer(1 / rate, look)

    def _hear_description(self, message: String) -> None:
        try:
            self._describe(message.data)
        except ValueError as error:
            self.get_logger().error(f"robot_description: {error}")

    def _describe(self, text: str) -> None:
        self._description = Description.read(text)
        self._matter.clear()

    def _hear_odometry(self, odometry: Odometry) -> None:
        frame = odometry.child_frame_id
        self._publish(frame, True, partial(from_odometry, odometry, name=self._name))

    def _publish(self, frame: str, locked: bool, state_of: Callable[..., BodyState]) -> None:
        try:
            self._publisher.publish(state_of(matter=self._matter_of(frame, locked)))
        except ValueError as error:
            self._report(frame, f"{frame!r} is left out: {error}")

    def _matter_of(self, frame: str, locked: bool) -> MassProperties:
        """Raises: ValueError: nobody knows."""
        if self._description is None:
            raise ValueError("no robot_description has been received")
        known = self._matter.get((frame, locked))
        if known is None:
            links = self._description.inertials
            link = frame if frame in links else frame.rpartition("/")[2]  # without a frame_prefix
            known = self._matter[frame, locked] = self._description.mass_properties(link, locked=locked)
        return known


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(BodyStatePublisher, args)
