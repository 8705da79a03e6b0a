"""Kinetic energy.

An impact takes exactly the work done against the impulse, at the mean of the contact's velocities before
and after: ``E - E+ = -P.(u + u+) / 2``. Its normal part is what restitution loses, the rest what friction
loses; each law says how much, in the form that rounds best.
"""

from __future__ import annotations

from ..numbers.operations import Scalar, choose
from .body import Body


def kinetic_energy(body: Body) -> Scalar:
    """Kinetic energy [J]; 0 for an immovable body, and for an articulated one, of which it is not known."""
    spin = body.to_body(body.angular_velocity)
    v = body.velocity + body.angular_velocity.cross(body.to_world(body.com))
    energy = (body.mass * v.dot(v) + spin.dot(body.inertia @ spin)) / 2
    return choose(body.has_mass(), lambda: energy, lambda: spin.x * 0)
