"""A break shot: sixteen balls on a table without pockets or cloth.

The balls glide like pucks, so all motion is in the plane, and nothing but impacts takes energy. Each
contact is found at its exact time: between impacts all paths are straight.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.mass_properties import sphere
from ..physics.vector import ZERO, Vec3
from .balance import EnergyBalance, momentum, spin_momentum
from .scene import FRAMES, Answer, Encounter, Resolve, Show
from .time_of_impact import until_spheres_touch

RADIUS, MASS = 0.028575, 0.17
LENGTH, WIDTH = 2.24, 1.12
SPEED = 10.0
"""Of the cue ball [m/s]."""

LOOSE = 2e-4
"""How far apart the balls of a rack are, more or less [m]: no rack is tight."""

BALL_ON_BALL = {"restitution": 0.95, "friction": 0.06}
BALL_ON_CUSHION = {"restitution": 0.9, "friction": 0.1}

CUSHIONS = {
    "cushion_left": Vec3(1.0, 0.0, 0.0),
    "cushion_right": Vec3(-1.0, 0.0, 0.0),
    "cushion_near": Vec3(0.0, 1.0, 0.0),
    "cushion_far": Vec3(0.0, -1.0, 0.0),
}
"""The normal of each: into the table. The table's middle is the origin."""


def cushion_bodies() -> dict[str, Body]:
    """The cushions, which stand still."""
    return {
        name: Body.static(Vec3(-n.x * LENGTH / 2, -n.y * WIDTH / 2, RADIUS)) for name, n in CUSHIONS.items()
    }


def rack() -> dict[str, Body]:
    """The cue ball on its way, and fifteen balls in a triangle."""
    chance = random.Random(9)
    pitch = 2 * RADIUS + LOOSE
    balls = {"cue": _ball(-LENGTH / 4, 0.003, SPEED)}
    for row in range(5):
        for place in range(row + 1):
            x = LENGTH / 4 + row * pitch * math.sqrt(3) / 2
            y = (place - row / 2) * pitch
            shift = [chance.uniform(-LOOSE, LOOSE) / 3 for _ in range(2)]
            balls[f"ball_{len(balls)}"] = _ball(x + shift[0], y + shift[1])
    return balls


def _ball(x: float, y: float, speed: float = 0.0) -> Body:
    return Body.dynamic(MASS, sphere(MASS, RADIUS).inertia, (x, y, RADIUS), None, (speed, 0.0, 0.0))


class Break:
    """The scene, and its balance.

    Attributes:
        time: of the scene [s].
        balls: by name.
        impacts: number of those resolved so far.
        energy: its balance.
        given: momentum that the cushions have taken [kg m/s].
        given_spin: angular momentum about the table's middle that they have taken [kg m^2/s].
    """

    def __init__(self, balls: Mapping[str, Body]) -> None:
        self.time = 0.0
        self.balls = dict(balls)
        self.impacts = 0
        self.energy = EnergyBalance(self._kinetic_energy())
        self.given, self.given_spin = ZERO, 0.0
        self._momentum = momentum(self.balls.values())
        self._spin = spin_momentum(self.balls.values())

    def run(self, resolve: Resolve, show: Show, duration: float) -> Iterator[int]:
        """Play the scene; gives the number of impacts after each."""
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
                encounter = self._encounter(name_a, name_b)
                self._enter(encounter, resolve(encounter))
                yield self.impacts

    def momentum_error(self) -> float:
        """By how much the momentum of balls and cushions has changed, relative to the cue ball's."""
        change = momentum(self.balls.values()) + self.given - self._momentum
        return change.norm() / (MASS * SPEED)

    def spin_error(self) -> float:
        """The same for the angular momentum about the table's middle."""
        change = spin_momentum(self.balls.values()) + self.given_spin - self._spin
        return abs(change) / (MASS * SPEED * LENGTH / 2)

    def _next(self) -> tuple[float, str, str]:
        """The next contact: how long until then [s], and which two."""
        best = (math.inf, "", "")
        names = list(self.balls)
        for i, a in enumerate(names):
            p, v = self.balls[a].position, self.balls[a].velocity
            for cushion, n in CUSHIONS.items():
                if (speed := n.dot(v)) < 0:
                    room = (LENGTH if n.x else WIDTH) / 2 - RADIUS + n.dot(p)
                    best = min(best, (max(room, 0.0) / -speed, a, cushion))
            for b in names[:i]:
                other = self.balls[b]
                wait = until_spheres_touch(other.position - p, other.velocity - v, 2 * RADIUS)
                best = min(best, (wait, a, b))
        return best

    def _advance(self, time: float) -> None:
        dt, self.time = time - self.time, time
        for name, ball in self.balls.items():
            self.balls[name] = ball._replace(position=ball.position + ball.velocity * dt)

    def _encounter(self, name_a: str, name_b: str) -> Encounter:
        a, b = self.balls[name_a], self.balls.get(name_b)
        if b is None:
            n = CUSHIONS[name_b]
            contact = Contact.of(a.position - n * RADIUS, n, **BALL_ON_CUSHION)
        else:
            contact = Contact.of((a.position + b.position) / 2, a.position - b.position, **BALL_ON_BALL)
        return Encounter(self.time, name_a, name_b, a, b, contact)

    def _enter(self, encounter: Encounter, answer: Answer) -> None:
        self.impacts += 1
        self.balls[encounter.name_a] = encounter.body_a.with_twist(answer.twist_a)
        if encounter.body_b is not None:
            self.balls[encounter.name_b] = encounter.body_b.with_twist(answer.twist_b)
        else:
            self.given -= answer.impulse
            self.given_spin -= encounter.contact.position.cross(answer.impulse).z
        self.energy.enter(self._kinetic_energy(), answer.lost_restitution, answer.lost_friction)

    def _kinetic_energy(self) -> float:
        return math.fsum(kinetic_energy(ball) for ball in self.balls.values())
