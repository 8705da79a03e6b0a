"""Prints measurements; complete ones are also stored and written to the page."""

from __future__ import annotations

import datetime
import json
import os
from typing import Any

import pages
from machine import machine

from . import page

STORED = pages.ROOT / "benchmarks" / "results"
LOAD = os.getloadavg()[0]
"""Load average before anything was started; other load affects every time."""


def finish(part: str, found: dict[str, Any], *, is_whole: bool, broken: list[str]) -> int:
    """Print results and store complete ones. Return the exit code: 1 if a promise was broken."""
    when = {"date": datetime.date.today().isoformat(), "machine": machine(), "load": LOAD}
    found = {**when, **found, "broken": broken}
    print("\n\n".join(write(found) for write in page.PARTS[part].values()))
    for promise in broken:
        print(f"==> BROKEN: {promise}")
    if is_whole:
        pages.store(found, STORED / f"reliability-{part}.json")
        pages.rewrite(pages.DOCS / "reliability.md", page.parts(stored()))
        print("==> wrote docs/reliability.md")
    return 1 if broken else 0


def stored() -> dict[str, dict[str, Any]]:
    """The last complete measurements of each part."""
    files = {part: STORED / f"reliability-{part}.json" for part in page.PARTS}
    return {part: json.loads(file.read_text()) for part, file in files.items() if file.exists()}
