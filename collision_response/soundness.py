"""What is wrong with a contact, over any kind of number.

These are the checks of :mod:`~collision_response.validate`, as conditions: for arrays and for traced
formulas, where nothing can be raised. An immovable body is one of infinite mass and zero inertia.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from .model import Geometry
from .physics.body import PIVOT_LIMIT, Body
from .physics.contact import Contact
from .physics.number import Scalar, choose
from .physics.tensor import Symmetric3
from .status import StatusCode

CLEARANCE = 2.0**-44
"""What is left of the product of the second moments, relative to ``(tr(I)/2)^3``, that is not rounding."""

Condition = Any
"""A truth value, or an array or symbol of them."""


class Scene(NamedTuple):
    """Two bodies, their contact, and ``e_t``."""

    body_a: Body
    body_b: Body
    contact: Contact
    tangential_restitution: Scalar


def requirements(scene: Scene, geometry: Geometry) -> Iterator[tuple[Condition, StatusCode]]:
    """What must hold, each with the code of what is wrong if it does not. The first that fails counts."""
    body_a, body_b, contact, e_t = scene
    yield is_mass(body_a.mass) & is_mass(body_b.mass), StatusCode.INVALID_MASS
    for body in (body_a, body_b):
        numbers = [
            *body.inertia,
            *body.position,
            *body.velocity,
            *body.angular_velocity,
            *(body.orientation or ()),
        ]
        yield all_finite(numbers), StatusCode.NOT_FINITE
        if geometry is not Geometry.POINT:
            is_inertia = is_moment(body) if geometry is Geometry.PLANAR else is_tensor(body.inertia)
            yield is_inertia & (is_movable(body) | ~any_nonzero(body.inertia)), StatusCode.INVALID_INERTIA
        if body.orientation is not None:
            yield any_nonzero(body.orientation), StatusCode.INVALID_ORIENTATION
    yield is_movable(body_a) | is_movable(body_b), StatusCode.NO_DYNAMIC_BODY
    yield all_finite([*contact.position, *contact.normal]), StatusCode.NOT_FINITE
    yield any_nonzero(contact.normal), StatusCode.INVALID_NORMAL
    for value, is_in_range in zip(
        (contact.restitution, contact.friction, e_t), are_coefficients(scene), strict=True
    ):
        yield all_finite([value]), StatusCode.NOT_FINITE
        yield is_in_range, StatusCode.INVALID_COEFFICIENT


def is_mass(mass: Scalar) -> Condition:
    """Whether a mass is positive, and its inverse a number."""
    return choose(mass > 0, lambda: 1 / mass < math.inf, lambda: mass > 0)


def is_movable(body: Body) -> Condition:
    """Whether an impulse moves a body."""
    return body.mass < math.inf


def is_moment(body: Body) -> Condition:
    """Whether a body can have its moment of inertia about z."""
    return body.inertia.zz >= 0


def is_tensor(inertia: Symmetric3) -> Condition:
    """Whether a body can have this tensor: its second moments of mass, ``tr(I)/2 1 - I``, are not negative.

    Rounding of the components is forgiven.
    """
    moments = second_moments(inertia)
    factor = moments.factor()
    x_is, y_is = (moments.xx > 0) & (moments.yy > 0) & (moments.zz > 0), factor.d_y > 0
    is_definite = choose(x_is, lambda: choose(y_is, lambda: factor.d_z > 0, lambda: y_is), lambda: x_is)
    return is_definite | ~any_nonzero(inertia)


def is_clearly_tensor(inertia: Symmetric3) -> Condition:
    """Whether :func:`is_tensor` holds beyond rounding, for a positive definite tensor: a cheap test.

    Of such a tensor at most one second moment is not positive, so it is enough that their product is:
    ``h (c - h^2) - d`` with the invariants ``h = tr(I)/2``, ``c`` (the minors) and ``d = det(I)``.
    """
    xx, _, xz, yy, yz, zz = inertia
    factor = inertia.factor()
    h, minor = inertia.trace() / 2, xx * factor.d_y
    c = minor + (xx * zz - xz * xz) + (yy * zz - yz * yz)
    return minor * factor.d_z < h * (c - h * h * (1 + CLEARANCE))


def are_coefficients(scene: Scene) -> tuple[Condition, Condition, Condition]:
    """Whether restitution, friction and ``e_t`` are in their ranges."""
    e, mu, e_t = scene.contact.restitution, scene.contact.friction, scene.tangential_restitution
    return (e >= 0) & (e <= 1), (mu >= 0) & (mu < math.inf), (e_t >= -1) & (e_t <= 1)


def second_moments(inertia: Symmetric3) -> Symmetric3:
    """``tr(I)/2 1 - I``, with the rounding of the components forgiven."""
    xx, xy, xz, yy, yz, zz = inertia
    forgiven = inertia.trace() / 2 * (1 + 2 * PIVOT_LIMIT)
    return Symmetric3(forgiven - xx, -xy, -xz, forgiven - yy, -yz, forgiven - zz)


def all_finite(numbers: Iterable[Scalar]) -> Condition:
    """Whether no number is infinite or NaN."""
    total: Scalar = 0.0
    for number in numbers:
        total = total + (number - number)
    return total == 0


def any_nonzero(numbers: Iterable[Scalar]) -> Condition:
    """Whether not all numbers are 0; NaN is not 0."""
    zero: Condition = True
    for number in numbers:
        zero = (number == 0) & zero
    return ~zero
