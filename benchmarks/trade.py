"""Time against true error: every law, geometry and precision, on a fixed suite of scenes.

The truth is the law's own answer in space, to 40 digits, by the tests' oracle, which shares no formula
with the package. So the error counts rounding and what the geometry leaves out; not what the law leaves
out, for which see ``between_laws``. Where MOREAU falls back to COULOMB, the truth is COULOMB's.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mpmath import mp
from tables import tables
from timing import interleaved, spread

from collision_response import Body, Contact, Geometry, ImpactError, ImpactModel, Law, Precision, resolve
from collision_response.model import EXACT_LAWS
from collision_response.physics.mass_properties import rod, sphere
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

sys.path.append(str(Path(__file__).resolve().parent.parent / "test"))
from scenes import Scene

LAWS = [law for law in Law if law is not Law.AUTO]
GEOMETRIES = [Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL]
ROUTH = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
ASKED = (1e-2, 1e-6, 1e-12, 1e-15)
"""Tolerances given to AUTO."""
DIGITS = 40
CONTACTS = 16384
"""In a batch: the more, the less the call itself costs; few enough for the processor's cache."""


class Way(NamedTuple):
    """A way to an answer, as the plot and the table name it.

    Attributes:
        law, geometry: names.
        precision: the name of a tier; ``AUTO``; or of a batch, its type.
        tolerance: asked for, 0: none.
        by: ``resolve``, or what computes a batch.
    """

    law: str
    geometry: str
    precision: str
    tolerance: float = 0.0
    by: str = "resolve"


# The suite ------------------------------------------------------------------------------------

TURN = Quaternion(0.3, -0.2, 0.5, 0.8)
SLANT = Vec3(0.36, 0.48, 0.8)


def central() -> Scene:
    """Two balls, head-on."""
    a = Body.dynamic(1.0, sphere(1.0, 0.5).inertia, (0.5, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0))
    b = Body.dynamic(2.0, sphere(2.0, 0.5).inertia, (-0.5, 0.0, 0.0), velocity=(0.7, 0.0, 0.0))
    return Scene(a, b, Contact.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.6, 0.3))


def well_conditioned() -> Scene:
    """Two compact bodies, turned, that tumble."""
    a = Body.dynamic(
        2.0, (0.3, 0.02, -0.01, 0.4, 0.03, 0.5), (0.1, 0.2, 0.6), TURN, (0.3, -0.2, -1.5), (0.4, -0.7, 0.9)
    )
    b = Body.dynamic(
        3.0, (0.5, 0.01, 0.02, 0.6, -0.03, 0.7), (-0.2, 0.1, -0.5), None, (-0.1, 0.2, 0.8), (0.2, 0.5, -0.3)
    )
    return Scene(a, b, Contact.of((0.05, 0.1, 0.02), SLANT, 0.5, 0.3))


def grazing() -> Scene:
    """The same bodies, of which the approach speed is 1e-10 of the speed."""
    scene = well_conditioned()
    a, b, contact = scene
    u = a.velocity_at(contact.position - a.position) - b.velocity_at(contact.position - b.position)
    n = contact.normal
    change = n * (-(n.dot(u) + 1e-10 * u.norm()) / n.dot(n))
    return scene._replace(body_a=a._replace(velocity=a.velocity + change))


def thin_rod() -> Scene:
    """A rod 1e5 times as long as thick, its tensor given in axes that are not its own, strikes a wall."""
    mass, length, radius = 1.0, 1.0, 1e-5
    across, along = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
    d = Vec3(2 / 3, 1 / 3, 2 / 3)
    tensor = [
        (across if i == k else 0.0) - (across - along) * d[i] * d[k]
        for i, k in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    ]
    a = Body.dynamic(mass, tensor, d * (length / 2), None, (0.4, 0.1, -1.0), (0.3, 0.2, -0.5))
    return Scene(a, Body.static(), Contact.of((1e-5, -1e-5, 0.0), (0.1, 0.2, 1.0), 0.5, 0.3))


def slip_reversal() -> Scene:
    """A rod whose end strikes a floor in the plane; the slip stops, and runs back."""
    angle = math.atan(2.0)
    a = Body.dynamic(
        1.0,
        rod(1.0, 1.0).inertia,
        (math.cos(angle) / 2, math.sin(angle) / 2, 0.0),
        (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        (0.5, -1.0, 0.0),
    )
    return Scene(a, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.9, 0.3))


def turning_slip() -> Scene:
    """A slender body whose slip turns all through the impact."""
    a = Body.dynamic(
        1.0, (0.081, 0.0, 0.0, 0.08, 0.0, 0.004), (0.1, -0.25, 0.35), TURN, (0.5, 0.9, -1.2), (1.0, -0.6, 0.3)
    )
    return Scene(a, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.1, -0.2, 1.0), 0.5, 0.4))


SUITE: dict[str, Callable[[], Scene]] = {
    "central": central,
    "well-conditioned": well_conditioned,
    "grazing": grazing,
    "thin rod": thin_rod,
    "slip reversal": slip_reversal,
    "turning slip": turning_slip,
}


# Ways to an answer ----------------------------------------------------------------------------


def scalar_ways() -> Iterator[tuple[Way, ImpactModel]]:
    """Every combination that ``resolve`` takes."""
    for law in LAWS:
        tiers = [Precision.SINGLE, Precision.DOUBLE]
        if law in EXACT_LAWS:
            tiers.append(Precision.EXTENDED)
        for geometry in GEOMETRIES:
            for tier in tiers:
                yield Way(law.name, geometry.name, tier.name), ImpactModel(law, geometry, tier)
        if law in ROUTH:
            for tolerance in TOLERANCES[:-1]:
                way = Way(law.name, Geometry.SPATIAL.name, Precision.DOUBLE.name, tolerance)
                yield way, ImpactModel(law, Geometry.SPATIAL, Precision.DOUBLE, tolerance)
    for tolerance in ASKED:
        way = Way(Law.COULOMB.name, "AUTO", "AUTO", tolerance)
        yield way, ImpactModel(law=Law.COULOMB, tolerance=tolerance)


def batch_ways(scene: Scene) -> Iterator[tuple[Way, Callable[[], Any]]]:
    """Every combination that ``resolve_batch`` takes, on many copies of a scene."""
    from collision_response.batch import resolve_batch
    from collision_response.batch.backends import Backend
    from collision_response.numerics import compiled

    backends = [Backend.NUMPY, *([Backend.COMPILED] if compiled.is_available() else [])]
    for law in EXACT_LAWS:
        for geometry in GEOMETRIES:
            bodies, contacts = tables(scene, geometry, CONTACTS, friction=law is Law.COULOMB)
            for kind in ("float32", "float64"):
                of, at = bodies.astype(kind), contacts.astype(kind)
                out = resolve_batch(of, at, ImpactModel(law=law))
                for backend in backends:

                    def call(of=of, at=at, law=law, out=out, backend=backend) -> Any:
                        return resolve_batch(of, at, ImpactModel(law=law), out=out, backend=backend)

                    yield Way(law.name, geometry.name, kind, by=backend.value), call


# Measuring ------------------------------------------------------------------------------------


def relative_error(impulse: Any, truth: Any) -> float:
    """Of an impulse; what has fewer than three components has none along the others."""
    found = [float(component) for component in impulse] + [0.0] * (3 - len(impulse))
    with mp.workdps(DIGITS):
        return float(mp.norm(mp.matrix(found) - truth) / mp.norm(truth))


def measure(skipped: dict[str, str], progress: Callable[[str], None]) -> dict[str, Any]:
    """Time [s] and error of every way in every scene, and the distances between the laws."""
    points, between, above, bounded = [], {}, [], 0
    for name, build in SUITE.items():
        progress(name)
        scene = build()
        truths = {law: scene.by_oracle(law, DIGITS).impulse for law in LAWS}
        between[name] = between_laws(truths)
        calls: dict[Way, Callable[[], Any]] = {}
        errors: dict[Way, float] = {}
        for way, model in scalar_ways():
            try:
                impact = resolve(*scene, model)
            except ImpactError:  # this geometry is none for this scene
                continue
            calls[way] = lambda scene=scene, model=model: resolve(*scene, model)
            errors[way] = relative_error(impact.impulse, truths[impact.model.law])
            if way.geometry in ("SPATIAL", "AUTO") and 0 <= impact.error_bound < math.inf:
                bounded += 1
                if errors[way] > impact.error_bound:
                    above.append(f"{name}, {way.law} {way.precision}")
        times = interleaved(calls, rounds=15, seconds=0.002)
        try:
            batches = dict(batch_ways(scene))
        except Exception as failure:
            skipped["batches in the trade"] = f"{type(failure).__name__}: {failure}"
            batches = {}
        for way, call in batches.items():
            errors[way] = relative_error(call().impulse[:, 0], truths[Law[way.law]])
        of_batches = interleaved(batches, rounds=15, seconds=0.002)
        times |= {way: [t / CONTACTS for t in taken] for way, taken in of_batches.items()}
        points += [
            {"scene": name, **way._asdict(), "s": spread(taken), "error": errors[way]}
            for way, taken in times.items()
        ]
    return {"points": points, "between_laws": between, "bounded": bounded, "above_bound": above}


def between_laws(truths: dict[Law, Any]) -> dict[str, float]:
    """How far the exact answers of the laws are from ROUTH_STRONGE's."""
    reference = truths[Law.ROUTH_STRONGE]
    return {law.name: float(mp.norm(truths[law] - reference) / mp.norm(reference)) for law in LAWS}


def summary(results: dict[str, Any]) -> dict[str, Any]:
    """The same in short: of each way and scene the median time [s] and the error."""
    ways: dict[str, dict[str, list[float]]] = {}
    for point in results["points"]:
        way = " ".join(str(point[field]) for field in Way._fields if point[field])
        ways.setdefault(way, {})[point["scene"]] = [point["s"]["median"], point["error"]]
    return {**results, "points": ways}
