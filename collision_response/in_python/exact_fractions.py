"""Exact rationals: what FRICTIONLESS gives of fractions.

The law takes no square root, so impulses and twists are exact. Only what is along the normal is relative
to its length: where that is no fraction, ``normal_impulse`` and the normal velocities are the nearest
ones to some 60 bits. The other laws are not rational: they answer fractions by floats, and their bounds
count the rounding.
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
    """The answer of FRICTIONLESS to a request with fractions in it; the numbers of the answer are fractions.

    Raises:
        ImpactError: the request cannot be answered.
    """
    a, b, touch = body_as_fractions(body_a), body_as_fractions(body_b), contact_as_fractions(contact)
    validity.check(a, b, touch, model.tangential_restitution)
    settings = Settings(restitution_threshold=Fraction(model.restitution_threshold))
    found = impact(a, b, touch, Law.FRICTIONLESS, settings)[:3]
    geometry = model.geometry
    if geometry is Geometry.AUTO:
        geometry = required_geometry(a, b, touch, frictionless=True)
    return make_impact(
        (a, b),
        found,
        touch._replace(friction=Fraction(0)),
        model._replace(law=Law.FRICTIONLESS, geometry=geometry, precision=Precision.EXTENDED),
        0.0,
        0.0,
        normalised=any(map(validity.is_not_normalised, (a, b))),
    )


def body_as_fractions(body: Body) -> Body:
    """A body of exact numbers; an infinite mass stays."""
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
    """A contact of exact numbers for FRICTIONLESS; a restitution that is a function stays."""
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
    """Exactly; what is not finite stays."""
    if isinstance(x, Rational):
        return Fraction(x)
    x = float(x)
    return Fraction(x) if math.isfinite(x) else x
