"""Two bodies as seen from their contact: relative velocity, inverse effective mass, response to an impulse.

**Rigid bodies.** Let ``x`` be the centre of mass of a body, ``v`` its velocity, ``w`` the angular velocity,
``m`` the mass, ``I`` the inertia about ``x``, and ``r = C - x`` the lever arm of the contact point ``C``. The
velocity of body_a relative to body_b at the contact is

    u = v_A + w_A x r_A - v_B - w_B x r_B

An impulse ``P`` at ``C`` changes a body's twist by ``dv = P / m`` and ``dw = I^-1 (r x P)``, and therefore
the velocity of its material at ``C`` by ``dv + dw x r``. If ``P`` acts on body_a and ``-P`` on body_b, ``u``
becomes ``u + K P`` with the inverse effective mass

    K = (1/m_A + 1/m_B) 1 - [r_A]x I_A^-1 [r_A]x - [r_B]x I_B^-1 [r_B]x

a symmetric positive definite tensor. Along the normal ``n`` only ``n.K n`` matters; the effective mass there
is ``n.n / n.K n``.

**Body axes.** ``I`` stays in body axes, where it is best conditioned. With the rotation ``R`` from body axes
to world axes, ``G P = R^T (r x P)`` is the moment of an impulse in body axes, and

    -[r]x R I^-1 R^T [r]x = G^T I^-1 G        G = R^T [r]x

**Reference point.** A body's position and velocity are those of its reference point, at ``-com`` from the
centre of mass. With ``d = com + r`` from the reference point to ``C``, the velocity of the material at ``C``
is ``v_ref + w x d``, and an impulse changes ``v_ref`` by ``P / m - dw x com``.

**Massless spin.** A thin rod has no inertia about its axis, a point mass about no axis. Rotation about such
an axis moves no matter. So only the rest of ``w``, the effective spin ``w_e``, counts at the contact. The
centre of mass moves with ``v_ref + w x com`` all the same, and the material at ``C`` with

    v_ref + w x com + w_e x r = v_ref + w_e x d + (w - w_e) x com

**Mechanisms.** A link of a mechanism adds the ``K`` of ``inverse_inertia.py`` to that of a body that cannot
move. ``K`` may then be singular: impulses along its null space, the locked directions, move nothing.

Planar and point geometries use the same formulas; the numbers that they do not model are 0.
"""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

from ..numbers.operations import (
    Condition,
    Scalar,
    all_zero,
    certain,
    choose,
    error_of,
    given_roundoff,
    maximum,
    may_have_effect,
    minimum,
    or_one,
    positive_part,
    square_root,
)
from .body import ROUNDINGS, Body, Twist
from .contact import Contact
from .inverse_inertia import SYMMETRY_TOLERANCE, InverseInertia
from .orientation import Rotation
from .tensor import LEAST_EIGENVALUE, InverseTensor, Symmetric3
from .vector import Vec3

PERPENDICULAR = 2.0**-60
"""Squared cosine of the angle between two directions, up to which they count as perpendicular."""

MOST_TURN = 2.0**-20
"""The angle by which locked directions may be off, at most: the energy of an answer may be off by as much."""

EDGE = 2.0**-40
"""A locked direction that is beyond the edge of the friction cone by this part may be in it: it is known from
rounded numbers."""

CANCELLATION = 2.0**-48
"""A difference of at most this part of its terms is rounding."""


class BodyAtContact(NamedTuple):
    """One body as seen from the contact: its side of ``u`` and ``K``.

    Attributes:
        inverse_mass: ``1/m`` [1/kg]; 0 for an immovable body and for a link of a mechanism.
        inverse_tensor: ``I^-1`` about the centre of mass, in body axes [1/(kg m^2)].
        rotation: from body axes to world axes.
        has_com_offset: whether the reference point is not the centre of mass.
        com: from the reference point to the centre of mass, in world axes [m].
        r: lever arm, from the centre of mass to the contact point, in world axes [m].
        d: from the reference point to the contact point, in world axes [m].
        effective_spin: the angular velocity without ``massless_spin`` [rad/s].
        massless_spin: the part of the angular velocity about axes without inertia [rad/s].
        has_full_inertia: whether there is inertia about every axis, or the body is immovable:
            ``massless_spin`` is then 0.
        link_inverse_inertia: the inverse inertia of a link of a mechanism; empty for a rigid body.
    """

    inverse_mass: Scalar
    inverse_tensor: InverseTensor
    rotation: Rotation
    has_com_offset: Condition
    com: Vec3
    r: Vec3
    d: Vec3
    effective_spin: Vec3
    massless_spin: Vec3
    has_full_inertia: Condition
    link_inverse_inertia: InverseInertia | tuple[()] = ()

    @classmethod
    def of(cls, body: Body, point: Vec3) -> BodyAtContact:
        """A body as seen from a contact at ``point``, in world axes [m]."""
        rotation = body.rotation()
        has_offset = may_have_effect(body.com)
        com = choose(has_offset, lambda: rotation.to_world(body.com), lambda: body.com)
        d = point - body.position
        r = choose(has_offset, lambda: d - com, lambda: d)
        has_full_inertia, effective = body.effective_spin()
        massless = choose(has_full_inertia, lambda: effective * 0, lambda: body.angular_velocity - effective)
        return cls(
            inverse_mass=body.inverse_mass(),
            inverse_tensor=body.inverse_tensor(),
            rotation=rotation,
            has_com_offset=has_offset,
            com=com,
            r=r,
            d=d,
            effective_spin=effective,
            massless_spin=massless,
            has_full_inertia=has_full_inertia,
            link_inverse_inertia=body.inverse_inertia or (),
        )

    def has_massless_spin(self) -> Condition:
        """Whether ``massless_spin`` is more than rounding makes of other spin."""
        massless, effective = (
            certain(square_root(spin.dot(spin))) for spin in (self.massless_spin, self.effective_spin)
        )
        given, computed = 2 * given_roundoff(effective) * effective, error_of(effective + effective)
        return massless > ROUNDINGS * (given + computed)

    def velocity_from_spin(self) -> Vec3:
        """Velocity of the material at the contact point relative to the reference point [m/s]."""
        effective = self.effective_spin.cross(self.d)
        return choose(
            self.has_full_inertia, lambda: effective, lambda: effective + self.massless_spin.cross(self.com)
        )

    def normal_velocity_from_spin(self, n: Vec3) -> Scalar:
        """``n.velocity_from_spin()``, summed as ``w.(d x n)``, which is accurate far from the origin."""
        effective = self.effective_spin.dot(self.d.cross(n))
        return choose(
            self.has_full_inertia,
            lambda: effective,
            lambda: effective + self.massless_spin.dot(self.com.cross(n)),
        )

    def inverse_effective_mass(self) -> Symmetric3:
        """``K`` of this body alone: ``1/m + G^T I^-1 G`` [1/kg]."""
        m = self.inverse_mass
        xx, xy, xz, yy, yz, zz = self.inverse_tensor.congruence(*self.rotation.moments(self.r))
        K = Symmetric3(m + xx, xy, xz, m + yy, yz, m + zz)
        link = self.link_inverse_inertia
        return K + link.inverse_effective_mass(self.d) if link else K

    def n_Kn_without_mass(self, n: Vec3) -> Scalar:
        """``n.K n`` of this body alone, without the term ``n.n / m``."""
        rigid = self.inverse_tensor.quadratic_form(self._moment(n))
        link = self.link_inverse_inertia
        return rigid + n.dot(link.inverse_effective_mass(self.d) @ n) if link else rigid

    def twist_change(self, impulse: Vec3) -> Twist:
        """Change of the twist of the reference point, caused by an impulse at the contact [N s]."""
        x, y, z = self.rotation.moments(self.r)
        moment = x * impulse[0] + y * impulse[1] + z * impulse[2]
        return self._twist_change(impulse, self.rotation.to_world(self.inverse_tensor @ moment))

    def twist_change_along(self, n: Vec3, j: Scalar, impulse: Vec3) -> Twist:
        """:meth:`twist_change` for ``impulse = j n``; it shares most terms with :meth:`n_Kn_without_mass`."""
        angular = self.rotation.to_world(self.inverse_tensor @ self._moment(n)) * j
        return self._twist_change(impulse, angular)

    def _twist_change(self, impulse: Vec3, angular: Vec3) -> Twist:
        """Twist change of the reference point, from ``dw`` of the rigid body."""
        of_com = impulse * self.inverse_mass
        linear = choose(self.has_com_offset, lambda: of_com - angular.cross(self.com), lambda: of_com)
        if not self.link_inverse_inertia:
            return Twist(linear, angular)
        link_linear, link_angular = self.link_inverse_inertia.twist_change(self.d, impulse)
        return Twist(linear + link_linear, angular + link_angular)

    def _moment(self, impulse: Vec3) -> Vec3:
        """Moment about the centre of mass, in body axes, of an impulse at the contact."""
        return self.rotation.to_body(self.r.cross(impulse))

    def velocity_change(self, change: Twist) -> Vec3:
        """Change of the velocity at the contact point for a change of the twist."""
        return change.linear + change.angular.cross(self.d)

    def size_of_terms(self) -> Scalar:
        """Size of the terms that add up to the ``K`` of a link, before any cancel [1/kg]; 0 if rigid."""
        if not self.link_inverse_inertia:
            return 0
        linear, _, angular = self.link_inverse_inertia.blocks()
        return linear.trace() + angular.trace() * self.d.dot(self.d)

    def size_of_offset_terms(self) -> Scalar:
        """The part of :meth:`size_of_terms` that is there because ``d`` is not 0 [1/kg]; 0 if rigid."""
        if not self.link_inverse_inertia:
            return 0
        linear, _, angular = self.link_inverse_inertia.blocks()
        turned = angular.trace() * self.d.dot(self.d)
        return turned + square_root(turned) * square_root(linear.trace())

    def energy_gained(self, velocity: Vec3, impulse: Vec3, change: Twist) -> Scalar:
        """Kinetic energy that a mechanism gains [J]; 0 for a rigid body.

        It is the work of the impulse, ``P.(v + v+) / 2`` with the velocities of the contact point before and
        after. Nothing else is known of a mechanism's energy.

        Args:
            velocity: of the reference point before the impact [m/s].
            impulse: on this body [N s].
            change: of the twist of the reference point.
        """
        if not self.link_inverse_inertia:
            return 0
        mean = velocity + self.velocity_from_spin() + self.velocity_change(change) / 2
        return choose(all_zero(self.link_inverse_inertia), lambda: 0 * mean.x, lambda: impulse.dot(mean))


class ContactKinematics(NamedTuple):
    """What a law is given: two bodies at the instant of impact, as seen from their contact.

    Attributes:
        n: the normal, from body_b to body_a, of any length.
        u: velocity of body_a relative to body_b at the contact [m/s], without ``locked_u``.
        n_u: ``n.u``, summed so that it stays accurate far from the origin; negative if the bodies approach.
        n_Kn: ``n.K n``: the inverse effective mass along the normal [1/kg] times ``n.n``.
        body_a, body_b: the two bodies.
        locked_u: for a mechanism, the part of the relative velocity along the locked directions; else empty.
    """

    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar
    body_a: BodyAtContact
    body_b: BodyAtContact
    locked_u: Vec3 | tuple[()] = ()

    @classmethod
    def of(cls, body_a: Body, body_b: Body, contact: Contact) -> ContactKinematics:
        """Two bodies as seen from their contact."""
        n = contact.normal
        a, b = (BodyAtContact.of(body, contact.position) for body in (body_a, body_b))
        v = body_a.velocity - body_b.velocity
        found = cls(
            n=n,
            u=v + (a.velocity_from_spin() - b.velocity_from_spin()),
            n_u=n.dot(v) + a.normal_velocity_from_spin(n) - b.normal_velocity_from_spin(n),
            n_Kn=n.dot(n) * (a.inverse_mass + b.inverse_mass)
            + a.n_Kn_without_mass(n)
            + b.n_Kn_without_mass(n),
            body_a=a,
            body_b=b,
        )
        if found.is_rigid():
            return found
        locked_u = found._locked_directions(found._possibly_singular_K()) @ found.u
        return found._replace(u=found.u - locked_u, locked_u=locked_u)

    def whole_u(self) -> Vec3:
        """``u`` with ``locked_u``."""
        return self.u + self.locked_u if self.locked_u else self.u

    def is_rigid(self) -> bool:
        """Whether neither body is a link of a mechanism."""
        return not (self.body_a.link_inverse_inertia or self.body_b.link_inverse_inertia)

    def inverse_effective_mass(self) -> Symmetric3:
        """``K`` [1/kg].

        For a mechanism that cannot move in some tangential directions, ``K`` is given its smallest non-zero
        eigenvalue there, so that it can be inverted. ``u`` is 0 in those directions, so laws apply no impulse
        there.
        """
        K = self._possibly_singular_K()
        if self.is_rigid():
            return K
        locked = self._locked_directions(K)
        return choose(
            self._locked_part_of_normal(locked) <= PERPENDICULAR,
            lambda: K + locked * K.least_nonzero_eigenvalue(self._rounding_of_K()),
            lambda: K,
        )

    def _locked_part_of_normal(self, locked: Symmetric3) -> Scalar:
        """The square of the part of the normal that is along locked directions."""
        n, locked_n = self.n, locked @ self.n
        return locked_n.dot(locked_n) / n.dot(n)

    def regularized(self, K: Symmetric3) -> Symmetric3:
        """``K``, made invertible: with its smallest non-zero eigenvalue where a mechanism is locked.

        Its inverse gives the least impulse that changes ``u`` as wanted.
        """
        if self.is_rigid():
            return K
        return K + self._locked_directions(K) * K.least_nonzero_eigenvalue(self._rounding_of_K())

    def tolerated_error(self, impulse: Vec3) -> tuple[Scalar, Scalar]:
        """How far an answer may be off because matrices of mechanisms are accepted with some rounding.

        A locked component of ``u`` is rounding too. No law changes ``u`` by more than twice that component.

        Returns:
            The error of twice the work of the impulse [J], and of ``n.u`` after it; 0, 0 for rigid bodies.
        """
        if not self.locked_u:
            return 0, 0
        terms, size = self.body_a.size_of_terms() + self.body_b.size_of_terms(), impulse.norm()
        change = SYMMETRY_TOLERANCE * terms * size + 2 * self.locked_u.norm()
        return change * size, change * self.n.norm()

    def locked_part_of_approach(self) -> Scalar:
        """The part of ``n_u`` that is along locked directions, as ``|n.locked_u / n_u|``; 0 for rigid bodies.

        Friction acts on ``u``, which lacks it. The ``u`` that was meant may have all of ``n_u`` along
        directions that move; the impulse, which is proportional to ``u``, would then be greater by this part.
        """
        if not self.locked_u:
            return 0
        return certain(abs(self.n.dot(self.locked_u)) / or_one(abs(self.n_u)))

    def tilt_of_tangential_directions(self) -> Scalar:
        """The angle between locked directions that count as tangential and the tangent plane; 0 for others.

        In ``K``, an impulse along the normal moves the contact along such a direction, where the tangential
        impulse seems to have to stop it: it is off by as much as this part of the normal impulse.
        """
        if not self.locked_u:
            return 0
        part = certain(self._locked_part_of_normal(self._locked_directions(self._possibly_singular_K())))
        return choose(part <= PERPENDICULAR, lambda: square_root(part), lambda: 0 * part)

    def is_movable_along_normal(self) -> Condition:
        """Whether an impulse along the normal moves the contact."""
        n, K = Vec3(*_scaled(*self.n)), self._possibly_singular_K()
        cancelled = CANCELLATION * (n.x * n.x * K.xx + n.y * n.y * K.yy + n.z * n.z * K.zz)
        least = n.dot(n) * maximum(LEAST_EIGENVALUE * K.trace(), self._rounding_of_K())
        return n.dot(K @ n) > maximum(cancelled, least)

    def is_confined_to_a_line(self) -> Condition:
        """Whether impulses can move the contact along one line only, and that line is not the normal."""
        return self.inverse_effective_mass().has_rank_one(self._rounding_of_K())

    def has_locked_direction(self) -> Condition:
        """Whether impulses in some direction that is not tangential move nothing; never for rigid bodies."""
        if self.is_rigid():
            return False
        return certain(self._locked_directions(self.inverse_effective_mass()).trace()) > 0

    def has_locked_direction_in_cone(self, mu: Scalar) -> Condition:
        """Whether a locked direction lies in the friction cone: no law determines the impulse along it."""
        n, locked = Vec3(*_scaled(*self.n)), self._locked_directions(self.inverse_effective_mass())
        nn, along = n.dot(n), n.dot(locked @ n)
        across = square_root(positive_part(nn - along))
        return self.has_locked_direction() & (across <= mu * square_root(along) * (1 + EDGE))

    def can_come_to_rest(self) -> Condition:
        """Whether some impulse brings the contact to rest: ``u`` lies in the range of ``K``.

        A locked component of ``u`` is ignored if it is rounding of the velocities that add up to ``u``, or of
        ``K``, which turns the locked directions the more the less ``K`` moves in others.
        """
        if not self.locked_u:
            return True
        a, b, u = self.body_a.velocity_from_spin(), self.body_b.velocity_from_spin(), self.whole_u()
        locked_u = Vec3(*_scaled(*self.locked_u, *u, *(u - (a - b)), *a, *b)[:3])
        K = self._possibly_singular_K()
        turn = CANCELLATION * K.trace() / or_one(K.least_nonzero_eigenvalue(self._rounding_of_K()))
        turn = minimum(turn, MOST_TURN)
        return locked_u.dot(locked_u) <= PERPENDICULAR + certain(turn * turn)

    def _locked_directions(self, K: Symmetric3) -> Symmetric3:
        """The projection on the null space of ``K``: the directions in which impulses move nothing."""
        return K.null_space(self._rounding_of_K())

    def _rounding_of_K(self) -> Scalar:
        """Rounding of ``K`` from terms that cancel [1/kg]."""
        return CANCELLATION * (self.body_a.size_of_offset_terms() + self.body_b.size_of_offset_terms())

    def _possibly_singular_K(self) -> Symmetric3:
        return self.body_a.inverse_effective_mass() + self.body_b.inverse_effective_mass()

    def moving_part(self, impulse: Vec3) -> Vec3:
        """``impulse`` without its component along the locked directions, which moves nothing.

        Next to a wedge that component is so large that ``K`` times it, which is rounding, counts as motion.
        """
        if self.is_rigid():
            return impulse
        return impulse - self._locked_directions(self._possibly_singular_K()) @ impulse

    def twist_changes(self, impulse: Vec3) -> tuple[Twist, Twist]:
        """Changes of the twists of both reference points, for ``impulse`` on body_a."""
        return self.body_a.twist_change(impulse), self.body_b.twist_change(-impulse)

    def twist_changes_along_normal(self, impulse: Vec3, j: Scalar) -> tuple[Twist, Twist]:
        """:meth:`twist_changes` for ``impulse = j n``."""
        n = self.n
        return self.body_a.twist_change_along(n, j, impulse), self.body_b.twist_change_along(n, -j, -impulse)

    def velocity_change(self, change_a: Twist, change_b: Twist) -> Vec3:
        """Change of ``u`` for changes of the two twists."""
        return self.body_a.velocity_change(change_a) - self.body_b.velocity_change(change_b)


class ContactNumbers(NamedTuple):
    """The numbers that a law reads from a :class:`ContactKinematics`, without the bodies.

    Compiled functions and tests call a law with these.

    Attributes:
        n, u, n_u, n_Kn: as in :class:`ContactKinematics`.
        K: the inverse effective mass [1/kg].
        regularized_K: for a mechanism, ``K`` made invertible [1/kg]; empty if ``K`` is invertible.
    """

    n: Vec3
    u: Vec3
    n_u: Scalar
    n_Kn: Scalar
    K: Symmetric3
    regularized_K: Symmetric3 | tuple[()] = ()

    @classmethod
    def of(cls, contact: ContactKinematics | ContactNumbers) -> ContactNumbers:
        """The numbers of a contact, without ``regularized_K``."""
        return cls(contact.n, contact.u, contact.n_u, contact.n_Kn, contact.inverse_effective_mass())

    def is_rigid(self) -> bool:
        """Always true: a law needs to do nothing else for a mechanism, once it has ``regularized_K``."""
        return True

    def has_locked_direction(self) -> bool:
        """Always false."""
        return False

    def inverse_effective_mass(self) -> Symmetric3:
        """``K``."""
        return self.K

    def regularized(self, K: Symmetric3) -> Symmetric3:
        """``regularized_K`` if there is one, else ``K``."""
        return self.regularized_K or K


def _scaled(*numbers: Scalar) -> list[Scalar]:
    """The numbers divided by the greatest of their magnitudes."""
    size = or_one(reduce(maximum, (certain(abs(x)) for x in numbers)))
    return [x / size for x in numbers]
