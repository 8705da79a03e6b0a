"""What a scene requires: the least that gives the answer, exactly or to a tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from .model import Geometry, ImpactModel, Law, Precision
from .numerics.error_bound import NOTHING, Dropped, amplification_by_arm, are_in_range
from .physics.body import Body
from .physics.contact import Contact
from .physics.tensor import ZERO_TENSOR
from .physics.vector import Vec3

FRICTION_MARGIN = 1 / 16
"""Friction can multiply what is dropped by the condition of K: with it, so much less may be."""


class Plan(NamedTuple):
    """A model with its geometry decided.

    Attributes:
        model: as asked, with law and geometry decided.
        dropped: bounds on what that geometry leaves out.
    """

    model: ImpactModel
    dropped: Dropped

    def at(self, precision: Precision) -> Plan:
        """The same in another precision."""
        return self._replace(model=self.model._replace(precision=precision))

    def modelling_all(self, body_a: Body, body_b: Body, contact: Contact) -> Plan:
        """The same in the cheapest geometry that drops nothing."""
        frictionless = self.model.law is Law.FRICTIONLESS
        exact = least_exact_geometry(body_a, body_b, contact, frictionless=frictionless)
        return Plan(self.model._replace(geometry=exact), NOTHING)


def choose_model(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> ImpactModel:
    """``model`` with every AUTO decided, without computing an impulse.

    The geometry is the cheapest whose answer is that of SPATIAL, exactly or (with a tolerance) to
    less than the tolerance: POINT if the impulse turns neither body, PLANAR if all that matters lies
    in the x-y plane. The precision stays AUTO where only the answer's error bound can decide it.
    """
    return plan(body_a, body_b, contact, model).model


def plan(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Plan:
    """The model to compute with, and what it drops."""
    law = model.law
    if law is Law.AUTO:
        law = Law.COULOMB if contact.friction else Law.FRICTIONLESS
    precision = model.precision
    if precision is Precision.AUTO and not model.tolerance:
        precision = Precision.DOUBLE
    model = model._replace(law=law, precision=precision)
    if model.geometry is not Geometry.AUTO:
        return Plan(model, NOTHING)
    frictionless = law is Law.FRICTIONLESS
    exact = least_exact_geometry(body_a, body_b, contact, frictionless=frictionless)
    may_drop = model.tolerance and law in (Law.FRICTIONLESS, Law.COULOMB)
    if may_drop and are_in_range(_sizes(body_a, body_b, contact)):
        limit = model.tolerance / 2 if frictionless else model.tolerance * FRICTION_MARGIN
        for geometry, drop in ((Geometry.POINT, _drop_rotation), (Geometry.PLANAR, _drop_out_of_plane)):
            if geometry < exact:
                dropped = drop(body_a, body_b, contact, frictionless)
                if dropped.effect(_approach_speed(body_a, body_b, contact)) <= limit:
                    return Plan(model._replace(geometry=geometry), dropped)
    return Plan(model._replace(geometry=exact), NOTHING)


def least_exact_geometry(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Geometry:
    """The cheapest geometry whose answer is exactly that of SPATIAL."""
    arms = contact.position - body_a.position, contact.position - body_b.position
    bodies = list(zip((body_a, body_b), arms, strict=True))
    if all(_is_point(body, arm, contact.normal, frictionless) for body, arm in bodies):
        return Geometry.POINT
    in_plane = not contact.normal.z and all(_is_planar(body, arm) for body, arm in bodies)
    at_rest_across = body_a.velocity.z == body_b.velocity.z and not (_tumbles(body_a) or _tumbles(body_b))
    if in_plane and (frictionless or at_rest_across):
        return Geometry.PLANAR
    return Geometry.SPATIAL


def _is_point(body: Body, arm: Vec3, normal: Vec3, frictionless: bool) -> bool:
    """Whether rotation neither moves the contact, as far as the law looks, nor responds to it."""
    acts_centrally = _is_parallel(arm, normal) if frictionless else not any(arm)
    return acts_centrally or (body.inertia == ZERO_TENSOR and not any(body.angular_velocity))


def _is_parallel(v: Vec3, w: Vec3) -> bool:
    """Whether two vectors lie along one axis of coordinates: then no rounding can hide a torque."""
    return not any(v[i] and w[j] for i in range(3) for j in range(3) if i != j)


def _is_planar(body: Body, arm: Vec3) -> bool:
    """Whether an impulse in the plane through the centre of mass turns the body about z alone."""
    inertia, orientation = body.inertia, body.orientation
    turned_about_z = orientation is None or not (orientation.x or orientation.y)
    return not (arm.z or inertia.xz or inertia.yz) and (turned_about_z or inertia == ZERO_TENSOR)


def _tumbles(body: Body) -> bool:
    return bool(body.angular_velocity.x or body.angular_velocity.y)


def _sizes(body_a: Body, body_b: Body, contact: Contact) -> Iterator[float]:
    """What the bounds below are made of."""
    yield _greatest(contact.normal)
    yield _greatest(body_a.velocity - body_b.velocity)
    for body in (body_a, body_b):
        yield body.inverse_mass
        yield _greatest(contact.position - body.position)
        yield _greatest(body.angular_velocity)
        yield from (body.inertia.xx, body.inertia.yy, body.inertia.zz)


def _greatest(v: Vec3) -> float:
    return max(map(abs, v))


def _approach_speed(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Of the centres of mass, along the normal [m/s]."""
    return abs(contact.normal.dot(body_a.velocity - body_b.velocity)) / contact.normal.norm()


def _drop_rotation(body_a: Body, body_b: Body, contact: Contact, frictionless: bool) -> Dropped:
    """Bounds on what POINT leaves out."""
    speed = mobility = spin = 0.0
    total = body_a.inverse_mass + body_b.inverse_mass
    for body in (body_a, body_b):
        arm = contact.position - body.position
        lever = arm.cross(contact.normal).norm() / contact.normal.norm() if frictionless else arm.norm()
        speed += body.angular_velocity.norm() * lever
        if lever and body.inertia != ZERO_TENSOR:
            by_arm = amplification_by_arm(body)
            turning = lever * by_arm.s
            mobility += turning**2 / total
            spin = max(spin, turning * by_arm.spread / math.sqrt(body.inverse_mass))
    return Dropped(speed, mobility, spin)


def _drop_out_of_plane(body_a: Body, body_b: Body, contact: Contact, frictionless: bool) -> Dropped:
    """Bounds on what PLANAR leaves out, of bodies whose inertia does not couple z to x and y."""
    tilt = abs(contact.normal.z) / contact.normal.norm()
    drift = abs(body_a.velocity.z - body_b.velocity.z)
    speed, mobility, spin = drift * (tilt if frictionless else 1.0), tilt, tilt
    total = body_a.inverse_mass + body_b.inverse_mass
    for body in (body_a, body_b):
        if not _is_planar(body, Vec3(0.0, 0.0, 0.0)):
            return Dropped(math.inf, math.inf, math.inf)
        arm, w = contact.position - body.position, body.angular_velocity
        reach = arm.norm()
        speed += 2 * math.hypot(w.x, w.y) * reach + abs(w.z) * reach * tilt
        if reach and body.inertia != ZERO_TENSOR:
            by_arm = amplification_by_arm(body)
            turning = (abs(arm.z) + tilt * reach) * by_arm.s
            mobility += 3 * turning * reach * by_arm.s / total
            spin = max(spin, tilt + turning * by_arm.spread / math.sqrt(body.inverse_mass))
    return Dropped(speed, mobility, spin)
