"""Waiting for body states that have not been received yet."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator

from ..status import ImpactError, StatusCode
from .body_lookup import Found, LookUp, StateNotYetReceived

BODIES_PER_STEP = 50
"""Bodies that are looked up, or converted, between two yields: each takes up to a tenth of a millisecond."""


def wait_for_states(
    look_up: Callable[[], LookUp[Found]], timeout: float
) -> Generator[float | None, None, Found]:
    """Look up bodies, and wait for their states if necessary.

    Args:
        look_up: tried at once, and again whenever states have arrived.
        timeout: how long to wait [s].

    Yields:
        While it waits: when it stops waiting [s], by ``time.perf_counter``. In a look-up: ``None``.

    Returns:
        What the look-up returns.

    Raises:
        ImpactError: STALE_STATE if no such state arrives in time; or what the look-up raises.
    """
    deadline = time.perf_counter() + timeout
    while True:
        try:
            return (yield from look_up())
        except StateNotYetReceived as error:
            if time.perf_counter() >= deadline:
                reason = f"{error.reason}; waited {timeout:.6g} s (max_state_wait)"
                raise ImpactError(StatusCode.STALE_STATE, error.field, reason) from None
        yield deadline
