"""The worker that writes recordings, and never gets in the way of who feeds it."""

from __future__ import annotations

import gc
import queue
import threading
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path

from .record import Entry

CAPACITY = 10_000
"""Entries that may wait. Those that come on top of them are dropped."""

INTERVAL = 0.5
"""Entries are written in batches, this often [s]: one by one they would cost more than the impacts."""


class Recorder:
    """Writes impacts to a new file. It costs the caller a queue's :meth:`put`, whatever happens.

    rerun is imported by the worker, for that takes a second. If it is not there, or the file cannot
    be written, the recorder says so once and takes no more.

    Attributes:
        path: of the file.
        dropped: number of entries that found the queue full.
    """

    def __init__(
        self,
        directory: Path,
        report: Callable[[str], object],
        *,
        name: str = "",
        capacity: int = CAPACITY,
    ) -> None:
        """Start the worker.

        Args:
            directory: made if it is not there.
            report: is told what goes wrong, from any thread.
            name: of the file, which must not be there yet. Empty: one made from the time.
            capacity: entries that may wait.
        """
        self.path = directory / (name or f"collision_response_{datetime.now():%Y-%m-%d_%H-%M-%S.%f}.rrd")
        self.dropped = 0
        self._report = report
        self._capacity = capacity
        self._queue: queue.SimpleQueue[Entry | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._stopped = threading.Event()
        self._worker = threading.Thread(target=self._work, name="recording", daemon=True)
        self._worker.start()

    def add(self, entry: Entry) -> None:
        """Record this. Returns at once."""
        if self._stopped.is_set():
            return
        if self._queue.qsize() < self._capacity:
            self._queue.put(entry)
            return
        self.dropped += 1
        if self.dropped == 1:
            self._report(f"recording {self.path} cannot keep up: entries are dropped")

    def close(self, timeout: float = 10.0) -> None:
        """Write what waits and complete the file; a second call does nothing.

        Args:
            timeout: how long to wait for that [s].
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._queue.put(None)
        self._worker.join(timeout)
        if self._worker.is_alive():
            self._report(f"recording {self.path} is not complete: the disk took more than {timeout:g} s")
        if self.dropped:
            self._report(f"recording {self.path} lacks {self.dropped} entries")

    def _work(self) -> None:
        try:
            from .writer import Writer

            gc.freeze()  # what waits grows old: the collector would soon search all of rerun too, for 50 ms
            with Writer(self.path) as writer:
                for batch in self._batches():
                    writer.write(batch)
        except Exception as error:  # of rerun, of its absence or of the disk: none may reach the caller
            self._report(f"recording {self.path} has stopped: {error}")
        finally:
            self._stopped.set()

    def _batches(self) -> Iterator[list[Entry]]:
        """What has come since the last batch, until :meth:`close`."""
        last = False
        while not last:
            batch = [self._queue.get()]
            self._closing.wait(INTERVAL)
            while not self._queue.empty():
                batch.append(self._queue.get())
            last = None in batch
            yield [entry for entry in batch if entry is not None]
