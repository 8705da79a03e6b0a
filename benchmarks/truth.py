"""Exact answers from the tests' oracle, which shares no code with the package.

It computes with rational numbers, and with mpmath for laws that follow the path of the impulse.
"""

from __future__ import annotations

from typing import Any

import exact
from cases import Scene
from exact import Answer
from exact_adapter import as_request as as_request
from exact_adapter import exact_answer
from exact_adapter import true_error as true_error

from collision_response import Body, ImpactModel, Law


def truth_of(scene: Scene, law: Law) -> Answer:
    """The exact answer to a request."""
    return exact_answer(*scene, ImpactModel(law))


def error_of_impulse(impulse: Any, truth: Answer) -> float:
    """The relative error of an impulse."""
    return exact.impulse_error([float(x) for x in impulse], truth.impulses[0])


def error_of_twists(twists: Any, scene: Scene, truth: Answer) -> float:
    """Largest error of twists ``(v, w)`` after the impact, relative to what the impact changes."""
    P = truth.impulses[0]
    errors = []
    for body, side, row, push in zip(
        scene[:2], (truth.pair.a, truth.pair.b), twists, (P, tuple(-x for x in P)), strict=True
    ):
        change = [
            exact.Fraction(float(x)) - exact.Fraction(y) for x, y in zip(row, _motion(body), strict=True)
        ]
        errors.append(exact.twist_error(side, change[:3], change[3:], push))  # type: ignore[arg-type]
    return max(errors)


def _motion(body: Body) -> list[float]:
    return [*body.velocity, *body.angular_velocity]
