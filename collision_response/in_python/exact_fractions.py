"""Exact answers in fractions, for requests with fractions and the law FRICTIONLESS.

This law takes no square root, so the impulse and the twists are exact. Numbers along the normal are divided
by its length: if that is not a fraction, ``normal_impulse`` and the normal velocities are fractions that are
right to about 60 bits. The other laws are not rational. They answer requests with fractions in floats, and
their error bound includes the rounding.
"""

from __future__ import annotations

from fractions import Fraction

from .. import validity
from ..answer import Impact, make_impact
from ..geometry import geometry_for
from ..impact import impact
from ..model import ImpactModel, Precision
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law, Settings
from .request_numbers import as_fraction, body_as_fractions, contact_as_fractions


def resolve(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Impact:
    """Answer a request by FRICTIONLESS, exactly. The numbers of the answer are fractions.

    Raises:
        ImpactError: if the request breaks a rule of :mod:`~collision_response.validity`.
    """
    request = body_as_fractions(body_a), body_as_fractions(body_b), contact_as_fractions(contact)
    validity.check(*request, model.tangential_restitution)
    settings = Settings(restitution_threshold=as_fraction(model.restitution_threshold))
    return make_impact(
        request[:2],
        impact(*request, Law.FRICTIONLESS, settings),
        request[2]._replace(friction=Fraction(0)),
        model._replace(
            law=Law.FRICTIONLESS,
            geometry=geometry_for(model.geometry, *request, frictionless=True),
            precision=Precision.EXTENDED,
        ),
        error_bound=0.0,
        bound_limit=0.0,
    )
