"""A progress line."""

from __future__ import annotations

import sys
import time


class Progress:
    """Reports progress: on a terminal in one line that is overwritten, elsewhere in a new line every 2 s.

    Use it as a context manager: on a terminal the line is erased at the end.
    """

    def __init__(self) -> None:
        self._terminal = sys.stdout.isatty()
        self._interval = 0.1 if self._terminal else 2.0
        self._next = time.monotonic() + (0.0 if self._terminal else self._interval)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._terminal:
            print("\r\033[K", end="", flush=True)

    def report(self, text: str) -> None:
        """Print the text, unless another one was printed shortly before."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + self._interval
            line = f"\r\033[K  {text} ..." if self._terminal else f"  {text} ...\n"
            print(line, end="", flush=True)
