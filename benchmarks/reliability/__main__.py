"""``make faults``, ``fuzz``, ``states``, ``soak`` test the node from outside; ``make reliability`` runs all.

``make twice`` tests the test suite. With arguments these only print; without, they also write
benchmarks/results and docs/reliability.md.
"""

from __future__ import annotations

import importlib
import json
import signal
import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parent.parent)

PARTS = ("faults", "fuzz", "states", "soak")


def main() -> int:
    """Run as a child process, or measure one part or all."""
    name, *arguments = sys.argv[1:]
    if name not in (*PARTS, "all", "twice"):  # the module of a child process
        from reliability.child_process import Parent

        importlib.import_module(f"reliability.{name}").run(json.loads(arguments[0]), Parent())
        return 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that started processes are ended
    names = PARTS if name == "all" else (name,)
    return max([importlib.import_module(f"reliability.{part}").main(arguments) for part in names])


if __name__ == "__main__":
    sys.exit(main())
