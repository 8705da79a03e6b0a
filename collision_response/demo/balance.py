"""Energy balance of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field


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

    def add_impact(self, energy: float, lost_restitution: float, lost_friction: float) -> None:
        """Record an impact: the energy after it, and the losses that its answer reports."""
        self.largest_rise = max(self.largest_rise, energy - self.current)
        self.current = energy
        self.lost_restitution += lost_restitution
        self.lost_friction += lost_friction

    def error(self) -> float:
        """Error of the balance, relative to the initial energy."""
        return abs(self.initial - self.lost_restitution - self.lost_friction - self.current) / self.initial

    def relative_rise(self) -> float:
        """The largest increase, relative to the initial energy."""
        return self.largest_rise / self.initial
