"""Kinetic energy.

An impact removes exactly the work done against the impulse ``P`` at the mean of the relative velocities
before and after, ``u`` and ``u+``:

    E - E+ = -P.(u + u+) / 2

Each law divides this loss into one to restitution and one to friction: see ``docs/impact-laws.md``.
"""

from __future__ import annotations

from ..numbers.operations import Scalar, choose
from .body import Body


def kinetic_energy(body: Body) -> Scalar:
    """Kinetic energy [J]; 0 for an immovable body, and for an articulated one, whose energy is not known."""
    spin = body.to_body(body.angular_velocity)
    v = body.velocity + body.angular_velocity.cross(body.to_world(body.com))

    def energy() -> Scalar:  # only with a mass: large fractions overflow the float of an infinite one
        return (body.mass * v.dot(v) + spin.dot(body.inertia @ spin)) / 2

    return choose(body.has_mass(), energy, lambda: spin.x * 0)
