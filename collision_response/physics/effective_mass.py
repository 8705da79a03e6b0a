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

from functools import reduce
from typing import NamedTuple

from ..numbers.number import Condition, Scalar, all_zero, certain, choose, greater, negation, square_root
from .body import Body, Twist
from .contact import Contact
from .inverse_inertia import MISFIT, InverseInertia
from .orientation import ALIGNED, Rotation
from .tensor import LEAST, InverseTensor, Symmetric3
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
        own: of a link of a mechanism its inverse inertia: it is besides a body that no impulse moves.
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
    own: InverseInertia | tuple[()] = ()

    @classmethod
    def of(cls, body: Body, point: Vec3) -> Side:
        rotation = ALIGNED if body.orientation is None else body.orientation.rotation()
        eccentric = negation(all_zero(body.com))
        com = choose(eccentric, lambda: rotation.to_world(body.com), lambda: body.com)
        d = point - body.position
        r = choose(eccentric, lambda: d - com, lambda: d)
        drives, spin = body.driving_spin()
        idle = choose(drives, lambda: spin * 0, lambda: body.angular_velocity - spin)
        m, inertia, own = body.inverse_mass(), body.inverse_tensor(), body.inverse_inertia or ()
        return cls(m, inertia, rotation, eccentric, com, r, d, spin, idle, drives, own)

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
        rigid = self.inverse_inertia.form(self._moment(n))
        return rigid + n.dot(self.own.mobility(self.d) @ n) if self.own else rigid

    def response_along(self, n: Vec3, j: Scalar, impulse: Vec3) -> Twist:
        """The change of twist that ``impulse = j n`` causes; the compliance has most of it already."""
        angular = self.rotation.to_world(self.inverse_inertia @ self._moment(n)) * j
        return self._twist(impulse, angular)

    def _twist(self, impulse: Vec3, angular: Vec3) -> Twist:
        """The change of the twist of the reference point; ``angular``: what it is of a rigid body."""
        of_centre = impulse * self.inverse_mass
        linear = choose(self.is_eccentric, lambda: of_centre - angular.cross(self.com), lambda: of_centre)
        if not self.own:
            return Twist(linear, angular)
        own_linear, own_angular = self.own.response(self.d, impulse)
        return Twist(linear + own_linear, angular + own_angular)

    def _moment(self, impulse: Vec3) -> Vec3:
        """In body axes, that an impulse at the contact has."""
        return self.rotation.to_body(self.r.cross(impulse))

    def mobility(self) -> Symmetric3:
        """``K``, of this body alone: ``1/m + G^T I^-1 G``."""
        m = self.inverse_mass
        xx, xy, xz, yy, yz, zz = self.inverse_inertia.forms(*self.rotation.moments(self.r))
        K = Symmetric3(m + xx, xy, xz, m + yy, yz, m + zz)
        return K + self.own.mobility(self.d) if self.own else K

    def size_of_terms(self) -> Scalar:
        """Of those that make up a mechanism's share of ``K``, however they cancel [1/kg]."""
        if not self.own:
            return 0
        linear, _, angular = self.own.blocks()
        return linear.trace() + angular.trace() * self.d.dot(self.d)

    def size_of_shift(self) -> Scalar:
        """Of those of them by which it differs from that of the reference point [1/kg]."""
        if not self.own:
            return 0
        linear, _, angular = self.own.blocks()
        turned = angular.trace() * self.d.dot(self.d)
        return turned + square_root(turned) * square_root(linear.trace())

    def response(self, impulse: Vec3) -> Twist:
        """The change of the twist of the reference point that an impulse at the contact causes."""
        x, y, z = self.rotation.moments(self.r)
        moment = x * impulse[0] + y * impulse[1] + z * impulse[2]
        return self._twist(impulse, self.rotation.to_world(self.inverse_inertia @ moment))

    def velocity_of(self, change: Twist) -> Vec3:
        """What a change of the twist does to the velocity at the contact."""
        return change.linear + change.angular.cross(self.d)

    def energy_gained(self, velocity: Vec3, impulse: Vec3, change: Twist) -> Scalar:
        """What a mechanism gains: all that is known of its energy; 0 for a rigid body [J].

        The work of the impulse, at the mean of the contact's velocities before and after.
        """
        if not self.own:
            return 0
        mean = velocity + self.velocity() + self.velocity_of(change) * 0.5
        return choose(all_zero(self.own), lambda: 0.0 * mean.x, lambda: impulse.dot(mean))


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
        a, b = (Side.of(body, contact.position) for body in (body_a, body_b))
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
        """``K``: the inverse effective mass in every direction [1/kg].

        Across the normal it is made up where it is 0, and where ``u`` is 0 too: no impulse is wasted there.
        """
        K = self._mobility()
        if self.is_rigid():
            return K
        n, idle = self.n, self._null_space(K)
        along = idle @ n
        apart = along.dot(along) <= ACROSS * n.dot(n)
        return choose(apart, lambda: K + idle * K.breadth(self._rounding()), lambda: K)

    def impulse_for(self, K: Symmetric3, change: Vec3) -> Vec3:
        """The least impulse that changes ``u`` so, where ``K`` is the inverse effective mass."""
        return self.made_invertible(K).solve(change)

    def made_invertible(self, K: Symmetric3) -> Symmetric3:
        """``K``; of mechanisms with an inverse effective mass where nothing moves."""
        return K if self.is_rigid() else K + self._null_space(K) * K.breadth(self._rounding())

    def forgiven(self, impulse: Vec3) -> tuple[Scalar, Scalar]:
        """How far an answer may be off for the rounding with which matrices of mechanisms are accepted.

        Twice the work of the impulse [J], and ``n.u`` after it; 0 for rigid bodies. What no impulse moves is
        rounding too, be it all of ``u``, and no law takes more than twice of it.
        """
        if self.is_rigid():
            return 0, 0
        own, size = (self.side_a.size_of_terms(), self.side_b.size_of_terms()), impulse.norm()
        idle = self._null_space(self._mobility()) @ self.u
        change = MISFIT * sum(own) * size + 2 * idle.norm()
        return change * size, change * self.n.norm()

    def moves_normal(self) -> Condition:
        """Whether an impulse along the normal moves the contact."""
        n, K = Vec3(*_scaled(*self.n)), self._mobility()
        cancelled = CANCELLED * (n.x * n.x * K.xx + n.y * n.y * K.yy + n.z * n.z * K.zz)
        least = n.dot(n) * greater(LEAST * K.trace(), self._rounding())
        return n.dot(K @ n) > greater(cancelled, least)

    def moves_one_way(self) -> Condition:
        """Whether impulses move the contact along one line alone, not that of the normal."""
        return self.inverse_effective_mass().is_line(self._rounding())

    def locks(self) -> Condition:
        """Whether impulses in some direction that is not across the normal move nothing: of mechanisms."""
        if self.is_rigid():
            return False
        return certain(self._null_space(self.inverse_effective_mass()).trace()) > 0

    def wedges(self, mu: Scalar) -> Condition:
        """Whether such a direction lies in the cone of friction: no law then says how great impulses are."""
        n, idle = Vec3(*_scaled(*self.n)), self._null_space(self.inverse_effective_mass())
        nn, along = n.dot(n), n.dot(idle @ n)
        return self.locks() & (square_root(greater(nn - along, 0 * nn)) <= mu * square_root(along))

    def can_rest(self) -> Condition:
        """Whether some impulse brings the contact to rest: ``u`` lies in the range of ``K``.

        To rounding of the velocities that ``u`` is the sum of.
        """
        a, b = self.side_a.velocity(), self.side_b.velocity()
        whole = _scaled(*self.u, *(self.u - (a - b)), *a, *b)
        rest = self._null_space(self._mobility()) @ Vec3(*whole[:3])
        return rest.dot(rest) <= ACROSS

    def _null_space(self, K: Symmetric3) -> Symmetric3:
        """The projection on the directions in which nothing moves."""
        return K.null_space(self._rounding())

    def _rounding(self) -> Scalar:
        """Of ``K``, of the terms that cancel in it [1/kg]."""
        return CANCELLED * (self.side_a.size_of_shift() + self.side_b.size_of_shift())

    def _mobility(self) -> Symmetric3:
        return self.side_a.mobility() + self.side_b.mobility()

    def is_rigid(self) -> bool:
        """Whether neither body is a link of a mechanism."""
        return not (self.side_a.own or self.side_b.own)

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


class Seen(NamedTuple):
    """What a law sees of a contact: as :class:`ContactKinematics`, but all of it numbers.

    Attributes:
        n, u, n_u, n_Kn: see there.
        K: the inverse effective mass in every direction [1/kg].
        invertible: of a mechanism ``K`` with what makes it so [1/kg]; there is none where ``K`` is.
    """

    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar
    K: Symmetric3
    invertible: Symmetric3 | tuple[()] = ()

    @classmethod
    def of(cls, contact: ContactKinematics | Seen) -> Seen:
        """Of a contact between rigid bodies."""
        return cls(contact.n, contact.u, contact.n_u, contact.n_Kn, contact.inverse_effective_mass())

    def is_rigid(self) -> bool:
        """Always."""
        return True

    def locks(self) -> bool:
        """Never."""
        return False

    def inverse_effective_mass(self) -> Symmetric3:
        """``K``."""
        return self.K

    def impulse_for(self, K: Symmetric3, change: Vec3) -> Vec3:
        """That changes ``u`` so."""
        return self.made_invertible(K).solve(change)

    def made_invertible(self, K: Symmetric3) -> Symmetric3:
        """``K``, or what was given in its place."""
        return self.invertible or K


def _scaled(*numbers: Scalar) -> list[Scalar]:
    """Numbers in the middle of their range: the greatest is 1."""
    size = reduce(greater, (certain(abs(x)) for x in numbers))
    size = choose(size > 0, lambda: size, lambda: size * 0 + 1)
    return [x / size for x in numbers]


ACROSS = 2.0**-60
"""Square of the sine of an angle that is rounding."""

CANCELLED = 2.0**-48
"""What is left of terms that cancel is rounding of this part of them."""
