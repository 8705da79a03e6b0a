"""What must hold of a request before its numbers matter: names, look-up, age, frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time

from ..msg import BodyState, Contact
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from .parameters import Parameters
from .serialized import nanoseconds
from .states import LatestStates, quoted

OWNERS = ("body_a", "body_b")


class Used(NamedTuple):
    """Which state stood for a body.

    Attributes:
        stamp: of the state.
        age: how much older it was than the contact [s]; NaN if that is not known.
    """

    stamp: Time
    age: float

    @classmethod
    def of(cls, state: BodyState, time: int) -> Used:
        """That of a state at a time [ns]; without an age if it has no stamp, or there is no time yet."""
        stamp = nanoseconds(state.header.stamp)
        return cls(state.header.stamp, (time - stamp) / 1e9 if stamp and time else math.nan)


IN_FULL = Used(Time(), 0.0)
"""Of a body that was given in full."""


class TooEarly(ImpactError):
    """A state may still come that would do."""


def complete(
    request: ResolveCollision.Request, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> list[Used]:
    """Replace the bodies that are given by name only, and check that the parts belong together.

    Args:
        request: changed in place; left as it is by an error.
        states: the latest states received.
        parameters: of the node.
        now: the time by the node's clock [ns]; reading it is not free, and rarely needed.

    Returns:
        Which state stood for body_a, and for body_b.

    Raises:
        TooEarly: a state is older than ``not_before``, or unknown.
        ImpactError: SAME_BODY, UNKNOWN_BODY, STALE_STATE or FRAME_MISMATCH.
    """
    names = {
        owner: name
        for owner, name in zip(OWNERS, names_of(request), strict=True)
        if name and _is_only_named(getattr(request, owner))
    }
    used = dict.fromkeys(OWNERS, IN_FULL)
    if names:
        time, not_before = nanoseconds(request.contact.header.stamp) or now(), nanoseconds(request.not_before)
        known = {
            owner: find(states, owner, f"{owner}.name", name, not_before) for owner, name in names.items()
        }
        for owner, state in known.items():
            used[owner] = Used.of(state, time)
            check_age(owner, names[owner], used[owner].age, parameters.max_state_age)
        for owner, state in known.items():
            setattr(request, owner, state)
    check_frames(request, parameters.world_frame)
    return list(used.values())


def _is_only_named(body: BodyState) -> bool:
    """Whether nothing else of a body is given."""
    if body.inertia.m or body.motion_type:
        return False  # most bodies given in full; the comparison below takes ten times as long
    return body == BodyState(name=body.name)


def find(states: LatestStates, owner: str, field: str, name: str, not_before: int) -> BodyState:
    """The latest state of a body given by name.

    Args:
        states: the latest states received.
        owner, field: of the body and of its name, for the error.
        name: of the body.
        not_before: the least stamp [ns]; 0: any.

    Raises:
        TooEarly: there is none yet.
        ImpactError: UNKNOWN_BODY.
    """
    try:
        state = states.find(field, name)
    except ImpactError as error:
        raise TooEarly(error.code, error.field, error.reason) if not_before else error from None
    stamp = nanoseconds(state.header.stamp)
    if stamp < not_before:
        late = f"is {(not_before - stamp) / 1e9:.6g} s older than not_before asks for"
        if not stamp:
            late = "has no stamp, and not_before asks for one"
        reason = f"the last state of {quoted(name)} {late}"
        raise TooEarly(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)
    return state


def check_age(owner: str, name: str, age: float, limit: float) -> None:
    """Refuse a state that is too far from the time of the contact.

    Args:
        owner: of the state, for the error.
        name: of the body.
        age: of the state [s]; NaN: not known.
        limit: the greatest allowed [s], to either side; 0: any.

    Raises:
        ImpactError: STALE_STATE.
    """
    if not limit or abs(age) <= limit:
        return
    when = f"is {age:.6g} s old" if age > 0 else f"is {-age:.6g} s ahead: do the clocks agree?"
    if math.isnan(age):
        when = "has no stamp, or there is no time yet"
    reason = f"the last state of {quoted(name)} {when}; max_state_age is {limit:.6g} s"
    raise ImpactError(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)


def names_of(request: ResolveCollision.Request) -> list[str]:
    """The names of body_a and body_b; empty where there is none.

    Raises:
        ImpactError: UNKNOWN_BODY or SAME_BODY.
    """
    names = []
    for owner in OWNERS:
        own, in_contact = getattr(request, owner).name, getattr(request.contact, owner)
        if own and in_contact and own != in_contact:
            reason = f"is {quoted(in_contact)}, but {owner}.name is {quoted(own)}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"contact.{owner}", reason)
        names.append(own or in_contact)
    if names[0] and names[0] == names[1]:
        reason = f"is {quoted(names[1])}, as that of body_a: a body cannot strike itself"
        raise ImpactError(StatusCode.SAME_BODY, "body_b.name", reason)
    return names


def check_distinct(names: Sequence[str]) -> None:
    """Raises: ImpactError: SAME_BODY."""
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        if first.setdefault(name, i) != i:
            reason = f"is {quoted(name)}, as names[{first[name]}]: a body has one column"
            raise ImpactError(StatusCode.SAME_BODY, f"names[{i}]", reason)


def check_immovable(immovable: Sequence[int], count: int) -> None:
    """Whether these are columns of a table of so many. Raises: ImpactError: INVALID_TABLE."""
    if len(immovable) and np.max(immovable) >= count:
        reason = f"must hold indices below {count}, holds {np.max(immovable)}"
        raise ImpactError(StatusCode.INVALID_TABLE, "immovable", reason)


def check_frames(request: ResolveCollision.Request, world_frame: str) -> None:
    """Raises: ImpactError: FRAME_MISMATCH."""
    frame, field = request.contact.header.frame_id, "contact.header.frame_id"
    check_world_frame(field, frame, world_frame)
    for owner in OWNERS:
        check_frame(f"{owner}.header.frame_id", getattr(request, owner), field, frame)


def check_world_frame(field: str, frame: str, world_frame: str) -> None:
    """Raises: ImpactError: FRAME_MISMATCH."""
    if world_frame and frame != world_frame:
        reason = f"is {quoted(frame)}, but the parameter world_frame is {world_frame!r}"
        raise ImpactError(StatusCode.FRAME_MISMATCH, field, reason)


def check_frame(field: str, message: BodyState | Contact, of: str, frame: str) -> None:
    """Whether a message is in the same frame as another one, whose field is ``of``.

    Raises:
        ImpactError: FRAME_MISMATCH.
    """
    own = message.header.frame_id
    if own != frame:
        reason = f"is {quoted(own)}, but {of} is {quoted(frame)}"
        raise ImpactError(StatusCode.FRAME_MISMATCH, field, reason)
