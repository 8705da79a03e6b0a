"""A file that rerun may write without ever failing to."""

from __future__ import annotations

import os
import threading
from pathlib import Path

CHUNK = 1 << 16


class PipedFile:
    """A new file behind a pipe.

    rerun writes files in a thread of its own, and does not outlive an error in it: with the disk
    full, closing the recording, and even leaving the interpreter, may wait for ever (rerun 0.41).
    What is written to the pipe is always taken; an error of the file is kept, to be asked for.

    Attributes:
        name: of the pipe's end, for rerun to open.
        error: what went wrong with the file, if anything did.
    """

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            OSError: it exists, or cannot be created.
        """
        self.error: OSError | None = None
        self._path = path
        self._file = path.open("xb", buffering=0)
        self._source, self._sink = os.pipe()
        self.name = f"/dev/fd/{self._sink}"
        self._pump = threading.Thread(target=self._copy, name="recording file", daemon=True)
        self._pump.start()

    def opened(self) -> None:
        """To be called once ``name`` has been opened: the file ends when whoever did so closes it."""
        os.close(self._sink)

    def size(self) -> int:
        """What has been written [bytes]; before :meth:`join` only."""
        return os.fstat(self._file.fileno()).st_size

    def is_in_place(self) -> bool:
        """Whether the file is still where it was created; before :meth:`join` only.

        Raises:
            OSError: nobody can tell.
        """
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._file.fileno()))
        except (FileNotFoundError, NotADirectoryError):
            return False

    def check(self) -> None:
        """Raises: OSError: something went wrong with the file."""
        if self.error is not None:
            raise self.error

    def join(self) -> None:
        """Wait until all is written."""
        self._pump.join()

    def _copy(self) -> None:
        with self._file, open(self._source, "rb", buffering=0) as source:
            while chunk := source.read(CHUNK):
                if self.error is None:
                    self._write(chunk)

    def _write(self, chunk: bytes) -> None:
        rest = memoryview(chunk)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error
