"""``collision_response node``."""

from __future__ import annotations

from ..ros.node import main as run_node
from ..ros.parameters import DECLARATIONS
from . import ros_node

DESCRIPTION = """Runs the node collision_response until Ctrl-C. It is the same as
ros2 run collision_response collision_response_node, and takes the same arguments after --ros-args, which
may be left out here:

  collision_response node -p friction:=0.3 -p recording.enabled:=true
  collision_response node -r __ns:=/robot1
  collision_response node --params-file params.yaml
"""


def main(arguments: list[str]) -> int:
    """Run the node, or list its parameters."""
    return ros_node.run("node", DESCRIPTION, DECLARATIONS, run_node, arguments)
