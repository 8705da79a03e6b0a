"""A rod that tumbles on a rough floor, under gravity.

In its first impact, engines that apply friction at the end of the impact create energy (T3 in
docs/impact-laws.md): restitution 0.9, friction 0.3, and the rod inclined with slope 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from ..msg import CollisionResult
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.energy import kinetic_energy
from ..physics.orientation import Quaternion
from ..physics.vector import Vec3
from ..ros.convert import twist_of
from .simulation import FRAMES, Collision, EnergyBalance, Resolve, Show
from .time_of_impact import until_touch

GRAVITY = 9.81
MASS, LENGTH = 1.0, 1.0
RESTITUTION, FRICTION = 0.9, 0.3
FALL = 1.25
"""Height of the fall before the first impact [m]."""


class Bounce(NamedTuple):
    """One impact of the rod, at a time of the scene [s] and an angle between rod and floor [rad].

    ``energy`` is the kinetic plus potential energy after it [J], ``spin`` the angular velocity [rad/s].
    """

    time: float
    angle: float
    answer: CollisionResult
    energy: float
    spin: float


class TumblingRod:
    """The rod, which falls on a place of the floor, with its energy balance.

    It rotates about the y axis; ``angle`` is the elevation of its +x end above the horizontal [rad].
    """

    def __init__(self, place: Vec3) -> None:
        self.time = 0.0
        self.angle = math.atan(2.0)
        down = math.sqrt(2 * GRAVITY * FALL)
        centre = place + Vec3(0.0, 0.0, FALL + LENGTH / 2 * math.sin(self.angle))
        self.body = self._oriented(Body.rod(MASS, LENGTH, position=centre, velocity=(down / 2, 0.0, 0.0)))
        self.energy = EnergyBalance(self.total_energy())

    def run(self, resolve: Resolve, show: Show, bounces: int) -> Iterator[Bounce]:
        """Play the scene; yield each bounce."""
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
            answer = resolve(self._collision(end))
            self.body = self.body.with_twist(twist_of(answer.twist_a))
            self.energy.add_impact(self.total_energy(), answer)
            yield Bounce(self.time, angle, answer, self.energy.current, self.body.angular_velocity.y)

    def total_energy(self) -> float:
        """Kinetic plus potential energy [J]."""
        return kinetic_energy(self.body) + MASS * GRAVITY * self.body.position.z

    def _rate(self) -> float:
        return -self.body.angular_velocity.y  # rotation about +y lowers the +x end

    def _gap(self, end: int) -> Callable[[float], tuple[float, float]]:
        """Function that returns the height of an end above the floor, and its rate, at a time from now."""
        z, v = self.body.position.z, self.body.velocity.z
        angle, rate, half = self.angle, self._rate(), end * LENGTH / 2

        def gap(t: float) -> tuple[float, float]:
            angle_then = angle + rate * t
            height = z + v * t - GRAVITY * t * t / 2 + half * math.sin(angle_then)
            return height, v - GRAVITY * t + half * rate * math.cos(angle_then)

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

    def _collision(self, end: int) -> Collision:
        to_end = Vec3(math.cos(self.angle), 0.0, math.sin(self.angle)) * (end * LENGTH / 2)
        contact = Contact.of(self.body.position + to_end, (0.0, 0.0, 1.0), RESTITUTION, FRICTION)
        return Collision(self.time, "rod", "floor", self.body, None, contact)
