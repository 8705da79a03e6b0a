"""Two bodies as seen from their contact: relative velocity, effective mass, response.

With the lever arms ``r = C - x`` from the centres of mass ``x`` to the contact point ``C``, the velocity
of body_a relative to body_b at the contact is

    u = v_A + w_A x r_A - v_B - w_B x r_B

An impulse ``P`` on body_a, and ``-P`` on body_b, changes it to ``u + K P``, with the inverse effective
mass at the contact, a symmetric positive definite tensor

    K = (1/m_A + 1/m_B) 1 - [r_A]x I_A^-1 [r_A]x - [r_B]x I_B^-1 [r_B]x

Along the normal ``n`` only ``n.K n`` matters; the effective mass is ``n.n / n.K n``.

The inertia stays in body axes, where it is best conditioned: with ``G = R^T [r]x``, the moment in body
axes that an impulse has, ``-[r]x R I^-1 R^T [r]x = G^T I^-1 G``.

There is one formula for all geometries. Where rotation or a third dimension is not modelled, the numbers
of it are 0.
"""

from __future__ import annotations

from typing import NamedTuple

from ..numbers.number import Condition, Scalar, all_zero, choose, negation
from .body import Body, Twist
from .contact import Contact
from .orientation import ALIGNED, Rotation
from .tensor import InverseTensor, Symmetric3
from .vector import Vec3


class Side(NamedTuple):
    """One body as seen from the contact.

    Attributes:
        inverse_mass: [1/kg].
        inverse_inertia: in body axes [1/(kg m^2)].
        rotation: from body axes to world axes.
        is_eccentric: whether the reference point is not the centre of mass.
        com: from the one to the other, in world axes [m].
        r: lever arm: from the centre of mass to the contact point, in world axes [m].
        d: from the reference point to the contact point [m].
        spin: angular velocity, but for what moves no contact for want of inertia [rad/s].
        idle: that rest of it [rad/s].
        drives: whether there is no such rest.
    """

    inverse_mass: Scalar
    inverse_inertia: InverseTensor
    rotation: Rotation
    is_eccentric: Condition
    com: Vec3
    r: Vec3
    d: Vec3
    spin: Vec3
    idle: Vec3
    drives: Condition

    @classmethod
    def of(cls, body: Body, point: Vec3) -> Side:
        rotation = ALIGNED if body.orientation is None else body.orientation.rotation()
        eccentric = negation(all_zero(body.com))
        com = choose(eccentric, lambda: rotation.to_world(body.com), lambda: body.com)
        d = point - body.position
        r = choose(eccentric, lambda: d - com, lambda: d)
        drives, spin = body.driving_spin()
        idle = choose(drives, lambda: spin * 0, lambda: body.angular_velocity - spin)
        return cls(
            body.inverse_mass(), body.inverse_inertia(), rotation, eccentric, com, r, d, spin, idle, drives
        )

    def velocity(self) -> Vec3:
        """Of the body's material at the contact point, relative to the reference point [m/s]."""
        driven = self.spin.cross(self.d)
        return choose(self.drives, lambda: driven, lambda: driven + self.idle.cross(self.com))

    def normal_velocity(self, n: Vec3) -> Scalar:
        """``n.velocity``, summed so that it keeps its accuracy far from the bodies."""
        driven = self.spin.dot(self.d.cross(n))
        return choose(self.drives, lambda: driven, lambda: driven + self.idle.dot(self.com.cross(n)))

    def compliance(self, n: Vec3) -> Scalar:
        """``n.K n``, of this body without its mass."""
        w = self.inverse_inertia.reduced(self._moment(n))
        return w.dot(self.inverse_inertia.scaled(w))

    def response_along(self, n: Vec3, j: Scalar, impulse: Vec3) -> Twist:
        """The change of twist that ``impulse = j n`` causes; the compliance has most of it already."""
        angular = self.rotation.to_world(self.inverse_inertia @ self._moment(n)) * j
        return Twist(self._linear(impulse, angular), angular)

    def _linear(self, impulse: Vec3, angular: Vec3) -> Vec3:
        """The change of the velocity of the reference point."""
        of_centre = impulse * self.inverse_mass
        return choose(self.is_eccentric, lambda: of_centre - angular.cross(self.com), lambda: of_centre)

    def _moment(self, impulse: Vec3) -> Vec3:
        """In body axes, that an impulse at the contact has."""
        return self.rotation.to_body(self.r.cross(impulse))

    def mobility(self) -> Symmetric3:
        """``K``, of this body alone: ``1/m + G^T I^-1 G``."""
        x, y, z = (self.inverse_inertia.reduced(moment) for moment in self.rotation.moments(self.r))
        jx, jy, jz = (self.inverse_inertia.scaled(w) for w in (x, y, z))
        m = self.inverse_mass
        return Symmetric3(m + x.dot(jx), x.dot(jy), x.dot(jz), m + y.dot(jy), y.dot(jz), m + z.dot(jz))

    def response(self, impulse: Vec3) -> Twist:
        """The change of the twist of the reference point that an impulse at the contact causes."""
        x, y, z = self.rotation.moments(self.r)
        moment = x * impulse[0] + y * impulse[1] + z * impulse[2]
        angular = self.rotation.to_world(self.inverse_inertia @ moment)
        return Twist(self._linear(impulse, angular), angular)

    def velocity_of(self, change: Twist) -> Vec3:
        """What a change of the twist does to the velocity at the contact."""
        return change.linear + change.angular.cross(self.d)


class ContactKinematics(NamedTuple):
    """What a law is given: two bodies about to collide, as seen from their contact.

    Attributes:
        n: the normal, from body_b to body_a, of any length.
        u: velocity of body_a relative to body_b at the contact [m/s].
        n_u: ``n.u``, summed so that it keeps its accuracy far from the bodies; negative if approaching.
        n_Kn: ``n.K n``: the inverse effective mass along the normal [1/kg] times ``n.n``.
        side_a, side_b: the bodies.
    """

    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar
    side_a: Side
    side_b: Side

    @classmethod
    def of(cls, body_a: Body, body_b: Body, contact: Contact) -> ContactKinematics:
        """Two bodies as seen from their contact."""
        n = contact.normal
        a, b = Side.of(body_a, contact.position), Side.of(body_b, contact.position)
        v = body_a.velocity - body_b.velocity
        return cls(
            n,
            v + (a.velocity() - b.velocity()),
            n.dot(v) + a.normal_velocity(n) - b.normal_velocity(n),
            n.dot(n) * (a.inverse_mass + b.inverse_mass) + a.compliance(n) + b.compliance(n),
            a,
            b,
        )

    def inverse_effective_mass(self) -> Symmetric3:
        """``K``: the inverse effective mass in every direction [1/kg]."""
        return self.side_a.mobility() + self.side_b.mobility()

    def respond(self, impulse: Vec3) -> tuple[Twist, Twist]:
        """What ``impulse`` on body_a changes of the twists of both bodies' reference points."""
        return self.side_a.response(impulse), self.side_b.response(-impulse)

    def respond_along_normal(self, impulse: Vec3, j: Scalar) -> tuple[Twist, Twist]:
        """The same for an impulse ``j n``."""
        n = self.n
        return self.side_a.response_along(n, j, impulse), self.side_b.response_along(n, -j, -impulse)

    def velocity_change(self, change_a: Twist, change_b: Twist) -> Vec3:
        """What changes of the twists do to ``u``."""
        return self.side_a.velocity_of(change_a) - self.side_b.velocity_of(change_b)
