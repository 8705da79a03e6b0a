"""The latest state of every body that has been heard of."""

from __future__ import annotations

from builtin_interfaces.msg import Time

from ..msg import BodyState
from ..status import ImpactError, StatusCode


def nanoseconds(stamp: Time) -> int:
    """A stamp as one number [ns]."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class LatestStates:
    """Body states by name: of each body, the one that arrived last."""

    def __init__(self) -> None:
        self._by_name: dict[str, BodyState] = {}

    def remember(self, state: BodyState) -> None:
        """Take note of a state. One without a name could not be asked for, and is passed over."""
        if state.name:
            self._by_name[state.name] = state

    def find(self, owner: str, name: str) -> BodyState:
        """The state of a body given by name only.

        Raises:
            ImpactError: UNKNOWN_BODY, its field starting with ``owner``.
        """
        try:
            return self._by_name[name]
        except KeyError:
            heard_of = ", ".join(sorted(self._by_name)[:10]) or "no body"
            reason = f"is {name!r}, of which no state has been received; heard of: {heard_of}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, f"{owner}.name", reason) from None


def check_age(owner: str, state: BodyState, now: int, limit: float) -> None:
    """Refuse a state that is too old.

    Args:
        owner: of the state, for the error.
        state: stamped by whoever published it.
        now: by the node's clock [ns].
        limit: the greatest age allowed [s].

    Raises:
        ImpactError: STALE_STATE.
    """
    age = (now - nanoseconds(state.header.stamp)) / 1e9
    if age > limit:
        reason = f"the last state of {state.name!r} is {age:.6g} s old; max_state_age is {limit:.6g} s"
        raise ImpactError(StatusCode.STALE_STATE, f"{owner}.header.stamp", reason)
