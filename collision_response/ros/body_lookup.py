"""Finding the states of bodies given by name, waiting for them, and checks of names, ages and frames."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from ..msg import BodyState
from ..srv import ResolveCollision
from ..status import ImpactError, StatusCode
from .convert import nanoseconds
from .parameters import Parameters
from .round_robin import Steps
from .states import LatestStates, quoted

Found = TypeVar("Found")

BODIES_PER_STEP = 50
"""Bodies that are looked up, or converted, between two yields: each takes up to a tenth of a millisecond."""

OWNERS = ("body_a", "body_b")

TEXTS = (
    "contact.header.frame_id",
    "contact.body_a",
    "contact.body_b",
    *(f"{owner}.{field}" for owner in OWNERS for field in ("name", "header.frame_id", "material")),
)
"""The fields of ``ResolveCollision`` that hold text."""

MAX_TEXT = 256
"""Longest name, frame or material in a request [characters]. Answers repeat them, a scene for each
contact, and are kept for subscribers."""


class StateNotYetReceived(ImpactError):
    """No suitable state has been received, but one may still come.

    ``missing``: the arguments of :meth:`StateFinder.find`.
    """

    def __init__(self, code: StatusCode, field: str, reason: str, missing: tuple[str, str, str]) -> None:
        super().__init__(code, field, reason)
        self.missing = missing


class StateFinder:
    """Finds the states of the bodies that one request gives by name.

    Args:
        field: the field that holds the header of the contact, for errors.
        header: that header. Without a stamp, the contact is now.
        not_before: of the request: the earliest stamp accepted; 0: any.

    Raises:
        ImpactError: FRAME_MISMATCH if the header is not in the frame of the parameter ``world_frame``.
    """

    def __init__(
        self, field: str, header: Header, not_before: Time, states: LatestStates, parameters: Parameters
    ) -> None:
        self._states = states
        self._time = nanoseconds(header.stamp)
        self._not_before = nanoseconds(not_before)
        self._max_age, self._max_wait = parameters.max_state_age, parameters.max_state_wait
        self._frame_field, self._frame = f"{field}.frame_id", header.frame_id
        if parameters.world_frame and self._frame != parameters.world_frame:
            reason = (
                f"is {quoted(self._frame)}, but the parameter world_frame is {quoted(parameters.world_frame)}"
            )
            raise ImpactError(StatusCode.FRAME_MISMATCH, self._frame_field, reason)

    def wait(self, look_up: Callable[[], Steps[Found]]) -> Steps[Found]:
        """Look up bodies at once, and again whenever the state that one of them waits for has arrived.

        Raises:
            ImpactError: STALE_STATE if no such state arrives in time; or what the look-up raises.
        """
        deadline = time.perf_counter() + self._max_wait
        missing = None
        while True:
            try:
                if missing:
                    self.find(*missing)
                return (yield from look_up())
            except StateNotYetReceived as error:
                missing = error.missing
                if time.perf_counter() >= deadline:
                    reason = f"{error.reason}; waited {self._max_wait:.6g} s (max_state_wait)"
                    raise ImpactError(StatusCode.STALE_STATE, error.field, reason) from None
            yield deadline

    def find(self, owner: str, field: str, name: str) -> tuple[BodyState, float]:
        """Find the latest state of a body, and how much older it is than the contact [s]; NaN: unknown.

        Errors call the body ``owner``, and the field with its name ``field``.

        Raises:
            StateNotYetReceived: if there is a ``not_before``, and no such state.
            ImpactError: UNKNOWN_BODY.
        """
        missing = owner, field, name
        try:
            state = self._states.find(field, name)
        except ImpactError as error:
            if not self._not_before:
                raise
            raise StateNotYetReceived(error.code, error.field, error.reason, missing) from None
        stamp, time_of_contact = nanoseconds(state.header.stamp), self._time or self._states.now()
        if self._not_before and (not stamp or stamp < self._not_before):
            fault = f"is {(self._not_before - stamp) / 1e9:.6g} s older than not_before"
            if not stamp:
                fault = "has no stamp, which not_before requires"
            reason = f"the last state of {quoted(name)} {fault}"
            raise StateNotYetReceived(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason, missing)
        age = (time_of_contact - stamp) / 1e9 if stamp and time_of_contact else math.nan
        return state, age

    def check(self, owner: str, state: BodyState, age: float) -> None:
        """Refuse a received state too far in time from the contact (STALE_STATE), or not in its frame."""
        if self._max_age and not abs(age) <= self._max_age:
            fault = f"is {age:.6g} s old" if age > 0 else f"is {-age:.6g} s ahead of the contact"
            if math.isnan(age):
                fault = "has no stamp, or there is no time yet"
            advice = ": do the clocks agree?" if age < 0 else ""
            limit = f"max_state_age is {self._max_age:.6g} s"
            reason = f"the last state of {quoted(state.name)} {fault}; {limit}{advice}"
            raise ImpactError(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)
        self.check_frame(owner, state)

    def check_frame(self, owner: str, state: BodyState) -> None:
        """Refuse a body that is not in the frame of the contact (FRAME_MISMATCH)."""
        frame = state.header.frame_id
        if frame != self._frame:
            reason = f"is {quoted(frame)}, but {self._frame_field} is {quoted(self._frame)}"
            raise ImpactError(StatusCode.FRAME_MISMATCH, f"{owner}.header.frame_id", reason)


def complete(request: ResolveCollision.Request, finder: StateFinder) -> Steps[list[tuple[Time, float]]]:
    """Replace bodies given only by name by their latest states; return stamp and age of those of both bodies.

    The request is changed in place, but not if there is an error.

    Raises:
        ImpactError: INVALID_MASS, if a body given in full has no mass; as ``names_of``, and ``find`` and
            ``check`` of the finder.
    """
    yield from ()  # two bodies need no pause
    given = dict(zip(OWNERS, names_of(request), strict=True))
    bodies = {owner: getattr(request, owner) for owner in OWNERS}
    by_name = [owner for owner in OWNERS if given[owner].name and _has_only_a_name(bodies[owner])]
    for owner in OWNERS:
        if owner not in by_name:
            finder.check_frame(owner, bodies[owner])
            _check_is_given(owner, bodies[owner])
    found = {owner: finder.find(owner, *given[owner]) for owner in by_name}
    for owner, (state, age) in found.items():
        finder.check(owner, state, age)
    for owner, (state, _) in found.items():
        setattr(request, owner, state)
    used = {owner: (state.header.stamp, age) for owner, (state, age) in found.items()}
    return [used.get(owner, (Time(), 0.0)) for owner in OWNERS]


def _has_only_a_name(body: BodyState) -> bool:
    """Whether all fields of a body except its name have their defaults."""
    if body.inertia.m or body.motion_type:
        return False  # true of most bodies given in full; the comparison below takes ten times as long
    return body == BodyState(name=body.name)


def _check_is_given(owner: str, body: BodyState) -> None:
    """Refuse a body that has a name and more, but no mass (INVALID_MASS): it may be meant to be known."""
    if body.name and not (body.inertia.m or body.motion_type or body.inverse_inertia):
        reason = f"is 0: to use the last state of {quoted(body.name)}, set no field but its name"
        raise ImpactError(StatusCode.INVALID_MASS, f"{owner}.inertia.m", reason)


class GivenName(NamedTuple):
    """The name of a body in a request, and the field that has it; empty where there is none."""

    field: str
    name: str


def names_of(request: ResolveCollision.Request) -> list[GivenName]:
    """Names of body_a and body_b, from the bodies or the contact.

    Raises:
        ImpactError: UNKNOWN_BODY if the two places differ; SAME_BODY.
    """
    names = []
    for owner in OWNERS:
        name, name_in_contact = getattr(request, owner).name, getattr(request.contact, owner)
        if name and name_in_contact and name != name_in_contact:
            reason = f"is {quoted(name_in_contact)}, but {owner}.name is {quoted(name)}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"contact.{owner}", reason)
        names.append(
            GivenName(f"{owner}.name", name) if name else GivenName(f"contact.{owner}", name_in_contact)
        )
    (_, first), (field, second) = names
    if first and first == second:
        reason = f"is {quoted(second)}, the name of body_a: a body cannot collide with itself"
        raise ImpactError(StatusCode.SAME_BODY, field, reason)
    return names


_getter = lru_cache(attrgetter)  # making one takes as long as using it


def check_texts(request: Any, fields: Sequence[str]) -> None:
    """Refuse a request with a text that is too long (BUDGET_EXCEEDED).

    Such texts are shortened in the request, because the refusal repeats some of them.
    """
    too_long = {field: len(text) for field in fields if len(text := _getter(field)(request)) > MAX_TEXT}
    for field in too_long:
        owner, _, name = field.rpartition(".")
        setattr(_getter(owner)(request), name, _getter(field)(request)[:MAX_TEXT])
    if too_long:
        raise _too_long(*next(iter(too_long.items())))


def _too_long(field: str, length: int) -> ImpactError:
    reason = f"has {length} characters; may have {MAX_TEXT}"
    return ImpactError(StatusCode.BUDGET_EXCEEDED, field, reason)


def check_names(names: Sequence[str]) -> None:
    """Refuse a list in which a name is too long (BUDGET_EXCEEDED) or appears twice (SAME_BODY)."""
    if max(map(len, names), default=0) <= MAX_TEXT and len(set(names)) == len(names):
        return  # a hundred thousand names take 10 ms
    first: dict[str, int] = {}
    for i, name in enumerate(names):
        if len(name) > MAX_TEXT:
            raise _too_long(f"names[{i}]", len(name))
        if first.setdefault(name, i) != i:
            reason = f"is {quoted(name)}, the same as names[{first[name]}]: names must be distinct"
            raise ImpactError(StatusCode.SAME_BODY, f"names[{i}]", reason)


def check_immovable(immovable: Sequence[int], count: int) -> None:
    """Refuse indices that are not below the number of bodies in the table (INVALID_TABLE)."""
    if len(immovable) and np.max(immovable) >= count:
        reason = f"must hold indices below {count}, holds {np.max(immovable)}"
        raise ImpactError(StatusCode.INVALID_TABLE, "immovable", reason)
