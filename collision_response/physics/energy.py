"""Kinetic energy, and what an impact takes of it.

The two bodies lose exactly the work done against the impulse, at the mean of the contact's
velocities before and after: ``E - E+ = -P.(u + u+) / 2``. Its normal part is what restitution loses,
its tangential part what friction loses.
"""

from __future__ import annotations

from typing import NamedTuple

from .body import Body
from .number import Scalar
from .vector import V, Vec3


class Loss(NamedTuple):
    """Energy lost in an impact [J], by cause."""

    restitution: Scalar
    friction: Scalar


def kinetic_energy(body: Body) -> Scalar:
    """Kinetic energy [J]; 0 for an immovable body."""
    v, w = body.velocity, body.angular_velocity
    w_in_body_axes: Vec3 = w if body.orientation is None else body.orientation.to_body(w)
    return (body.mass * v.dot(v) + w_in_body_axes.dot(body.inertia @ w_in_body_axes)) / 2


def energy_lost(n: V, impulse: V, u: V, u_after: V, normal_work: Scalar | None = None) -> Loss:
    """The loss by cause, from the contact's velocities before and after.

    ``normal_work`` [J] is given by a law that follows the impulse's path, along which the normal
    velocity does not change in proportion to the impulse; the total is the same.
    """
    mean = (u + u_after) / 2
    if normal_work is None:
        normal_work = impulse.dot(n) * mean.dot(n) / n.dot(n)
    return Loss(-normal_work, normal_work - impulse.dot(mean))
