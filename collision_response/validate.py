"""The checks at the front door: every bad request gets its own code, field and value."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from .model import EXACT_LAWS, Geometry, ImpactModel, Law, Precision
from .numerics import extended
from .physics.body import PIVOT_LIMIT, Body
from .physics.contact import Contact
from .physics.tensor import Symmetric3
from .status import ImpactError, StatusCode

ROUNDED_FULLY = 2.0**-960
"""Above this, rounding is to 53 bits, of products by ``PIVOT_LIMIT`` too."""


def check_request(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> None:
    """Accept a request, or say what is wrong with it.

    Raises:
        ImpactError: with the code, the field and its value.
    """
    check_model(model)
    if body_a is body_b:
        raise ImpactError(StatusCode.SAME_BODY, "body_b", "is body_a: a body cannot strike itself")
    check_body("body_a", body_a)
    check_body("body_b", body_b)
    if not (body_a.inverse_mass or body_b.inverse_mass):
        raise ImpactError(StatusCode.NO_DYNAMIC_BODY, "body_a", "and body_b are both immovable")
    check_contact(contact, model)


def check_body(name: str, body: Body) -> None:
    """Raises: ImpactError: NOT_FINITE, INVALID_MASS, INVALID_INERTIA or INVALID_ORIENTATION."""
    mass, inverse_mass, inertia, position, orientation, velocity, angular_velocity = body
    linear = sum(position) + sum(velocity) + sum(angular_velocity) + sum(orientation or ())
    if not math.isfinite(mass + inverse_mass + sum(inertia) + linear):
        _refuse_not_finite(name, body)
    if body.mass < 0 or body.inverse_mass < 0 or (body.mass > 0) != (body.inverse_mass > 0):
        reason = f"must be positive, and the inverse of inverse_mass {body.inverse_mass}; is {body.mass}"
        raise ImpactError(StatusCode.INVALID_MASS, f"{name}.mass", reason)
    if not _is_inertia(body.inertia):
        raise ImpactError(StatusCode.INVALID_INERTIA, f"{name}.inertia", _inertia_fault(body.inertia))
    if body.orientation is not None and not any(body.orientation):
        reason = f"is a quaternion of length 0: {tuple(body.orientation)}"
        raise ImpactError(StatusCode.INVALID_ORIENTATION, f"{name}.orientation", reason)


def check_contact(contact: Contact, model: ImpactModel) -> None:
    """Raises: ImpactError: NOT_FINITE, INVALID_NORMAL or INVALID_COEFFICIENT."""
    for field, vector in (("position", contact.position), ("normal", contact.normal)):
        if not math.isfinite(sum(vector)):
            _refuse_not_finite(f"contact.{field}", vector)
    if not any(contact.normal):
        raise ImpactError(StatusCode.INVALID_NORMAL, "contact.normal", "is of length 0: (0, 0, 0)")
    if model.geometry is Geometry.PLANAR and not any(contact.normal[:2]):
        reason = f"has no part in the x-y plane, which is all that PLANAR models: {tuple(contact.normal)}"
        raise ImpactError(StatusCode.INVALID_NORMAL, "contact.normal", reason)
    if not callable(contact.restitution):
        check_coefficient("contact.restitution", contact.restitution, 0, 1)
    check_coefficient("contact.friction", contact.friction, 0, math.inf)


def check_model(model: ImpactModel) -> None:
    """Raises: ImpactError: NOT_FINITE, INVALID_MODEL or INVALID_COEFFICIENT."""
    for field, kind in (("law", Law), ("geometry", Geometry), ("precision", Precision)):
        value = getattr(model, field)
        if not isinstance(value, kind):
            known = ", ".join(f"{member.name} ({member.value})" for member in kind)
            raise ImpactError(
                StatusCode.INVALID_MODEL, f"model.{field}", f"must be one of {known}; is {value!r}"
            )
    if model.precision is Precision.EXTENDED:
        if not extended.AVAILABLE:
            raise ImpactError(StatusCode.INVALID_MODEL, "model.precision", "EXTENDED needs python-flint")
        if model.law not in (Law.AUTO, *EXACT_LAWS):
            reason = f"EXTENDED is for FRICTIONLESS and COULOMB, not for {model.law.name}"
            raise ImpactError(StatusCode.INVALID_MODEL, "model.precision", reason)
    check_coefficient("model.tangential_restitution", model.tangential_restitution, -1, 1)
    for field in ("tolerance", "restitution_threshold"):
        value = getattr(model, field)
        if not math.isfinite(value):
            raise ImpactError(StatusCode.NOT_FINITE, f"model.{field}", f"must be finite, is {value}")
        if value < 0:
            raise ImpactError(StatusCode.INVALID_MODEL, f"model.{field}", f"must not be negative, is {value}")


def check_coefficient(field: str, value: Any, least: float, most: float) -> None:
    """Raises: ImpactError: NOT_FINITE or INVALID_COEFFICIENT."""
    if not math.isfinite(value):
        raise ImpactError(StatusCode.NOT_FINITE, field, f"must be finite, is {value}")
    if not least <= value <= most:
        limits = f"at least {least}" if most == math.inf else f"in [{least}, {most}]"
        raise ImpactError(StatusCode.INVALID_COEFFICIENT, field, f"must be {limits}, is {value}")


def _is_inertia(inertia: Symmetric3) -> bool:
    """Whether a real body can have this tensor.

    It can if the second moments of its mass, ``S = tr(I)/2 1 - I``, are positive semi-definite: that
    is the triangle inequality of the principal moments, and makes ``I`` positive semi-definite too.
    Rounding of the components is forgiven, nothing more.
    """
    half_trace = inertia.trace() / 2
    if half_trace == 0:
        return not any(inertia)
    if 0 < half_trace < ROUNDED_FULLY:
        return _is_inertia(Symmetric3(*(component / ROUNDED_FULLY for component in inertia)))
    forgiven = half_trace * (1 + 2 * PIVOT_LIMIT)
    xx, xy, xz, yy, yz, zz = inertia
    s_xx, s_yy, s_zz = forgiven - xx, forgiven - yy, forgiven - zz
    if s_xx <= 0 or s_yy <= 0 or s_zz <= 0:
        return False
    if not (xy or xz or yz):
        return True
    if s_yy - xy / s_xx * xy <= 0:
        return False
    return Symmetric3(s_xx, -xy, -xz, s_yy, -yz, s_zz).factor().d_z > 0


def _inertia_fault(inertia: Symmetric3) -> str:
    xx, xy, xz, yy, yz, zz = (float(component) for component in inertia)
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    if least < 0 and -least > most * PIVOT_LIMIT:
        return (
            f"is not positive semi-definite: its principal moments are {least:.6g}, {middle:.6g}, {most:.6g}"
        )
    return (
        f"violates the triangle inequality: of its principal moments {least:.6g}, {middle:.6g}, {most:.6g} "
        "the greatest is more than the sum of the others"
    )


def _refuse_not_finite(name: str, value: Any) -> None:
    """Name the first number that is not finite. There is none if finite ones only have too great a sum."""
    for field, number in _numbers(name, value):
        if not math.isfinite(number):
            raise ImpactError(StatusCode.NOT_FINITE, field, f"must be finite, is {number}")


def _numbers(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Every number in nested named tuples, with its dotted name."""
    if value is None:
        return
    if isinstance(value, tuple):
        for field, part in zip(value._fields, value, strict=True):  # type: ignore[attr-defined]
            yield from _numbers(f"{name}.{field}", part)
    else:
        yield name, value
