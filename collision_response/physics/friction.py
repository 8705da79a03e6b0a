"""Friction that depends on the slip speed, for :attr:`Contact.friction`.

Each function here takes constants of the two surfaces and returns a function ``mu(v)``: the coefficient,
>= 0, for a slip speed ``v`` [m/s]. The returned functions can be pickled. You can also pass a function of
your own. It is called with speeds >= 0. ``mu(0)`` is static friction and may differ from the limit for small
speeds. The Routh laws also call it with speeds slightly beyond those that occur during the impact.

The functions here refuse constants as those of :mod:`~collision_response.physics.restitution` do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial

from ..status import POSITIVE
from .restitution import constant, interpolation

Friction = Callable[[float], float]


def stribeck(static: float, kinetic: float, speed: float) -> Friction:
    """Friction that falls from static to kinetic: ``kinetic + (static - kinetic) exp(-v / speed)``.

    Args:
        static: coefficient at rest, >= 0.
        kinetic: limit of the coefficient for high speed, >= 0.
        speed: slip speed over which the difference falls to 1/2.718 of itself [m/s], > 0.

    Source: Bo & Pavelescu, "The friction-speed relation and its influence on the critical velocity of
    stick-slip motion", Wear 82 (1982) 277-289, with the exponent 1.
    """
    coefficients = constant("static", static), constant("kinetic", kinetic)
    return partial(_stribeck, *coefficients, constant("speed", speed, POSITIVE))


def _stribeck(static: float, kinetic: float, speed: float, v: float) -> float:
    return kinetic + (static - kinetic) * math.exp(-v / speed)


def tabulated(speeds: Iterable[float], values: Iterable[float]) -> Friction:
    """Measured coefficients, interpolated linearly; beyond the first and last speed the value stays constant.

    Args:
        speeds: slip speeds [m/s], >= 0, strictly increasing as floats, at least one.
        values: coefficients, >= 0 and finite, one for each speed.
    """
    return interpolation(speeds, values, math.inf)
