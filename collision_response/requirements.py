"""What a scene requires: the least that gives the answer, exactly or to a tolerance."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from functools import reduce
from typing import Any, NamedTuple

from .model import Geometry, ImpactModel, Law, Precision
from .numerics.error_bound import NOTHING, Dropped, amplification_by_arm, are_in_range
from .physics.body import Body
from .physics.contact import Contact
from .physics.number import are_zero
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
    if is_point(body_a, body_b, contact, frictionless=frictionless):
        return Geometry.POINT
    return (
        Geometry.PLANAR if is_planar(body_a, body_b, contact, frictionless=frictionless) else Geometry.SPATIAL
    )


def is_point(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Any:
    """Whether rotation neither moves the contact, as far as the law looks, nor responds to it."""

    def is_point_like(body: Body) -> Any:
        arm = contact.position - body.position
        acts_centrally = _is_parallel(arm, contact.normal) if frictionless else are_zero(arm)
        return acts_centrally | are_zero([*body.inertia, *body.angular_velocity])

    return is_point_like(body_a) & is_point_like(body_b)


def is_planar(body_a: Body, body_b: Body, contact: Contact, *, frictionless: bool) -> Any:
    """Whether all that matters lies in the x-y plane."""
    in_plane = contact.normal.z == 0
    for body in (body_a, body_b):
        in_plane = in_plane & (contact.position.z == body.position.z) & _turns_about_z(body)
    if frictionless:
        return in_plane
    tumbling = [w for body in (body_a, body_b) for w in body.angular_velocity[:2]]
    return in_plane & (body_a.velocity.z == body_b.velocity.z) & are_zero(tumbling)


def _is_parallel(v: Vec3, w: Vec3) -> Any:
    """Whether two vectors lie along one axis of coordinates: then no rounding can hide a torque."""
    pairs = ((v[i] == 0) | (w[j] == 0) for i in range(3) for j in range(3) if i != j)
    return reduce(operator.and_, pairs)


def _turns_about_z(body: Body) -> Any:
    """Whether an impulse in the x-y plane through the centre of mass turns the body about z alone."""
    inertia, q = body.inertia, body.orientation
    is_uncoupled = are_zero([inertia.xz, inertia.yz])
    return is_uncoupled if q is None else is_uncoupled & (are_zero([q.x, q.y]) | are_zero(inertia))


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
            turning = lever * math.sqrt(by_arm.ss)
            mobility += turning**2 / total
            spin = max(spin, turning * math.sqrt(by_arm.condition / body.inverse_mass))
    return Dropped(speed, mobility, spin)


def _drop_out_of_plane(body_a: Body, body_b: Body, contact: Contact, frictionless: bool) -> Dropped:
    """Bounds on what PLANAR leaves out, of bodies whose inertia does not couple z to x and y."""
    tilt = abs(contact.normal.z) / contact.normal.norm()
    drift = abs(body_a.velocity.z - body_b.velocity.z)
    speed, mobility, spin = drift * (tilt if frictionless else 1.0), tilt, tilt
    total = body_a.inverse_mass + body_b.inverse_mass
    for body in (body_a, body_b):
        if not _turns_about_z(body):
            return Dropped(math.inf, math.inf, math.inf)
        arm, w = contact.position - body.position, body.angular_velocity
        reach = arm.norm()
        speed += 2 * math.hypot(w.x, w.y) * reach + abs(w.z) * reach * tilt
        if reach and body.inertia != ZERO_TENSOR:
            by_arm = amplification_by_arm(body)
            c = math.sqrt(by_arm.ss)
            turning = (abs(arm.z) + tilt * reach) * c
            mobility += 3 * turning * reach * c / total
            spin = max(spin, tilt + turning * math.sqrt(by_arm.condition / body.inverse_mass))
    return Dropped(speed, mobility, spin)
