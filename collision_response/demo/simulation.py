"""What the simulations share. They find their contacts themselves, and the caller resolves them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..physics.body import Body
from ..physics.contact import Contact

FRAMES = 20
"""Number of times that a simulation shows its bodies, per second of its own time."""


class Collision(NamedTuple):
    """Two bodies in contact, just before the impact, at a time of the simulation [s].

    ``body_b`` is ``None`` if it is static and known to the node by its name.
    """

    time: float
    name_a: str
    name_b: str
    body_a: Body
    body_b: Body | None
    contact: Contact


Resolve = Callable[[Collision], Any]
"""Returns the ``CollisionResult``."""

Show = Callable[[float, Mapping[str, Body]], None]
"""Called with the time of the simulation [s] and the bodies by name."""


@dataclass
class EnergyBalance:
    """The initial energy minus the losses of all impacts must equal the current energy.

    Attributes:
        initial: energy at the start [J].
        current: energy after the latest impact [J].
        lost_restitution, lost_friction: sums of the losses reported by the answers [J].
        largest_rise: largest increase of the energy from one impact to the next [J].
    """

    initial: float
    current: float = field(init=False)
    lost_restitution: float = 0.0
    lost_friction: float = 0.0
    largest_rise: float = 0.0

    def __post_init__(self) -> None:
        self.current = self.initial

    def add_impact(self, energy: float, answer: Any) -> None:
        """Record an impact: the energy after it, and its answer, which reports the losses."""
        self.largest_rise = max(self.largest_rise, energy - self.current)
        self.current = energy
        self.lost_restitution += answer.energy_lost_restitution
        self.lost_friction += answer.energy_lost_friction

    def error(self) -> float:
        """Error of the balance, relative to the initial energy."""
        return abs(self.initial - self.lost_restitution - self.lost_friction - self.current) / self.initial

    def relative_rise(self) -> float:
        """The largest increase, relative to the initial energy."""
        return self.largest_rise / self.initial
