"""Targets for the package itself: tightness of its error bounds, lines of code, import time."""

from __future__ import annotations

import random
import subprocess
import sys
from statistics import median
from typing import Any

from cases import Scene
from pages import ROOT
from truth import as_request, true_error, truth_of

from collision_response import ImpactModel, Law, Precision, StatusCode, resolve

PACKAGE = ROOT / "collision_response"
SOURCES = {".py", ".hpp", ".cpp", ".in", ".txt"}
BOXES = 400

IMPORT = "import time; t = time.perf_counter(); import collision_response; print(time.perf_counter() - t)"


def measure(*_: object) -> dict[str, Any]:
    """Measure the targets."""
    found = [
        {
            "what": f"error bound over true error, boxes, {law.name}, median",
            "most": most,
            "measured": tightness(law),
        }
        for law, most in ((Law.FRICTIONLESS, 70.0), (Law.COULOMB, 400.0))
    ]
    found.append({"what": "lines of the package, Python and C++", "most": 6000.0, "measured": lines()})
    found.append({"what": "`import collision_response` [s]", "most": 0.15, "measured": import_time()})
    return {"targets": found}


def tightness(law: Law) -> float:
    """Median of bound over error, for boxes that approach and answers with an error."""
    from attacks import random_boxes

    draw, quotients = random.Random(5), []
    model = ImpactModel(law, precision=Precision.DOUBLE)
    while len(quotients) < BOXES:
        scene = Scene(*as_request(random_boxes(draw)))
        impact = resolve(*scene, model)
        error = true_error(impact, truth_of(scene, law))
        if impact.status is StatusCode.OK and error:
            quotients.append(impact.error_bound / error)
    return median(quotients)


def lines() -> int:
    """Number of lines of the package, without the demo."""
    demo = PACKAGE / "demo"
    files = [path for path in PACKAGE.rglob("*") if path.suffix in SOURCES and demo not in path.parents]
    return sum(len(path.read_bytes().splitlines()) for path in files)


def import_time() -> float:
    """Import time including NumPy [s]: the best of some runs, with the files in memory."""
    times = [
        float(subprocess.run([sys.executable, "-I", "-c", IMPORT], capture_output=True, check=True).stdout)
        for _ in range(7)
    ]
    return min(times)
