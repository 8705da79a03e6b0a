"""The stability report: ``make stability`` measures everything again and rewrites docs/stability.md.

    python benchmarks/stability.py [--quick]

It compares random impacts and structured attacks with exact answers: is any error above its bound?
``--quick`` does a twentieth of the work and only prints the tables.
"""

from __future__ import annotations

import argparse
import datetime
import math
import multiprocessing
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "test")]

import exact  # noqa: E402
import stability_page  # noqa: E402
from cases import PAIR, Scene, grazing  # noqa: E402
from exact import Answer  # noqa: E402
from exact_adapter import as_request, exact_answer, true_error  # noqa: E402
from random_impacts import RandomImpacts, rotated_tensor  # noqa: E402

from collision_response import (  # noqa: E402
    Adjustment,
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
)
from collision_response.physics.vector import Vec3  # noqa: E402

FORMULAS = (Law.FRICTIONLESS, Law.COULOMB)
PATHS = (Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
PRECISIONS = (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED, Precision.AUTO)
WILDNESS = {"usual": 0.0, "1e±3": 3.0, "1e±10": 10.0, "1e±30": 30.0, "1e±150": 150.0}
"""Spread of the magnitudes, in decades."""

WILDEST_PATH = 3.0
REQUESTS, PATH_REQUESTS, SAMPLES, IMPACTS = 1500, 500, 400, 1_000_000
"""Impacts for each law and spread, each path law and spread, each ill condition, and for the drift."""

PIECE = 50
"""Random impacts of one job."""

CORES = 2
Key = tuple[Any, ...]


class Tally(NamedTuple):
    """Counts of the outcomes of many impacts.

    Attributes:
        counts: number of impacts, by key and outcome.
        ratios: ratios of error to bound by key, where there is an error and a finite bound.
        violations: descriptions of the answers whose error is above their bound.
    """

    counts: Counter[tuple[Key, str]]
    ratios: dict[Key, list[float]]
    violations: list[str]

    @classmethod
    def empty(cls) -> Tally:
        return cls(Counter(), {}, [])

    def add(self, other: Tally) -> None:
        self.counts.update(other.counts)
        for key, found in other.ratios.items():
            self.ratios.setdefault(key, []).extend(found)
        self.violations.extend(other.violations)

    def count(self, key: Key, name: str, scene: Scene, model: ImpactModel) -> None:
        """Resolve a request, and count its answer or refusal."""
        self.counts[key, "asked"] += 1
        try:
            impact = resolve(*scene, model)
        except ImpactError as refusal:
            self.counts[key, refusal.code.name] += 1
            return
        self.counts[key, impact.status.name] += 1
        truth = right_answer(scene, impact, model)
        error, bound = true_error(impact, truth), impact.error_bound
        self.counts[key, "bounded"] += bound < math.inf
        slack = 0.0 if truth.report is None else exact.ORACLE_ERROR
        if error > slack and bound < math.inf:
            self.ratios.setdefault(key, []).append((error - slack) / bound if bound else math.inf)
        if not error <= bound + slack:
            self.violations.append(f"{key} {name}: error {error:.3g} above bound {bound:.3g}")


def right_answer(scene: Scene, impact: Impact, model: ImpactModel) -> Answer:
    """The exact answer of the law that answered."""
    if Adjustment.LAW_FALLBACK in impact.adjustments:
        model = model._replace(tangential_restitution=0.0)
    return exact_answer(*scene, model._replace(law=impact.model.law))


# Random impacts -------------------------------------------------------------------------------


def random_piece(law: Law, wildness: str, seed: int) -> Tally:
    """Count some random impacts of one law, in every precision.

    Invalid requests, and bodies that separate, are drawn again.
    """
    tally, impacts = Tally.empty(), RandomImpacts(f"{law.name} {wildness} {seed}", WILDNESS[wildness])
    draw, done = impacts.draw, 0
    while done < PIECE:
        scene = Scene(*impacts.collision())
        e_t = draw.choice([0.0, draw.uniform(-1, 1)]) if law is Law.COULOMB else 0.0
        try:
            if resolve(*scene, ImpactModel(law)).status is StatusCode.SEPARATING:
                continue
        except ImpactError as refusal:
            if refusal.code not in (StatusCode.OUT_OF_RANGE, StatusCode.PATH_TOO_LONG):
                continue
        done += 1
        for precision in PRECISIONS:
            model = ImpactModel(law, precision=precision, tangential_restitution=e_t)
            tally.count(("random", law.name, wildness, precision.name), f"{seed}, {done}", scene, model)
    return tally


# Attacks --------------------------------------------------------------------------------------


def attack_family(family: str) -> Tally:
    """Count all attacks of one family of test/attacks.py."""
    import attacks

    enums = {"law": Law, "geometry": Geometry, "precision": Precision}
    tally = Tally.empty()
    for case in attacks.FAMILIES[family]():
        fields = {name: enums[name][value] if name in enums else value for name, value in case.model.items()}
        tally.count(("attack", family), case.name, Scene(*as_request(case.collision)), ImpactModel(**fields))
    return tally


# One ill condition at a time ------------------------------------------------------------------


def by_condition(samples: int) -> dict[str, list[dict[str, Any]]]:
    """True error and bound of grazing impacts with friction, and of more and more slender bodies."""
    found: dict[str, list[dict[str, Any]]] = {"grazing": [], "inertia": []}
    draw = random.Random(7)
    while len(found["inertia"]) < samples:
        condition = 10 ** draw.uniform(0, 15)
        scene = _varied(draw, PAIR.body_a.inertia)
        if len(found["grazing"]) < samples:
            found["grazing"] += _sample(condition, grazing(scene, 1 / condition))
        x, y, z = 1.0, draw.random() / condition, draw.random() / condition
        moments = (y + z, x + z, x + y)
        in_turned_axes = rotated_tensor(moments, [draw.gauss(0, 1) for _ in range(4)])
        inertia = draw.choice([(moments[0], 0.0, 0.0, moments[1], 0.0, moments[2]), in_turned_axes])
        try:
            found["inertia"] += _sample(max(moments) / min(moments), _varied(draw, inertia))
        except ImpactError:  # rounded to a tensor that no body has
            continue
    return found


def _sample(condition: float, scene: Scene) -> list[dict[str, Any]]:
    """Error and bound in each precision; an empty list for bodies that separate."""
    sample: dict[str, Any] = {"condition": condition}
    for precision in (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED):
        impact = resolve(*scene, ImpactModel(Law.COULOMB, Geometry.SPATIAL, precision))
        truth = exact_answer(*scene, ImpactModel(Law.COULOMB))
        if truth.separating:
            return []
        bound = impact.error_bound
        sample[precision.name] = [true_error(impact, truth), bound if bound < math.inf else None]
    return [sample]


def _varied(draw: random.Random, inertia: tuple[float, ...]) -> Scene:
    """``PAIR`` with random velocities, and another inertia of body_a."""

    def vector() -> Vec3:
        return Vec3(*(draw.gauss(0, 1) for _ in range(3)))

    a = PAIR.body_a
    body = Body.dynamic(a.mass, inertia, a.position, a.orientation, vector(), vector())
    return PAIR._replace(body_a=body, body_b=PAIR.body_b._replace(velocity=vector()))


# Many impacts ---------------------------------------------------------------------------------


def drift(precision: str, impacts: int) -> list[dict[str, float]]:
    """Relative drift of energy and momenta of three fixed bodies, after many elastic impacts."""
    draw = random.Random(20)

    def vector() -> list[float]:
        return [draw.gauss(0, 1) for _ in range(3)]

    def body() -> Body:
        mass = draw.uniform(0.5, 3)
        x, y, z = (mass * draw.uniform(0.1, 0.4) for _ in range(3))
        turn = [draw.gauss(0, 1) for _ in range(4)]
        return Body.dynamic(mass, (y + z, 0, 0, x + z, 0, x + y), vector(), turn, vector(), vector())

    bodies = [body() for _ in range(3)]
    model = ImpactModel(Law.FRICTIONLESS, Geometry.SPATIAL, Precision[precision])
    contacts = [
        (pair, Contact.of(vector(), vector())) for pair in ((0, 1), (1, 2), (2, 0)) for _ in range(40)
    ]
    start, rows, done = invariants(bodies), [], 0
    scale = math.sqrt(2 * start[0] * sum(one.mass for one in bodies))
    marks = {count * 10**k for k in range(8) for count in (1, 2, 5)}
    while done < impacts:
        (a, b), contact = draw.choice(contacts)
        impact = resolve(bodies[a], bodies[b], contact, model)
        if impact.status is StatusCode.SEPARATING:  # then the opposite normal approaches
            impact = resolve(bodies[a], bodies[b], contact._replace(normal=-contact.normal), model)
        for i, twist in ((a, impact.twist_a), (b, impact.twist_b)):
            bodies[i] = bodies[i].with_twist(twist)
        done += 1
        if done in marks:
            now = invariants(bodies)
            apart = [math.dist(x, y) / scale for x, y in zip(now[1:], start[1:], strict=True)]
            drifts = (abs(now[0] / start[0] - 1), *apart)
            names = ("energy", "momentum", "angular momentum")
            rows.append({"impacts": done, **dict(zip(names, drifts, strict=True))})
    return rows


def invariants(bodies: list[Body]) -> tuple[Any, ...]:
    """Energy and momenta, which elastic impacts conserve; exact except for the last rounding."""
    energy, momentum, angular = exact.Fraction(0), exact.ZERO, exact.ZERO
    for body in bodies:
        side = exact.Side(exact.PlainBody(*body[:7]), exact.ZERO)
        v, w = exact.vec(body.velocity), exact.vec(body.angular_velocity)
        p = exact.times(v, side.mass)
        energy += side.energy(v, w)
        momentum = exact.plus(momentum, p)
        spin = exact.plus(exact.cross(exact.vec(body.position), p), exact.apply(side.inertia, w))
        angular = exact.plus(angular, spin)
    return float(energy), tuple(map(float, momentum)), tuple(map(float, angular))


# All of it ------------------------------------------------------------------------------------


def jobs(share: int) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Names and arguments of the functions of this module to run, the longest first."""
    for precision in ("EXTENDED", "DOUBLE", "SINGLE"):
        yield "drift", (precision, IMPACTS // share)
    yield "by_condition", (SAMPLES // share,)
    import attacks

    for family in attacks.FAMILIES:
        yield "attack_family", (family,)
    for laws, total, wildest in ((PATHS, PATH_REQUESTS, WILDEST_PATH), (FORMULAS, REQUESTS, math.inf)):
        for law in laws:
            for name, decades in WILDNESS.items():
                if decades <= wildest:
                    yield from (
                        ("random_piece", (law, name, seed)) for seed in range(max(1, total // PIECE // share))
                    )


def _done(job: tuple[str, tuple[Any, ...]]) -> tuple[tuple[str, tuple[Any, ...]], Any]:
    return job, globals()[job[0]](*job[1])


def measure(share: int = 1) -> dict[str, Any]:
    """Measure all figures of the report."""
    start, tally, others = time.monotonic(), Tally.empty(), {}
    todo = list(jobs(share))
    with multiprocessing.Pool(CORES) as pool:
        for done, (job, result) in enumerate(pool.imap_unordered(_done, todo), 1):
            if isinstance(result, Tally):
                tally.add(result)
            else:
                others[job] = result
            print(f"\r    {done} of {len(todo)}, {len(tally.violations)} violations ", end="", flush=True)
    print()
    return {
        "date": datetime.date.today().isoformat(),
        "seconds": round(time.monotonic() - start),
        "rows": rows_of(tally),
        "violations": tally.violations,
        "conditions": next(result for job, result in others.items() if job[0] == "by_condition"),
        "drift": {job[1][0]: result for job, result in others.items() if job[0] == "drift"},
    }


def rows_of(tally: Tally) -> list[dict[str, Any]]:
    """A row with the outcomes of each key."""
    rows: dict[Key, dict[str, Any]] = {}
    for (key, outcome), count in tally.counts.items():
        rows.setdefault(key, {"key": list(key), "statuses": {}})["statuses"][outcome] = count
    for key, row in rows.items():
        ratios = tally.ratios.get(key, [])
        row |= {
            "worst": max(ratios, default=0.0),
            "looseness": 1 / median(ratios) if ratios else None,
            "violations": sum(line.startswith(str(key)) for line in tally.violations),
        }
    return sorted(rows.values(), key=lambda row: row["key"])


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="do a twentieth of the work, and only print")
    quick = parser.parse_args().quick
    results = measure(20 if quick else 1)
    if quick:
        print(*(part(results) for part in stability_page.PARTS.values()), sep="\n\n")
    else:
        stability_page.write(results)
    for violation in results["violations"]:
        print("VIOLATION", violation)
    print(f"{len(results['violations'])} violations; {results['seconds']} s")
    return bool(results["violations"])


if __name__ == "__main__":
    sys.exit(main())
