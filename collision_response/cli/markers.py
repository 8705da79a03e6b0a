"""``collision_response markers``."""

from __future__ import annotations

from ..ros.markers import DECLARATIONS
from ..ros.markers import main as run_node
from . import ros_node

DESCRIPTION = """Shows what the service answers, in RViz or Foxglove: listens to its results and publishes
collision_response/markers (visualization_msgs/MarkerArray) and collision_response/wrench
(geometry_msgs/WrenchStamped). It is the same as ros2 run collision_response collision_response_markers.

  collision_response markers -p metres_per_newton_second:=0.01
"""


def main(arguments: list[str]) -> int:
    """Run the node, or list its parameters."""
    return ros_node.run("markers", DESCRIPTION, DECLARATIONS, run_node, arguments)
