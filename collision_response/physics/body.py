"""A rigid body at the instant of impact, and what an impulse does to it.

An immovable body (static or kinematic) has inverse mass and inverse inertia 0. It enters every
formula like any other body; none has a branch for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from ..status import ImpactError, StatusCode
from .number import Scalar, choose
from .orientation import Quaternion
from .tensor import ZERO_TENSOR, Factor3, Symmetric3
from .vector import ZERO, Vec3

PIVOT_LIMIT = 2.0**-50
"""A pivot of the inertia tensor at or below this part of its diagonal is rounding, not inertia."""


class Twist(NamedTuple):
    """Linear [m/s] and angular [rad/s] velocity, or a change of them, in world axes."""

    linear: Vec3
    angular: Vec3


class Body(NamedTuple):
    """A rigid body: build one with :meth:`dynamic`, :meth:`kinematic` or :meth:`static`.

    Attributes:
        mass: [kg]; 0 for an immovable body, which takes part in no energy or momentum balance.
        inverse_mass: ``1 / mass`` [1/kg]; 0 for an immovable body.
        inertia: about the centre of mass, in body axes [kg m^2]. One zero moment: a thin rod. All
            zero: rotation does not respond to impulses (a point mass, or an immovable body).
        position: of the centre of mass, in world axes [m].
        orientation: from body axes to world axes; ``None`` where the two are parallel.
        velocity: of the centre of mass, in world axes [m/s].
        angular_velocity: in world axes [rad/s].
    """

    mass: Scalar
    inverse_mass: Scalar
    inertia: Symmetric3
    position: Vec3
    orientation: Quaternion | None
    velocity: Vec3
    angular_velocity: Vec3

    @classmethod
    def dynamic(
        cls,
        mass: Scalar,
        inertia: Sequence[Scalar] = ZERO_TENSOR,
        position: Sequence[Scalar] = ZERO,
        orientation: Sequence[Scalar] | None = None,
        velocity: Sequence[Scalar] = ZERO,
        angular_velocity: Sequence[Scalar] = ZERO,
    ) -> Body:
        """A body that impulses move.

        Args:
            mass: [kg], > 0.
            inertia: ``(xx, xy, xz, yy, yz, zz)`` about the centre of mass in body axes [kg m^2].
                Left out: a point mass.
            position: of the centre of mass [m].
            orientation: ``(x, y, z, w)``, from body axes to world axes; any length but 0.
            velocity: of the centre of mass [m/s].
            angular_velocity: in world axes [rad/s].

        Raises:
            ImpactError: INVALID_MASS if ``mass`` is not positive or its inverse overflows.
        """
        if not mass > 0:
            raise ImpactError(StatusCode.INVALID_MASS, "mass", f"must be positive, is {mass}")
        inverse_mass = 1 / mass
        if inverse_mass == math.inf:
            raise ImpactError(
                StatusCode.INVALID_MASS, "mass", f"is so small that 1/mass overflows, is {mass}"
            )
        return cls._of(mass, inverse_mass, inertia, position, orientation, velocity, angular_velocity)

    @classmethod
    def kinematic(
        cls,
        position: Sequence[Scalar] = ZERO,
        velocity: Sequence[Scalar] = ZERO,
        angular_velocity: Sequence[Scalar] = ZERO,
    ) -> Body:
        """A body that moves as it does, whatever strikes it."""
        return cls._of(0, 0, ZERO_TENSOR, position, None, velocity, angular_velocity)

    @classmethod
    def static(cls, position: Sequence[Scalar] = ZERO) -> Body:
        """A body at rest for ever."""
        return cls.kinematic(position)

    @classmethod
    def _of(
        cls,
        mass: Scalar,
        inverse_mass: Scalar,
        inertia: Sequence[Scalar],
        position: Sequence[Scalar],
        orientation: Sequence[Scalar] | None,
        velocity: Sequence[Scalar],
        angular_velocity: Sequence[Scalar],
    ) -> Body:
        return cls(
            mass,
            inverse_mass,
            Symmetric3(*inertia),
            Vec3(*position),
            None if orientation is None else Quaternion(*orientation),
            Vec3(*velocity),
            Vec3(*angular_velocity),
        )

    def twist(self) -> Twist:
        """The twist of the centre of mass."""
        return Twist(self.velocity, self.angular_velocity)

    def velocity_at(self, lever_arm: Vec3) -> Vec3:
        """Velocity of the body's point at ``lever_arm`` from its centre of mass [m/s]."""
        return self.velocity + self.angular_velocity.cross(lever_arm)

    def spin(self, angular_impulse: Vec3) -> Vec3:
        """The change of angular velocity that an angular impulse [N m s] causes [rad/s].

        Both are in world axes; the inertia is undone in body axes, where it is best conditioned.
        """
        if self.orientation is None:
            return solve_inertia(self.inertia, angular_impulse)
        in_body_axes = self.orientation.to_body(angular_impulse)
        return self.orientation.to_world(solve_inertia(self.inertia, in_body_axes))

    def spin_about_z(self, angular_impulse: Scalar) -> Scalar:
        """The same about z alone, for a body turned about z whose inertia does not couple z to x and y."""
        has_inertia, zz = _pivot(self.inertia.zz, 0)
        return choose(has_inertia, lambda: angular_impulse / zz, lambda: angular_impulse * 0)

    def response(self, impulse: Vec3, lever_arm: Vec3) -> Twist:
        """The change of twist that ``impulse`` [N s] at ``lever_arm`` [m] causes."""
        return Twist(impulse * self.inverse_mass, self.spin(lever_arm.cross(impulse)))

    def moved_by(self, change: Twist) -> Body:
        """This body with its twist changed."""
        return self._replace(
            velocity=self.velocity + change.linear,
            angular_velocity=self.angular_velocity + change.angular,
        )


def solve_inertia(inertia: Symmetric3, angular_impulse: Vec3) -> Vec3:
    """``I^-1 L``, or its pseudo-inverse where the body has no inertia about some axis.

    A tensor of a real body has ``I_1 <= I_2 + I_3`` for its moments in any order. If one moment is
    0 the other two are therefore equal, to ``c = tr(I) / 2``: the body is a thin rod, ``I / c``
    projects across its axis, and the pseudo-inverse is ``I / c^2``. If two are 0, so is the third.
    """
    is_definite, factor = factor_inertia(inertia)
    return choose(
        is_definite,
        lambda: factor.solve(angular_impulse),
        lambda: _solve_rod(inertia, angular_impulse),
    )


def factor_inertia(inertia: Symmetric3) -> tuple[Any, Factor3]:
    """Whether there is inertia about every axis, and then the factors of the tensor; no pivot is ever 0."""
    xx, xy, xz, yy, yz, zz = inertia
    has_x, d_x = _pivot(xx, xx)
    l_yx, l_zx = xy / d_x, xz / d_x
    has_y, d_y = _pivot(yy - l_yx * xy, yy)
    w = yz - l_zx * xy
    l_zy = w / d_y
    has_z, d_z = _pivot(zz - l_zx * xz - l_zy * w, zz)
    return has_x & has_y & has_z, Factor3(l_yx, l_zx, l_zy, d_x, d_y, d_z)


def _solve_rod(inertia: Symmetric3, angular_impulse: Vec3) -> Vec3:
    _, c = _pivot(inertia.trace() / 2, 0)
    return (inertia @ angular_impulse) / c / c


def _pivot(value: Scalar, diagonal: Scalar) -> tuple[bool, Scalar]:
    """Whether a pivot is more than rounding, and a divisor that is never 0."""
    is_inertia = value > diagonal * PIVOT_LIMIT
    return is_inertia, choose(is_inertia, lambda: value, lambda: value * 0 + 1)
