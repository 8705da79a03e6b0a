"""``collision_response states``."""

from __future__ import annotations

from ..ros.sources import DECLARATIONS
from ..ros.sources import main as run_node
from . import ros_node

DESCRIPTION = """Tells the service where a robot is: publishes BodyState on body_states, from the robot's
odometry (topic odom) and its description (topic robot_description: URDF or SDF). It is the same as
ros2 run collision_response collision_response_states.

  collision_response states -r odom:=/robot1/odom -r robot_description:=/robot1/robot_description
  collision_response states -p description_file:=box.sdf -r odom:=/model/box/odometry -p name:=box
  collision_response states -p 'frames:=[tool0]' -p world_frame:=map
"""


def main(arguments: list[str]) -> int:
    """Run the node, or list its parameters."""
    return ros_node.run("states", DESCRIPTION, DECLARATIONS, run_node, arguments)
