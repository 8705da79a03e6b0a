"""``make faults``, ``make fuzz``, ``make states``, ``make soak`` and ``make reliability``: the node from outside.

With arguments they only print, for a look. Without they also write benchmarks/results and docs/reliability.md.
"""

from __future__ import annotations

import importlib
import json
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
    names = PARTS if name == "all" else (name,)
    return max([importlib.import_module(f"reliability.{part}").main(arguments) for part in names])


if __name__ == "__main__":
    sys.exit(main())
