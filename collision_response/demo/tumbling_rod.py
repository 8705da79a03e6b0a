"""A rod that tumbles on a rough floor, under gravity.

Its first impact is the one from which engines that settle friction at the end of the impact create
energy (T3 in docs/impact-laws.md): restitution 0.9, friction 0.3, the rod at an angle of slope 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.mass_properties import rod
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3
from .balance import EnergyBalance
from .scene import FRAMES, Answer, Encounter, Resolve, Show
from .time_of_impact import until_touch

GRAVITY = 9.81
MASS, LENGTH = 1.0, 1.0
RESTITUTION, FRICTION = 0.9, 0.3
FALL = 1.25
"""How far it falls before the first impact [m]."""


class Bounce(NamedTuple):
    """One impact of the rod.

    Attributes:
        time: of the scene [s].
        angle: between rod and floor, of the end that touches, before [rad].
        answer: of the node.
        energy: kinetic and potential, after [J].
        spin: rate of turning after [rad/s].
    """

    time: float
    angle: float
    answer: Answer
    energy: float
    spin: float


class Tumbling:
    """The scene, and its balance.

    Attributes:
        time: of the scene [s].
        body: the rod; it turns about the y axis, and ``angle`` is that of its +x end above the horizon.
        angle: [rad].
        energy: its balance.
    """

    def __init__(self, place: Vec3) -> None:
        self.time = 0.0
        self.angle = math.atan(2.0)
        down = math.sqrt(2 * GRAVITY * FALL)
        height = FALL + LENGTH / 2 * math.sin(self.angle)
        self.body = self._oriented(
            Body.dynamic(
                MASS, rod(MASS, LENGTH).inertia, place + Vec3(0.0, 0.0, height), None, (down / 2, 0.0, 0.0)
            )
        )
        self.energy = EnergyBalance(self.total_energy())

    def run(self, resolve: Resolve, show: Show, bounces: int) -> Iterator[Bounce]:
        """Play the scene, bounce by bounce."""
        frame = 0
        for _ in range(bounces):
            wait, end = min((until_touch(self._gap(end), self._curvature(), 10.0), end) for end in (-1, 1))
            event = self.time + wait
            while frame <= event * FRAMES:
                self._advance(frame / FRAMES)
                show(self.time, {"rod": self.body})
                frame += 1
            self._advance(event)
            angle = math.asin(abs(math.sin(self.angle)))
            answer = resolve(self._encounter(end))
            self.body = self.body.with_twist(answer.twist_a)
            self.energy.enter(self.total_energy(), answer.lost_restitution, answer.lost_friction)
            yield Bounce(self.time, angle, answer, self.energy.last, self.body.angular_velocity.y)

    def total_energy(self) -> float:
        """Kinetic and potential [J]."""
        return kinetic_energy(self.body) + MASS * GRAVITY * self.body.position.z

    def _rate(self) -> float:
        return -self.body.angular_velocity.y  # turning about +y lowers the +x end

    def _gap(self, end: int) -> Callable[[float], tuple[float, float]]:
        """Height of an end above the floor, and its rate, at a time from now."""
        z, v = self.body.position.z, self.body.velocity.z
        angle, rate, half = self.angle, self._rate(), end * LENGTH / 2

        def gap(t: float) -> tuple[float, float]:
            turned = angle + rate * t
            height = z + v * t - GRAVITY * t * t / 2 + half * math.sin(turned)
            return height, v - GRAVITY * t + half * rate * math.cos(turned)

        return gap

    def _curvature(self) -> float:
        return GRAVITY + LENGTH / 2 * self._rate() ** 2

    def _advance(self, time: float) -> None:
        dt, self.time = time - self.time, time
        v = self.body.velocity
        self.angle += self._rate() * dt
        self.body = self._oriented(
            self.body._replace(
                position=self.body.position + v * dt - Vec3(0.0, 0.0, GRAVITY * dt * dt / 2),
                velocity=v - Vec3(0.0, 0.0, GRAVITY * dt),
            )
        )

    def _oriented(self, body: Body) -> Body:
        half = -self.angle / 2
        return body._replace(orientation=Quaternion(0.0, math.sin(half), 0.0, math.cos(half)))

    def _encounter(self, end: int) -> Encounter:
        to_end = Vec3(math.cos(self.angle), 0.0, math.sin(self.angle)) * (end * LENGTH / 2)
        contact = Contact.of(self.body.position + to_end, (0.0, 0.0, 1.0), RESTITUTION, FRICTION)
        return Encounter(self.time, "rod", "floor", self.body, None, contact)
