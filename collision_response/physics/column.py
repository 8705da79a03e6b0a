"""One body at one contact, in one direction: the column that a contact adds to the equations of a scene.

With ``d`` the unit direction of an impulse ``p`` on a body, at the point ``C``, its reference point
``x``:

    velocity    of the body's material at C along d            d.v + w.((C - x) x d)
    arm         (C - x) x d: what turning the body does to it  d(velocity) = d.dv + arm.dw
    response    the change of the body's twist for p = 1       (dv, dw)

``d`` need not be of unit length: ``p`` is then the impulse over that length.
"""

from __future__ import annotations

from typing import NamedTuple

from ..numbers.operations import Scalar
from .body import Body, Twist
from .effective_mass import BodyAtContact
from .vector import Vec3


class Column(NamedTuple):
    """What an impulse along a direction does to a body, and what its motion does along it."""

    velocity: Scalar
    arm: Vec3
    response: Twist

    @classmethod
    def of(cls, body: Body, point: Vec3, direction: Vec3) -> Column:
        """The column of a body at a point, along a direction."""
        return cls.at(BodyAtContact.of(body, body.position), body.velocity, point - body.position, direction)

    @classmethod
    def at(cls, centre: BodyAtContact, velocity: Vec3, d: Vec3, direction: Vec3) -> Column:
        """The same, given a body as seen from its reference point: its velocity, and ``d`` from there."""
        side = centre._replace(r=d - centre.com, d=d)
        along = direction.dot(velocity) + side.normal_velocity_from_spin(direction)
        return cls(along, side.d.cross(direction), side.twist_change_along(direction, 1, direction))
