"""A progress line."""

from __future__ import annotations

import sys
import time
from typing import TextIO


class Progress:
    """Reports progress: on a terminal in one line that is overwritten, elsewhere in a new line every 2 s.

    Use it as a context manager: on a terminal the line is erased at the end.
    """

    def __init__(self, stream: TextIO = sys.stdout) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._interval = 0.1 if self._terminal else 2.0
        self._next = time.monotonic() + (0.0 if self._terminal else self._interval)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._terminal:
            self._write("\r\033[K")

    def report(self, text: str) -> None:
        """Print the text, unless another one was printed shortly before."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + self._interval
            self._write(f"\r\033[K  {text} ..." if self._terminal else f"  {text} ...\n")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
