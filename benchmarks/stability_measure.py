"""The single measurements of the report: extremes, ill conditions, tolerances, the cost of the bound."""

from __future__ import annotations

import math
import random
import timeit
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

from extremes import ORDINARY, extremes, grazing
from random_impacts import turned_tensor
from reference import exact_answer, true_error
from scenes import Scene
from stability_arithmetics import median_time

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    straight_line,
)
from collision_response.physics.vector import Vec3

TIERS = (Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED)
LAWS = (Law.FRICTIONLESS, Law.COULOMB)
REPEATS = 31
PLANAR_SCENE = Scene(
    Body.dynamic(
        2.0, (0.5, 0.0, 0.0, 0.6, 0.0, 0.4), (0.1, 0.5, 0.0), None, (0.4, -2.0, 0.0), (0.0, 0.0, 0.7)
    ),
    Body.dynamic(
        3.0, (0.7, 0.0, 0.0, 0.5, 0.0, 0.6), (-0.1, -0.6, 0.0), None, (0.1, 1.0, 0.0), (0.0, 0.0, 0.1)
    ),
    Contact.of((0.25, 0.05, 0.0), (0.1, 1.0, 0.0), 0.5, 0.3),
)


def all_extremes() -> list[dict[str, Any]]:
    """Every extreme by every law and tier: its true error, bound and time, or why it is refused."""
    rows = []
    for extreme in extremes():
        for law in LAWS:
            answers = {tier.name: _answer(extreme.scene, _spatial(law, tier)) for tier in TIERS}
            answers["AUTO"] = _answer(extreme.scene, _spatial(law, Precision.AUTO))
            rows.append({"extreme": extreme.name, "law": law.name, "answers": answers})
    return rows


def _spatial(law: Law, precision: Precision) -> ImpactModel:
    return ImpactModel(law, Geometry.SPATIAL, precision)


def _answer(scene: Scene, model: ImpactModel, repeats: int = REPEATS) -> dict[str, Any]:
    try:
        impact = resolve(*scene, model)
    except ImpactError as refusal:
        return {"refused": refusal.code.name}
    return {
        "tier": impact.model.precision.name,
        "status": impact.status.name,
        "error": true_error(impact, exact_answer(*scene, impact.model)),
        "bound": _finite(impact.error_bound),
        "microseconds": median_time(lambda: resolve(*scene, model), repeats),
    }


def _finite(bound: float) -> float | None:
    """A bound for JSON, which knows no infinity."""
    return bound if bound < math.inf else None


def by_condition(samples: int) -> dict[str, list[dict[str, Any]]]:
    """True error and bound against what makes an impact ill-conditioned, one at a time."""
    return {
        "grazing": [_sample(*_grazing(seed), LAWS[seed % 2]) for seed in range(samples)],
        "inertia": [_sample(*_slender(seed), LAWS[seed % 2]) for seed in range(samples)],
    }


def _sample(condition: float, scene: Scene, law: Law) -> dict[str, Any]:
    truth = exact_answer(*scene, ImpactModel(law, Geometry.SPATIAL))
    sample: dict[str, Any] = {"condition": condition}
    for tier in TIERS:
        impact = resolve(*scene, _spatial(law, tier))
        sample[tier.name] = [true_error(impact, truth), _finite(impact.error_bound)]
    return sample


def _grazing(seed: int) -> tuple[float, Scene]:
    draw = random.Random(seed)
    condition = 10 ** draw.uniform(0, 15)
    return condition, grazing(1 / condition, _varied(draw, ORDINARY.body_a.inertia))


def _slender(seed: int) -> tuple[float, Scene]:
    """A body with one moment much smaller than the others, in principal axes or in turned ones."""
    draw = random.Random(seed)
    condition = 10 ** draw.uniform(0, 15)
    x, y, z = 1.0, draw.random() / condition, draw.random() / condition
    moments = (y + z, x + z, x + y)
    if draw.random() < 0.5:
        inertia = turned_tensor(moments, [draw.gauss(0, 1) for _ in range(4)])
    else:
        inertia = (moments[0], 0.0, 0.0, moments[1], 0.0, moments[2])
    while True:
        scene = _varied(draw, inertia)
        if resolve(*scene).status is not StatusCode.SEPARATING:
            return max(moments) / min(moments), scene


def _varied(draw: random.Random, inertia: tuple[float, ...]) -> Scene:
    """``ORDINARY`` with other velocities, and another body_a."""

    def vector() -> Vec3:
        return Vec3(*(draw.gauss(0, 1) for _ in range(3)))

    body = ORDINARY.body_a
    body = Body.dynamic(body.mass, inertia, body.position, body.orientation, vector(), vector())
    return ORDINARY._replace(body_a=body, body_b=ORDINARY.body_b._replace(velocity=vector()))


def tolerances() -> list[dict[str, Any]]:
    """One grazing contact, asked for ever more digits."""
    scene = grazing(1e-10)
    return [
        {"tolerance": tolerance, **_answer(scene, ImpactModel(Law.COULOMB, tolerance=tolerance), 101)}
        for tolerance in (1e-3, 1e-9, 1e-15)
    ]


def cost_of_the_bound() -> list[dict[str, Any]]:
    """The time of one impact with its bound and without [us]: the least of many, taken in turns."""
    rows = []
    for geometry, scene in (
        (Geometry.POINT, PLANAR_SCENE),
        (Geometry.PLANAR, PLANAR_SCENE),
        (Geometry.SPATIAL, ORDINARY),
    ):
        for law in LAWS:
            model = ImpactModel(law, geometry, Precision.DOUBLE)
            whole, impact = [], []
            for _ in range(60):
                whole.append(_least_time(scene, model))
                with _no_bound():
                    impact.append(_least_time(scene, model))
            times = {"whole": min(whole), "impact": min(impact)}
            rows.append({"geometry": geometry.name, "law": law.name, **times})
    return rows


def _least_time(scene: Scene, model: ImpactModel) -> float:
    resolve(*scene, model)
    return 1e6 * min(timeit.repeat(lambda: resolve(*scene, model), number=20, repeat=5)) / 20


@contextmanager
def _no_bound() -> Iterator[None]:
    """``resolve`` as it would be without a bound; what grazes it must know all the same."""
    straight_line.computation.cache_clear()
    with mock.patch.object(straight_line, "bound_of_collision", lambda *_: 0.0):
        yield
    straight_line.computation.cache_clear()
