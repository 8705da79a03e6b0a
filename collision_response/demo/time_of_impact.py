"""When bodies touch: found exactly, and no contact stepped over."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..physics.vector import Vec3

TOUCHING = 1e-13
"""A gap [m] that counts as none: rounding of positions of some metres is about as large."""


def until_spheres_touch(offset: Vec3, velocity: Vec3, reach: float) -> float:
    """Time until two spheres touch, if nothing stops them [s]; infinite if they never do.

    Args:
        offset: from the centre of one to that of the other [m].
        velocity: of the other relative to the one [m/s].
        reach: sum of the radii [m].
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

    Each step is as long as the gap is sure to stay open (conservative advancement). Close to the
    touch that is Newton's step, so it converges as fast.

    Args:
        gap: the gap [m] and its rate [m/s] at a time from now [s].
        curvature: a bound on the size of its second derivative [m/s^2].
        limit: how far to look [s].
    """
    time = 0.0
    while time < limit:
        width, rate = gap(time)
        if width <= TOUCHING and rate < 0:
            return time
        root = math.sqrt(rate * rate + 2 * curvature * max(width, 0.0))
        step = 2 * width / (root - rate) if rate < 0 else (rate + root) / curvature
        time += max(step, 1e-12)
    return math.inf
