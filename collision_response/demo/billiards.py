"""A break shot: sixteen balls on a table without pockets or cloth.

The balls slide without friction on the table, so all motion is planar and only impacts change the energy.
Between impacts all paths are straight, so the time of each contact has a closed form.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping

from ..msg import CollisionResult
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.vector import Vec3
from ..ros.convert import twist_of
from .simulation import FRAMES, Collision, EnergyBalance, Resolve, Show
from .time_of_impact import until_spheres_touch

RADIUS, MASS = 0.028575, 0.17
LENGTH, WIDTH = 2.24, 1.12
SPEED = 10.0
"""Initial speed of the cue ball [m/s]."""

GAP = 2e-4
"""Mean gap between the balls of the rack [m]: no real rack is tight."""

BALL_ON_BALL = {"restitution": 0.95, "friction": 0.06}
BALL_ON_CUSHION = {"restitution": 0.9, "friction": 0.1}

CUSHIONS = {
    "cushion_left": Vec3(1.0, 0.0, 0.0),
    "cushion_right": Vec3(-1.0, 0.0, 0.0),
    "cushion_near": Vec3(0.0, 1.0, 0.0),
    "cushion_far": Vec3(0.0, -1.0, 0.0),
}
"""Normals of the cushions, towards the table. The origin is the middle of the table."""


def cushion_bodies() -> dict[str, Body]:
    """The cushions as static bodies, by name."""
    return {
        name: Body.static(Vec3(-n.x * LENGTH / 2, -n.y * WIDTH / 2, RADIUS)) for name, n in CUSHIONS.items()
    }


def rack() -> dict[str, Body]:
    """The moving cue ball, and fifteen balls in a triangle."""
    rng = random.Random(9)
    pitch = 2 * RADIUS + GAP
    balls = {"cue": _ball(-LENGTH / 4, 0.003, SPEED)}
    for row in range(5):
        for place in range(row + 1):
            x = LENGTH / 4 + row * pitch * math.sqrt(3) / 2
            y = (place - row / 2) * pitch
            shift = [rng.uniform(-GAP, GAP) / 3 for _ in range(2)]
            balls[f"ball_{len(balls)}"] = _ball(x + shift[0], y + shift[1])
    return balls


def _ball(x: float, y: float, speed: float = 0.0) -> Body:
    return Body.sphere(MASS, RADIUS, position=(x, y, RADIUS), velocity=(speed, 0.0, 0.0))


class Break:
    """The balls by name, with the number of their impacts so far and their energy balance."""

    def __init__(self, balls: Mapping[str, Body]) -> None:
        self.time = 0.0
        self.balls = dict(balls)
        self.impacts = 0
        self.energy = EnergyBalance(self._kinetic_energy())

    def run(self, resolve: Resolve, show: Show, duration: float) -> None:
        """Play the break."""
        frame = 0
        while self.time < duration:
            wait, name_a, name_b = self._next()
            event = min(self.time + wait, duration)
            while frame <= event * FRAMES:
                self._advance(frame / FRAMES)
                show(self.time, self.balls)
                frame += 1
            self._advance(event)
            if event < duration:
                collision = self._collision(name_a, name_b)
                self._apply(collision, resolve(collision))

    def _next(self) -> tuple[float, str, str]:
        """The next contact: time until it happens [s], and the names of both bodies."""
        best = (math.inf, "", "")
        names = list(self.balls)
        for i, a in enumerate(names):
            p, v = self.balls[a].position, self.balls[a].velocity
            for cushion, n in CUSHIONS.items():
                if (speed := n.dot(v)) < 0:
                    gap = (LENGTH if n.x else WIDTH) / 2 - RADIUS + n.dot(p)
                    best = min(best, (max(gap, 0.0) / -speed, a, cushion))
            for b in names[:i]:
                other = self.balls[b]
                wait = until_spheres_touch(other.position - p, other.velocity - v, 2 * RADIUS)
                best = min(best, (wait, a, b))
        return best

    def _advance(self, time: float) -> None:
        dt, self.time = time - self.time, time
        for name, ball in self.balls.items():
            self.balls[name] = ball._replace(position=ball.position + ball.velocity * dt)

    def _collision(self, name_a: str, name_b: str) -> Collision:
        a, b = self.balls[name_a], self.balls.get(name_b)
        if b is None:
            n = CUSHIONS[name_b]
            contact = Contact.of(a.position - n * RADIUS, n, **BALL_ON_CUSHION)
        else:
            contact = Contact.of((a.position + b.position) / 2, a.position - b.position, **BALL_ON_BALL)
        return Collision(self.time, name_a, name_b, a, b, contact)

    def _apply(self, collision: Collision, answer: CollisionResult) -> None:
        self.impacts += 1
        self.balls[collision.name_a] = collision.body_a.with_twist(twist_of(answer.twist_a))
        if collision.body_b is not None:
            self.balls[collision.name_b] = collision.body_b.with_twist(twist_of(answer.twist_b))
        self.energy.add_impact(self._kinetic_energy(), answer)

    def _kinetic_energy(self) -> float:
        return math.fsum(kinetic_energy(ball) for ball in self.balls.values())
