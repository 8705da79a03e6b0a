"""Scenes in which several contacts strike at once: a cradle, a box that lands flat, a tight rack.

Nothing holds their bodies: they glide up to the impact, and away from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.mass_properties import box, sphere
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3

RADIUS, MASS = 0.05, 0.5
SIDE, HEIGHT = 0.3, 0.15
ROWS = 5
"""Of the rack."""


class Touching(NamedTuple):
    """Bodies that touch, as they are just before they strike.

    Attributes:
        bodies: those that move, by name.
        others: names of those that stand still.
        pairs: for each contact, the places of its bodies among all of these.
        contacts: where and how.
        law: by which.
    """

    bodies: dict[str, Body]
    others: tuple[str, ...]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]
    law: Law


def cradle(law: Law, start: Vec3) -> Touching:
    """Three equal balls in a row along x, of which the first comes at 1 m/s."""
    balls = [_ball(start + Vec3(2 * RADIUS * i, 0.0, 0.0), float(i == 0)) for i in range(3)]
    return _of_balls({f"{law.name.lower()}_{i}": ball for i, ball in enumerate(balls)}, 1.0, law)


def flat_box(name: str, floor: str, below: Vec3) -> Touching:
    """A box with a square base that comes down at 1 m/s, flat on a floor."""
    half = SIDE / 2
    inertia = box(1.0, (SIDE, SIDE, HEIGHT)).inertia
    body = Body.dynamic(1.0, inertia, below + Vec3(0.0, 0.0, HEIGHT / 2), None, (0.0, 0.0, -1.0))
    corners = [below + Vec3(x, y, 0.0) for x in (-half, half) for y in (-half, half)]
    contacts = [Contact.of(corner, (0.0, 0.0, 1.0), 1.0) for corner in corners]
    return Touching({name: body}, (floor,), [(0, 1)] * 4, contacts, Law.AUTO)


def tight_rack(tip: Vec3) -> Touching:
    """Fifteen balls in a triangle that touch, and a cue ball that strikes the first of them head on."""
    pitch = 2 * RADIUS
    balls = {"rack_cue": _ball(tip - Vec3(pitch, 0.0, 0.0), 1.0)}
    for row in range(ROWS):
        for place in range(row + 1):
            beside = Vec3(row * math.sqrt(3) / 2, place - row / 2, 0.0)
            balls[f"rack_{len(balls)}"] = _ball(tip + beside * pitch)
    return _of_balls(balls, 0.95, Law.FRICTIONLESS)


def mirrored_in_rack() -> list[tuple[int, int]]:
    """The places of two balls of the rack that are each other's image."""
    first = [1 + row * (row + 1) // 2 for row in range(ROWS)]
    return [(start + i, start + row - i) for row, start in enumerate(first) for i in range(row + 1)]


def approaches(body: Body, contact: Contact) -> bool:
    """Whether a body moves into what stands still at a contact."""
    moves = body.velocity + body.angular_velocity.cross(contact.position - body.position)
    return contact.normal.dot(moves) < 0


def drifted(bodies: Mapping[str, Body], time: float) -> dict[str, Body]:
    """Where bodies are after a time in which nothing strikes them [s].

    Their spin stays: they are balls, or boxes with a square base that turn about an axis along it.
    """
    return {name: _drifted(body, time) for name, body in bodies.items()}


def _drifted(body: Body, time: float) -> Body:
    speed = body.angular_velocity.norm()
    if speed:
        half = speed * time / 2
        x, y, z = body.angular_velocity * (math.sin(half) / speed)
        body = body._replace(orientation=Quaternion(x, y, z, math.cos(half)))
    return body._replace(position=body.position + body.velocity * time)


def _ball(at: Vec3, speed: float = 0.0) -> Body:
    return Body.dynamic(MASS, sphere(MASS, RADIUS).inertia, at, None, (speed, 0.0, 0.0))


def _of_balls(balls: dict[str, Body], e: float, law: Law) -> Touching:
    """Balls, and a contact where two of them touch."""
    at = [ball.position for ball in balls.values()]
    pairs = [
        (a, b)
        for b in range(len(at))
        for a in range(b)
        if math.isclose((at[a] - at[b]).norm(), 2 * RADIUS, rel_tol=1e-9)
    ]
    contacts = [Contact.of((at[a] + at[b]) / 2, at[a] - at[b], e) for a, b in pairs]
    return Touching(balls, (), pairs, contacts, law)
