"""The balance of energy of a scene, and its momentum."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from ..physics.body import Body
from ..physics.vector import ZERO, Vec3


@dataclass
class EnergyBalance:
    """What there was, what each impact took, and what is left: the three must agree.

    Attributes:
        first: energy at the start [J].
        last: energy after the latest impact [J].
        lost_restitution, lost_friction: as the answers say [J].
        rise: largest increase of the energy from one impact to the next [J].
    """

    first: float
    last: float = field(init=False)
    lost_restitution: float = 0.0
    lost_friction: float = 0.0
    rise: float = 0.0

    def __post_init__(self) -> None:
        self.last = self.first

    def enter(self, energy: float, lost_restitution: float, lost_friction: float) -> None:
        """One impact: the energy after it, and what its answer says was lost."""
        self.rise = max(self.rise, energy - self.last)
        self.last = energy
        self.lost_restitution += lost_restitution
        self.lost_friction += lost_friction

    def error(self) -> float:
        """By how much first, losses and last disagree, relative to the first."""
        return abs(self.first - self.lost_restitution - self.lost_friction - self.last) / self.first

    def relative_rise(self) -> float:
        """The largest increase, relative to the first."""
        return self.rise / self.first


def momentum(bodies: Iterable[Body]) -> Vec3:
    """Total linear momentum [kg m/s]."""
    return sum((body.velocity * body.mass for body in bodies), ZERO)


def spin_momentum(bodies: Iterable[Body]) -> float:
    """Total angular momentum about the world's z axis [kg m^2/s], of bodies with axes along the world's."""
    return sum(
        body.mass * body.position.cross(body.velocity).z + (body.inertia @ body.angular_velocity).z
        for body in bodies
    )
