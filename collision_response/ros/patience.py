"""Waiting for a state that may still come."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import TypeVar

from ..status import ImpactError, StatusCode
from .request import TooEarly

Found = TypeVar("Found")


def when_not_too_early(look: Callable[[], Found], wait: float) -> Generator[float, None, Found]:
    """What a look-up finds, in the end.

    Args:
        look: done at once, and again each time that states have arrived.
        wait: how long [s] to go on with that.

    Yields:
        The time [s], by ``time.perf_counter``, until which it waits.

    Raises:
        ImpactError: that of the look-up; STALE_STATE when it has waited in vain.
    """
    until = time.perf_counter() + wait
    while True:
        try:
            return look()
        except TooEarly as error:
            if time.perf_counter() >= until:
                reason = f"{error.reason}; waited {wait:.6g} s (max_state_wait)"
                raise ImpactError(StatusCode.STALE_STATE, error.field, reason) from None
        yield until
