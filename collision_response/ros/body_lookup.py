"""Finding the states of bodies given by name, and checks of names, ages and frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time

from ..msg import BodyState
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from .parameters import Parameters
from .serialized import nanoseconds
from .states import LatestStates, quoted

OWNERS = ("body_a", "body_b")


class StateUsed(NamedTuple):
    """The state that was used for a body given by name.

    Attributes:
        stamp: its stamp.
        age: how much older it is than the contact [s]; NaN if unknown.
    """

    stamp: Time
    age: float

    @classmethod
    def of(cls, state: BodyState, time: int) -> StateUsed:
        """Stamp of a state, and its age at a time [ns].

        The age is unknown if the state has no stamp, or ``time`` is 0.
        """
        stamp = nanoseconds(state.header.stamp)
        return cls(state.header.stamp, (time - stamp) / 1e9 if stamp and time else math.nan)


GIVEN_IN_FULL = StateUsed(Time(), 0.0)
"""For a body that the request gives in full."""


class StateNotYetReceived(ImpactError):
    """No suitable state has been received, but one may still come."""


def complete(
    request: ResolveCollision.Request, states: LatestStates, parameters: Parameters, now: Callable[[], int]
) -> list[StateUsed]:
    """Replace bodies given only by name by their latest states, and check names, ages and frames.

    Args:
        request: changed in place; unchanged if there is an error.
        states: the latest states received.
        parameters: the parameters of the node.
        now: returns the time of the node's clock [ns]. A function, because reading the clock takes time and
            is rarely necessary.

    Returns:
        The states used for body_a and body_b.

    Raises:
        StateNotYetReceived: if the request has ``not_before``, and a state is older than that or unknown.
        ImpactError: SAME_BODY, UNKNOWN_BODY, STALE_STATE or FRAME_MISMATCH.
    """
    names = {
        owner: name
        for owner, name in zip(OWNERS, names_of(request), strict=True)
        if name and _has_only_a_name(getattr(request, owner))
    }
    used = dict.fromkeys(OWNERS, GIVEN_IN_FULL)
    if names:
        time, not_before = nanoseconds(request.contact.header.stamp) or now(), nanoseconds(request.not_before)
        found = {
            owner: find_state(states, owner, f"{owner}.name", name, not_before)
            for owner, name in names.items()
        }
        for owner, state in found.items():
            used[owner] = StateUsed.of(state, time)
            check_age(owner, names[owner], used[owner].age, parameters.max_state_age)
        for owner, state in found.items():
            setattr(request, owner, state)
    check_frames(request, parameters.world_frame)
    return list(used.values())


def _has_only_a_name(body: BodyState) -> bool:
    """Whether all fields of a body except its name have their defaults."""
    if body.inertia.m or body.motion_type:
        return False  # true of most bodies given in full; the comparison below takes ten times as long
    return body == BodyState(name=body.name)


def find_state(states: LatestStates, owner: str, field: str, name: str, not_before: int) -> BodyState:
    """Find the latest state of a body given by name.

    Args:
        states: the latest states received.
        owner: what errors call the body.
        field: the field that holds its name, for errors.
        name: its name.
        not_before: the earliest stamp accepted [ns]; 0: any.

    Raises:
        StateNotYetReceived: if there is a ``not_before``, and no such state.
        ImpactError: UNKNOWN_BODY.
    """
    try:
        state = states.find(field, name)
    except ImpactError as error:
        if not_before:
            raise StateNotYetReceived(error.code, error.field, error.reason) from None
        raise
    stamp = nanoseconds(state.header.stamp)
    if stamp < not_before:
        fault = f"is {(not_before - stamp) / 1e9:.6g} s older than not_before"
        if not stamp:
            fault = "has no stamp, which not_before requires"
        reason = f"the last state of {quoted(name)} {fault}"
        raise StateNotYetReceived(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)
    return state


def check_age(owner: str, name: str, age: float, limit: float) -> None:
    """Refuse a state that is too far in time from the contact.

    Args:
        owner: what the error calls the body.
        name: the name of the body.
        age: how much older the state is than the contact [s]; NaN: unknown.
        limit: the greatest distance in time allowed, before and after the contact [s]; 0: any.

    Raises:
        ImpactError: STALE_STATE.
    """
    if not limit or abs(age) <= limit:
        return
    fault = f"is {age:.6g} s old" if age > 0 else f"is {-age:.6g} s ahead: do the clocks agree?"
    if math.isnan(age):
        fault = "has no stamp, or there is no time yet"
    reason = f"the last state of {quoted(name)} {fault}; max_state_age is {limit:.6g} s"
    raise ImpactError(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)


def names_of(request: ResolveCollision.Request) -> list[str]:
    """Names of body_a and body_b, from the bodies or the contact; empty where there is none.

    Raises:
        ImpactError: UNKNOWN_BODY if the contact names another body, SAME_BODY if both names are the same.
    """
    names = []
    for owner in OWNERS:
        name, name_in_contact = getattr(request, owner).name, getattr(request.contact, owner)
        if name and name_in_contact and name != name_in_contact:
            reason = f"is {quoted(name_in_contact)}, but {owner}.name is {quoted(name)}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"contact.{owner}", reason)
        names.append(name or name_in_contact)
    if names[0] and names[0] == names[1]:
        reason = f"is {quoted(names[1])}, the name of body_a: a body cannot collide with itself"
        raise ImpactError(StatusCode.SAME_BODY, "body_b.name", reason)
    return names


def check_distinct(names: Sequence[str]) -> None:
    """Refuse a list in which a name appears twice.

    Raises:
        ImpactError: SAME_BODY.
    """
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        if first.setdefault(name, i) != i:
            reason = f"is {quoted(name)}, the same as names[{first[name]}]: names must be distinct"
            raise ImpactError(StatusCode.SAME_BODY, f"names[{i}]", reason)


def check_immovable(immovable: Sequence[int], count: int) -> None:
    """Refuse indices that are not below the number of bodies in the table.

    Raises:
        ImpactError: INVALID_TABLE.
    """
    if len(immovable) and np.max(immovable) >= count:
        reason = f"must hold indices below {count}, holds {np.max(immovable)}"
        raise ImpactError(StatusCode.INVALID_TABLE, "immovable", reason)


def check_frames(request: ResolveCollision.Request, world_frame: str) -> None:
    """Check that the contact and both bodies are in the same frame, and that it is ``world_frame``.

    Raises:
        ImpactError: FRAME_MISMATCH.
    """
    frame, field = request.contact.header.frame_id, "contact.header.frame_id"
    check_world_frame(field, frame, world_frame)
    for owner in OWNERS:
        check_frame(f"{owner}.header.frame_id", getattr(request, owner), field, frame)


def check_world_frame(field: str, frame: str, world_frame: str) -> None:
    """Refuse a frame other than ``world_frame``, unless that is empty.

    Raises:
        ImpactError: FRAME_MISMATCH.
    """
    if world_frame and frame != world_frame:
        reason = f"is {quoted(frame)}, but the parameter world_frame is {world_frame!r}"
        raise ImpactError(StatusCode.FRAME_MISMATCH, field, reason)


def check_frame(field: str, state: BodyState, expected_field: str, expected: str) -> None:
    """Refuse a body that is not in the expected frame.

    Args:
        field: the field that holds the frame of the body.
        state: the body.
        expected_field: the field that holds the expected frame.
        expected: the expected frame.

    Raises:
        ImpactError: FRAME_MISMATCH.
    """
    frame = state.header.frame_id
    if frame != expected:
        reason = f"is {quoted(frame)}, but {expected_field} is {quoted(expected)}"
        raise ImpactError(StatusCode.FRAME_MISMATCH, field, reason)
