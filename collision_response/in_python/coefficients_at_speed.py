"""Coefficients that are functions of a speed, as numbers for the impact at hand."""

from __future__ import annotations

import math
from collections.abc import Callable

from .. import validity
from ..kernels import library
from ..model import check_number
from ..numbers.operations import square_root
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.effective_mass import ContactKinematics
from ..physics.laws import BY_SPEED, PATHS, Law
from ..status import ImpactError, StatusCode
from . import arbitrary_precision
from .exact_fractions import as_fraction


def restitution_at_speed(speed: float, contact: Contact, field: str) -> float:
    """What the function of the restitution gives for an approach speed [m/s].

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE: it gives no coefficient.
    """
    return _value(contact.restitution, speed, 1.0, f"{field}.restitution(approach_speed)")


def friction_at_speed(speed: float, contact: Contact) -> float:
    """What the function of the friction gives for a slip speed [m/s].

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE: it gives no coefficient.
    """
    return _value(contact.friction, speed, math.inf, "contact.friction(slip_speed)")


def initial_friction(body_a: Body, body_b: Body, contact: Contact, law: Law) -> float:
    """What the function of the friction gives for the slip speed at first touch.

    Args:
        body_a, body_b, contact: of one impact.
        law: not AUTO. COMPLIANT takes no such function; Routh's laws, of one contact, follow it on its way
            instead: see ``friction_along_path.py``.

    Raises:
        ImpactError: INVALID_MODEL, INVALID_COEFFICIENT or NOT_FINITE; or the request cannot be answered.
    """
    if law in PATHS:
        of_several = " of several contacts" if law in BY_SPEED else ""
        reason = f"{law.name} takes no friction{of_several} that depends on slip speed: give a number"
        raise ImpactError(StatusCode.INVALID_MODEL, "contact.friction", f"{reason}, or ask COULOMB")
    validity.check(*arbitrary_precision.read_request(body_a, body_b, contact._replace(friction=0.0)), 0.0)
    return friction_at_speed(initial_slip_speed(body_a, body_b, contact), contact)


def initial_slip_speed(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Of body_a relative to body_b across the normal, before the impact, to rounding [m/s].

    Raises:
        ImpactError: OUT_OF_RANGE.
    """
    a, b, touch = arbitrary_precision.read_request(body_a, body_b, contact, lambda x, _: as_fraction(x))
    kinematics = ContactKinematics.of(a, b, touch)
    n, u = touch.normal, kinematics.u
    try:
        return float(square_root(u.dot(u) - kinematics.n_u * kinematics.n_u / n.dot(n)))
    except OverflowError:
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None


def _value(function: Callable[[float], float], speed: float, most: float, field: str) -> float:
    value = function(speed)
    try:
        check_number(field, value, 0, most, StatusCode.INVALID_COEFFICIENT)
    except ImpactError as error:
        raise ImpactError(error.code, field, f"{error.reason} at {speed:.6g} m/s") from None
    return float(value)
