"""Time against true error and error bound: every law, every precision, six scenes.

The true answer is that of the same law, by the tests' oracle. So the error measures rounding and not the law;
see ``between_laws`` for the difference between laws. If MOREAU falls back to COULOMB, the true answer is that
of COULOMB.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import batch
from batch_cases import batch_of
from cases import ALIGNED, PAIR, Scene, grazing, slip_reversal, thin_rod, turning_slip
from one import PINOCCHIO_J, by_resolve, peers_of
from timing import interleaved, spread
from truth import error_of_impulse, true_error, truth_of

from collision_response import Body, Contact, ImpactError, ImpactModel, Law, Precision, resolve
from collision_response.batch import resolve_batch
from collision_response.impact import impact
from collision_response.in_python import arbitrary_precision
from collision_response.in_python.request_numbers import body_as_fractions, contact_as_fractions
from collision_response.physics.mass_properties import sphere

LAWS = [law for law in Law if law not in (Law.AUTO, Law.COMPLIANT)]  # which has no known exact answer
ROUNDS, BATCH_ROUNDS, CONTACTS = 9, 3, 500
"""Rounds of timing for single impacts and for batches; contacts in a batch."""


class Way(NamedTuple):
    """A row of the table; a ``tolerance`` of 0 means none."""

    law: str
    precision: str
    tolerance: float = 0.0
    by: str = "resolve"


def central() -> Scene:
    """Two balls, head-on."""
    a = Body.dynamic(1.0, sphere(1.0, 0.5).inertia, (0.5, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0))
    b = Body.dynamic(2.0, sphere(2.0, 0.5).inertia, (-0.5, 0.0, 0.0), velocity=(0.7, 0.0, 0.0))
    return Scene(a, b, Contact.of((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.6, 0.3))


SUITE: dict[str, Callable[[], Scene]] = {
    "central": central,
    "usual": lambda: PAIR,
    "grazing": lambda: grazing(PAIR, 1e-10),
    "thin rod": thin_rod,
    "slip reversal": slip_reversal,
    "turning slip": turning_slip,
}


def ways() -> dict[Way, ImpactModel]:
    """The models for ``resolve``."""
    precisions = (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED)
    found = {Way(law.name, one.name): ImpactModel(law, precision=one) for law in LAWS for one in precisions}
    for tolerance in (1e-6, 1e-9, 1e-12, 1e-15):
        found[Way("COULOMB", "AUTO", tolerance)] = ImpactModel(Law.COULOMB, tolerance=tolerance)
    for tolerance in (1e-3, 1e-6, 1e-9):
        found[Way("ROUTH_STRONGE", "AUTO", tolerance)] = ImpactModel(Law.ROUTH_STRONGE, tolerance=tolerance)
    return found


def batch_ways() -> dict[Way, ImpactModel]:
    """The models for ``resolve_batch``."""
    found = {}
    for law in batch.LAWS:
        found[Way(law.name, "DOUBLE", by="batch")] = ImpactModel(law)
        found[Way(law.name, "AUTO", 1e-9, "batch")] = ImpactModel(law, tolerance=1e-9)
        found[Way(law.name, "EXTENDED", by="batch")] = ImpactModel(law, precision=Precision.EXTENDED)
    return found


def measure(skipped: dict[str, str], progress: Callable[[str], object]) -> dict[str, Any]:
    """Measure time [s], error and bound of all ways in all scenes, the plot, and the laws' differences."""
    points, between, above, bounded = [], {}, [], 0
    for name, build in SUITE.items():
        progress(f"    {name}")
        scene = build()
        truths = {law: truth_of(scene, law) for law in LAWS}
        between[name] = between_laws(truths)
        calls: dict[Way, Callable[[], Any]] = {}
        results: dict[Way, tuple[float, float | None]] = {}
        for way, model in ways().items():
            try:
                answer = resolve(*scene, model)
            except ImpactError:  # 32 bits are not enough for some paths
                continue
            error = true_error(answer, truths[answer.model.law])
            calls[way], results[way] = by_resolve(scene, model).call, (error, answer.error_bound)
            bounded += 1
            if error > answer.error_bound + (1e-15 if Law[way.law] > Law.COULOMB else 0.0):
                above.append(f"{name}, {way.law} {way.precision}")
        times = interleaved(calls, rounds=ROUNDS, seconds=0.002)
        bodies, contacts = batch_of([scene] * CONTACTS)
        runs = {way: batch.by_batch(bodies, contacts, model) for way, model in batch_ways().items()}
        for way, run in runs.items():
            out = run()
            bound = None if out.error_bound is None else float(out.error_bound[0])
            results[way] = error_of_impulse(out.impulse[:, 0], truths[Law[way.law]]), bound
        of_batches = interleaved(runs, rounds=BATCH_ROUNDS, seconds=0.002)
        times |= {way: [t / CONTACTS for t in taken] for way, taken in of_batches.items()}
        points += [
            {
                "scene": name,
                **way._asdict(),
                "s": spread(taken),
                "error": results[way][0],
                "bound": results[way][1],
            }
            for way, taken in times.items()
        ]
    progress("    the plot")
    plot = [point for name, scene in PLOTTED.items() for point in plotted(name, scene(), skipped)]
    return {"points": points, "plot": plot, "between_laws": between, "bounded": bounded, "above_bound": above}


def between_laws(truths: dict[Law, Any]) -> dict[str, float]:
    """Relative differences of the laws' exact impulses from that of ROUTH_STRONGE."""
    reference = truths[Law.ROUTH_STRONGE].impulses[0]
    size = math.hypot(*map(float, reference))
    return {
        law.name: math.dist([*map(float, truths[law].impulses[0])], [*map(float, reference)]) / size
        for law in LAWS
    }


# The plot -------------------------------------------------------------------------------------

PLOTTED: dict[str, Callable[[], Scene]] = {
    "a usual pair": lambda: ALIGNED,
    "grazing at 1e-10 of the speed": lambda: grazing(ALIGNED, 1e-10),
    "a thin rod in turned axes": thin_rod,
}


def plotted(name: str, scene: Scene, skipped: dict[str, str]) -> list[dict[str, Any]]:
    """One frictionless impact by all programs; ``kind`` is ours, exact, peer or batch.

    The error is that of the impulse, which most of the programs return; of a whole step that of the twists.
    """
    scene = scene._replace(contact=scene.contact._replace(friction=0.0))
    truth, found, calls = truth_of(scene, Law.FRICTIONLESS), [], {}

    def note(kind: str, way: str, error: float, bound: float | None, call: Callable[[], Any]) -> None:
        found.append({"scene": name, "kind": kind, "way": way, "error": error, "bound": bound})
        calls[way] = call

    for precision in (Precision.DOUBLE, Precision.EXTENDED):
        model = ImpactModel(Law.FRICTIONLESS, precision=precision)
        answer = resolve(*scene, model)
        error = error_of_impulse(answer.impulse, truth)
        note("ours", precision.name, error, answer.error_bound, by_resolve(scene, model).call)
    model = ImpactModel(Law.FRICTIONLESS)
    note("exact", "balls", error_of_impulse(arbitrary_precision.resolve(*scene, model).impulse, truth), None,
         lambda: arbitrary_precision.resolve(*scene, model))  # fmt: skip
    note("exact", "fractions", error_of_impulse(in_fractions(scene).changes.impulse, truth), None,
         lambda: in_fractions(scene))  # fmt: skip
    for way, peer in peers_of(scene, skipped).items():
        is_usual = scene.contact.position == ALIGNED.contact.position and "grazing" not in name
        if way == PINOCCHIO_J or (is_usual and "step" in way):
            note("peer", way, peer.error(peer.call(), truth), None, peer.call)
    times = interleaved(calls, rounds=ROUNDS, seconds=0.002)
    bodies, contacts = batch_of([scene] * CONTACTS, oriented=False)  # all axes are the world's
    runs = {
        "batch": ImpactModel(Law.FRICTIONLESS),
        "batch, with bound": ImpactModel(Law.FRICTIONLESS, precision=Precision.DOUBLE, tolerance=1e-9),
        "batch, EXTENDED": ImpactModel(Law.FRICTIONLESS, precision=Precision.EXTENDED),
    }
    calls = {}
    for way, model in runs.items():
        out = resolve_batch(bodies, contacts, model)
        bound = None if out.error_bound is None else float(out.error_bound[0])
        note(
            "batch",
            way,
            error_of_impulse(out.impulse[:, 0], truth),
            bound,
            batch.by_batch(bodies, contacts, model),
        )
    if libraries := batch.c_libraries():
        call, impulse = batch.by_c(list(libraries.values())[-1], Law.FRICTIONLESS, bodies, contacts)
        call()
        note("batch", "C", error_of_impulse(impulse[:, 0], truth), None, call)
    of_batches = interleaved(calls, rounds=BATCH_ROUNDS, seconds=0.002)
    times |= {way: [t / CONTACTS for t in taken] for way, taken in of_batches.items()}
    return [{**point, "s": spread(times[point["way"]])} for point in found]


def in_fractions(scene: Scene) -> Any:
    """The Python formulas on exact rational numbers."""
    a, b, contact = scene
    return impact(body_as_fractions(a), body_as_fractions(b), contact_as_fractions(contact), Law.FRICTIONLESS)
