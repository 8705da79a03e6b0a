"""What is asked of a scene, checked and in numbers of one make; and which field is at fault."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

from .. import validity
from ..in_python import arbitrary_precision
from ..physics.body import Body
from ..physics.contact import Contact
from ..status import ImpactError, StatusCode, shown
from .clusters import Pair

T = TypeVar("T")


class SceneRequest(NamedTuple):
    """The parts of a request.

    Attributes:
        bodies, pairs, contacts: as given.
        movable: of each body, whether impulses move it.
        has_friction: whether any contact has.
    """

    bodies: list[Body]
    pairs: list[Pair]
    contacts: list[Contact]
    movable: list[bool]
    has_friction: bool


def check(bodies: Iterable[Any], pairs: Iterable[Any], contacts: Iterable[Any]) -> SceneRequest:
    """What can be told of a request without its numbers.

    Raises:
        ImpactError: UNKNOWN_BODY, SAME_BODY, NO_DYNAMIC_BODY; INVALID_INERTIA: a body is articulated.
        TypeError: a part is not of the kind that it should be.
        ValueError: there is not one pair for each contact.
    """
    bodies, pairs, contacts = list(bodies), list(pairs), list(contacts)
    movable, has_friction = [], False
    for i, body in enumerate(bodies):
        if not isinstance(body, Body):
            raise TypeError(f"bodies[{i}]: must be a Body, is {shown(body)}")
        if body.inverse_inertia is not None:
            field, reason = f"bodies[{i}].inverse_inertia", "is for one impact, by resolve(), not for scenes"
            raise ImpactError(StatusCode.INVALID_INERTIA, field, reason)
        try:
            movable.append(bool(body[0] < math.inf))
        except TypeError:
            raise TypeError(f"bodies[{i}].mass: must be a real number, is {body.mass!r}") from None
    for i, contact in enumerate(contacts):
        if not isinstance(contact, Contact):
            raise TypeError(f"contacts[{i}]: must be a Contact, is {shown(contact)}")
        try:
            has_friction = has_friction or callable(contact[3]) or bool(contact[3] > 0)
        except TypeError:
            reason = f"must be a real number, is {contact.friction!r}"
            raise TypeError(f"contacts[{i}].friction: {reason}") from None
    count = len(bodies)
    if len(pairs) != len(contacts):
        raise ValueError(
            f"pairs: must be one for each contact; are {len(pairs)} for {len(contacts)} contacts"
        )
    for i, pair in enumerate(pairs):
        if not (pair.__class__ is tuple and len(pair) == 2 and type(pair[0]) is type(pair[1]) is int):
            pairs[i] = pair = _as_pair(i, pair)
        a, b = pair
        if not (0 <= a < count and 0 <= b < count):
            reason = f"must be two indices of bodies, from 0 to {count - 1}; is {shown(pair)}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"pairs[{i}]", reason)
        if a == b:
            raise ImpactError(StatusCode.SAME_BODY, f"pairs[{i}]", f"a body cannot strike itself; is {pair}")
    return SceneRequest(bodies, pairs, contacts, movable, has_friction)


def _as_pair(i: int, pair: Any) -> Pair:
    try:
        a, b = (index.__index__() for index in pair)
    except (AttributeError, TypeError, ValueError):
        raise TypeError(f"pairs[{i}]: must be two indices of bodies, is {shown(pair)}") from None
    return a, b


def as_floats(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    names: Sequence[ContactIndices],
) -> tuple[list[Body], list[Contact]]:
    """The same in floats, where numbers were of other kinds.

    Args:
        bodies, pairs, contacts: of a cluster.
        names: of the contacts and their bodies in the scene.

    Raises:
        TypeError: something is no number.
        ImpactError: INVALID_MODEL: a number is no float; give :class:`fractions.Fraction` for exact numbers.
    """
    floats, touches = list(bodies), list(contacts)
    for i, ((a, b), name) in enumerate(zip(pairs, names, strict=True)):
        lost: list[float] = []

        def read(x: float, error: float, lost: list[float] = lost) -> float:
            lost.append(error)
            return x

        given = bodies[a], bodies[b], contacts[i], read
        floats[a], floats[b], touches[i] = with_scene_names(name, arbitrary_precision.read, *given)
        if any(lost):
            reason = (
                "a number of it, or of its bodies, is no float: give fractions.Fraction for exact numbers"
            )
            raise ImpactError(StatusCode.INVALID_MODEL, f"contacts[{name.contact}]", reason)
    return floats, touches


class ContactIndices(NamedTuple):
    """A contact and its bodies, as the scene numbers them."""

    contact: int
    body_a: int
    body_b: int


def _named(text: str, name: ContactIndices) -> str:
    """A message about one impact, in the words of the scene."""
    fields = (("body_a", f"bodies[{name.body_a}]"), ("body_b", f"bodies[{name.body_b}]"))
    for word, place in (*fields, ("contact", f"contacts[{name.contact}]")):
        if text == word or text.startswith((word + ".", word + ":", word + "(")):
            return place + text[len(word) :]
    return text


def with_scene_names(name: ContactIndices, function: Callable[..., T], *arguments: Any) -> T:
    """``function(*arguments)``, which is about one impact; its errors are in the words of the scene."""
    try:
        return function(*arguments)
    except ImpactError as error:
        raise _renamed(error, name) from None
    except TypeError as error:
        raise TypeError(_named(str(error), name)) from None


def _renamed(error: ImpactError, name: ContactIndices) -> ImpactError:
    if error.code is StatusCode.NO_DYNAMIC_BODY:
        reason = f"one body must be dynamic; is {(name.body_a, name.body_b)}"
        return ImpactError(error.code, f"pairs[{name.contact}]", reason)
    return ImpactError(error.code, _named(error.field, name), error.reason)


def check_contact(body_a: Body, body_b: Body, contact: Contact, name: ContactIndices) -> None:
    """Raises: ImpactError: what is wrong with one contact, or its bodies."""
    with_scene_names(name, validity.check, body_a, body_b, contact, 0.0)
