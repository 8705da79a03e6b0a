"""One body at one contact, along one direction: the column that a contact adds to the equations of a scene.

An impulse ``p s`` acts on the body at the contact point ``C``, with ``s`` the direction and ``p`` a number.
With the body's twist ``(v, w)`` at its reference point ``x``, and ``d = C - x``:

    velocity    of the body's material at C along s       s.v + w.(d x s)
    arm         how turning the body contributes to it    d x s, so that  d(velocity) = s.dv + arm.dw
    response    change of the twist for p = 1             (dv, dw)

``s`` may have any length: ``p`` is then the impulse divided by that length.
"""

from __future__ import annotations

from typing import NamedTuple

from ..numbers.operations import Scalar
from .body import Body, Twist
from .effective_mass import BodyAtContact
from .vector import Vec3


class Column(NamedTuple):
    """The effect of a body's motion along a direction, and of an impulse in that direction on the body.

    Attributes:
        velocity: of the body's material at the contact along the direction.
        arm: ``d x s``.
        response: change of the body's twist for ``p = 1``.
    """

    velocity: Scalar
    arm: Vec3
    response: Twist

    @classmethod
    def of(cls, body: Body, point: Vec3, direction: Vec3) -> Column:
        """The column of a body at a point, along a direction, both in world axes."""
        at_reference = BodyAtContact.of(body, body.position)
        return cls.at(at_reference, body.velocity, point - body.position, direction)

    @classmethod
    def at(cls, at_reference: BodyAtContact, velocity: Vec3, d: Vec3, direction: Vec3) -> Column:
        """The column of a body that is given as seen from its reference point.

        Args:
            at_reference: the body, for a contact at its reference point.
            velocity: of the reference point [m/s].
            d: from the reference point to the contact point [m].
            direction: ``s``.
        """
        body = at_reference._replace(r=d - at_reference.com, d=d)
        along = direction.dot(velocity) + body.normal_velocity_from_spin(direction)
        return cls(along, body.d.cross(direction), body.twist_change_along(direction, 1, direction))
