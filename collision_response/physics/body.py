"""A rigid body at the instant of impact, and what an impulse does to it.

An immovable body, static or kinematic, has infinite mass: ``1/m`` and the inverse inertia are 0. It
enters every formula like any other body.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from ..numbers.operations import (
    Condition,
    Scalar,
    all_zero,
    choose,
    fixed,
    for_derivatives,
    given_roundoff,
    negation,
    varying_as,
)
from ..status import shown
from . import mass_properties as solids
from .inverse_inertia import InverseInertia
from .mass_properties import MassProperties
from .orientation import Quaternion
from .tensor import UNIT, ZERO_TENSOR, Factor3, InverseTensor, RodFactor, Symmetric3
from .vector import ZERO, Vec3, as_vector

if TYPE_CHECKING:
    from typing import Unpack

ROUNDINGS = 8
"""A pivot of the inertia tensor of at most so many roundings of its diagonal is rounding, not inertia."""


class Twist(NamedTuple):
    """Linear [m/s] and angular [rad/s] velocity, or a change of them, in world axes."""

    linear: Vec3
    angular: Vec3


class Placement(TypedDict, total=False):
    """Where a body is and how it moves, as for :meth:`Body.dynamic`; what is left out is 0."""

    position: Sequence[Scalar]
    orientation: Sequence[Scalar] | None
    velocity: Sequence[Scalar]
    angular_velocity: Sequence[Scalar]


class Body(NamedTuple):
    """A body: of a shape, or :meth:`dynamic`, :meth:`kinematic`, :meth:`static` or :meth:`articulated`.

    A shape is a homogeneous solid about its centre of mass: ``Body.sphere(2.0, 0.1, velocity=(0, 0, -3))``.
    It takes ``position``, ``orientation``, ``velocity`` and ``angular_velocity``, as :meth:`dynamic` does.

    ``position`` and ``velocity`` are those of the body's reference point: the origin of its axes. It is
    the centre of mass, unless ``com`` says that this lies elsewhere.

    Attributes:
        mass: [kg]; infinite for an immovable body, which takes part in no energy or momentum balance.
        inertia: about the centre of mass, in body axes [kg m^2]. One zero moment: a thin rod. All
            zero: a point mass, or an immovable body. What has no inertia about some axis has no
            rotation about it either: an angular velocity about it moves no contact.
        position: of the reference point, in world axes [m].
        orientation: from body axes to world axes; ``None`` where the two are parallel.
        velocity: of the reference point, in world axes [m/s].
        angular_velocity: in world axes [rad/s].
        com: the centre of mass, from the reference point, in body axes [m].
        inverse_inertia: of an articulated body, at the reference point, in world axes; else ``None``.
    """

    mass: Scalar
    inertia: Symmetric3
    position: Vec3
    orientation: Quaternion | None
    velocity: Vec3
    angular_velocity: Vec3
    com: Vec3 = ZERO
    inverse_inertia: InverseInertia | None = None

    @classmethod
    def dynamic(
        cls,
        mass: Scalar,
        inertia: Sequence[Scalar] = ZERO_TENSOR,
        position: Sequence[Scalar] = ZERO,
        orientation: Sequence[Scalar] | None = None,
        velocity: Sequence[Scalar] = ZERO,
        angular_velocity: Sequence[Scalar] = ZERO,
        com: Sequence[Scalar] = ZERO,
    ) -> Body:
        """A body that impulses move.

        Args:
            mass: [kg], > 0; infinite: as :meth:`kinematic`, without inertia.
            inertia: about the centre of mass in body axes [kg m^2]: ``(xx, xy, xz, yy, yz, zz)`` or a
                matrix. Left out: a point mass, which does not turn.
            position: of the reference point [m].
            orientation: ``(x, y, z, w)``, w last as in ROS, from body axes to world axes; any length but 0.
            velocity: of the reference point [m/s].
            angular_velocity: in world axes [rad/s].
            com: the centre of mass, from the reference point, in body axes [m].

        Raises:
            TypeError: a vector has not as many components.
            ValueError: the inertia is neither six numbers nor a symmetric matrix.
        """
        try:
            tensor = Symmetric3.of(inertia)
        except TypeError:
            raise TypeError(
                f"inertia: must be (xx, xy, xz, yy, yz, zz) or a matrix, is {shown(inertia)}"
            ) from None
        except ValueError as error:
            raise ValueError(f"inertia: {error}") from None
        return cls(
            mass,
            tensor,
            as_vector("position", position),
            None if orientation is None else _quaternion(orientation),
            as_vector("velocity", velocity),
            as_vector("angular_velocity", angular_velocity),
            as_vector("com", com),
        )

    @classmethod
    def of(cls, matter: MassProperties, **placement: Unpack[Placement]) -> Body:
        """A body of some matter: see :mod:`~collision_response.physics.mass_properties`."""
        return cls.dynamic(matter.mass, matter.inertia, com=matter.com, **placement)

    @classmethod
    def sphere(cls, mass: Scalar, radius: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid sphere."""
        return cls.of(solids.sphere(mass, radius), **placement)

    @classmethod
    def hollow_sphere(cls, mass: Scalar, radius: Scalar, **placement: Unpack[Placement]) -> Body:
        """A thin spherical shell, such as a table tennis ball."""
        return cls.of(solids.hollow_sphere(mass, radius), **placement)

    @classmethod
    def box(cls, mass: Scalar, size: Sequence[Scalar], **placement: Unpack[Placement]) -> Body:
        """A solid box with edges ``size = (x, y, z)`` [m] along the body's axes."""
        return cls.of(solids.box(mass, size), **placement)

    @classmethod
    def cylinder(cls, mass: Scalar, radius: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid cylinder about the body's z axis."""
        return cls.of(solids.cylinder(mass, radius, length), **placement)

    @classmethod
    def capsule(cls, mass: Scalar, radius: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid cylinder about the body's z axis with round ends; ``length`` is the cylinder's."""
        return cls.of(solids.capsule(mass, radius, length), **placement)

    @classmethod
    def cone(cls, mass: Scalar, radius: Scalar, height: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid cone about the body's z axis; ``position`` is its centre of mass."""
        return cls.of(solids.cone(mass, radius, height), **placement)

    @classmethod
    def rod(cls, mass: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A thin rod along the body's x axis."""
        return cls.of(solids.rod(mass, length), **placement)

    @classmethod
    def mesh(cls, mass: Scalar, shape: Any, **placement: Unpack[Placement]) -> Body:
        """A solid of any shape, such as ``trimesh.load_mesh("part.stl")``; ``position`` is its origin's."""
        return cls.of(solids.mesh(mass, shape), **placement)

    @classmethod
    def kinematic(
        cls,
        position: Sequence[Scalar] = ZERO,
        velocity: Sequence[Scalar] = ZERO,
        angular_velocity: Sequence[Scalar] = ZERO,
    ) -> Body:
        """A body that moves as it does, whatever strikes it."""
        return cls(
            math.inf,
            ZERO_TENSOR,
            as_vector("position", position),
            None,
            as_vector("velocity", velocity),
            as_vector("angular_velocity", angular_velocity),
            ZERO,
        )

    @classmethod
    def articulated(
        cls,
        inverse_inertia: Iterable[Any],
        position: Sequence[Scalar] = ZERO,
        velocity: Sequence[Scalar] = ZERO,
        angular_velocity: Sequence[Scalar] = ZERO,
    ) -> Body:
        """A link of a mechanism: what an impulse on it moves is given by its inverse inertia.

        Two bodies of one mechanism also move each other, which their two matrices do not say: for these,
        :func:`~collision_response.resolve_contact` with the Jacobian of their relative velocity.

        Of one freedom, such as a door, a link moves one way only, and slip stops when the approach does. Of
        two, impulses in some direction move nothing, and no law says how great they are if that direction
        lies in the cone of friction. The laws that follow slip then give COULOMB's answer, with
        ``LAW_FALLBACK``. Else their ``error_bound`` may be infinite where that direction is not across the
        normal; that of COMPLIANT is.

        Args:
            inverse_inertia: Khatib's ``J M^-1 J^T``, 6x6 or its 36 numbers; rows linear [1/kg], then angular
                [1/(kg m^2)], in world axes, at the origin of the body frame; ``J`` has these rows too.
            position: of the origin of the body frame [m].
            velocity, angular_velocity: the twist ``J q'`` there, in world axes [m/s, rad/s].

        Raises:
            ImpactError: INVALID_INERTIA or NOT_FINITE: no 36 finite numbers, or not symmetric.
        """
        moving = cls.kinematic(position, velocity, angular_velocity)
        return moving._replace(inverse_inertia=InverseInertia.of(inverse_inertia))

    @classmethod
    def static(cls, position: Sequence[Scalar] = ZERO) -> Body:
        """A body at rest for ever."""
        return cls.kinematic(position)

    def with_twist(self, twist: Twist) -> Body:
        """The body where it is, now moving so."""
        return self._replace(velocity=twist.linear, angular_velocity=twist.angular)

    def is_movable(self) -> Condition:
        """Whether impulses move the body."""
        return self.has_mass() if self.inverse_inertia is None else self.has_mass() | self.is_articulated()

    def has_mass(self) -> Condition:
        """Whether the body is rigid, and impulses move it."""
        return self.mass < math.inf

    def is_articulated(self) -> Condition:
        """Whether the body is a link that impulses move."""
        return False if self.inverse_inertia is None else negation(all_zero(self.inverse_inertia))

    def inverse_mass(self) -> Scalar:
        """``1/m`` [1/kg]; 0 for an immovable body."""
        return choose(self.has_mass(), lambda: 1 / self.mass, lambda: 0)

    def to_world(self, v: Vec3) -> Vec3:
        """World components of a vector given in body axes."""
        return v if self.orientation is None else Quaternion(*self.orientation).rotation().to_world(v)

    def to_body(self, v: Vec3) -> Vec3:
        """Body components of a vector given in world axes."""
        return v if self.orientation is None else Quaternion(*self.orientation).rotation().to_body(v)

    def inverse_tensor(self) -> InverseTensor:
        """``I^-1`` in body axes [1/(kg m^2)]; the pseudo-inverse where there is no inertia about some axis.

        A tensor of a real body has ``I_1 <= I_2 + I_3`` for its moments in any order. If one moment is
        0 the other two are therefore equal, to ``c = tr(I)/2``: the body is a thin rod, ``I/c``
        projects across its axis, and the pseudo-inverse is ``(I/c) (1/c) (I/c)``. If two are 0, so is
        the third.
        """
        is_definite, factors = _factor(self.inertia)
        c = self.inertia.trace() / 2
        has_inertia = _varying_with(c, self.inertia.xy, self.inertia.xz, self.inertia.yz) > 0
        i = 1 / choose(has_inertia, lambda: c, lambda: c * 0 + 1)
        rod = choose(has_inertia, lambda: RodFactor(self.inertia * i, i), lambda: RodFactor(UNIT, 0))
        return InverseTensor(is_definite | negation(self.has_mass()), factors, rod)

    def effective_spin(self) -> tuple[Condition, Vec3]:
        """Whether all of the angular velocity moves contacts, and the part that does, in world axes [rad/s].

        What has no inertia has no rotation to give. That of an immovable body is prescribed.
        """
        inverse, spin = self.inverse_tensor(), self.angular_velocity

        def across() -> Vec3:
            return self.to_world(inverse.rod.effective_spin(self.to_body(spin)))

        return inverse.has_factors, choose(inverse.has_factors, lambda: spin, across)


def _quaternion(values: Sequence[Scalar]) -> Quaternion:
    try:
        return Quaternion(*values)
    except TypeError:
        raise TypeError(f"orientation: must be a quaternion (x, y, z, w), is {shown(values)}") from None


def _factor(inertia: Symmetric3) -> tuple[Condition, Factor3]:
    """Whether there is inertia about every axis, and the factors of the tensor, ``i`` 0 if there is not."""
    xx, xy, xz, yy, yz, zz = inertia
    has_x, i_x = _inverse_pivot(xx, xx, xy, xz)
    l_yx, l_zx = xy * i_x, xz * i_x
    w = yz - l_zx * xy
    has_y, i_y = _inverse_pivot(yy - l_yx * xy, yy, l_yx, w)
    l_zy = w * i_y
    has_z, i_z = _inverse_pivot(zz - l_zx * xz - l_zy * w, zz, l_zx - l_zy * l_yx, l_zy)
    is_definite = has_x & has_y & has_z
    i = choose(is_definite, lambda: (i_x, i_y, i_z), lambda: (0, 0, 0))
    return is_definite, Factor3(l_yx, l_zx, l_zy, *i)


def _inverse_pivot(value: Scalar, diagonal: Scalar, *beside: Scalar) -> tuple[Condition, Scalar]:
    """Whether a pivot is more than rounding, and then its inverse, or 1.

    What is beside it says which axis has no inertia where it is rounding: there is no derivative by that.
    """
    rounding = fixed(diagonal * (ROUNDINGS * given_roundoff(diagonal)))
    is_inertia = value > rounding

    def on_the_edge() -> Scalar:
        nought = varying_as(rounding, lambda: _varying_with(value, *beside))
        return choose(is_inertia, lambda: value, lambda: nought)

    is_inertia = for_derivatives(value, on_the_edge) > rounding
    return is_inertia, 1 / choose(is_inertia, lambda: value, lambda: value * 0 + 1)


def _varying_with(x: Scalar, *others: Scalar) -> Scalar:
    """``x``, which varies where any of these do."""
    return varying_as(x, lambda: sum((y * 2.0**i for i, y in enumerate(others)), start=x))
