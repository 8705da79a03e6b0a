"""How energy and momentum drift over many elastic impacts between the same bodies.

Three bodies stay where they are and strike each other at random points, in random directions, so that
in exact arithmetic the kinetic energy, the momentum and the angular momentum about the origin would
stay what they are. Between the impacts the velocities are float64 (or float32), as a user keeps them.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from flint import ctx

from collision_response import Body, Contact, Geometry, ImpactModel, Law, Precision, resolve
from collision_response.numerics import extended
from collision_response.numerics.error_bound import survey
from collision_response.physics.body import Twist
from collision_response.physics.effective_mass import Spatial
from collision_response.physics.energy import kinetic_energy
from collision_response.physics.laws import Parameters, frictionless
from collision_response.physics.vector import ZERO, Vec3
from collision_response.tiers import GRAZING

Step = Callable[[Body, Body, Contact], tuple[Twist, Twist]]
ELASTIC = Parameters(1.0)
CHECKED = 300
"""Impacts of each drift that are compared with what ``resolve`` answers, to the last bit."""


class Invariants(NamedTuple):
    """What elastic impacts keep."""

    energy: Any
    momentum: Vec3
    angular_momentum: Vec3


def drift(tier: str, impacts: int) -> list[dict[str, float]]:
    """The relative drifts after 1, 2, 5, 10, ... impacts.

    Momenta are relative to those that the bodies would have if all moved one way.
    """
    step, number = STEPS[tier]
    bodies, contacts = _scene(number)
    start = _invariants(bodies)
    scale = _momentum_scale(bodies, start.energy)
    marks, rows = set(_marks(impacts)), []
    draw = random.Random(1)
    for count in range(1, impacts + 1):
        a, b, contact = draw.choice(contacts)
        twists = step(bodies[a], bodies[b], contact)
        if count <= CHECKED and tier in PRECISIONS:
            _check(tier, bodies[a], bodies[b], contact, twists)
        for i, twist in zip((a, b), twists, strict=True):
            bodies[i] = bodies[i]._replace(velocity=twist.linear, angular_velocity=twist.angular)
        if count in marks:
            rows.append({"impacts": count, **_drifts(_invariants(bodies), start, scale)})
    return rows


def _plain(body_a: Body, body_b: Body, contact: Contact) -> tuple[Twist, Twist]:
    return _after(Spatial.prepare(body_a, body_b, contact))


def _speed_made_good(body_a: Body, body_b: Body, contact: Contact) -> tuple[Twist, Twist]:
    approach = Spatial.prepare(body_a, body_b, contact)
    sizes = survey(approach)
    if sizes.u_n_error > GRAZING * abs(sizes.u_n):
        n_u = extended.exact_normal_velocity(Spatial.prepare, body_a, body_b, contact)
        approach = approach._replace(n_u=n_u)
    return _after(approach)


def _in_balls(body_a: Body, body_b: Body, contact: Contact) -> tuple[Twist, Twist]:
    with ctx.workprec(extended.BITS[0]):
        a, b = (extended.with_inverse_mass(extended.lift(body)) for body in (body_a, body_b))
        twist_a, twist_b = _after(Spatial.prepare(a, b, extended.lift(contact)))
    return extended.lower(twist_a), extended.lower(twist_b)


def _after(approach: Spatial) -> tuple[Twist, Twist]:
    """Whichever way the normal points: at e = 1 the formula also turns separation into approach."""
    response = approach.respond(frictionless(approach, ELASTIC).impulse)
    return (
        approach.body_a.moved_by(response.change_a).twist(),
        approach.body_b.moved_by(response.change_b).twist(),
    )


STEPS: dict[str, tuple[Step, Callable[[float], Any]]] = {
    "float32": (_plain, np.float32),
    "SINGLE": (_plain, float),
    "DOUBLE": (_speed_made_good, float),
    "EXTENDED": (_in_balls, float),
}
PRECISIONS = {precision.name: precision for precision in Precision}


def _check(tier: str, body_a: Body, body_b: Body, contact: Contact, twists: tuple[Twist, Twist]) -> None:
    """The drift is that of the tier: ``resolve`` gives the same, once the normal points the right way."""
    if Spatial.prepare(body_a, body_b, contact).n_u > 0:
        contact = contact._replace(normal=-contact.normal)
    model = ImpactModel(Law.FRICTIONLESS, Geometry.SPATIAL, PRECISIONS[tier])
    impact = resolve(body_a, body_b, contact, model)
    assert (impact.twist_a, impact.twist_b) == twists, (tier, contact)


def _scene(number: Callable[[float], Any]) -> tuple[list[Body], list[tuple[int, int, Contact]]]:
    """Three bodies at rest relative to the axes, but with velocities; and where they can touch."""
    draw = random.Random(20)

    def vector(size: float = 1.0) -> list[Any]:
        return [number(size * draw.gauss(0, 1)) for _ in range(3)]

    def body(mass: float) -> Body:
        x, y, z = (mass * draw.uniform(0.1, 0.4) for _ in range(3))
        moments = [number(i) for i in (y + z, 0.0, 0.0, x + z, 0.0, x + y)]
        turn = [number(draw.gauss(0, 1)) for _ in range(4)]
        return Body.dynamic(number(mass), moments, vector(), turn, vector(), vector())

    def contact() -> Contact:
        return Contact.of(vector(0.5), vector(), number(1.0))

    bodies = [body(mass) for mass in (1.0, 1.7, 0.6)]
    return bodies, [(a, b, contact()) for a, b in ((0, 1), (1, 2), (2, 0)) for _ in range(40)]


def _invariants(bodies: list[Body]) -> Invariants:
    """With more digits than the bodies have."""
    with ctx.workprec(200):
        lifted = [_exactly(body) for body in bodies]
        momenta = [body.velocity * body.mass for body in lifted]
        angular = [
            body.position.cross(p) + _spin_momentum(body) for body, p in zip(lifted, momenta, strict=True)
        ]
        energy = sum(kinetic_energy(body) for body in lifted)
        return Invariants(energy, sum(momenta, ZERO), sum(angular, ZERO))


def _exactly(body: Body) -> Body:
    return extended.lift(Body(*(_as_floats(part) for part in body)))


def _as_floats(value: Any) -> Any:
    if isinstance(value, tuple):
        return type(value)(*(float(x) for x in value))
    return float(value)


def _spin_momentum(body: Body) -> Vec3:
    turn = body.orientation
    return turn.to_world(body.inertia @ turn.to_body(body.angular_velocity))


def _momentum_scale(bodies: list[Body], energy: Any) -> float:
    return math.sqrt(2 * float(energy) * float(sum(body.mass for body in bodies)))


def _drifts(now: Invariants, start: Invariants, scale: float) -> dict[str, float]:
    with ctx.workprec(200):
        return {
            "energy": abs(float((now.energy - start.energy) / start.energy)),
            "momentum": float((now.momentum - start.momentum).norm()) / scale,
            "angular momentum": float((now.angular_momentum - start.angular_momentum).norm()) / scale,
        }


def _marks(impacts: int) -> Iterator[int]:
    decade = 1
    while decade <= impacts:
        yield from (decade, 2 * decade, 5 * decade)
        decade *= 10
