"""What a scene requires: the least that gives the exact answer."""

from __future__ import annotations

from .model import Geometry, ImpactModel, Law, Precision
from .physics.body import Body
from .physics.contact import Contact
from .physics.tensor import ZERO_TENSOR
from .physics.vector import Vec3


def choose_model(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> ImpactModel:
    """``model`` with every AUTO decided, without computing an impulse.

    The geometry is the cheapest that is *exact* for the inputs: POINT if the impulse turns neither
    body, PLANAR if all that matters lies in the x-y plane, else SPATIAL.
    """
    law = model.law
    if law is Law.AUTO:
        law = Law.COULOMB if contact.friction else Law.FRICTIONLESS
    geometry = model.geometry
    if geometry is Geometry.AUTO:
        geometry = least_exact_geometry(body_a, body_b, contact, frictionless=law is Law.FRICTIONLESS)
    precision = Precision.DOUBLE if model.precision is Precision.AUTO else model.precision
    return model._replace(law=law, geometry=geometry, precision=precision)


def least_exact_geometry(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Geometry:
    """The cheapest geometry whose answer is that of SPATIAL."""
    arms = contact.position - body_a.position, contact.position - body_b.position
    bodies = list(zip((body_a, body_b), arms, strict=True))
    if all(_is_point(body, arm, contact.normal, frictionless) for body, arm in bodies):
        return Geometry.POINT
    if not contact.normal.z and all(_is_planar(body, arm) for body, arm in bodies):
        if frictionless or (body_a.velocity.z == body_b.velocity.z and not (_tumbles(body_a) or _tumbles(body_b))):
            return Geometry.PLANAR
    return Geometry.SPATIAL


def _is_point(body: Body, arm: Vec3, normal: Vec3, frictionless: bool) -> bool:
    """Whether rotation neither moves the contact, as far as the law looks, nor responds to it."""
    acts_centrally = not any(arm.cross(normal)) if frictionless else not any(arm)
    return acts_centrally or (body.inertia == ZERO_TENSOR and not any(body.angular_velocity))


def _is_planar(body: Body, arm: Vec3) -> bool:
    """Whether an impulse in the plane through the centre of mass turns the body about z alone."""
    inertia, orientation = body.inertia, body.orientation
    turned_about_z = orientation is None or not (orientation.x or orientation.y)
    return not (arm.z or inertia.xz or inertia.yz) and (turned_about_z or inertia == ZERO_TENSOR)


def _tumbles(body: Body) -> bool:
    return bool(body.angular_velocity.x or body.angular_velocity.y)
