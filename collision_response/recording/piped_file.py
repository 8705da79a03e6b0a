"""A file to which rerun can write without errors."""

from __future__ import annotations

import os
import select
import threading
from pathlib import Path

CHUNK = 1 << 16


class PipedFile:
    """A new file behind a pipe.

    rerun writes files in a thread of its own, and does not survive an error in that thread: if the disk is
    full, closing the recording, or even leaving the interpreter, may wait for ever (rerun 0.41). A pipe
    accepts everything. If the file cannot be written, the error is kept and the data is dropped.

    ``name`` is the path of the pipe's end that rerun opens.

    Raises:
        OSError: if the file exists or cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.error: OSError | None = None
        self._path = path
        self._file = path.open("xb", buffering=0)
        self._source, self._sink = os.pipe()
        self._ended = os.eventfd(0)
        self.name = f"/dev/fd/{self._sink}"
        self._copier = threading.Thread(target=self._copy, name="recording file", daemon=True)
        self._copier.start()

    def size(self) -> int:
        """Number of bytes written so far. Not to be called after :meth:`join`."""
        return os.fstat(self._file.fileno()).st_size

    def is_in_place(self) -> bool:
        """Whether the file is still at its path, not moved or removed. Not to be called after :meth:`join`.

        Raises:
            OSError: if the path cannot be examined.
        """
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._file.fileno()))
        except (FileNotFoundError, NotADirectoryError):
            return False

    def check(self) -> None:
        """Raise the error of the file, if there was one."""
        if self.error is not None:
            raise self.error

    def join(self) -> None:
        """Wait until everything is written. To be called once, when rerun has closed the pipe.

        The pipe itself does not tell: a process forked meanwhile has a copy of its end.
        """
        os.eventfd_write(self._ended, 1)
        self._copier.join()
        for descriptor in (self._sink, self._ended):
            os.close(descriptor)

    def _copy(self) -> None:
        poll = select.poll()
        for descriptor in (self._source, self._ended):
            poll.register(descriptor, select.POLLIN)
        with self._file, open(self._source, "rb", buffering=0) as source:
            while self._source in dict(poll.poll()) and (chunk := source.read(CHUNK)):
                if self.error is None:
                    self._write(chunk)

    def _write(self, chunk: bytes) -> None:
        rest = memoryview(chunk)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
