"""How contact point and normal move with the bodies: what a plain derivative by a pose leaves out.

The state of two bodies is ``q = (x_A, theta_A, x_B, theta_B)``, twelve small changes: of the reference
points, and turns about the axes of the world. A ready form is a function of two bodies and their contact.
The surface of body_a is a sphere of radius R about the point ``c_A``, which is fixed to it: with ``R = 0`` a
corner; that of body_b is a plane, or a sphere about ``c_B``:

    plane     dn = dtheta_B x n
    sphere    dn = (1 - n n^T)(dc_A - dc_B) / (R_A + R_B)
    both      dC = dc_A - R dn,    dc = dx + dtheta x (c - x)

So a body's own shape beyond the contact, its curvature included, enters by ``dn`` and ``dC`` alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..model import check_number
from ..physics.body import Body
from ..physics.contact import Contact
from ..status import StatusCode

Array = np.ndarray[Any, Any]


class SurfaceMotion(NamedTuple):
    """How a contact moves with the bodies, and with a normal that is not well known.

    Attributes:
        position: of the contact point, by ``q``, shape ``(3, 12)``.
        normal: of the unit normal, by ``q``, shape ``(3, 12)``.
        position_by_normal: of the contact point, as the normal is turned by itself, shape ``(3, 3)``.
    """

    position: Array
    normal: Array
    position_by_normal: Array


Surfaces: TypeAlias = Callable[[Body, Body, Contact], SurfaceMotion]
"""A ready form, or one of your own."""


def cross_matrix(v: Any) -> Array:
    """``[v]x``: the matrix of ``v x``."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unit_normal(contact: Contact) -> Array:
    """The normal, of length 1."""
    n = np.array(contact.normal, float)
    n /= np.abs(n).max()
    unit: Array = n / np.linalg.norm(n)
    return unit


def point_on_plane(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
    """A point mass, which is body_a's reference point, on a plane of body_b."""
    return corner_on_plane(body_a._replace(position=contact.position), body_b, contact)


def corner_on_plane(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
    """A corner of body_a, where the contact is, on a plane of body_b."""
    return sphere_on_plane(0.0)(body_a, body_b, contact)


def sphere_on_plane(radius: float) -> Surfaces:
    """A sphere of body_a, which may be a part of it, on a plane of body_b.

    Raises:
        ImpactError: NOT_FINITE: ``radius`` [m] is beyond float64.
        TypeError: it is no real number.
    """
    radius = _finite("radius", radius)

    def motion(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
        n = unit_normal(contact)
        normal = np.zeros((3, 12))
        normal[:, 9:] = -cross_matrix(n)
        return _of_sphere(radius, n, normal, body_a, contact)

    return motion


def sphere_on_sphere(radius_a: float, radius_b: float) -> Surfaces:
    """A sphere of body_a on a sphere of body_b, outside; each may be a part of its body.

    Raises:
        ImpactError: NOT_FINITE: a radius [m] is beyond float64.
        TypeError: it is no real number.
    """
    radius_a, radius_b = _finite("radius_a", radius_a), _finite("radius_b", radius_b)

    def motion(body_a: Body, body_b: Body, contact: Contact) -> SurfaceMotion:
        n = unit_normal(contact)
        apart = np.zeros((3, 12))
        apart[:, :6] = _of_point(body_a, np.add(contact.position, radius_a * n))
        apart[:, 6:] = -_of_point(body_b, np.subtract(contact.position, radius_b * n))
        normal = (np.eye(3) - np.outer(n, n)) @ apart / (radius_a + radius_b)
        return _of_sphere(radius_a, n, normal, body_a, contact)

    return motion


def _finite(name: str, radius: Any) -> float:
    check_number(name, radius, -math.inf, math.inf, StatusCode.NOT_FINITE)
    return float(radius)


def _of_sphere(radius: float, n: Array, normal: Array, body_a: Body, contact: Contact) -> SurfaceMotion:
    position = -radius * normal
    position[:, :6] += _of_point(body_a, np.add(contact.position, radius * n))
    return SurfaceMotion(position, normal, -radius * np.eye(3))


def _of_point(body: Body, point: Any) -> Array:
    """How a point that is fixed to a body moves with it, shape ``(3, 6)``."""
    return np.hstack([np.eye(3), -cross_matrix(np.subtract(point, body.position))])
