"""Warnings that are not repeated all the time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

WARNING_INTERVAL = 5.0
"""Shortest time [s] between two warnings about the same subject."""

MAX_SUBJECTS = 100
"""Subjects that are warned about within ``WARNING_INTERVAL``. Their names may come from any publisher."""


class ThrottledWarnings:
    """Logs warnings, at most one per subject in ``WARNING_INTERVAL``.

    rclpy's own throttling goes by the line of code, not by the subject.
    """

    def __init__(self, warn: Callable[[str], object], clock: Callable[[], float] = time.perf_counter) -> None:
        self._warn, self._clock = warn, clock
        self._last: dict[str, float] = {}

    def __call__(self, subject: str, text: Callable[[], str]) -> None:
        """Log a warning, unless there was one about the same subject a moment ago.

        ``text`` makes it: there may be thousands a second that are not logged.
        """
        now = self._clock()
        if now - self._last.get(subject, -math.inf) < WARNING_INTERVAL:
            return
        if len(self._last) >= MAX_SUBJECTS:
            self._last = {known: last for known, last in self._last.items() if now - last < WARNING_INTERVAL}
        if len(self._last) < MAX_SUBJECTS:
            self._last[subject] = now
            self._warn(text())
