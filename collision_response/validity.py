"""The rules that a request must keep, each with the status code and the field that name a violation.

The rules are formulas over any number type. :func:`check` evaluates them on floats or fractions and raises
an error for the first one that does not hold. The kernels have :func:`first_fault` compiled: it gives the
code of that rule, for one request and for each contact of a batch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import reduce
from typing import Any, NamedTuple

from .numbers.operations import Condition, Scalar, all_of, all_zero, choose, given_roundoff, negation, or_one
from .physics.body import ROUNDINGS, Body
from .physics.contact import Contact
from .physics.effective_mass import ContactKinematics
from .physics.tensor import Symmetric3
from .status import ImpactError, StatusCode, format_range, format_value

UNIT_LENGTH_TOLERANCE = 1e-9
"""Largest difference between a quaternion's squared length and 1 that an answer does not report."""


class Rule(NamedTuple):
    """One condition on a request.

    Attributes:
        holds: whether the request keeps the rule.
        code: the status code of a violation.
        field: the field that the rule is about.
        requirement: what the field must be, as a message says it.
    """

    holds: Condition
    code: StatusCode
    field: str
    requirement: str


def rules(body_a: Body, body_b: Body, contact: Contact, tangential_restitution: Scalar) -> Iterator[Rule]:
    """Yield all rules for a request. An error is about the first one that does not hold."""
    for name, body in (("body_a", body_a), ("body_b", body_b)):
        yield from _body_rules(name, body)
    movable = body_a.is_movable() | body_b.is_movable()
    yield Rule(movable, StatusCode.NO_DYNAMIC_BODY, "body_a", "must be dynamic, or body_b must be")
    yield _finite("contact.position", contact.position)
    yield _finite("contact.normal", contact.normal)
    yield Rule(
        negation(all_zero(contact.normal)), StatusCode.INVALID_NORMAL, "contact.normal", "must not be 0"
    )
    if body_a.inverse_inertia is not None or body_b.inverse_inertia is not None:
        yield from _articulated_rules(ContactKinematics.of(body_a, body_b, contact), contact)
    e, mu = contact.restitution, contact.friction
    yield from _within("contact.restitution", e, 0, 1)
    yield from _within("contact.friction", mu, 0, math.inf)
    yield from _within("model.tangential_restitution", tangential_restitution, -1, 1)


def _body_rules(name: str, body: Body) -> Iterator[Rule]:
    mass = body.mass
    yield Rule(mass == mass, StatusCode.NOT_FINITE, f"{name}.mass", "must be a number that float64 holds")
    yield Rule(
        _is_mass(mass),
        StatusCode.INVALID_MASS,
        f"{name}.mass",
        "must be positive, and 1/mass finite; for an immovable body use Body.static(), motion_type STATIC",
    )
    yield _finite(f"{name}.inertia", body.inertia)
    yield Rule(
        _is_inertia(body.inertia) & (body.has_mass() | all_zero(body.inertia)),
        StatusCode.INVALID_INERTIA,
        f"{name}.inertia",
        "must be positive semi-definite, with no principal moment greater than the sum of the other two, and "
        "0 if the body is immovable",
    )
    if body.inverse_inertia is not None:
        yield Rule(
            body.inverse_inertia.is_semi_definite(),
            StatusCode.INVALID_INERTIA,
            f"{name}.inverse_inertia",
            "must be positive semi-definite",
        )
    for field in ("position", "velocity", "angular_velocity", "com"):
        yield _finite(f"{name}.{field}", getattr(body, field))
    q = body.orientation
    if q is not None:
        yield _finite(f"{name}.orientation", q)
        yield Rule(
            negation(all_zero(q)), StatusCode.INVALID_ORIENTATION, f"{name}.orientation", "must not be 0"
        )


def _articulated_rules(kinematics: ContactKinematics, contact: Contact) -> Iterator[Rule]:
    """Yield the rules for an articulated body, which an impulse may be unable to move in some directions."""
    yield Rule(
        kinematics.is_movable_along_normal(),
        StatusCode.INVALID_NORMAL,
        "contact.normal",
        "must be a direction in which an impulse moves the contact: n.K n is 0, or rounding",
    )
    yield Rule(
        (contact.friction == 0) | (kinematics.n_u >= 0) | kinematics.can_come_to_rest(),
        StatusCode.INVALID_COEFFICIENT,
        "contact.friction",
        "must be 0 if a contact that approaches slips in a direction in which no impulse moves it",
    )


def is_not_normalised(body: Body) -> Condition:
    """Whether a quaternion is so far from unit length that the answer reports its normalisation."""
    if body.orientation is None:
        return False
    return abs(body.orientation.squared_length() - 1) > UNIT_LENGTH_TOLERANCE


def _is_mass(mass: Scalar) -> Condition:
    return choose(mass > 0, lambda: 1 / mass < math.inf, lambda: mass > 0)


def _is_inertia(inertia: Symmetric3) -> Condition:
    """Whether a real body can have this tensor.

    It can if the matrix of the second moments of its mass, ``S = tr(I)/2 1 - I``, is positive semi-definite.
    That is the triangle inequality of the principal moments, and makes ``I`` positive semi-definite as well.
    The test tolerates the rounding of the components and nothing more. The tensor is first scaled to the
    middle of the range of floats.
    """
    size = inertia.trace()
    grow = choose(size < 2.0**-900, lambda: 2.0**150, lambda: 1.0)
    scale = choose(size < 2.0**1000, lambda: grow, lambda: 2.0**-10)
    moments = (inertia.xx >= 0) & (inertia.yy >= 0) & (inertia.zz >= 0)
    scaled = Symmetric3(*(component * scale for component in inertia))
    return (moments & _has_second_moments(scaled)) | all_zero(inertia)


def _has_second_moments(inertia: Symmetric3) -> Condition:
    xx, xy, xz, yy, yz, zz = inertia
    forgiven = (xx / 2 + yy / 2 + zz / 2) * (1 + 2 * ROUNDINGS * given_roundoff(xx))
    s_xx, s_yy, s_zz = forgiven - xx, forgiven - yy, forgiven - zz
    positive = (s_xx > 0) & (s_yy > 0) & (s_zz > 0)
    d_x = choose(positive, lambda: s_xx, lambda: s_xx * 0 + 1)
    l_yx, l_zx = -xy / d_x, -xz / d_x
    d_y = s_yy + l_yx * xy
    w = -yz + l_zx * xy
    d_z = s_zz + l_zx * xz - w / or_one(d_y) * w
    return positive & (d_y > 0) & (d_z > 0)


def _is_plainly_inertia(inertia: Symmetric3) -> Condition:
    """Whether the second moments are positive definite by far more than rounding, by their minors."""
    xx, xy, xz, yy, yz, zz = inertia
    h = (xx + yy + zz) / 2
    s_xx, s_yy, s_zz = h - xx, h - yy, h - zz
    minor = s_xx * s_yy - xy * xy
    det = s_zz * minor - (s_yy * (xz * xz) + s_xx * (yz * yz) + 2 * (xy * xz * yz))
    least = CLEARANCE * h
    return (s_xx > least) & (minor > least * h) & (det > least * h * h)


CLEARANCE = 2.0**-16
"""A relative second moment greater than any rounding, also that of float32."""


def _finite(field: str, numbers: Iterable[Scalar]) -> Rule:
    return Rule(sum(x - x for x in numbers) == 0, StatusCode.NOT_FINITE, field, "must be finite")


def _within(field: str, x: Scalar, least: float, most: float) -> Iterator[Rule]:
    yield _finite(field, (x,))
    holds = (x >= least) & (x <= most)
    yield Rule(holds, StatusCode.INVALID_COEFFICIENT, field, f"must be {format_range(least, most)}")


def is_clearly_valid(
    body_a: Body, body_b: Body, contact: Contact, tangential_restitution: Scalar
) -> Condition:
    """Whether a request is valid by far more than rounding. It takes half the work of all rules.

    A request that is not clearly valid may still be valid.
    """
    e, mu, e_t = contact.restitution, contact.friction, tangential_restitution
    vectors: list[Iterable[Scalar]] = [contact.position, contact.normal, (mu,)]
    conditions = [e >= 0, e <= 1, mu >= 0, e_t >= -1, e_t <= 1, contact.normal.dot(contact.normal) > 0]
    conditions.append(body_a.is_movable() | body_b.is_movable())
    for body in (body_a, body_b):
        vectors += [body.inertia, body.position, body.velocity, body.angular_velocity, body.com]
        conditions += [_is_mass(body.mass), _is_plainly_inertia(body.inertia) | all_zero(body.inertia)]
        conditions.append(body.has_mass() | all_zero(body.inertia))
        if body.orientation is not None:
            vectors.append(body.orientation)
            conditions.append(body.orientation.squared_length() > 0)
    total = sum(map(sum, vectors))  # NaN or infinite if any number is
    return all_of([*conditions, total - total == 0])


def first_fault(*request: Any) -> Scalar:
    """Return the code of the first rule that a request breaks, or 0. Takes the arguments of :func:`rules`."""

    def or_else(code: Scalar, rule: Rule) -> Scalar:
        return choose(rule.holds, lambda: code, lambda: 1.0 * rule.code)

    return reduce(or_else, reversed(list(rules(*request))), 0.0)


def check_distinct(body_a: Body, body_b: Body) -> None:
    """Check that two bodies are not the same object.

    Raises:
        ImpactError: SAME_BODY, if they are.
    """
    if body_a is body_b:
        raise ImpactError(StatusCode.SAME_BODY, "body_b", "is body_a: a body cannot strike itself")


def check(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    tangential_restitution: float,
    given: tuple[Body, Body, Contact] | None = None,
) -> None:
    """Check a request of floats or fractions by all rules.

    Args:
        body_a, body_b, contact, tangential_restitution: the request. A number beyond float64 is NaN here.
        given: the bodies and the contact before their conversion to floats, so that the error can quote such
            a number.

    Raises:
        ImpactError: if a rule does not hold; with its code, the field and the value of the field.
    """
    request = body_a, body_b, contact
    for rule in rules(*request, tangential_restitution):
        if not rule.holds:
            value = _value(rule.field, *request, tangential_restitution)
            if given is not None and "nan" in value:
                value = _value(rule.field, *given, tangential_restitution)
            raise ImpactError(rule.code, rule.field, f"{rule.requirement}; is {value}")


def _value(field: str, body_a: Body, body_b: Body, contact: Contact, e_t: float) -> str:
    owner, _, name = field.partition(".")
    if not name:
        return "immovable, as is the other body"
    owners = {"body_a": body_a, "body_b": body_b, "contact": contact}
    value = getattr(owners[owner], name) if owner in owners else e_t
    return format_value(tuple(value) if isinstance(value, tuple) else value, str)
