"""Evaluate coefficients that are functions of a speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from .. import validity
from ..arguments import check_number
from ..kernels import library
from ..model import ImpactModel, Precision
from ..numbers.operations import Scalar, of_python, positive_part, square_root
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.effective_mass import ContactKinematics
from ..physics.laws import BY_SPEED, PATHS, Law
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from .request_numbers import body_as_fractions, contact_as_fractions, read_request


def friction_at_speed(speed: float, contact: Contact) -> float:
    """Evaluate the friction of a contact, a function, at a slip speed [m/s].

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE, if the value is negative or not finite.
    """
    return _evaluate(contact.friction, speed, math.inf, "contact.friction(slip_speed)")


def approach_speed(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Return the approach speed before the impact, right to some 2^-52; 0 if the bodies separate [m/s].

    Raises:
        ImpactError: OUT_OF_RANGE, if the speed is beyond float64. Others, if the request breaks a rule of
            :mod:`~collision_response.validity`.
    """
    plain = Contact(contact.position, contact.normal, 0.0, 0.0)
    impact = library.resolve(body_a, body_b, plain, TO_THE_LAST_DIGIT, _leave_to_fractions)
    if impact is None:
        n, _, n_u = _kinematics_in_fractions(body_a, body_b, plain)
        normal_velocity = _as_float(n_u / n.norm())
    else:
        normal_velocity = impact.normal_velocity_before
    return max(-normal_velocity, 0.0)


def restitutions_at_speeds(
    speeds: Sequence[float], contacts: Sequence[Contact], fields: Sequence[str]
) -> list[Scalar]:
    """Return the restitution of each contact of a cluster, evaluated if it is a function.

    A contact that does not approach may be struck by what the others do. It gets the value at the fastest
    approach.

    Args:
        speeds: the approach speeds [m/s], >= 0.
        contacts: the contacts.
        fields: their names, for errors.

    Raises:
        ImpactError: INVALID_COEFFICIENT or NOT_FINITE, if a value is not in [0, 1].
    """
    fastest = max(speeds, default=0.0)
    return [
        _evaluate(contact.restitution, speed or fastest, 1.0, f"{field}.restitution(approach_speed)")
        if callable(contact.restitution)
        else contact.restitution
        for speed, contact, field in zip(speeds, contacts, fields, strict=True)
    ]


def initial_friction(body_a: Body, body_b: Body, contact: Contact, law: Law) -> float:
    """Evaluate the friction of a contact, a function, at the slip speed before the impact.

    Args:
        body_a, body_b, contact: the request.
        law: the law that takes the value; not AUTO. COMPLIANT takes no friction that is a function. Routh's
            laws follow the function along the path of the impulse (``friction_along_path.py``), but only for
            a single contact.

    Raises:
        ImpactError: INVALID_MODEL, if the law cannot take the value. INVALID_COEFFICIENT or NOT_FINITE, if
            the value is negative or not finite. Others, if the request breaks a rule of
            :mod:`~collision_response.validity`.
    """
    if law in PATHS:
        of_several = " of several contacts" if law in BY_SPEED else ""
        reason = f"{law.name} takes no friction{of_several} that depends on slip speed: give a number"
        raise ImpactError(StatusCode.INVALID_MODEL, "contact.friction", f"{reason}, or ask COULOMB")
    return friction_at_speed(initial_slip_speed(body_a, body_b, contact), contact)


def initial_slip_speed(body_a: Body, body_b: Body, contact: Contact) -> float:
    """Return the tangential speed of body_a relative to body_b at the contact before the impact [m/s].

    It is ``|n x u| / |n|``, right to some 2^-51. The components of ``n x u`` are the velocities along three
    vectors that are exactly perpendicular to ``n``, so no part of the approach is left in them.

    Raises:
        ImpactError: OUT_OF_RANGE, if the speed is beyond float64. Others, if the request breaks a rule of
            :mod:`~collision_response.validity`.
    """
    n_x, n_y, n_z = map(of_python, contact.normal)
    try:
        length = math.hypot(n_x, n_y, n_z)
    except OverflowError:  # an integer or a fraction beyond float64
        length = math.inf
    if not 1e-100 < length < 1e100:  # so that no product with it overflows or underflows
        return _slip_speed_by_fractions(body_a, body_b, contact)
    e = contact.restitution
    components = []
    for normal in ((0.0, -n_z, n_y), (n_z, 0.0, -n_x), (-n_y, n_x, 0.0)):
        if not any(normal):
            continue
        across = Contact(contact.position, Vec3(*normal), 0.0 if callable(e) else e, 0.0)
        impact = library.resolve(body_a, body_b, across, TO_THE_LAST_DIGIT, _leave_to_fractions)
        if impact is None:
            return _slip_speed_by_fractions(body_a, body_b, contact)
        components.append(impact.normal_velocity_before * (math.hypot(*normal) / length))
    return math.hypot(*components)


TO_THE_LAST_DIGIT = ImpactModel(Law.FRICTIONLESS, precision=Precision.EXTENDED)


def _leave_to_fractions(*request: object) -> None:
    """What the kernels call where they refuse, or do not know the last digit."""


def _slip_speed_by_fractions(body_a: Body, body_b: Body, contact: Contact) -> float:
    n, u, n_u = _kinematics_in_fractions(body_a, body_b, contact._replace(friction=0.0))
    square = u.dot(u) - n_u * n_u / n.dot(n)  # below 0 by what is locked of u, which is rounding
    return _as_float(square_root(positive_part(square)))


def _kinematics_in_fractions(body_a: Body, body_b: Body, contact: Contact) -> tuple[Vec3, Vec3, Scalar]:
    """Return the normal as given, the relative velocity at the contact, and its product with the normal."""
    validity.check(*read_request(body_a, body_b, contact), 0.0)
    bodies = body_as_fractions(body_a), body_as_fractions(body_b)
    return ContactKinematics.of(*bodies, contact_as_fractions(contact))[:3]


def _as_float(speed: Scalar) -> float:
    try:
        return float(speed)
    except OverflowError:
        raise library.refusal(StatusCode.OUT_OF_RANGE) from None


def _evaluate(function: Callable[[float], float], speed: float, most: float, field: str) -> float:
    value = function(speed)
    try:
        return check_number(field, value, 0, most, StatusCode.INVALID_COEFFICIENT)
    except ImpactError as error:
        raise ImpactError(error.code, field, f"{error.reason} at {speed:.6g} m/s") from None
