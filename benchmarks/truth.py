"""The exact answers, by the tests' oracle, which shares no code with the package.

It computes in rational numbers, and with mpmath where the path of the impulse is followed.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parent.parent / "test"))

import exact
from cases import Scene
from exact import Answer, Solid, Touch

from collision_response import Body, Contact, Impact, Law


def truth_of(scene: Scene, law: Law) -> Answer:
    """The exact answer to a request."""
    return exact.answer(scene_of(scene), law.name)


def scene_of(scene: Scene) -> exact.Scene:
    """A request of the package's as one of the oracle's."""
    solids = (Solid(None if body.mass == math.inf else body.mass, *body[1:7]) for body in scene[:2])
    return exact.Scene(*solids, Touch(*scene.contact[:4]))


def request_of(scene: exact.Scene) -> Scene:
    """A request of the oracle's as one of the package's."""

    def body(solid: Solid) -> Body:
        if solid.mass is None:
            return Body.kinematic(solid.position, solid.velocity, solid.spin)
        return Body.dynamic(*solid)

    return Scene(body(scene.a), body(scene.b), Contact.of(*scene.contact))


def error_of_impact(impact: Impact, truth: Answer) -> float:
    """What ``error_bound`` is about: the greatest relative error of the impulse and of both twist changes.

    Of several answers that a law allows, the nearest counts.
    """

    def error(P: Any) -> float:
        opposite = tuple(-x for x in P)
        return max(
            exact.impulse_error(impact.impulse, P),
            exact.twist_error(truth.pair.a, *impact.change_a, P),
            exact.twist_error(truth.pair.b, *impact.change_b, opposite),
        )

    return min(map(error, truth.impulses))


def error_of_impulse(impulse: Any, truth: Answer) -> float:
    """The relative error of an impulse."""
    return exact.impulse_error([float(x) for x in impulse], truth.impulses[0])


def error_of_twists(twists: Any, scene: Scene, truth: Answer) -> float:
    """Of rows ``(v, w)`` after the impact: the greatest error, relative to what the impact changes."""
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
