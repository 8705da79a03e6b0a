"""``collision_response demo``."""

from __future__ import annotations

import argparse

from ..demo import __main__ as demo

DESCRIPTION = """Starts a node of its own and calls it: eight systems with known answers, a break shot and a
tumbling rod. Ends with 0 if every difference is rounding. Writes recordings/demo.rrd for the rerun viewer."""


def main(arguments: list[str]) -> int:
    """Run the demo."""
    argparse.ArgumentParser(prog="collision_response demo", description=DESCRIPTION).parse_args(arguments)
    return demo.main()
