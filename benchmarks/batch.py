"""Batches on one core, compared with plain C: pairs of bodies in space, without orientation."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from cases import flat_boxes, tables, with_immovable
from timing import Call, Samples, interleaved, ratio, spread

from collision_response import Geometry, ImpactModel, Law, Precision, resolve, resolve_scene
from collision_response.batch import body_rows, contact_rows, resolve_batch, resolve_scenes
from collision_response.batch.one_by_one import body_of, contact_of

SIZES = (1_000, 1_000_000)
LAWS = (Law.FRICTIONLESS, Law.COULOMB)
TOLERANCE = 1e-9
C, C_TUNED = "C", "C, tuned"
FLAGS = {
    C: ("-O3", "-march=native"),
    C_TUNED: ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math"),
}
"""Compiler flags as a user sets them, and tuned so that roots and choices are vectorised too."""


def c_libraries() -> dict[str, ctypes.CDLL]:
    """The C loops, by the way they were compiled; empty if there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return {}
    folder, source = Path(tempfile.mkdtemp()), Path(__file__).with_name("impacts.c")
    libraries = {}
    for way, flags in FLAGS.items():
        library = folder / f"{len(flags)}.so"
        subprocess.run([compiler, *flags, "-shared", "-fPIC", "-o", library, source], check=True)
        libraries[way] = ctypes.CDLL(str(library))
    return libraries


def by_c(library: ctypes.CDLL, law: Law, bodies: np.ndarray, contacts: np.ndarray) -> tuple[Call, np.ndarray]:
    """A call of the C loop, and the array into which it writes the impulses."""
    n = bodies.shape[-1]
    velocity, spin, impulse = np.empty((3, 2, n)), np.empty((3, 2, n)), np.empty((3, n))
    arrays = (bodies, contacts, velocity, spin, impulse)
    function = library[f"{law.name.lower()}_impacts"]
    function.restype = None
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
    return lambda kept=arrays: function(ctypes.c_size_t(n), *pointers), impulse


def by_batch(bodies: np.ndarray, contacts: np.ndarray, model: ImpactModel, **options: Any) -> Call:
    """A call of ``resolve_batch`` with preallocated results."""
    out = resolve_batch(bodies, contacts, model, **options)
    return lambda: resolve_batch(bodies, contacts, model, out=out, **options)


def runs_of(n: int, libraries: dict[str, ctypes.CDLL]) -> dict[str, Call]:
    """The calls that are timed for one size, by name."""
    bodies, contacts = tables(Geometry.SPATIAL, n)
    flat = tables(Geometry.PLANAR, n)
    source = np.ones(40 * n + 15 * n)
    target = np.empty_like(source)
    runs: dict[str, Call] = {"memcpy": lambda: np.copyto(target, source)}
    for law in LAWS:
        name = law.name
        ours = resolve_batch(bodies, contacts, ImpactModel(law)).impulse
        for way, library in libraries.items():
            runs[f"{way}, {name}"], impulse = by_c(library, law, bodies, contacts)
            runs[f"{way}, {name}"]()
            assert np.allclose(impulse, ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max()), name
        runs[name] = by_batch(bodies, contacts, ImpactModel(law))
        runs[f"{name}, with bound"] = by_batch(bodies, contacts, ImpactModel(law, tolerance=TOLERANCE))
        runs[f"{name}, EXTENDED"] = by_batch(bodies, contacts, ImpactModel(law, precision=Precision.EXTENDED))
    coulomb = ImpactModel(Law.COULOMB)
    runs["COULOMB, with immovable bodies"] = by_batch(
        with_immovable(bodies, Geometry.SPATIAL), contacts, coulomb
    )
    reported = resolve_batch(bodies, contacts, coulomb, report=True)
    runs["COULOMB, with a report"] = lambda: resolve_batch(bodies, contacts, coulomb, out=reported)
    table, pairs = bodies.reshape(len(bodies), -1), np.arange(2 * n).reshape(2, n)
    runs["COULOMB, pairs of one table"] = by_batch(table, contacts, coulomb, pairs=pairs)
    runs["COULOMB, planar"] = by_batch(*flat, coulomb)
    runs["MOREAU"] = by_batch(bodies, contacts, ImpactModel(Law.MOREAU))
    runs["ROUTH_STRONGE, planar"] = by_batch(*flat, ImpactModel(Law.ROUTH_STRONGE))
    if n < 100_000:
        runs["ROUTH_STRONGE, 1e-9"] = by_batch(
            bodies, contacts, ImpactModel(Law.ROUTH_STRONGE, tolerance=TOLERANCE)
        )
    return runs


def measure(_: object, say: Callable[[str], object]) -> dict[str, Any]:
    """Measure the time per contact [ns] by size and name, and the targets."""
    libraries = c_libraries()
    ns: dict[str, dict[str, dict[str, float]]] = {}
    samples: dict[int, Samples] = {}
    for n in SIZES:
        size = f"{n:.0e}".replace("e+0", "e")
        say(f"    {size} contacts")
        runs = runs_of(n, libraries)
        samples[n] = interleaved(runs, rounds=41 if n < 100_000 else 7, seconds=0.01)
        ns[size] = {name: spread([1e9 * t / n for t in times]) for name, times in samples[n].items()}
    return {"ns": ns, "targets": targets(samples)}


def targets(samples: dict[int, Samples]) -> list[dict[str, Any]]:
    """The targets and their measured ratios."""
    few, many = SIZES
    found = []

    def against(what: str, most: float, n: int, numerator: str, denominator: str) -> None:
        measured = ratio(samples[n], numerator, denominator)
        found.append({"what": f"batch, {what}", "most": most, "measured": measured})

    for n, size, mosts in ((few, "1e3", (1.3, 1.5)), (many, "1e6", (1.5, 1.8))):
        for law, most in zip(LAWS, mosts, strict=True):
            name = law.name
            against(f"{name}, N = {size}, against C", most, n, name, f"C, {name}")
            against(f"{name}, N = {size}, against tuned C", most, n, name, f"{C_TUNED}, {name}")
            bounded = f"{name}, N = {size}, with bounds to {TOLERANCE:g}, against C"
            against(bounded, 5.0, n, f"{name}, with bound", f"C, {name}")
            against(f"{name}, N = {size}, EXTENDED, against C", 12.0, n, f"{name}, EXTENDED", f"C, {name}")
        what = f"COULOMB, N = {size}, with immovable bodies, against without"
        against(what, 1.2, n, "COULOMB, with immovable bodies", "COULOMB")
    against(
        "ROUTH_STRONGE in the plane, against COULOMB", 5.0, few, "ROUTH_STRONGE, planar", "COULOMB, planar"
    )
    against("ROUTH_STRONGE in space to 1e-9, against COULOMB", 150.0, few, "ROUTH_STRONGE, 1e-9", "COULOMB")
    bodies, contacts = tables(Geometry.SPATIAL, many)
    calls = {str(n): by_batch(bodies, contacts, ImpactModel(Law.COULOMB), workers=n) for n in (1, 2)}
    workers = interleaved(calls, rounds=11, seconds=0.01, clock=time.perf_counter)
    found.append(
        {"what": "batch, N = 1e6: one worker against two", "least": 1.7, "measured": ratio(workers, "1", "2")}
    )
    return found + boxes()


BOXES = 500
"""Boxes of :func:`boxes`."""


def boxes() -> list[dict[str, Any]]:
    """Targets for flat boxes: one call for all, and single impacts, also as one scene."""
    tables_and_pairs = bodies, contacts, pairs = flat_boxes(BOXES)
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    scenes = [[body_of(body_row, bodies[:, i]), body_of(body_row, bodies[:, BOXES])] for i in range(BOXES)]
    corners = [contact_of(contact_row, contacts[:, i]) for i in range(4)]
    of_one = (
        [scene[0] for scene in scenes] + [scenes[0][1]],
        [(i, BOXES) for i in range(BOXES)],
        corners[:1] * BOXES,
    )
    calls: dict[str, Call] = {
        "one call for all": lambda: resolve_scenes(*tables_and_pairs[:2], pairs=pairs),
        "single impacts": lambda: [resolve(*scene, corners[0]) for scene in scenes],
        "one scene of single contacts": lambda: resolve_scene(*of_one),
    }
    samples = interleaved(calls, rounds=11, seconds=0.05)
    what = f"{BOXES} flat boxes with friction"
    return [
        {"what": f"{what}: one call for all, against single impacts", "most": 10.0,
         "measured": ratio(samples, "one call for all", "single impacts")},
        {"what": f"{BOXES} boxes with one contact each: one scene, against single impacts", "most": 1.0,
         "measured": ratio(samples, "one scene of single contacts", "single impacts")},
    ]  # fmt: skip
