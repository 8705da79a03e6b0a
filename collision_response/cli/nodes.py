"""The commands that run a node."""

from __future__ import annotations

import argparse
from types import ModuleType

DESCRIPTIONS = {
    "node": """Runs the node collision_response until Ctrl-C, like
ros2 run collision_response collision_response_node. It takes the same arguments, but --ros-args may be
left out:

  collision_response node -p friction:=0.3 -p recording.enabled:=true
  collision_response node -r __ns:=/robot1
  collision_response node --params-file params.yaml
""",
    "states": """Publishes the states of a robot for the service, as BodyState on body_states, from its
odometry (topic odom) and its description (topic robot_description: URDF or SDF). It is the same as
ros2 run collision_response collision_response_states.

  collision_response states -r odom:=/robot1/odom -r robot_description:=/robot1/robot_description
  collision_response states -p description_file:=box.sdf -r odom:=/model/box/odometry -p name:=box
  collision_response states -p 'frames:=[tool0]' -p world_frame:=odom
""",
    "markers": """Shows the service's answers in RViz or Foxglove: subscribes to its results and publishes
collision_response/markers (visualization_msgs/MarkerArray) and collision_response/wrench
(geometry_msgs/WrenchStamped). It is the same as ros2 run collision_response collision_response_markers.

  collision_response markers -p metres_per_newton_second:=0.01
""",
}


def run(command: str, node: ModuleType, arguments: list[str]) -> int:
    """Run a node with ROS arguments, with or without ``--ros-args`` before them, or print its help."""
    if {"-h", "--help"} & set(arguments):
        width = max(len(declaration.name) for declaration in node.DECLARATIONS)
        lines = [f"  {d.name:{width}}  {d.default!r}: {d.full_description()}" for d in node.DECLARATIONS]
        argparse.ArgumentParser(
            prog=f"collision_response {command}",
            usage=f"collision_response {command} [ROS ARGUMENT ...]",
            description=DESCRIPTIONS[command] + "\nparameters, with their defaults:\n" + "\n".join(lines),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        ).print_help()
        return 0
    return node.main(arguments if "--ros-args" in arguments else ["--ros-args", *arguments])
