"""The request for a scene, checked, and the errors that name its fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

from ..arguments import as_list, check_count, check_number
from ..in_python.request_numbers import read_request
from ..kernels import library
from ..model import ImpactModel
from ..numbers.operations import Scalar
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..status import BELOW_ONE, POSITIVE, ImpactError, StatusCode, format_value, raise_renamed
from .find_clusters import Pair

T = TypeVar("T")

MOST_ORDERS = 1000
"""Greatest number of orders to try. A few show whether the order matters."""


class SceneRequest(NamedTuple):
    """The bodies and contacts of a scene.

    Attributes:
        bodies, pairs, contacts: as given.
        movable: for each body, whether impulses move it.
        has_friction: whether any contact has friction.
    """

    bodies: list[Body]
    pairs: list[Pair]
    contacts: list[Contact]
    movable: list[bool]
    has_friction: bool


class SceneOptions(NamedTuple):
    """How to resolve a scene: see :func:`~collision_response.resolve_scene`.

    Attributes:
        model, threshold, stiffness, exponent: as given.
        law: the law of ``model``, with AUTO decided.
        exact: whether to compute with fractions.
    """

    model: ImpactModel
    law: Law
    threshold: Scalar
    stiffness: Sequence[float] | None
    exponent: float
    exact: bool


def check_parts(
    bodies: Iterable[Any], pairs: Iterable[Any], contacts: Iterable[Any]
) -> tuple[list[Body], list[Any], list[Contact]]:
    """Return the parts of a scene as lists, with bodies and contacts checked but for their numbers.

    Raises:
        ImpactError: INVALID_INERTIA if a body is articulated.
        TypeError: if a part has the wrong type.
        ValueError: if there is not one pair for each contact.
    """
    bodies, pairs, contacts = (
        as_list("bodies", bodies),
        as_list("pairs", pairs),
        as_list("contacts", contacts),
    )
    for i, body in enumerate(bodies):
        if not isinstance(body, Body):
            raise TypeError(f"bodies[{i}]: must be a Body, is {format_value(body)}")
        if body.inverse_inertia is not None:
            field, reason = f"bodies[{i}].inverse_inertia", "is for one impact, by resolve(), not for scenes"
            raise ImpactError(StatusCode.INVALID_INERTIA, field, reason)
    for i, contact in enumerate(contacts):
        if not isinstance(contact, Contact):
            raise TypeError(f"contacts[{i}]: must be a Contact, is {format_value(contact)}")
    if len(pairs) != len(contacts):
        raise ValueError(
            f"pairs: must be one for each contact; are {len(pairs)} for {len(contacts)} contacts"
        )
    return bodies, pairs, contacts


def check_request(bodies: Iterable[Any], pairs: Iterable[Any], contacts: Iterable[Any]) -> SceneRequest:
    """Check everything about a request that does not depend on its numbers.

    Raises:
        ImpactError: UNKNOWN_BODY or SAME_BODY for a pair; as :func:`check_parts`.
        TypeError, ValueError: as :func:`check_parts`.
    """
    bodies, pairs, contacts = check_parts(bodies, pairs, contacts)
    movable = [
        _holds(f"bodies[{i}].mass", body[0], lambda mass: mass < math.inf) for i, body in enumerate(bodies)
    ]
    has_friction = False
    for i, contact in enumerate(contacts):
        is_rough = _holds(f"contacts[{i}].friction", contact[3], lambda mu: callable(mu) or mu > 0)
        has_friction = has_friction or is_rough
    count = len(bodies)
    for i, pair in enumerate(pairs):
        if not (pair.__class__ is tuple and len(pair) == 2 and type(pair[0]) is type(pair[1]) is int):
            pairs[i] = pair = _as_pair(i, pair)
        a, b = pair
        if not (0 <= a < count and 0 <= b < count):
            reason = f"must be two indices of bodies, from 0 to {count - 1}; is {format_value(pair)}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"pairs[{i}]", reason)
        if a == b:
            raise ImpactError(StatusCode.SAME_BODY, f"pairs[{i}]", f"a body cannot strike itself; is {pair}")
    return SceneRequest(bodies, pairs, contacts, movable, has_friction)


def _holds(field: str, number: Any, condition: Callable[[Any], Any]) -> bool:
    """Return whether a number satisfies a condition. Raises: TypeError: if it is not a number."""
    try:
        return bool(condition(number))
    except (TypeError, ValueError, ArithmeticError):
        raise TypeError(f"{field}: must be a real number, is {format_value(number)}") from None


def _as_pair(i: int, pair: Any) -> Pair:
    try:
        a, b = (index.__index__() for index in pair)
    except (AttributeError, TypeError, ValueError):
        raise TypeError(f"pairs[{i}]: must be two indices of bodies, is {format_value(pair)}") from None
    return a, b


def check_options(threshold: Any, stiffness: Any, exponent: Any, orders: Any, contacts: int) -> None:
    """Check the options of :func:`~collision_response.resolve_scene`.

    Raises:
        ImpactError: NOT_FINITE or INVALID_MODEL, if a number is out of range.
        TypeError: if an option has the wrong type.
        ValueError: if ``stiffness`` does not have one entry for each of the ``contacts``.
    """
    check_number("threshold", threshold, 0, BELOW_ONE, StatusCode.INVALID_MODEL)
    check_number("exponent", exponent, 1, 10, StatusCode.INVALID_MODEL)
    check_count("orders", orders, 0, MOST_ORDERS)
    if stiffness is not None:
        if len(stiffness) != contacts:
            raise ValueError(
                f"stiffness: must be one for each contact; are {len(stiffness)} for {contacts} contacts"
            )
        for i, k in enumerate(stiffness):
            check_number(f"stiffness[{i}]", k, POSITIVE, math.inf, StatusCode.INVALID_MODEL)


class ContactIndices(NamedTuple):
    """The indices of a contact and its two bodies in the scene."""

    contact: int
    body_a: int
    body_b: int

    def names(self) -> dict[str, str]:
        """Return the fields of the scene, by what errors about one impact call them."""
        a, b, contact = f"bodies[{self.body_a}]", f"bodies[{self.body_b}]", f"contacts[{self.contact}]"
        return {"body_a": a, "body_b": b, "contact": contact}


def with_scene_names(indices: ContactIndices, function: Callable[..., T], *arguments: Any) -> T:
    """Return ``function(*arguments)``, a function about one impact.

    Its errors name ``body_a``, ``body_b`` and ``contact``; here they name ``bodies[i]`` and ``contacts[i]``.
    """
    try:
        return function(*arguments)
    except (ImpactError, TypeError) as error:
        if isinstance(error, ImpactError) and error.code is StatusCode.NO_DYNAMIC_BODY:
            reason = f"one body must be dynamic; is {(indices.body_a, indices.body_b)}"
            raise ImpactError(error.code, f"pairs[{indices.contact}]", reason) from None
        raise_renamed(error, indices.names())


def as_floats(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    indices: Sequence[ContactIndices],
) -> tuple[list[Body], list[Contact]]:
    """Return the bodies and contacts of a cluster with every number converted to a float, without loss.

    Args:
        bodies, pairs, contacts: of the cluster.
        indices: of the contacts and their bodies in the scene, for errors.

    Raises:
        TypeError: if something is not a number.
        ImpactError: INVALID_MODEL, if a number is not exactly a float.
    """
    float_bodies, float_contacts = list(bodies), list(contacts)
    for i, ((a, b), own) in enumerate(zip(pairs, indices, strict=True)):
        given = bodies[a], bodies[b], contacts[i]
        _, errors = with_scene_names(own, library.numbers_with_errors, *given)
        if any(errors):
            reason = "a number of it, or of a body, is no float: give floats, or, without friction, fractions"
            raise ImpactError(StatusCode.INVALID_MODEL, f"contacts[{own.contact}]", reason)
        float_bodies[a], float_bodies[b], float_contacts[i] = read_request(*given)
    return float_bodies, float_contacts
