"""Node that publishes body states from a robot's odometry or TF and its description.

There is one such node for each robot or model. The service only sees the body states.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import String

from ..description import Description, quaternion
from ..msg import BodyState
from ..physics.body import Body, Twist
from ..physics.mass_properties import MassProperties
from ..physics.orientation import Quaternion
from ..physics.vector import ZERO, Vec3
from ..status import format_value
from .convert import nanoseconds, state_message, twist_message, vector_of, write_vector
from .parameters import DeclaringNode, declare, fixed, warn_of_unknown
from .process import StartError, run
from .throttled_warnings import ThrottledWarnings

DECLARATIONS = (
    fixed("name", "", "Name of the body from odometry. Empty: its child_frame_id."),
    fixed(
        "description_file", "", "URDF or SDF file with the inertias. Empty: use the topic robot_description."
    ),
    fixed("frames", [""], 'Frames of TF to publish as bodies. [""]: none.'),
    fixed("world_frame", "", "Inertial frame in which to publish bodies from TF."),
    fixed("rate", 50.0, "How often to look up TF [1/s].", 0.001, 10_000.0),
)

DESCRIPTION_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As robot descriptions are published: a late subscriber gets the last one."""

ODOMETRY_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Compatible with reliable and best-effort publishers."""

LONGEST_INTERVAL = 1.0
"""Longest time [s] between two transforms whose mean twist says something, unless TF is looked up less often.
Longer ones are pauses of TF."""


def body_state(header: Any, name: str, mass_properties: MassProperties) -> BodyState:
    """Make the state of a body at rest at the origin; pose and twist can be filled in."""
    return state_message(name, Body.of(mass_properties), header)


def from_odometry(odometry: Odometry, mass_properties: MassProperties, name: str = "") -> BodyState:
    """Make the state of the body whose body frame is ``child_frame_id``, which is also its default name.

    The twist of an odometry is in axes of the child frame, that of a body state in axes of
    ``header.frame_id``.

    Raises:
        ValueError: if the quaternion is 0, or a number is not finite.
    """
    orientation, twist = odometry.pose.pose.orientation, odometry.twist.twist
    rotation = _nonzero(orientation).rotation()
    linear, angular = (rotation.to_world(vector_of(v)) for v in (twist.linear, twist.angular))
    state = body_state(odometry.header, name or odometry.child_frame_id, mass_properties)
    state.pose = odometry.pose.pose
    state.twist = twist_message(Twist(linear, angular))
    _check_finite(vector_of(state.pose.position), linear, angular)
    return state


def from_transforms(
    earlier: TransformStamped,
    later: TransformStamped,
    mass_properties: MassProperties,
    longest: float = LONGEST_INTERVAL,
) -> BodyState:
    """Make the state at the later of two transforms of a body frame in the inertial frame.

    Its twist is the mean twist between them. That is the twist at the middle of the interval ``T``, so it
    is wrong by ``T/2`` times the acceleration. If the body rotates by more than half a turn meanwhile,
    the twist is that of the shorter rotation.

    Raises:
        ValueError: if a quaternion is 0, a number not finite, or if the second stamp is not after the first,
            or more than ``longest`` [s] after it.
    """
    t = (nanoseconds(later.header.stamp) - nanoseconds(earlier.header.stamp)) * 1e-9
    if not t > 0:
        raise ValueError(f"the second transform must be later than the first; it is {t} s later")
    if t > longest:
        raise ValueError(f"there is no transform in the {t:g} s before, so the twist is unknown")
    before, after = earlier.transform, later.transform
    position = vector_of(after.translation)
    displacement = position - vector_of(before.translation)
    state = body_state(later.header, later.child_frame_id, mass_properties)
    write_vector(state.pose.position, position)
    state.pose.orientation = after.rotation
    angular_velocity = _rotation_vector(_nonzero(before.rotation), _nonzero(after.rotation)) / t
    state.twist = twist_message(Twist(displacement / t, angular_velocity))
    _check_finite(position, displacement / t)
    return state


def _check_finite(*vectors: Vec3) -> None:
    for vector in vectors:
        if not all(map(math.isfinite, vector)):
            raise ValueError(f"position and twist must be finite, one has {format_value(tuple(vector))}")


def _rotation_vector(before: Quaternion, after: Quaternion) -> Vec3:
    """Vector of the rotation ``after before^-1 = (v, w)``, in world axes and by at most half a turn."""
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


class BodyStatePublisher(DeclaringNode):
    """Publishes the states of one robot's bodies.

    Interfaces (all may be remapped):
        subscription ``odom``: moves the robot as one body, with its joints at 0.
        subscription ``robot_description``: mass and inertia, unless ``description_file`` is set.
        subscriptions ``/tf`` and ``/tf_static``, if ``frames`` is set: move links, each together with the
            links that are fixed to it.
        publisher ``body_states``: the topic to which the service subscribes.

    Raises:
        StartError: if ``frames`` is set and TF is not installed, or the description cannot be read.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("collision_response_states", **options)
        warn_of_unknown(self, declare(self, DECLARATIONS))
        start = {declaration.name: self.get_parameter(declaration.name).value for declaration in DECLARATIONS}
        self._warn = ThrottledWarnings(self.get_logger().warning)
        self._name: str = start["name"]
        self._description: Description | None = None
        self._mass_properties: dict[tuple[str, bool], MassProperties] = {}
        self._publisher = self.create_publisher(BodyState, "body_states", 10)
        description = os.path.expanduser(start["description_file"])
        if description:
            try:
                self._set_description(Path(description).read_bytes())
            except (OSError, ValueError) as error:
                raise StartError(f"description_file: {error}") from None
        else:
            subscription = self.create_subscription(
                String, "robot_description", self._on_description, DESCRIPTION_QOS
            )
            description = subscription.topic_name
        odometry = self.create_subscription(Odometry, "odom", self._on_odometry, ODOMETRY_QOS).topic_name
        frames = [frame for frame in start["frames"] if frame]
        if frames:
            self._follow_frames(frames, start["world_frame"], start["rate"])
        sources = [odometry, *(f"the TF frame {frame}" for frame in frames)]
        self.get_logger().info(
            f"publishing body states on {self._publisher.topic_name}: motion from {', '.join(sources)}; "
            f"mass and inertia from {description}"
        )

    def _follow_frames(self, frames: list[str], world_frame: str, rate: float) -> None:
        if not world_frame:
            raise StartError("frames needs world_frame: the inertial frame in which to publish the bodies")
        try:
            import tf2_ros
        except ImportError:
            raise StartError(
                "frames needs tf2_ros, which is not installed: apt install ros-$ROS_DISTRO-tf2-ros-py"
            ) from None
        buffer = tf2_ros.Buffer(node=self)  # the buffer is emptied when the node's clock is set back
        self._listener = tf2_ros.TransformListener(buffer, self)
        latest: dict[str, TransformStamped] = {}
        longest = max(LONGEST_INTERVAL, 2 / rate)

        def publish_frames() -> None:
            for frame in frames:
                try:
                    transform = buffer.lookup_transform(world_frame, frame, Time())
                except tf2_ros.TransformException as error:
                    self._warn(f"transforms of {frame}", partial(str, error))
                    continue
                before, latest[frame] = latest.get(frame, transform), transform
                if before is transform and not nanoseconds(transform.header.stamp):
                    reason = "is static and is not published: give it as a STATIC body"
                    self._warn(f"transforms of {frame}", partial("the TF frame {} {}".format, frame, reason))
                if nanoseconds(before.header.stamp) < nanoseconds(transform.header.stamp):
                    self._publish(frame, False, partial(from_transforms, before, transform, longest=longest))

        self.create_timer(1 / rate, publish_frames)

    def _on_description(self, message: String) -> None:
        try:
            self._set_description(message.data)
        except ValueError as error:
            self.get_logger().error(f"robot_description: {error}")

    def _set_description(self, text: str | bytes) -> None:
        self._description = Description.read(text)
        self._mass_properties.clear()

    def _on_odometry(self, odometry: Odometry) -> None:
        frame = odometry.child_frame_id
        self._publish(frame, True, partial(from_odometry, odometry, name=self._name))

    def _publish(self, frame: str, locked: bool, state_of: Callable[..., BodyState]) -> None:
        try:
            self._publisher.publish(state_of(mass_properties=self._mass_properties_of(frame, locked)))
        except ValueError as error:
            self._warn(frame, partial("{!r} is not published: {}".format, frame, error))

    def _mass_properties_of(self, frame: str, locked: bool) -> MassProperties:
        """Mass properties of a link and all that moves with it. A prefix of its name ends in ``/``.

        With ``locked`` joints that is the whole robot.
        """
        if self._description is None:
            raise ValueError("no robot_description has been received")
        link = frame if frame in self._description.inertials else frame.rpartition("/")[2]
        if (link, locked) not in self._mass_properties:
            self._mass_properties[link, locked] = self._description.mass_properties(link, locked=locked)
        return self._mass_properties[link, locked]


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM, and return the exit code."""
    return run(BodyStatePublisher, args)
