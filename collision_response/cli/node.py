"""``collision_response node``."""

from __future__ import annotations

import argparse

from ..ros import node
from ..ros.parameters import DECLARATIONS

DESCRIPTION = """Runs the node collision_response until Ctrl-C. It is the same as
ros2 run collision_response collision_response_node, and takes the same arguments after --ros-args, which
may be left out here:

  collision_response node -p friction:=0.3 -p recording.enabled:=true
  collision_response node -r __ns:=/robot1
  collision_response node --params-file params.yaml
"""


def main(arguments: list[str]) -> int:
    """Run the node, or list its parameters."""
    if {"-h", "--help"} & set(arguments):
        width = max(len(declaration.name) for declaration in DECLARATIONS)
        lines = [f"  {d.name:{width}}  {d.default!r}: {d.description}" for d in DECLARATIONS]
        argparse.ArgumentParser(
            prog="collision_response node",
            usage="collision_response node [ROS ARGUMENT ...]",
            description=DESCRIPTION + "\nparameters, with their defaults:\n" + "\n".join(lines),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        ).print_help()
        return 0
    return node.main(arguments if "--ros-args" in arguments else ["--ros-args", *arguments])
