"""Friction that depends on the slip speed, for :attr:`Contact.friction`.

Each function takes constants of the two surfaces and returns ``mu(v)``: the coefficient, >= 0, for a slip
speed ``v`` [m/s]. One of your own is asked for speeds >= 0 only; Routh's laws also ask it for some that slip
does not come to, near those that it does. At 0 it gives static friction, which may be a value by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from . import restitution

Friction = Callable[[float], float]


def stribeck(static: float, kinetic: float, speed: float) -> Friction:
    """From ``static`` at rest to ``kinetic`` at speed: ``kinetic + (static - kinetic) exp(-v / speed)``.

    Source: Bo & Pavelescu, "The friction-speed relation and its influence on the critical velocity of
    stick-slip motion", Wear 82 (1982) 277-289, with the exponent 1.

    Raises:
        ValueError: a coefficient is negative, ``speed`` [m/s] is not positive, or one is not finite.
    """
    for name, value in (("static", static), ("kinetic", kinetic)):
        if not 0 <= value < math.inf:
            raise ValueError(f"{name} must be finite and not negative, is {value}")
    if not 0 < speed < math.inf:
        raise ValueError(f"speed must be positive and finite, is {speed}")
    return lambda v: kinetic + (static - kinetic) * math.exp(-v / speed)


def tabulated(speeds: Sequence[float], values: Sequence[float]) -> Friction:
    """Measured values, with straight lines between them; outside as at the nearest.

    Args:
        speeds: of slip [m/s], >= 0, strictly increasing.
        values: >= 0, one for each speed.

    Raises:
        ValueError: they are not so, or none.
    """
    return restitution.tabulated(speeds, values, most=math.inf)
