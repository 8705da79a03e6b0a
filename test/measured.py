"""Measured impacts for tests of ``identify``: published readings, and point masses that fall."""

from __future__ import annotations

from collision_response import Body, Contact, Twist
from collision_response.identify import Impacts
from collision_response.physics.vector import Vec3

KHARAZ = {
    "ratio": [(30.2218, 0.6883), (39.3031, 0.7719), (49.5459, 0.8469), (59.8416, 0.9019)],
    "angle": [(30.3767, 21.7809), (39.6233, 32.5455), (49.7831, 45.1051), (60.0571, 57.3652)],
    "spin": [(31.0947, 612.6481), (39.0283, 595.4843), (50.2214, 452.9444), (60.2460, 381.3185)],
}
"""Readings from 30 degrees on: Kharaz, Gorham & Salman, Powder Technology 120 (2001) 281-291."""


READING = {"ratio": 0.008, "angle": 0.84, "spin": 44.0}


def falling(*speeds, after=0.5):
    """Point masses on a floor."""
    n = len(speeds)
    twists = [Twist(Vec3(0.0, 0.0, after * speed), Vec3(0.0, 0.0, 0.0)) for speed in speeds]
    balls = [Body.dynamic(1.0, velocity=(0.0, 0.0, -speed)) for speed in speeds]
    return Impacts.of(balls, [Body.static()] * n, [Contact.of((0, 0, 0), (0, 0, 1))] * n, twists, twists)
