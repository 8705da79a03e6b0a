"""A worker thread that writes recordings and never blocks its callers."""

from __future__ import annotations

import gc
import math
import os
import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from .record import BodyRecord, Entry, Gap, SceneRecord, UnwritableEntries, drawn_bodies, has_place

if TYPE_CHECKING:
    from .writer import Writer

CAPACITY = 10_000
"""Number of entries that may wait. Further entries are dropped. A scene counts as one for each two bodies."""

PART = 1000
"""Number of bodies that are written at once, at most, but for a larger scene."""

THREAD = "recording"
"""Name of the thread that writes."""

WRITING_SHARE = 0.3
"""The part of the time to close in which entries are written. To complete a file takes some, too.

The first part in a file is always written: to open the first file of a process may take longer than that."""

INTERVAL = 2.0
"""Time [s] between two batches. A batch is also written as soon as half of the capacity waits.

Each batch costs about 2 kB in the file for each entity in it, whatever the number of rows, and up to five
times as much memory until the file is complete. A killed process loses what it has not written."""

STATES_INTERVAL = 10.0
"""Time [s] between two batches of body states, which are written less often because there are many bodies."""

MAX_SIZE = 50.0
"""Largest file [MB]. Until a file is complete, memory grows with it, with these limits by up to 200 MB."""

MAX_DURATION = 3600.0
"""Longest duration of a file [s], from its first entry."""


def check_name(name: str) -> None:
    """Check that a file name has no directory, and the ending without which the viewer does not open it.

    The empty name, which means none, is accepted.

    Raises:
        ValueError: if it is another name.
    """
    if name in (".", "..") or "/" in name or not name.isprintable():
        raise ValueError(f"must be a plain file name, without a directory; is {name!r}")
    if name and Path(name).suffix != ".rrd":
        raise ValueError(f"must end in .rrd; is {name!r}")


def _size(entry: Entry) -> int:
    """How many entries it counts as: an impact has two bodies."""
    try:
        return max(1, len(entry.bodies) // 2) if isinstance(entry, SceneRecord) else 1
    except TypeError:  # entries may hold anything; the writer reports it
        return 1


def _drawn_names(entry: Entry) -> set[str]:
    """Names of the bodies that an entry draws; none if it cannot be written, which the writer reports."""
    try:
        return {str(name) for name, *_ in drawn_bodies(entry)}
    except Exception:  # entries may hold anything
        return set()


def _printable(text: str) -> str:
    """Return a text that loggers can encode: a path may hold bytes that are no characters."""
    return text.encode(errors="backslashreplace").decode()


class Recorder:
    """Writes impacts to new files. Each entry costs the caller one ``put`` to a queue.

    A new file begins when the current one is too large, too old, or has been removed. Each file is complete
    in itself, and all of them are one recording: ``rerun directory/*.rrd`` shows them together. Complete
    files are never touched again. The names are numbered: ``name.rrd``, ``name_001.rrd``, and so on.

    If the process is killed or the disk is full, the file is not complete: it has no footer, and its last
    chunk may be cut off. rerun can recover the rest::

        rerun rrd merge --continue-on-error torn.rrd -o recovered.rrd

    Entries that wait when the process ends without :meth:`close` are lost, and so are those added after it. A
    process forked from one with a recorder must not make one.

    The worker imports rerun, because that takes a second. If rerun is missing or a file cannot be written,
    the recorder reports that once, and only counts all further entries. Single entries that cannot be written
    are left out.

    Attributes:
        path: path of the current file, or of the last one.
        dropped: number of entries dropped because the queue was full. The recording has gaps for them.
        unwritable: number of entries that could not be written. The recording has gaps for the answers among
            them.
        abandoned: number of entries that waited when the recorder stopped because of an error, or came later,
            and those of the batch that it was writing; the file may hold some of them.
        late: number of entries that there was no time for when the recorder was closed.
        untimed: number of body states without a stamp, which have no place on any timeline.
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
            directory: directory of the files, which is made if it does not exist.
            report: called with the text of each problem, from any thread.
            opened: called with a text when a file has been opened, from the worker.
            name: name of the first file, which must not exist yet. Empty: a name made from the time.
            max_size: largest file [MB], exceeded by a part of a batch at most; 0: no limit.
            max_duration: longest time [s] from the first entry of a file to its last batch; 0: no limit.
            capacity: number of entries that may wait, as ``CAPACITY``.

        Raises:
            ValueError: as :func:`check_name`.
        """
        check_name(name)
        self.path = directory.absolute() / (
            name or f"collision_response_{datetime.now():%Y-%m-%d_%H-%M-%S.%f}.rrd"
        )
        self.dropped = self.unwritable = self.abandoned = self.late = self.untimed = 0
        self._first = self.path
        self._number = 0
        self._tell_problem = report
        self._opened = opened
        self._max_size = max_size * 1e6
        self._max_duration = max_duration
        self._capacity = capacity
        self._unwritten: list[Entry] = []  # the batch that is being written
        self._held_back: list[BodyRecord] = []  # body states for a later batch
        self._queue: queue.SimpleQueue[Entry | None] = queue.SimpleQueue()
        self._waiting = 0  # size of the entries in the queue
        self._counting = threading.Lock()
        self._write_until = math.inf
        self._closing = threading.Event()
        self._due = threading.Event()
        self._stopped = threading.Event()
        self._worker = threading.Thread(target=self._work, name=THREAD, daemon=True)
        self._worker.start()

    def add(self, entry: Entry) -> None:
        """Record an entry. Returns at once. Entries after :meth:`close` are ignored."""
        if self._stopped.is_set():
            self.abandoned += not self._closing.is_set()
            return
        size = _size(entry)
        with self._counting:
            before = self._waiting
            if before < self._capacity:
                self._waiting += size
                self._queue.put(entry)
        if before >= self._capacity:
            self.dropped += 1
            if self.dropped == 1:
                self._report(f"recording {self.path} cannot keep up: entries are dropped")
        elif before <= self._capacity // 2 < before + size:
            self._due.set()

    def missing(self) -> int:
        """Number of entries that are not recorded."""
        return self.dropped + self.unwritable + self.abandoned + self.late

    def close(self, timeout: float = 10.0) -> None:
        """Write what waits and complete the file, within a time [s]. A second call does nothing.

        Entries that there is no time for are left out, but for the first ones in a file.
        """
        if self._closing.is_set():
            return
        timeout = min(timeout, threading.TIMEOUT_MAX)
        self._write_until = time.monotonic() + WRITING_SHARE * timeout
        self._closing.set()
        self._due.set()
        self._queue.put(None)
        self._worker.join(timeout)
        if self._worker.is_alive():
            self._report(f"recording {self.path} is not complete: it took more than {timeout:.3g} s")
        for count, which in (
            (self.dropped, "entries, which came too fast"),
            (self.unwritable, "entries, which cannot be written"),
            (self.untimed, "body states, which had no stamp"),
            (self.late, "entries, for which there was no time at the end"),
        ):
            if count:
                self._report(f"recording {self._first} lacks {count} {which}")

    def _report(self, problem: str) -> None:
        self._tell_problem(_printable(problem))

    def _work(self) -> None:
        problem = "not recording to {}: {}"
        try:
            is_first = f"{__package__}.writer" not in sys.modules
            from .writer import Recording, Writer

            if is_first:
                gc.freeze()  # the garbage collector would search all of rerun, too, which takes 50 ms
            recording, parts = Recording(), self._parts()
            remaining: list[Entry] | None = []
            while remaining is not None:
                with Writer(self.path, recording) as writer:
                    self._opened(_printable(f"recording to {self.path}"))
                    problem = "recording {} has stopped: {}"
                    remaining = self._fill(writer, remaining, parts)
                if remaining is not None:
                    self.path = self._next_path()
        except Exception as error:  # of rerun or the disk; it must not reach the caller
            self.abandoned += self._left()
            self._report(problem.format(self.path, str(error) or type(error).__name__))
        finally:
            self._stopped.set()

    def _left(self) -> int:
        """Number of entries that are not written."""
        queued = [self._queue.get() for _ in range(self._queue.qsize())]
        left = [*self._unwritten, *self._held_back, *queued]
        return sum(not isinstance(entry, Gap | None) for entry in left)

    def _fill(self, writer: Writer, first: list[Entry], parts: Iterator[list[Entry]]) -> list[Entry] | None:
        """Write one file, and return the first part of the next one, or ``None`` if the recording ends."""
        begin, file = None, writer.file
        for part in filter(None, chain([first], parts)):
            if not file.is_in_place():
                self._report(f"recording {writer.path} was removed; recording continues in a new file")
                return part
            if begin is None:
                begin = time.monotonic()
            elif 0 < self._max_size <= file.size() or 0 < self._max_duration <= time.monotonic() - begin:
                return part
            elif time.monotonic() > self._write_until:
                self.late = self._left()
                break
            self._write(writer, part)
        if not file.is_in_place():
            self._report(f"recording {writer.path} was removed")
        return None

    def _write(self, writer: Writer, part: list[Entry]) -> None:
        """Write a part of a batch, with gaps in place of answers that cannot be written."""
        try:
            writer.write(part)
        except UnwritableEntries as error:
            fault = "".join(traceback.format_exception(error.__cause__))
            self._leave_out(len(error.entries), f"\n{fault}")
            unwritable = {id(entry) for entry in error.entries}
            why = f"this cannot be written: {error.__cause__!r}"
            rest = [entry for entry in part if id(entry) not in unwritable]
            self._unwritten = [entry for entry in self._unwritten if id(entry) not in unwritable]
            gaps = [Gap(e.stamp, e.sequence, 1, why) for e in error.entries if not isinstance(e, BodyRecord)]
            writer.write([*rest, *gaps])

    def _leave_out(self, count: int, why: str) -> None:
        """Count entries that cannot be written, and report why for the first."""
        if not self.unwritable:
            self._report(f"an entry cannot be written and is left out (logged once):{why}")
        self.unwritable += count

    def _next_path(self) -> Path:
        """Path with the next number that does not exist yet."""
        while True:
            self._number += 1
            path = self._first.with_stem(f"{self._first.stem}_{self._number:03d}")
            if not os.path.lexists(path):  # also not as a link to nowhere
                return path

    def _parts(self) -> Iterator[list[Entry]]:
        """Yield the parts of the batches: of ``PART`` bodies at most, or one scene."""
        for batch in self._batches():
            first, names = 0, set[str]()
            for i, entry in enumerate(batch):
                own = _drawn_names(entry)
                names |= own
                if i > first and len(names) > PART:
                    self._unwritten = batch[first:]
                    yield batch[first:i]
                    first, names = i, own
            self._unwritten = batch[first:]
            yield batch[first:]
            self._unwritten = []

    def _batches(self) -> Iterator[list[Entry]]:
        """Yield the batches to write, until :meth:`close`.

        Body states are held back for ``STATES_INTERVAL``. A batch after dropped entries has a gap for them.
        """
        sequence, recorded_drops, since, last = 0, 0, 0.0, False
        while not last:
            states = self._held_back
            waiting = self._wait(STATES_INTERVAL if states else None)
            last = None in waiting
            entries = [entry for entry in waiting if entry is not None and self._is_on_timeline(entry)]
            sequence = max((e.sequence for e in entries if not isinstance(e, BodyRecord)), default=sequence)
            dropped = self.dropped
            if dropped > recorded_drops:
                stamp = max((entry.stamp for entry in entries), default=0)
                entries.append(Gap(stamp, sequence, dropped - recorded_drops))
                recorded_drops = dropped
            since = since if states else time.monotonic()
            states += (entry for entry in entries if isinstance(entry, BodyRecord))
            batch: list[Entry] = [entry for entry in entries if not isinstance(entry, BodyRecord)]
            is_old = time.monotonic() - since >= STATES_INTERVAL
            if last or is_old or len(states) >= self._capacity // 2:
                states.sort(key=lambda state: str(state.name))  # a body in fewer parts costs less
                batch, self._held_back = states + batch, []
            yield batch

    def _wait(self, timeout: float | None) -> list[Entry | None]:
        """Wait for an entry, then for ``INTERVAL``, and return all entries that have come.

        Returns nothing if no entry comes within ``timeout`` [s]. ``None`` among the entries: no more will
        come.
        """
        try:
            waiting = [self._queue.get(timeout=timeout)]
        except queue.Empty:
            return []
        if not self._closing.is_set():
            self._due.wait(INTERVAL)
        self._due.clear()
        while not self._queue.empty():
            waiting.append(self._queue.get())
        with self._counting:
            self._waiting -= sum(_size(entry) for entry in waiting if entry is not None)
        return waiting

    def _is_on_timeline(self, entry: Entry) -> bool:
        """Whether an entry has a place on a timeline; if not, it is counted."""
        if not has_place(entry):
            self._leave_out(1, " its stamp or its number is not an integer of 64 bits")
            return False
        if entry.stamp or not isinstance(entry, BodyRecord):
            return True
        if not self.untimed:
            self._report("body states without a stamp are not recorded: they have no place in time")
        self.untimed += 1
        return False
