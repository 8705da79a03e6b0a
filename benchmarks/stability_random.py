"""Random impacts over all magnitudes, each against the exact answer: is any error above its bound?"""

from __future__ import annotations

import math
import random
from collections import Counter
from typing import Any, NamedTuple

from extremes import all_numbers
from random_impacts import RandomImpacts, nearly_planar
from reference import Truth, exact_answer, true_error
from scenes import Scene

from collision_response import Geometry, Impact, ImpactError, ImpactModel, Law, Precision, resolve

TIERS = (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED)
LAWS = (Law.FRICTIONLESS, Law.COULOMB)
WILDEST = 150.0
ULP = 2.0**-52
REQUESTS = 100
"""In one piece of the work."""


class Piece(NamedTuple):
    """A piece of the work: ``kind`` is "wild" or "nearly planar"."""

    kind: str
    law: Law
    seed: int


class Tally(NamedTuple):
    """What came of many impacts.

    Attributes:
        counts: by tier and outcome.
        tightest: least quotient of bound and error, where the error is above an ulp, by tier.
        violations: the requests that broke a promise, to be repeated from their seeds.
    """

    counts: Counter[tuple[str, str]]
    tightest: dict[str, float]
    violations: list[dict[str, Any]]

    def add(self, other: Tally) -> None:
        self.counts.update(other.counts)
        for tier, ratio in other.tightest.items():
            self.tightest[tier] = min(ratio, self.tightest.get(tier, math.inf))
        self.violations.extend(other.violations)

    def count(self, tier: str, impact: Impact, truth: Truth, request: dict[str, Any]) -> None:
        error = true_error(impact, truth)
        self.counts[tier, "answered"] += 1
        self.counts[tier, "with a bound"] += impact.error_bound < math.inf
        if error > ULP:
            self.tightest[tier] = min(impact.error_bound / error, self.tightest.get(tier, math.inf))
        sound = all(math.isfinite(x) for x in all_numbers(impact._replace(error_bound=0.0)))
        if not (sound and error <= impact.error_bound) or (tier == "EXTENDED" and impact.error_bound > ULP):
            broken = {"tier": tier, "error": error, "bound": impact.error_bound, "all finite": sound}
            self.violations.append(request | broken)


def nothing() -> Tally:
    return Tally(Counter(), {}, [])


def pieces(requests: int, nearly_planar_requests: int) -> list[Piece]:
    """The work: so many requests of each law and kind."""
    return [
        Piece(kind, law, seed)
        for kind, total in (("wild", requests), ("nearly planar", nearly_planar_requests))
        for law in LAWS
        for seed in range(-(-total // REQUESTS))
    ]


def run(piece: Piece) -> Tally:
    """The tally of one piece."""
    return _wild(piece) if piece.kind == "wild" else _nearly_planar(piece)


def wildness(seed: int) -> float:
    """From 0 to ``WILDEST`` decades; half of the seeds below 30, where a rounded answer has a bound."""
    share = (seed * 0.618034) % 1.0
    return WILDEST * share if seed % 2 else 30.0 * share


def _wild(piece: Piece) -> Tally:
    """All tiers, in a given geometry."""
    tally, impacts = nothing(), RandomImpacts(piece.seed, wildness(piece.seed))
    for index in range(REQUESTS):
        scene, model = impacts.request(piece.law)
        request = {"piece": str(piece), "wildness": wildness(piece.seed), "index": index}
        truth = exact_answer(*scene, model)
        for precision in TIERS:
            _try(tally, precision.name, scene, model._replace(precision=precision), truth, request)
    return tally


def _nearly_planar(piece: Piece) -> Tally:
    """AUTO in all respects, against SPATIAL: what is left out must be within the bound."""
    tally, draw = nothing(), random.Random(f"{piece.law.name} {piece.seed}")
    for index in range(REQUESTS):
        tolerance = 10 ** draw.uniform(-8, -1)
        scene = nearly_planar(draw, tolerance * 10 ** draw.uniform(-5, 1))
        truth = exact_answer(*scene, ImpactModel(piece.law, Geometry.SPATIAL))
        request = {"piece": str(piece), "index": index, "tolerance": tolerance}
        geometry = _try(tally, "AUTO", scene, ImpactModel(piece.law, tolerance=tolerance), truth, request)
        tally.counts["AUTO", "in the plane"] += geometry is Geometry.PLANAR
    return tally


def _try(
    tally: Tally, tier: str, scene: Scene, model: ImpactModel, truth: Truth, request: dict[str, Any]
) -> Geometry | None:
    """Count one answer, or its refusal; the geometry in which it was given."""
    tally.counts[tier, "asked"] += 1
    try:
        impact = resolve(*scene, model)
    except ImpactError as refusal:
        tally.counts[tier, f"refused: {refusal.code.name}"] += 1
        return None
    tally.count(tier, impact, truth, request)
    return impact.model.geometry
