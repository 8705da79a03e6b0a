"""Time until two bodies touch. No contact is missed."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..physics.vector import Vec3

TOUCH_GAP = 1e-13
"""Largest gap [m] that counts as touching: about the rounding of positions of some metres."""


def until_spheres_touch(offset: Vec3, velocity: Vec3, reach: float) -> float:
    """Time until two spheres in free motion touch [s]; infinite if they never do.

    ``offset`` [m] and ``velocity`` [m/s] are those of the second relative to the first, ``reach`` the sum of
    the radii [m].
    """
    closing = offset.dot(velocity)
    if closing >= 0:
        return math.inf
    distance = offset.norm()
    gap = (distance - reach) * (distance + reach)
    discriminant = closing * closing - velocity.dot(velocity) * gap
    if discriminant < 0:
        return math.inf
    return max(gap, 0.0) / (math.sqrt(discriminant) - closing)


def until_touch(gap: Callable[[float], tuple[float, float]], curvature: float, limit: float) -> float:
    """Time until a gap closes [s]; infinite if it does not before ``limit``.

    Each step is as long as the gap certainly stays open (conservative advancement). Near the contact this is
    a Newton step, and converges as fast. ``gap`` returns the gap [m] and its rate [m/s] at a time from now;
    ``curvature`` is an upper bound on the magnitude of its second derivative [m/s^2].
    """
    time = 0.0
    while time < limit:
        width, rate = gap(time)
        if width <= TOUCH_GAP and rate < 0:
            return time
        root = math.sqrt(rate * rate + 2 * curvature * max(width, 0.0))
        step = 2 * width / (root - rate) if rate < 0 else (rate + root) / curvature
        time += max(step, 1e-12)
    return math.inf
