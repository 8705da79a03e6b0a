"""The worker that writes recordings, and never gets in the way of who feeds it."""

from __future__ import annotations

import gc
import queue
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from .record import BodyRecord, Entry, Gap, UnwritableEntries

if TYPE_CHECKING:
    from .writer import Writer

CAPACITY = 10_000
"""Entries that may wait. Those that come on top of them are dropped."""

INTERVAL = 2.0
"""Entries are written in batches, this often [s], or when half of the capacity waits.

Each batch costs the file some 2 kB for each entity in it, whatever the number of rows, and up to five
times as much memory until the file is complete. A killed process loses what it had not written."""

STATES_INTERVAL = 10.0
"""Body states are written this often [s], or when half of the capacity waits: there are many bodies."""

MAX_SIZE = 50.0
"""Of a file [MB]. Until it is complete, memory grows with it: with these limits by at most some 200 MB."""

MAX_DURATION = 3600.0
"""Of a file [s], from the first entry in it."""


def check_name(name: str) -> None:
    """Make sure that a file of this name lies in the directory of the recordings. Empty: none is given.

    Raises:
        ValueError: it is more than a plain name.
    """
    if name in (".", "..") or "/" in name or not name.isprintable():
        raise ValueError(f"must be a plain file name, without a directory; is {name!r}")


class Recorder:
    """Writes impacts to new files. It costs the caller a queue's :meth:`put`, whatever happens.

    One file follows the other, when it is large, or old, or has been removed. Each is complete in
    itself, and all are one recording: ``rerun directory/*.rrd`` shows them together. Files that are
    complete are never touched again. The names are numbered: ``name.rrd``, ``name_001.rrd``, and so on.

    A file that is not complete, for the process was killed or the disk was full, has no footer, and its
    last piece may be torn. rerun itself makes a good file of what is there::

        rerun rrd merge --continue-on-error torn.rrd -o recovered.rrd

    rerun is imported by the worker, for that takes a second. If it is not there, or a file cannot be
    written, the recorder says so once and takes no more. An entry that cannot be written is left out.

    Attributes:
        path: of the file that is being written, or was last.
        dropped: number of entries that found the queue full. They are recorded as gaps, too.
        unwritable: number of entries that could not be written, whatever was done. Answers among them are
            recorded as gaps, too.
        untimed: number of sightings without a stamp. There is no place for them on any timeline.
    """

    def __init__(
        self,
        directory: Path,
        report: Callable[[str], object],
        *,
        opened: Callable[[str], object] = lambda _: None,
        name: str = "",
        max_size: float = MAX_SIZE,
        max_duration: float = MAX_DURATION,
        capacity: int = CAPACITY,
    ) -> None:
        """Start the worker.

        Args:
            directory: made if it is not there.
            report: is told what goes wrong, from any thread.
            opened: is told of each file, once it is open, from the worker.
            name: of the first file, which must not be there yet. Empty: one made from the time.
            max_size: of a file [MB], passed by one batch at most; 0: any.
            max_duration: of a file [s], from its first entry to the last batch; 0: any.
            capacity: entries that may wait.

        Raises:
            ValueError: the name is more than a plain name.
        """
        check_name(name)
        self.path = directory / (name or f"collision_response_{datetime.now():%Y-%m-%d_%H-%M-%S.%f}.rrd")
        self.dropped = 0
        self.unwritable = 0
        self.untimed = 0
        self._first = self.path
        self._number = 0
        self._report = report
        self._opened = opened
        self._max_size = max_size * 1e6
        self._max_duration = max_duration
        self._capacity = capacity
        self._queue: queue.SimpleQueue[Entry | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._due = threading.Event()
        self._stopped = threading.Event()
        self._worker = threading.Thread(target=self._work, name="recording", daemon=True)
        self._worker.start()

    def add(self, entry: Entry) -> None:
        """Record this. Returns at once."""
        if self._stopped.is_set():
            return
        waiting = self._queue.qsize()
        if waiting >= self._capacity:
            self.dropped += 1
            if self.dropped == 1:
                self._report(f"recording {self.path} cannot keep up: entries are dropped")
            return
        self._queue.put(entry)
        if waiting == self._capacity // 2:
            self._due.set()

    def missing(self) -> int:
        """How many entries are not recorded."""
        return self.dropped + self.unwritable

    def close(self, timeout: float = 10.0) -> None:
        """Write what waits and complete the file; a second call does nothing.

        Args:
            timeout: how long to wait for that [s].
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._due.set()
        self._queue.put(None)
        self._worker.join(min(timeout, threading.TIMEOUT_MAX))
        if self._worker.is_alive():
            self._report(f"recording {self.path} is not complete: the disk took more than {timeout:g} s")
        if self.dropped:
            self._report(f"recording {self._first} lacks {self.dropped} entries, which came too fast")
        if self.unwritable:
            self._report(f"recording {self._first} lacks {self.unwritable} entries, which cannot be written")
        if self.untimed:
            self._report(f"recording {self._first} lacks {self.untimed} body states, which had no stamp")

    def _work(self) -> None:
        what = "not recording to {}: {}"
        try:
            from .writer import Recording, Writer

            gc.freeze()  # what waits grows old: the collector would soon search all of rerun too, for 50 ms
            recording, batches = Recording(), self._batches()
            rest: list[Entry] | None = []
            while rest is not None:
                with Writer(self.path, recording) as writer:
                    self._opened(f"recording to {self.path}")
                    what = "recording {} has stopped: {}"
                    rest = self._fill(writer, rest, batches)
                if rest is not None:
                    self.path = self._next()
        except Exception as error:  # of rerun, of its absence or of the disk: none may reach the caller
            self._report(what.format(self.path, str(error) or type(error).__name__))
        finally:
            self._stopped.set()

    def _fill(self, writer: Writer, first: list[Entry], batches: Iterator[list[Entry]]) -> list[Entry] | None:
        """Write one file, from a batch on. Returns what belongs into the next one; ``None``: that was all."""
        begin = None
        for batch in filter(None, chain([first], batches)):
            if not writer.is_in_place():
                self._report(f"recording {writer.path} was removed; what comes goes into a new file")
                return batch
            if begin is None:
                begin = time.monotonic()
            elif 0 < self._max_size <= writer.size() or 0 < self._max_duration <= time.monotonic() - begin:
                return batch
            self._write(writer, batch)
        if not writer.is_in_place():
            self._report(f"recording {writer.path} was removed")
        return None

    def _write(self, writer: Writer, batch: list[Entry]) -> None:
        """Write all that can be, and gaps in place of the other answers."""
        try:
            writer.write(batch)
        except UnwritableEntries as error:
            if not self.unwritable:
                fault = "".join(traceback.format_exception(error.__cause__))
                self._report(f"an entry cannot be written, and is left out; this is said once:\n{fault}")
            self.unwritable += len(error.entries)
            odd = {id(entry) for entry in error.entries}
            why = f"this cannot be written: {error.__cause__!r}"
            rest = [entry for entry in batch if id(entry) not in odd]
            gaps = [Gap(e.stamp, e.sequence, 1, why) for e in error.entries if not isinstance(e, BodyRecord)]
            writer.write([*rest, *gaps])

    def _next(self) -> Path:
        """The next numbered name that is free."""
        while True:
            self._number += 1
            path = self._first.with_stem(f"{self._first.stem}_{self._number:03d}")
            if not path.exists():
                return path

    def _batches(self) -> Iterator[list[Entry]]:
        """What is to be written, until :meth:`close`: states less often; after drops, with their gap."""
        states: list[Entry] = []
        sequence, told, since, last = 0, 0, 0.0, False
        while not last:
            waiting = self._wait(STATES_INTERVAL if states else None)
            last = None in waiting
            entries = [entry for entry in waiting if entry is not None and self._has_place(entry)]
            sequence = max((e.sequence for e in entries if not isinstance(e, BodyRecord)), default=sequence)
            dropped = self.dropped
            if dropped > told:
                stamp = max((entry.stamp for entry in entries), default=0)
                entries.append(Gap(stamp, sequence, dropped - told))
                told = dropped
            since = since if states else time.monotonic()
            states += (entry for entry in entries if isinstance(entry, BodyRecord))
            batch: list[Entry] = [entry for entry in entries if not isinstance(entry, BodyRecord)]
            is_old = time.monotonic() - since >= STATES_INTERVAL
            if last or is_old or len(states) >= self._capacity // 2:
                batch, states = states + batch, []
            yield batch

    def _wait(self, timeout: float | None) -> list[Entry | None]:
        """What waits, some time after the first of it came; nothing if nothing came until the timeout."""
        try:
            waiting = [self._queue.get(timeout=timeout)]
        except queue.Empty:
            return []
        if not self._closing.is_set():
            self._due.wait(INTERVAL)
        self._due.clear()
        while not self._queue.empty():
            waiting.append(self._queue.get())
        return waiting

    def _has_place(self, entry: Entry) -> bool:
        """Whether there is a timeline for it."""
        if entry.stamp or not isinstance(entry, BodyRecord):
            return True
        if not self.untimed:
            self._report("body states without a stamp are not recorded: they have no place in time")
        self.untimed += 1
        return False
