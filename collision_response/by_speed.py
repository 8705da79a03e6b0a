"""Coefficients that are functions of a speed, as numbers for the impact at hand."""

from __future__ import annotations

import math
from collections.abc import Callable

from . import exactly, validity
from .model import check_number
from .numbers.number import square_root
from .physics.body import Body
from .physics.contact import Contact
from .physics.effective_mass import ContactKinematics
from .physics.laws import PATHS, Law
from .rationally import as_fraction
from .status import ImpactError, StatusCode


def restitution_at(speed: float, contact: Contact, field: str) -> float:
    """What the function of the restitution gives for an approach speed [m/s].

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE: it gives no coefficient.
    """
    return _value(contact.restitution, speed, 1.0, f"{field}.restitution(approach_speed)")


def friction_at_first(body_a: Body, body_b: Body, contact: Contact, law: Law, field: str) -> float:
    """What the function of the friction gives for the slip speed at first touch.

    Args:
        body_a, body_b, contact: of one impact.
        law: not AUTO. One that follows slip on its way takes no such function.
        field: how the contact is called.

    Raises:
        ImpactError: INVALID_MODEL, INVALID_COEFFICIENT or NOT_FINITE; or the request cannot be answered.
    """
    if law in PATHS:
        reason = f"{law.name} takes no friction that depends on slip speed: give a number, or ask COULOMB"
        raise ImpactError(StatusCode.INVALID_MODEL, f"{field}.friction", reason)
    validity.check(*exactly.read(body_a, body_b, contact._replace(friction=0.0)), 0.0)
    return _value(
        contact.friction, slip_speed(body_a, body_b, contact), math.inf, f"{field}.friction(slip_speed)"
    )


def slip_speed(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Of body_a relative to body_b across the normal, before the impact, to rounding [m/s]."""
    a, b, touch = exactly.read(body_a, body_b, contact, lambda x, _: as_fraction(x))
    kinematics = ContactKinematics.of(a, b, touch)
    n, u = touch.normal, kinematics.u
    return float(square_root(u.dot(u) - kinematics.n_u * kinematics.n_u / n.dot(n)))


def _value(function: Callable[[float], float], speed: float, most: float, field: str) -> float:
    value = function(speed)
    check_number(field, value, 0, most, StatusCode.INVALID_COEFFICIENT)
    return float(value)
