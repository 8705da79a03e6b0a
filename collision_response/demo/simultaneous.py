"""Scenes with several simultaneous contacts: a cradle, a box that lands flat, a tight rack.

There are no forces: the bodies move freely before and after the impact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3

RADIUS, MASS = 0.05, 0.5
SIDE, HEIGHT = 0.3, 0.15
ROWS = 5
"""Rows of the rack."""


class ContactScene(NamedTuple):
    """Moving bodies by name in contact with each other and with static bodies, just before the impact.

    ``pairs`` has for each contact the indices of its two bodies in ``bodies`` followed by the static bodies.
    """

    bodies: dict[str, Body]
    static_names: tuple[str, ...]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]
    law: Law


def cradle(law: Law, start: Vec3) -> ContactScene:
    """Three equal balls in a row along x; the first moves at 1 m/s."""
    balls = [_ball(start + Vec3(2 * RADIUS * i, 0.0, 0.0), float(i == 0)) for i in range(3)]
    return _with_contacts({f"{law.name.lower()}_{i}": ball for i, ball in enumerate(balls)}, 1.0, law)


def flat_box(name: str, floor: str, place: Vec3) -> ContactScene:
    """A box with a square base that lands flat on a floor at 1 m/s; ``place`` is below its centre."""
    half, centre = SIDE / 2, place + Vec3(0.0, 0.0, HEIGHT / 2)
    body = Body.box(1.0, (SIDE, SIDE, HEIGHT), position=centre, velocity=(0.0, 0.0, -1.0))
    corners = [place + Vec3(x, y, 0.0) for x in (-half, half) for y in (-half, half)]
    contacts = [Contact.of(corner, (0.0, 0.0, 1.0), 1.0) for corner in corners]
    return ContactScene({name: body}, (floor,), [(0, 1)] * 4, contacts, Law.AUTO)


def tight_rack(tip: Vec3) -> ContactScene:
    """Fifteen touching balls in a triangle, and a cue ball that strikes the first one head on."""
    pitch = 2 * RADIUS
    balls = {"rack_cue": _ball(tip - Vec3(pitch, 0.0, 0.0), 1.0)}
    for row in range(ROWS):
        for place in range(row + 1):
            offset = Vec3(row * math.sqrt(3) / 2, place - row / 2, 0.0)
            balls[f"rack_{len(balls)}"] = _ball(tip + offset * pitch)
    return _with_contacts(balls, 0.95, Law.FRICTIONLESS)


def mirror_pairs() -> list[tuple[int, int]]:
    """Pairs of indices of balls of the rack that are mirror images of each other."""
    first = [1 + row * (row + 1) // 2 for row in range(ROWS)]
    return [(start + i, start + row - i) for row, start in enumerate(first) for i in range(row + 1)]


def is_approaching(body: Body, contact: Contact) -> bool:
    """Whether a body approaches a static body at a contact."""
    velocity = body.velocity + body.angular_velocity.cross(contact.position - body.position)
    return contact.normal.dot(velocity) < 0


def moved_freely(bodies: Mapping[str, Body], time: float) -> dict[str, Body]:
    """Bodies after free motion for a time [s].

    Their angular velocity is constant, because they are balls, or boxes with a square base that rotate about
    an axis along that base.
    """
    return {name: _moved_freely(body, time) for name, body in bodies.items()}


def _moved_freely(body: Body, time: float) -> Body:
    speed = body.angular_velocity.norm()
    if speed:
        half = speed * time / 2
        x, y, z = body.angular_velocity * (math.sin(half) / speed)
        body = body._replace(orientation=Quaternion(x, y, z, math.cos(half)))
    return body._replace(position=body.position + body.velocity * time)


def _ball(position: Vec3, speed: float = 0.0) -> Body:
    return Body.sphere(MASS, RADIUS, position=position, velocity=(speed, 0.0, 0.0))


def _with_contacts(balls: dict[str, Body], e: float, law: Law) -> ContactScene:
    """A scene of these balls, with a contact wherever two of them touch."""
    centres = [ball.position for ball in balls.values()]
    pairs = [
        (a, b)
        for b in range(len(centres))
        for a in range(b)
        if math.isclose((centres[a] - centres[b]).norm(), 2 * RADIUS, rel_tol=1e-9)
    ]
    contacts = [Contact.of((centres[a] + centres[b]) / 2, centres[a] - centres[b], e) for a, b in pairs]
    return ContactScene(balls, (), pairs, contacts, law)
