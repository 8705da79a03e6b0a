"""Two bodies as seen from their contact: relative velocity, effective mass, response.

With the lever arms ``r = C - x`` of the contact point ``C``, the velocity of body_a relative to
body_b at the contact is

    u = v_A + w_A x r_A - v_B - w_B x r_B

An impulse ``P`` on body_a (and ``-P`` on body_b) changes it to ``u + K P``, with the inverse
effective mass at the contact, a symmetric positive definite tensor

    K = (1/m_A + 1/m_B) 1 - [r_A]x I_A^-1 [r_A]x - [r_B]x I_B^-1 [r_B]x

Along the normal ``n`` only ``n.K n`` matters; the effective mass is ``n.n / n.K n``.

There are three geometries, of growing cost. They share their methods, so that every law works in
each of them:

    Point     rotation is not modelled            K = (1/m_A + 1/m_B) 1
    Planar    motion in the x-y plane             K is 2 x 2, only I_zz enters
    Spatial   everything
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from .body import Body, Twist
from .contact import Contact
from .number import Scalar
from .tensor import Isotropic, Symmetric2, Symmetric3, Tensor
from .vector import ZERO, V, Vec2, Vec3, Vector


class Response(NamedTuple):
    """What an impulse does.

    Attributes:
        impulse: on body_a, in world axes [N s].
        change_a: of the twist of body_a.
        change_b: of the twist of body_b.
        velocity_after: of body_a relative to body_b at the contact, as far as it is modelled [m/s].
    """

    impulse: Vec3
    change_a: Twist
    change_b: Twist
    velocity_after: Vector


class Approach(Protocol[V]):
    """Two bodies about to collide, prepared for a law: what the three geometries share."""

    @property
    def n(self) -> V:
        """The normal, from body_b to body_a, of any length."""

    @property
    def u(self) -> V:
        """Velocity of body_a relative to body_b at the contact [m/s]."""

    @property
    def n_u(self) -> Scalar:
        """``n.u``, summed so that it keeps its accuracy far from the bodies; negative if approaching."""

    @property
    def n_Kn(self) -> Scalar:
        """``n.K n``: the inverse effective mass along the normal [1/kg] times ``n.n``."""

    def mobility(self) -> Tensor[V]:
        """``K``: the inverse effective mass in every direction [1/kg]."""

    def respond(self, impulse: V) -> Response:
        """What ``impulse`` on body_a does to both bodies."""


class Point(NamedTuple):
    """L0: rotation is not modelled."""

    body_a: Body
    body_b: Body
    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar

    @classmethod
    def prepare(cls, body_a: Body, body_b: Body, contact: Contact) -> Point:
        n, u = contact.normal, body_a.velocity - body_b.velocity
        return cls(body_a, body_b, n, u, n.dot(u), n.dot(n) * (body_a.inverse_mass + body_b.inverse_mass))

    def mobility(self) -> Isotropic:
        return Isotropic(self.body_a.inverse_mass + self.body_b.inverse_mass)

    def respond(self, impulse: Vec3) -> Response:
        change_a = impulse * self.body_a.inverse_mass
        change_b = -impulse * self.body_b.inverse_mass
        return Response(impulse, Twist(change_a, ZERO), Twist(change_b, ZERO), self.u + change_a - change_b)


class Planar(NamedTuple):
    """The x-y plane: positions, velocities and the normal lie in it, angular velocities along z."""

    body_a: Body
    body_b: Body
    r_a: Vec2
    r_b: Vec2
    n: Vec2
    u: Vec2
    n_u: Scalar
    n_Kn: Scalar

    @classmethod
    def prepare(cls, body_a: Body, body_b: Body, contact: Contact) -> Planar:
        n = _in_plane(contact.normal)
        r_a, r_b = (
            _in_plane(contact.position - body_a.position),
            _in_plane(contact.position - body_b.position),
        )
        w_a, w_b = body_a.angular_velocity.z, body_b.angular_velocity.z
        v = _in_plane(body_a.velocity - body_b.velocity)
        u = v + (r_a.turned(w_a) - r_b.turned(w_b))
        arm_a, arm_b = r_a.cross(n), r_b.cross(n)
        n_u = n.dot(v) + w_a * arm_a - w_b * arm_b
        n_Kn = n.dot(n) * (body_a.inverse_mass + body_b.inverse_mass)
        n_Kn = n_Kn + arm_a * body_a.spin_about_z(arm_a) + arm_b * body_b.spin_about_z(arm_b)
        return cls(body_a, body_b, r_a, r_b, n, u, n_u, n_Kn)

    def mobility(self) -> Symmetric2:
        return _mobility_2(self.body_a, self.r_a) + _mobility_2(self.body_b, self.r_b)

    def respond(self, impulse: Vec2) -> Response:
        change_a, after_a = _respond_2(self.body_a, self.r_a, impulse)
        change_b, after_b = _respond_2(self.body_b, self.r_b, -impulse)
        return Response(_in_space(impulse), change_a, change_b, self.u + after_a - after_b)


class Spatial(NamedTuple):
    """Everything: any position, any motion, any inertia."""

    body_a: Body
    body_b: Body
    r_a: Vec3
    r_b: Vec3
    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar

    @classmethod
    def prepare(cls, body_a: Body, body_b: Body, contact: Contact) -> Spatial:
        n = contact.normal
        r_a, r_b = contact.position - body_a.position, contact.position - body_b.position
        w_a, w_b = body_a.angular_velocity, body_b.angular_velocity
        v = body_a.velocity - body_b.velocity
        u = v + (w_a.cross(r_a) - w_b.cross(r_b))
        arm_a, arm_b = r_a.cross(n), r_b.cross(n)
        n_u = n.dot(v) + w_a.dot(arm_a) - w_b.dot(arm_b)
        n_Kn = n.dot(n) * (body_a.inverse_mass + body_b.inverse_mass)
        n_Kn = n_Kn + arm_a.dot(body_a.spin(arm_a)) + arm_b.dot(body_b.spin(arm_b))
        return cls(body_a, body_b, r_a, r_b, n, u, n_u, n_Kn)

    def mobility(self) -> Symmetric3:
        return _mobility_3(self.body_a, self.r_a) + _mobility_3(self.body_b, self.r_b)

    def respond(self, impulse: Vec3) -> Response:
        change_a = self.body_a.response(impulse, self.r_a)
        change_b = self.body_b.response(-impulse, self.r_b)
        after = (
            self.u
            + (change_a.linear - change_b.linear)
            + (change_a.angular.cross(self.r_a) - change_b.angular.cross(self.r_b))
        )
        return Response(impulse, change_a, change_b, after)


def _in_plane(v: Vec3) -> Vec2:
    return Vec2(v.x, v.y)


def _in_space(v: Vec2) -> Vec3:
    return Vec3(v.x, v.y, v.x * 0)


def _mobility_2(body: Body, r: Vec2) -> Symmetric2:
    spin = body.spin_about_z(1)
    m = body.inverse_mass
    return Symmetric2(m + r.y * r.y * spin, -r.x * r.y * spin, m + r.x * r.x * spin)


def _respond_2(body: Body, r: Vec2, impulse: Vec2) -> tuple[Twist, Vec2]:
    linear, spin = impulse * body.inverse_mass, body.spin_about_z(r.cross(impulse))
    return Twist(_in_space(linear), Vec3(spin * 0, spin * 0, spin)), linear + r.turned(spin)


def _mobility_3(body: Body, r: Vec3) -> Symmetric3:
    zero = r.x * 0
    m = body.inverse_mass
    turn_x = body.spin(Vec3(zero, r.z, -r.y)).cross(r)
    turn_y = body.spin(Vec3(-r.z, zero, r.x)).cross(r)
    turn_z = body.spin(Vec3(r.y, -r.x, zero)).cross(r)
    return Symmetric3(m + turn_x.x, turn_x.y, turn_x.z, m + turn_y.y, turn_y.z, m + turn_z.z)
