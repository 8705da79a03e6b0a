"""Commands that run a node: its help lists the parameters."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from ..ros.parameters import Declaration


def run(
    command: str,
    description: str,
    declarations: Sequence[Declaration],
    main: Callable[[list[str]], int],
    arguments: list[str],
) -> int:
    """Run a node with ROS arguments, before which ``--ros-args`` may be left out; or show help."""
    if {"-h", "--help"} & set(arguments):
        width = max(len(declaration.name) for declaration in declarations)
        lines = [f"  {d.name:{width}}  {d.default!r}: {d.description}" for d in declarations]
        argparse.ArgumentParser(
            prog=f"collision_response {command}",
            usage=f"collision_response {command} [ROS ARGUMENT ...]",
            description=description + "\nparameters, with their defaults:\n" + "\n".join(lines),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        ).print_help()
        return 0
    return main(arguments if "--ros-args" in arguments else ["--ros-args", *arguments])
