"""How the contact point and the normal move with the bodies, which the derivative by a pose leaves out.

``q = (x_A, theta_A, x_B, theta_B)`` stands for twelve small changes of the poses: displacements of the
reference points, and rotations about the world axes. Body_a touches with a sphere of radius ``R_A`` about a
point ``c_A`` that is fixed to it; ``R_A = 0`` is a corner. Body_b touches with a plane, or with a sphere
about ``c_B``:

    plane     dn = dtheta_B x n
    sphere    dn = (1 - n n^T)(dc_A - dc_B) / (R_A + R_B)
    both      dC = dc_A - R_A dn,    dc = dx + dtheta x (c - x)

The shapes of the bodies matter only through ``dn`` and ``dC``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..arguments import finite_number
from ..batch.arrays import Array, compared_by_identity
from ..physics.body import Body
from ..physics.contact import Contact
from ..status import ImpactError, StatusCode


@compared_by_identity
class SurfaceMotion(NamedTuple):
    """How the contact point and the normal move with the poses ``q``, and the point with the normal.

    Attributes:
        position: derivative of the contact point by ``q``, shape ``(3, 12)``.
        normal: derivative of the unit normal by ``q``, shape ``(3, 12)``.
        position_by_normal: derivative of the contact point by the unit normal while the bodies stay in
            place, shape ``(3, 3)``.
    """

    position: Array
    normal: Array
    position_by_normal: Array


Surfaces: TypeAlias = Callable[[Body, Body, Contact], SurfaceMotion]
"""Returns the motion for two bodies and their contact."""


def cross_matrix(v: Any) -> Array:
    """Return the matrix ``[v]x`` of the cross product with ``v``."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unit_normal(contact: Contact) -> Array:
    """Return the normal, scaled to length 1."""
    n = np.array(contact.normal, float)
    n /= np.abs(n).max()
    return n / np.linalg.norm(n)


def point_on_plane(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
    """Return the motion for a point mass, body_a, that touches a plane of body_b at its reference point."""
    return corner_on_plane(body_a._replace(position=contact.position), body_b, contact)


def corner_on_plane(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
    """Return the motion for a corner of body_a, at the contact point, on a plane of body_b."""
    return _sphere_on_plane(0.0, body_a, body_b, contact)


def sphere_on_plane(radius: float) -> Surfaces:
    """Return the motion for a sphere on a plane: a function of the bodies and their contact.

    Args:
        radius: of the sphere [m], which is body_a or a part of it. The plane belongs to body_b.

    Raises:
        ImpactError: NOT_FINITE if ``radius`` is not finite.
        TypeError: if ``radius`` is not a real number.
    """
    return partial(_sphere_on_plane, finite_number("radius", radius))


def _sphere_on_plane(radius: float, body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
    n = unit_normal(contact)
    normal = np.zeros((3, 12))
    normal[:, 9:] = -cross_matrix(n)
    return _sphere_motion(radius, n, normal, body_a, contact)


def sphere_on_sphere(radius_a: float, radius_b: float) -> Surfaces:
    """Return the motion for two spheres that touch from outside: a function of the bodies and their contact.

    Args:
        radius_a, radius_b: of the spheres [m]; each sphere is a body or a part of it. A sphere that encloses
            the other one has a negative radius.

    Raises:
        ImpactError: NOT_FINITE if a radius is not finite, INVALID_NORMAL if they add up to 0.
        TypeError: if a radius is not a real number.
    """
    radius_a, radius_b = finite_number("radius_a", radius_a), finite_number("radius_b", radius_b)
    if radius_a + radius_b == 0:
        reason = f"must not be {radius_b}: the centres would coincide, so there is no normal"
        raise ImpactError(StatusCode.INVALID_NORMAL, "radius_b", reason)
    return partial(_sphere_on_sphere, radius_a, radius_b)


def _sphere_on_sphere(
    radius_a: float, radius_b: float, body_a: Body, body_b: Body, contact: Contact
) -> SurfaceMotion:
    n = unit_normal(contact)
    between_centres = np.zeros((3, 12))
    between_centres[:, :6] = _point_motion(body_a, np.add(contact.position, radius_a * n))
    between_centres[:, 6:] = -_point_motion(body_b, np.subtract(contact.position, radius_b * n))
    normal = (np.eye(3) - np.outer(n, n)) @ between_centres / (radius_a + radius_b)
    return _sphere_motion(radius_a, n, normal, body_a, contact)


def _sphere_motion(radius: float, n: Array, normal: Array, body_a: Body, contact: Contact) -> SurfaceMotion:
    """Return the motion for a sphere of body_a, given the derivative of the normal ``n``."""
    position = -radius * normal
    position[:, :6] += _point_motion(body_a, np.add(contact.position, radius * n))
    return SurfaceMotion(position, normal, -radius * np.eye(3))


def _point_motion(body: Body, point: Any) -> Array:
    """Return the derivative of a point that is fixed to a body by the body's pose, shape ``(3, 6)``."""
    return np.hstack([np.eye(3), -cross_matrix(np.subtract(point, body.position))])
