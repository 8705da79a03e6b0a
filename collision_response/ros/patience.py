"""Waiting for a state that may still come."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import TypeVar

from ..status import ImpactError, StatusCode
from .request import TooEarly

Found = TypeVar("Found")


Look = Generator[None, None, Found]
"""A look-up; it yields when others may go first."""

TOGETHER = 50
"""Bodies that are looked up, or converted, without a pause: each takes up to a tenth of a millisecond."""


def in_one_part(look: Callable[[], Found]) -> Look[Found]:
    """A look-up without a pause."""
    yield from ()
    return look()


def when_not_too_early(look: Callable[[], Look[Found]], wait: float) -> Generator[float | None, None, Found]:
    """What a look-up finds, in the end.

    Args:
        look: done at once, and again each time that states have arrived.
        wait: how long [s] to go on with that.

    Yields:
        The time [s], by ``time.perf_counter``, until which it waits; or ``None``, to be gone on with.

    Raises:
        ImpactError: that of the look-up; STALE_STATE when it has waited in vain.
    """
    until = time.perf_counter() + wait
    while True:
        try:
            return (yield from look())
        except TooEarly as error:
            if time.perf_counter() >= until:
                reason = f"{error.reason}; waited {wait:.6g} s (max_state_wait)"
                raise ImpactError(StatusCode.STALE_STATE, error.field, reason) from None
        yield until
