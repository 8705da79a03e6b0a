"""Warnings that are not repeated all the time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from .server import THROTTLE

MOST = 100
"""Things that are warned of within ``THROTTLE``: their names may come from anybody."""


class Throttled:
    """Warns, but not of one thing all the time; rclpy would count all that is said in one line as one thing.

    Args:
        warn: is told what is new.
        clock: the time [s].
    """

    def __init__(self, warn: Callable[[str], object], clock: Callable[[], float] = time.perf_counter) -> None:
        self._warn, self._clock = warn, clock
        self._said: dict[str, float] = {}

    def __call__(self, about: str, text: str) -> None:
        """Say this, unless something was said about the same a moment ago."""
        now = self._clock()
        if now - self._said.get(about, -math.inf) < THROTTLE:
            return
        if len(self._said) >= MOST:
            self._said = {known: said for known, said in self._said.items() if now - said < THROTTLE}
        if len(self._said) < MOST:
            self._said[about] = now
            self._warn(text)
