"""Decide which geometry an impact requires: the smallest one whose answer is exactly that of SPATIAL."""

from __future__ import annotations

from collections.abc import Sequence

from .model import Geometry
from .numbers.operations import Condition, Scalar, all_of, all_zero, negation
from .physics.body import Body
from .physics.centre_of_mass import com_in_world_axes, moment_about_z, planar_spin
from .physics.contact import Contact
from .physics.tensor import ZERO_TENSOR
from .physics.vector import ZERO, Vec3


def point_suffices(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Condition:
    """Whether POINT gives the answer of SPATIAL.

    That is so if rotation changes no velocity that the law uses, and the impulse changes no rotation.
    """

    def is_point_like(body: Body) -> Condition:
        arm = contact.position - body.position
        acts_centrally = _is_parallel(arm, contact.normal) if frictionless else all_zero(arm)
        is_central = acts_centrally & all_zero(body.com)
        is_particle = is_central | all_zero([*body.inertia, *body.angular_velocity])
        return is_particle & negation(body.is_articulated())

    return is_point_like(body_a) & is_point_like(body_b)


def planar_suffices(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Condition:
    """Whether PLANAR gives the answer of SPATIAL: all that the law uses lies in the x-y plane."""
    in_plane = contact.normal.z == 0
    for body in (body_a, body_b):
        in_plane = in_plane & (contact.position.z == body.position.z) & _turns_about_z(body)
        in_plane = in_plane & negation(body.is_articulated())
    if frictionless:
        return in_plane
    tumbling = [w for body in (body_a, body_b) for w in body.angular_velocity[:2]]
    return in_plane & (body_a.velocity.z == body_b.velocity.z) & all_zero(tumbling)


def suffices(
    geometry: Geometry, body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool
) -> Condition:
    """Whether a geometry gives the answer of SPATIAL.

    POINT moves in space, so PLANAR does not always suffice where POINT does.
    """
    if geometry is Geometry.POINT:
        return point_suffices(body_a, body_b, contact, frictionless=frictionless)
    if geometry is Geometry.PLANAR:
        return planar_suffices(body_a, body_b, contact, frictionless=frictionless)
    return geometry is Geometry.SPATIAL


def geometry_for(
    geometry: Geometry, body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool
) -> Geometry:
    """Return the geometry that AUTO stands for, for plain numbers; any other geometry as it is."""
    if geometry is not Geometry.AUTO:
        return geometry
    sizes = Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL
    return next(size for size in sizes if suffices(size, body_a, body_b, contact, frictionless=frictionless))


def reduce_body(body: Body, geometry: Geometry) -> Body:
    """Return a body without what a geometry leaves out.

    It keeps its momentum and, in PLANAR, its angular momentum about z. Then an impulse changes its energy as
    it changes that of the given body, so the given body gains none either.
    """
    com, velocity, spin = com_in_world_axes(body), body.velocity, body.angular_velocity
    if geometry is Geometry.POINT:
        return body._replace(
            inertia=ZERO_TENSOR,
            orientation=None,
            velocity=velocity + spin.cross(com),
            angular_velocity=ZERO,
            com=ZERO,
        )
    zz, planar = moment_about_z(body), spin._replace(x=0.0, y=0.0, z=planar_spin(body))
    return body._replace(
        inertia=ZERO_TENSOR._replace(xx=zz, yy=zz, zz=zz),
        position=_in_plane(body.position),
        orientation=None,
        velocity=_in_plane(velocity + (spin - planar).cross(com)),
        angular_velocity=planar,
        com=_in_plane(com),
    )


def reduce_contact(contact: Contact, geometry: Geometry) -> Contact:
    """Return a contact without what a geometry leaves out."""
    if geometry is Geometry.POINT:
        return contact
    return contact._replace(position=_in_plane(contact.position), normal=_in_plane(contact.normal))


def _in_plane(v: Sequence[Scalar]) -> Vec3:
    return Vec3(v[0], v[1], 0.0)


def _is_parallel(v: Vec3, w: Vec3) -> Condition:
    """Whether two vectors lie along the same coordinate axis, so that their cross product is exactly 0."""
    return all_of((v[i] == 0) | (w[j] == 0) for i in range(3) for j in range(3) if i != j)


def _turns_about_z(body: Body) -> Condition:
    """Whether an impulse in the x-y plane of the reference point turns the body about z only."""
    inertia, q = body.inertia, body.orientation
    is_uncoupled = all_zero([inertia.xz, inertia.yz, body.com.z])
    return is_uncoupled if q is None else is_uncoupled & (all_zero([q.x, q.y]) | all_zero(inertia))
