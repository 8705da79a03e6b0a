"""Batches against the limit (C), the floor (memcpy) and what a person would write (cross and solve).

    python benchmarks/batch.py            # about two minutes

All figures of a row come from one run, in turns: the ratios are medians over the turns, so that a busy
machine slows both sides. The C kernel is compiled on the spot.
"""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import tempfile
import threading
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from collision_response import Geometry, ImpactModel, Law, Precision
from collision_response.batch import BatchResult, prepare_batch, resolve_batch
from collision_response.batch.backends import Backend, prepare
from collision_response.batch.more_digits import MANY
from collision_response.batch.problem import Problem, contact_count
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.numerics import compiled

Array = np.ndarray[Any, Any]
Runs = dict[str, Callable[[], object]]

SIZES = (100, 1_000, 10_000, 1_000_000)
FRICTIONLESS = ImpactModel(Law.FRICTIONLESS)
TARGETS = {
    "NumPy / C, N = 1e6": 3.5,
    "NumPy / cross and solve, N = 1e6": 0.2,
    "compiled / C, N = 1e6": 1.5,
    "compiled / C, N = 1e3": 1.5,
    "its loop alone / C, N = 1e3": 1.5,
    "EXTENDED compiled / C, N = 1e6": 10.0,
    "planar / spatial, NumPy": 0.45,
    "point / spatial, NumPy": 0.25,
    "extra memory at 1e6, NumPy [MiB]": 64.0,
}


def scene(geometry: Geometry, n: int, dtype: Any = np.float64) -> tuple[Array, Array]:
    """Pairs of movable bodies made of a few points, that meet at random."""
    random = np.random.default_rng(0)
    of, at = body_rows(geometry), contact_rows(geometry)
    bodies, contacts = random.normal(size=(of.height, 2, n)), random.normal(size=(at.height, n))
    bodies[of.mass] = random.uniform(0.5, 2.0, size=(1, 2, n))
    if geometry is Geometry.PLANAR:
        bodies[of.inertia] = random.uniform(0.5, 2.0, size=(1, 2, n))
    if geometry is Geometry.SPATIAL:
        tensor = np.zeros((6, 2, n))
        for _ in range(4):
            x, y, z = random.normal(size=(3, 2, n))
            tensor += (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
        bodies[of.inertia] = tensor
    contacts[at.restitution] = random.uniform(size=n)
    contacts[at.friction] = random.uniform(size=n)
    return bodies.astype(dtype), contacts.astype(dtype)


def c_library() -> ctypes.CDLL | None:
    """The C kernel; ``None`` where there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    library = Path(tempfile.mkdtemp()) / "kernel.so"
    source = Path(__file__).with_name("kernel.c")
    subprocess.run([compiler, "-O3", "-march=native", "-shared", "-fPIC", "-o", library, source], check=True)
    return ctypes.CDLL(str(library))


def by_c(library: ctypes.CDLL, bodies: Array, contacts: Array, out: BatchResult) -> Callable[[], None]:
    function = library[f"impacts_{bodies.dtype.name}"]
    function.restype = None
    arrays = (bodies, contacts, out.velocity, out.angular_velocity, out.impulse)
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
    return lambda: function(ctypes.c_size_t(bodies.shape[-1]), *pointers)


def by_cross_and_solve(bodies: Array, contacts: Array) -> Callable[[], object]:
    """Vectors as rows, tensors as matrices, ``np.cross`` and ``np.linalg.solve``."""
    of, at = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    mass, (xx, xy, xz, yy, yz, zz) = bodies[0][..., None], bodies[of.inertia]
    tensor = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), (0, 1), (-2, -1)).copy()
    position, velocity, spin = (
        np.moveaxis(bodies[rows], 0, -1).copy() for rows in (of.position, of.velocity, of.angular_velocity)
    )
    point, normal = contacts[at.position].T.copy(), contacts[at.normal].T.copy()
    restitution = contacts[at.restitution][0]

    def run() -> object:
        r = point - position
        arm = np.cross(r, normal)
        turn = np.linalg.solve(tensor, arm[..., None])[..., 0]
        at_contact = velocity + np.cross(spin, r)
        n_u = ((at_contact[0] - at_contact[1]) * normal).sum(-1)
        n_k_n = (1 / mass).sum(0)[:, 0] * (normal * normal).sum(-1) + (arm * turn).sum(-1).sum(0)
        j = np.where(n_u < 0, -(1 + restitution) * n_u / n_k_n, 0.0)[:, None]
        impulse = normal * j
        signed = np.stack([impulse, -impulse])
        return velocity + signed / mass, spin + turn * np.stack([j, -j]), impulse

    return run


def by_batch(
    bodies: Array, contacts: Array, backend: Backend, model: ImpactModel = FRICTIONLESS
) -> Callable[[], object]:
    out = resolve_batch(bodies, contacts, model, backend=backend)
    return lambda: resolve_batch(bodies, contacts, model, out=out, backend=backend)


def by_loop(bodies: Array, contacts: Array) -> Callable[[], object]:
    """The compiled loop alone, without what :func:`resolve_batch` looks after."""
    out = resolve_batch(bodies, contacts, FRICTIONLESS, backend=Backend.COMPILED)
    problem = Problem(Geometry.SPATIAL, Law.FRICTIONLESS)
    run = prepare(Backend.COMPILED, problem, bodies.dtype).run
    given = {"bodies": bodies, "contacts": contacts[: contact_count(problem)]}
    results = {"velocity": out.velocity, "angular_velocity": out.angular_velocity, "impulse": out.impulse}
    arrays = {**given, **results, "status": out.status[np.newaxis]}
    return lambda: run(arrays)


def in_turns(runs: Runs, n: int, turns: int = 9) -> dict[str, list[float]]:
    """Nanoseconds per contact of each, ``turns`` times."""
    repeat = max(1, 100_000 // n)
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(turns):
        for name, run in runs.items():
            start = time.perf_counter()
            for _ in range(repeat):
                run()
            spent[name].append((time.perf_counter() - start) / repeat / n * 1e9)
    return spent


def ratio(spent: dict[str, list[float]], one: str, other: str) -> float | None:
    if one not in spent or other not in spent:
        return None
    return median(a / b for a, b in zip(spent[one], spent[other], strict=True))


def spatial(n: int, dtype: Any, library: ctypes.CDLL | None) -> dict[str, list[float]]:
    bodies, contacts = scene(Geometry.SPATIAL, n, dtype)
    out = resolve_batch(bodies, contacts, FRICTIONLESS)
    source = np.ones(39 * n + 15 * n, dtype)
    target = np.empty_like(source)
    runs: Runs = {"memcpy": lambda: np.copyto(target, source)}
    if library:
        runs["C"] = by_c(library, bodies, contacts, out)
    if compiled.is_available():
        runs["compiled"] = by_batch(bodies, contacts, Backend.COMPILED)
        runs["its loop"] = by_loop(bodies, contacts)
        if dtype == np.float64 and n >= MANY:
            to_tolerance = ImpactModel(Law.FRICTIONLESS, tolerance=1e-9)
            extended = ImpactModel(Law.FRICTIONLESS, precision=Precision.EXTENDED)
            runs["to 1e-9"] = by_batch(bodies, contacts, Backend.COMPILED, to_tolerance)
            runs["EXTENDED"] = by_batch(bodies, contacts, Backend.COMPILED, extended)
    runs["NumPy"] = by_batch(bodies, contacts, Backend.NUMPY)
    runs["cross and solve"] = by_cross_and_solve(bodies, contacts)
    return in_turns(runs, n)


def geometries(backend: Backend, n: int) -> dict[str, list[float]]:
    runs: Runs = {}
    for geometry in (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL):
        bodies, contacts = scene(geometry, n)
        runs[geometry.name] = by_batch(bodies, contacts, backend)
        runs[f"{geometry.name} COULOMB"] = by_batch(bodies, contacts, backend, ImpactModel(Law.COULOMB))
    return in_turns(runs, n, turns=5)


def extra_memory(backend: Backend, n: int) -> float:
    """MiB beyond input and output, by the peak of what Python and NumPy allocate."""
    bodies, contacts = scene(Geometry.SPATIAL, n)
    run = by_batch(bodies, contacts, backend)
    thread = threading.Thread(target=run)  # a new one, which has no blocks yet
    tracemalloc.start()
    thread.start()
    thread.join()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def measure(say: Callable[[str], object] = print) -> dict[str, Any]:
    """All figures: ``ns_per_contact`` by table, row and column (medians), ``ratios``, ``compile_seconds``."""
    library = c_library()
    tables: dict[str, dict[str, dict[str, list[float]]]] = {"spatial": {}, "geometries, N = 1e5": {}}
    for dtype, n in [*((np.float64, n) for n in SIZES), (np.float32, SIZES[-1])]:
        row = f"{np.dtype(dtype).name}, N = {n:.0e}".replace("e+0", "e")
        say(f"batch: spatial, {row}")
        tables["spatial"][row] = spatial(n, dtype, library)
    backends = [Backend.NUMPY] + [Backend.COMPILED] * compiled.is_available()
    for backend in backends:
        say(f"batch: geometries and laws, {backend.name}")
        tables["geometries, N = 1e5"][backend.name] = geometries(backend, 100_000)
    most, some = tables["spatial"]["float64, N = 1e6"], tables["spatial"]["float64, N = 1e3"]
    by_numpy = tables["geometries, N = 1e5"]["NUMPY"]
    ratios = {
        "NumPy / C, N = 1e6": ratio(most, "NumPy", "C"),
        "NumPy / cross and solve, N = 1e6": ratio(most, "NumPy", "cross and solve"),
        "compiled / C, N = 1e6": ratio(most, "compiled", "C"),
        "compiled / C, N = 1e3": ratio(some, "compiled", "C"),
        "its loop alone / C, N = 1e3": ratio(some, "its loop", "C"),
        "EXTENDED compiled / C, N = 1e6": ratio(most, "EXTENDED", "C"),
        "planar / spatial, NumPy": ratio(by_numpy, "PLANAR", "SPATIAL"),
        "point / spatial, NumPy": ratio(by_numpy, "POINT", "SPATIAL"),
        "extra memory at 1e6, NumPy [MiB]": extra_memory(Backend.NUMPY, SIZES[-1]),
    }
    ready = [
        prepare_batch(*scene(Geometry.SPATIAL, 1), FRICTIONLESS, backend=backend) for backend in backends
    ]
    return {
        "ns_per_contact": {
            title: {
                row: {column: median(times) for column, times in spent.items()}
                for row, spent in table.items()
            }
            for title, table in tables.items()
        },
        "ratios": ratios,
        "targets": TARGETS,
        "compile_seconds": {one.backend.name: one.seconds for one in ready},
    }


def table(figures: dict[str, Any]) -> str:
    """The figures as text."""
    lines = []
    for title, rows in figures["ns_per_contact"].items():
        columns = list(dict.fromkeys(column for row in rows.values() for column in row))
        lines += ["", f"{title}: ns per contact", " " * 20 + "".join(f"{column:>17}" for column in columns)]
        lines += [
            f"{name:20}"
            + "".join(f"{row[column]:17.1f}" if column in row else " " * 17 for column in columns)
            for name, row in rows.items()
        ]
    lines += ["", f"{'ratio':36}{'measured':>10}{'target':>10}"]
    for name, value in figures["ratios"].items():
        measured = "-" if value is None else f"{value:.2f}"
        lines.append(f"{name:36}{measured:>10}{figures['targets'][name]:10.2f}")
    return "\n".join(lines)


if __name__ == "__main__":
    result = measure()
    print(table(result))
    print(json.dumps(result["compile_seconds"]))
