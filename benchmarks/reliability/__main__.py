"""``make faults``, ``fuzz``, ``states``, ``soak``, and ``make reliability`` for these: the node from outside.

``make twice`` is for the tests. With arguments they only print. Without, they write benchmarks/results and
docs/reliability.md too.
"""

from __future__ import annotations

import importlib
import json
import signal
import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parent.parent)

CHILDREN = ("client", "listener", "publisher", "raw", "values", "look", "known", "newcomers")
PARTS = ("faults", "fuzz", "states", "soak")


def main() -> int:
    """Be a child, or measure one part or all."""
    name, *arguments = sys.argv[1:]
    if name in CHILDREN:
        from reliability.child import Parent

        importlib.import_module(f"reliability.{name}").run(json.loads(arguments[0]), Parent())
        return 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # not without ending what was started
    names = PARTS if name == "all" else (name,)
    return max([importlib.import_module(f"reliability.{part}").main(arguments) for part in names])


if __name__ == "__main__":
    sys.exit(main())
