"""Exact answers in fractions, for requests with fractions and the law FRICTIONLESS.

This law takes no square root, so the impulse and the twists are exact. Numbers along the normal are divided
by its length: if that is not a fraction, ``normal_impulse`` and the normal velocities are fractions that are
right to about 60 bits. The other laws are not rational. They answer requests with fractions in floats, and
their error bound includes the rounding.
"""

from __future__ import annotations

import math
from fractions import Fraction
from numbers import Rational
from typing import Any

from .. import validity
from ..answer import Impact, make_impact
from ..geometry import required_geometry
from ..impact import impact
from ..model import Geometry, ImpactModel, Precision
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.inverse_inertia import InverseInertia
from ..physics.laws import Law, Settings
from ..physics.orientation import Quaternion
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """Answer a request by FRICTIONLESS, exactly. The numbers of the answer are fractions.

    Raises:
        ImpactError: if the request breaks a rule of :mod:`~collision_response.validity`.
    """
    a, b, exact_contact = body_as_fractions(body_a), body_as_fractions(body_b), contact_as_fractions(contact)
    validity.check(a, b, exact_contact, model.tangential_restitution)
    settings = Settings(restitution_threshold=Fraction(model.restitution_threshold))
    answer = impact(a, b, exact_contact, Law.FRICTIONLESS, settings)
    geometry = model.geometry
    if geometry is Geometry.AUTO:
        geometry = required_geometry(a, b, exact_contact, frictionless=True)
    return make_impact(
        (a, b),
        answer.changes,
        answer.report,
        answer.flags,
        exact_contact._replace(friction=Fraction(0)),
        model._replace(law=Law.FRICTIONLESS, geometry=geometry, precision=Precision.EXTENDED),
        error_bound=0.0,
        bound_limit=0.0,
        normalised=any(map(validity.is_not_normalised, (a, b))),
    )


def body_as_fractions(body: Body) -> Body:
    """Convert the numbers of a body to fractions, exactly. An infinite mass stays a float."""
    q = body.orientation
    return Body(
        as_fraction(body.mass),
        Symmetric3(*map(as_fraction, body.inertia)),
        _vector(body.position),
        None if q is None else Quaternion(*map(as_fraction, q)),
        _vector(body.velocity),
        _vector(body.angular_velocity),
        _vector(body.com),
        None if body.inverse_inertia is None else InverseInertia(*map(as_fraction, body.inverse_inertia)),
    )


def contact_as_fractions(contact: Contact) -> Contact:
    """Convert the numbers of a contact to fractions, exactly.

    A restitution that is a function stays one; a friction that is a function becomes 0.
    """
    e, mu = contact.restitution, contact.friction
    return Contact(
        _vector(contact.position),
        _vector(contact.normal),
        e if callable(e) else as_fraction(e),
        Fraction(0) if callable(mu) else as_fraction(mu),
        contact.tangential_restitution,
    )


def _vector(v: Any) -> Vec3:
    return Vec3(*map(as_fraction, v))


def as_fraction(x: Any) -> Any:
    """Convert a number to a fraction, exactly. An infinite number and NaN stay floats."""
    if isinstance(x, Rational):
        return Fraction(x)
    x = float(x)
    return Fraction(x) if math.isfinite(x) else x
