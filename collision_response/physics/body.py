"""A rigid body at the instant of impact.

An immovable body, static or kinematic, has infinite mass: ``1/m`` and its inverse inertia are 0. The formulas
treat it like any other body.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from ..numbers.operations import (
    Condition,
    Scalar,
    add_up,
    all_zero,
    choose,
    fixed,
    for_derivatives,
    given_roundoff,
    negation,
    varying_as,
)
from ..status import format_value
from . import mass_properties as solids
from .inverse_inertia import InverseInertia
from .mass_properties import MassProperties
from .orientation import ALIGNED, Quaternion, Rotation
from .tensor import UNIT, ZERO_TENSOR, Factor3, InverseTensor, RodFactor, Symmetric3
from .vector import ZERO, Vec3, as_vector

if sys.version_info >= (3, 11):
    from typing import Unpack
elif TYPE_CHECKING:
    from typing_extensions import Unpack

ROUNDINGS = 8
"""A pivot of the inertia tensor counts as 0 up to this number of units of roundoff of what it is made of."""


class Twist(NamedTuple):
    """Linear and angular velocity of a body, or a change of them.

    Attributes:
        linear: velocity of the body's reference point, in world axes [m/s].
        angular: angular velocity, in world axes [rad/s].
    """

    linear: Vec3
    angular: Vec3


class Placement(TypedDict, total=False):
    """Keyword arguments that say where a body is and how it moves: see :meth:`Body.dynamic`."""

    position: Iterable[Scalar]
    orientation: Iterable[Scalar] | None
    velocity: Iterable[Scalar]
    angular_velocity: Iterable[Scalar]


class Body(NamedTuple):
    """A body at the instant of impact: its mass properties, its pose and its twist.

    Build one with a shape, such as :meth:`sphere` or :meth:`box`, or with :meth:`dynamic`, :meth:`kinematic`,
    :meth:`static` or :meth:`articulated`. Shapes are homogeneous solids of a mass [kg] and lengths [m]. They
    refuse negative numbers with an ``ImpactError``. They take the keyword arguments ``position``,
    ``orientation``, ``velocity`` and ``angular_velocity`` of :meth:`dynamic`:

        >>> ball = Body.sphere(2.0, 0.1, velocity=(0, 0, -3))
        >>> ball.mass, ball.velocity
        (2.0, Vec3(x=0, y=0, z=-3))

    ``position`` and ``velocity`` belong to the body's reference point, which is the origin of its axes. The
    reference point is the centre of mass unless ``com`` places the centre of mass elsewhere.

    Numbers may be of any type that the formulas accept, such as floats or fractions. Two bodies and their
    contact need the same world axes: those of one inertial frame.

    Attributes:
        mass: [kg]; infinite for an immovable body, which is left out of energy and momentum balances.
        inertia: about the centre of mass, in body axes [kg m^2]. A thin rod has one zero moment; a point mass
            and an immovable body have zero inertia. A moment that may be rounding of the components counts as
            zero. An angular velocity about an axis without inertia moves no contact.
        position: of the reference point, in world axes [m].
        orientation: rotation from body axes to world axes; ``None`` if they are parallel.
        velocity: of the reference point, in world axes [m/s].
        angular_velocity: in world axes [rad/s].
        com: centre of mass, from the reference point, in body axes [m].
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
        inertia: Iterable[Any] = ZERO_TENSOR,
        position: Iterable[Scalar] = ZERO,
        orientation: Iterable[Scalar] | None = None,
        velocity: Iterable[Scalar] = ZERO,
        angular_velocity: Iterable[Scalar] = ZERO,
        com: Iterable[Scalar] = ZERO,
    ) -> Body:
        """Build a body that impulses move.

        Args:
            mass: [kg], > 0. An infinite mass gives an immovable body, which must have zero inertia.
            inertia: about the centre of mass, in body axes [kg m^2], as ``(xx, xy, xz, yy, yz, zz)`` or as a
                3x3 matrix. The default is a point mass, which does not rotate.
            position: of the reference point, in world axes [m].
            orientation: quaternion ``(x, y, z, w)``, w last as in ROS, that rotates body axes into world
                axes; any length but 0. ``None`` if they are parallel.
            velocity: of the reference point, in world axes [m/s].
            angular_velocity: in world axes [rad/s].
            com: centre of mass, from the reference point, in body axes [m].

        Raises:
            TypeError: if a vector, the quaternion or the inertia has the wrong form.
            ValueError: if the inertia is neither six numbers nor a symmetric matrix.
        """
        try:
            tensor = Symmetric3.of(inertia)
        except (TypeError, ArithmeticError):
            raise TypeError(
                f"inertia: must be (xx, xy, xz, yy, yz, zz) or a matrix, is {format_value(inertia)}"
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
        """Build a body from the result of a function of :mod:`~collision_response.physics.mass_properties`.

        Args:
            matter: mass, centre of mass and inertia in body axes.
            placement: ``position``, ``orientation``, ``velocity`` and ``angular_velocity``, as in
                :meth:`dynamic`.

        Raises:
            TypeError: if ``matter`` is not the result of such a function.
        """
        if not isinstance(matter, MassProperties):
            raise TypeError(f"matter: must be MassProperties, is {format_value(matter)}")
        if unknown := placement.keys() - Placement.__annotations__:
            places = "position, orientation, velocity and angular_velocity"
            reason = "for inertia or com of your own, use Body.dynamic()"
            raise TypeError(f"{min(unknown)}: a shape takes {places}; {reason}")
        return cls.dynamic(matter.mass, matter.inertia, com=matter.com, **placement)

    @classmethod
    def sphere(cls, mass: Scalar, radius: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid sphere of a mass [kg] and a radius [m]."""
        return cls.of(solids.sphere(mass, radius), **placement)

    @classmethod
    def hollow_sphere(cls, mass: Scalar, radius: Scalar, **placement: Unpack[Placement]) -> Body:
        """A thin spherical shell, such as a table tennis ball, of a mass [kg] and a radius [m]."""
        return cls.of(solids.hollow_sphere(mass, radius), **placement)

    @classmethod
    def box(cls, mass: Scalar, size: Iterable[Scalar], **placement: Unpack[Placement]) -> Body:
        """A solid box with edges ``size = (x, y, z)`` [m] along the body's axes."""
        return cls.of(solids.box(mass, size), **placement)

    @classmethod
    def cylinder(cls, mass: Scalar, radius: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid cylinder about the body's z axis, of a mass [kg], a radius [m] and a length [m]."""
        return cls.of(solids.cylinder(mass, radius, length), **placement)

    @classmethod
    def capsule(cls, mass: Scalar, radius: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A cylinder about the body's z axis with a half ball at each end; ``length`` is without them [m]."""
        return cls.of(solids.capsule(mass, radius, length), **placement)

    @classmethod
    def cone(cls, mass: Scalar, radius: Scalar, height: Scalar, **placement: Unpack[Placement]) -> Body:
        """A solid cone about the body's z axis, tip up; ``position`` is that of its centre of mass."""
        return cls.of(solids.cone(mass, radius, height), **placement)

    @classmethod
    def rod(cls, mass: Scalar, length: Scalar, **placement: Unpack[Placement]) -> Body:
        """A thin rod along the body's x axis, without inertia about it; ``length`` in m."""
        return cls.of(solids.rod(mass, length), **placement)

    @classmethod
    def mesh(cls, mass: Scalar, shape: Any, **placement: Unpack[Placement]) -> Body:
        """A homogeneous solid bounded by a mesh, such as ``trimesh.load_mesh("part.stl")``.

        ``position`` is that of the mesh's origin; the centre of mass may lie elsewhere.

        Raises:
            ValueError: if the mesh is not closed, or is inside out.
        """
        return cls.of(solids.mesh(mass, shape), **placement)

    @classmethod
    def kinematic(
        cls,
        position: Iterable[Scalar] = ZERO,
        velocity: Iterable[Scalar] = ZERO,
        angular_velocity: Iterable[Scalar] = ZERO,
    ) -> Body:
        """Build a body whose motion is prescribed: it strikes others, and no impulse changes its twist.

        Args:
            position: of the reference point, in world axes [m].
            velocity: of the reference point, in world axes [m/s].
            angular_velocity: in world axes [rad/s].
        """
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
        position: Iterable[Scalar] = ZERO,
        velocity: Iterable[Scalar] = ZERO,
        angular_velocity: Iterable[Scalar] = ZERO,
    ) -> Body:
        """Build a link of a mechanism, such as a robot arm. Its inverse inertia says how an impulse moves it.

        Do not use this for an impact between two links of the same mechanism: an impulse on one link also
        moves the other, which their two matrices do not express. Use
        :func:`~collision_response.resolve_contact` with the Jacobian of their relative velocity instead.

        A link may have so few degrees of freedom that impulses in some directions move nothing. If such a
        direction lies in the friction cone, no law determines the impulse along it. If the link has one
        degree of freedom, as a door, the contact moves along one line, and slip stops when the approach does.
        In both cases MOREAU, the Routh laws and COMPLIANT return the answer of COULOMB, with the adjustment
        ``LAW_FALLBACK``. If such a direction lies outside the cone and is not tangential, the ``error_bound``
        of MOREAU and the Routh laws may be infinite, and that of COMPLIANT is.

        Compute the matrix and the twist with the same ``J``, in float64. If the link has fewer than six
        degrees of freedom, rounding to float32 or nine digits makes it seem to move as its joints cannot, and
        the request is refused.

        Args:
            inverse_inertia: Khatib's ``J M^-1 J^T``, as 6x6 or 36 numbers, in world axes, at the origin of
                the body frame. ``M`` is the mass matrix of the mechanism; ``J`` maps joint rates ``q'`` to
                the link's twist. The linear rows come first. Units: 1/kg linear, 1/(kg m^2) angular, 1/(kg m)
                mixed.
            position: of the origin of the body frame, in world axes [m].
            velocity: of that origin, in world axes [m/s]: the linear rows of ``J q'``.
            angular_velocity: in world axes [rad/s]: the angular rows of ``J q'``.

        Raises:
            ImpactError: if ``inverse_inertia`` does not hold 36 numbers or is not symmetric
                (INVALID_INERTIA), or a number is not finite (NOT_FINITE).
            TypeError: if it holds something that is not a number.
        """
        moving = cls.kinematic(position, velocity, angular_velocity)
        return moving._replace(inverse_inertia=InverseInertia.of(inverse_inertia))

    @classmethod
    def static(cls, position: Iterable[Scalar] = ZERO) -> Body:
        """Build a body that stays at rest, such as the ground; ``position`` in world axes [m]."""
        return cls.kinematic(position)

    @property
    def twist(self) -> Twist:
        """The velocity at ``position``, and the angular velocity."""
        return Twist(self.velocity, self.angular_velocity)

    def with_twist(self, twist: Twist) -> Body:
        """Return this body with another twist.

        Raises:
            TypeError: if ``twist`` is not a :class:`Twist`.
        """
        if not isinstance(twist, Twist):
            raise TypeError(f"twist: must be a Twist, is {format_value(twist)}")
        return self._replace(
            velocity=as_vector("twist.linear", twist.linear),
            angular_velocity=as_vector("twist.angular", twist.angular),
        )

    def is_movable(self) -> Condition:
        """Whether impulses move the body."""
        return self.has_mass() if self.inverse_inertia is None else self.has_mass() | self.is_articulated()

    def has_mass(self) -> Condition:
        """Whether the body has a finite mass: it is rigid, and impulses move it."""
        return fixed(self.mass) < math.inf

    def is_articulated(self) -> Condition:
        """Whether the body is a link of a mechanism that impulses move."""
        return False if self.inverse_inertia is None else negation(all_zero(self.inverse_inertia))

    def inverse_mass(self) -> Scalar:
        """``1/m`` [1/kg]; 0 for an immovable body."""
        return choose(self.has_mass(), lambda: 1 / self.mass, lambda: 0)

    def rotation(self) -> Rotation:
        """Rotation from body axes to world axes."""
        return ALIGNED if self.orientation is None else Quaternion(*self.orientation).scaled().rotation()

    def to_world(self, v: Vec3) -> Vec3:
        """World components of a vector given in body axes."""
        return self.rotation().to_world(v)

    def to_body(self, v: Vec3) -> Vec3:
        """Body components of a vector given in world axes."""
        return self.rotation().to_body(v)

    def inverse_tensor(self) -> InverseTensor:
        """``I^-1`` in body axes [1/(kg m^2)]; the pseudo-inverse if an axis has no inertia.

        The principal moments of a real body satisfy ``I_1 <= I_2 + I_3`` in any order. So if one of them is
        0, the other two are equal, ``c = tr(I)/2``: the body is a thin rod. ``P = I/c`` then projects on the
        plane perpendicular to it, and the pseudo-inverse is ``P (1/c) P``. If two moments are 0, all are.
        """
        is_definite, factors = _factor(self.inertia)
        c = self.inertia.trace() / 2
        has_inertia = _varying_with(c, self.inertia.xy, self.inertia.xz, self.inertia.yz) > 0
        i = 1 / choose(has_inertia, lambda: c, lambda: c * 0 + 1)
        rod = choose(has_inertia, lambda: RodFactor(self.inertia * i, i), lambda: RodFactor(UNIT, 0))
        return InverseTensor(is_definite | negation(self.has_mass()), factors, rod)

    def effective_spin(self) -> tuple[Condition, Vec3]:
        """The part of the angular velocity that moves contacts: that about axes with inertia.

        Returns:
            Whether it is all of the angular velocity, as for an immovable body, whose motion is prescribed;
            and the part, in world axes [rad/s].
        """
        inverse, spin = self.inverse_tensor(), self.angular_velocity

        def about_axes_with_inertia() -> Vec3:
            return self.to_world(inverse.rod.effective_spin(self.to_body(spin)))

        return inverse.has_factors, choose(inverse.has_factors, lambda: spin, about_axes_with_inertia)


def _quaternion(values: Iterable[Scalar]) -> Quaternion:
    try:
        return Quaternion(*values)
    except TypeError:
        raise TypeError(
            f"orientation: must be a quaternion (x, y, z, w), is {format_value(values)}"
        ) from None


def _factor(inertia: Symmetric3) -> tuple[Condition, Factor3]:
    """Whether there is inertia about every axis, and the factors of the tensor; their ``i`` are 0 if not.

    A pivot is the moment ``v.I v`` about an axis ``v``: ``(1, 0, 0)``, ``(-l_yx, 1, 0)`` and
    ``(l_zy l_yx - l_zx, -l_zy, 1)``. Roundings of the components of ``I`` change it by up to a small multiple
    of ``v.D v``, where ``D`` is the diagonal of ``I``. A thin rod may lie along any axis, so its moment about
    itself counts as 0 up to that size, which may be much greater than the diagonal entry of the pivot.

    If a product of inertia couples two axes, the tensor was rotated or is a sum over parts, and the moments
    about both axes went into each component. So ``D`` has the moments of coupled axes added to its own.
    """
    xx, xy, xz, yy, yz, zz = inertia
    X, Y, Z = map(fixed, (xx, yy, zz))

    def coupled(product: Scalar, moment: Scalar) -> Scalar:
        return choose(fixed(product) == 0, lambda: moment * 0, lambda: moment)

    D_x = X + coupled(xy, Y) + coupled(xz, Z)
    D_y = Y + coupled(xy, X) + coupled(yz, Z)
    D_z = Z + coupled(xz, X) + coupled(yz, Y)
    has_x, i_x = _inverse_pivot(xx, D_x, xy, xz)
    l_yx, l_zx = xy * i_x, xz * i_x
    w = yz - l_zx * xy
    has_y, i_y = _inverse_pivot(yy - l_yx * xy, D_y + fixed(l_yx * xy), l_yx, w)
    l_zy = w * i_y
    v_x = l_zy * l_yx - l_zx
    v_Dv = D_x * fixed(v_x) * fixed(v_x) + D_y * fixed(l_zy) * fixed(l_zy) + D_z
    has_z, i_z = _inverse_pivot(zz - l_zx * xz - l_zy * w, v_Dv, v_x, l_zy)
    is_definite = has_x & has_y & has_z
    i = choose(is_definite, lambda: (i_x, i_y, i_z), lambda: (0, 0, 0))
    return is_definite, Factor3(l_yx, l_zx, l_zy, *i)


def _inverse_pivot(value: Scalar, size: Scalar, *couplings: Scalar) -> tuple[Condition, Scalar]:
    """Whether a pivot is more than rounding; and its inverse, or 1 if it is not.

    ``size`` is that of the terms that add up to it, without derivatives. If the pivot is rounding, its
    ``couplings`` to the other axes determine which axis has no inertia, and nothing has a derivative with
    respect to them. For numbers that carry derivatives the comparison is then exactly on its edge and varies
    with them, which marks the jump.
    """
    rounding = size * (ROUNDINGS * given_roundoff(size))
    is_inertia = value > rounding

    def with_couplings() -> Scalar:
        zero = varying_as(rounding, lambda: _varying_with(value, *couplings))
        return choose(is_inertia, lambda: value, lambda: zero)

    is_inertia = for_derivatives(value, with_couplings) > rounding
    return is_inertia, 1 / choose(is_inertia, lambda: value, lambda: value * 0 + 1)


def _varying_with(x: Scalar, *others: Scalar) -> Scalar:
    """``x``, with derivatives that are non-zero if those of any of ``others`` are."""
    return varying_as(x, lambda: add_up([x, *(y * 2.0**i for i, y in enumerate(others))]))
