"""Whose request is served next: clients take turns, and long requests are served in parts."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Hashable
from dataclasses import dataclass

from ..status import ImpactError

Parts = Generator[float | None, None, None]
"""The work for a request. It yields ``None`` when others may go first; or, when it can do nothing until
:meth:`Turns.wake` is called, the time [s] by the clock until which it waits for that."""

SLICE = 0.002
"""Time [s] after which it is the next client's turn."""


@dataclass(slots=True)
class Job:
    """A request to be answered.

    Attributes:
        parts: does it, and answers.
        refuse: answers with an error instead.
        spent: computing time so far [s].
        deadline: until when it waits [s].
    """

    parts: Parts
    refuse: Callable[[ImpactError], None]
    spent: float = 0.0
    deadline: float = 0.0

    def end(self, error: ImpactError) -> None:
        """Answer with an error, whatever has been done."""
        self.parts.close()
        self.refuse(error)


class Turns:
    """The jobs of all clients: those of one client in order, the clients in turn.

    Args:
        over_budget: given the time [s] that a job has taken: the error to end it with, or ``None``.
        clock: the time [s].
    """

    def __init__(
        self,
        over_budget: Callable[[float], ImpactError | None],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._over_budget = over_budget
        self._clock = clock
        self._queues: dict[Hashable, deque[Job]] = {}  # in the order of their turns; none is empty
        self._waiting: list[tuple[Hashable, Job]] = []

    def __len__(self) -> int:
        """How many jobs are not finished."""
        return sum(map(len, self._queues.values())) + len(self._waiting)

    @property
    def is_ready(self) -> bool:
        """Whether :meth:`work` has something to do."""
        return bool(self._queues)

    @property
    def is_waiting(self) -> bool:
        """Whether a job waits for :meth:`wake`."""
        return bool(self._waiting)

    def add(self, client: Hashable, job: Job) -> None:
        """Do this after what the client has asked for before."""
        self._queues.setdefault(client, deque()).append(job)

    def work(self) -> None:
        """Serve the client whose turn it is, for a slice of time."""
        if not self._queues:
            return
        client = next(iter(self._queues))
        queue = self._queues.pop(client)
        end = self._clock() + SLICE
        while queue and self._do_part(client, queue) < end:
            pass
        if queue:
            self._queues[client] = queue

    def wake(self, *, all_of_them: bool) -> None:
        """Let the jobs that wait go on: all, or those whose time is up."""
        now = self._clock()
        waiting, self._waiting = self._waiting, []
        for client, job in waiting:
            if all_of_them or job.deadline <= now:
                self._queues.setdefault(client, deque()).appendleft(job)
            else:
                self._waiting.append((client, job))

    def drop(self, client: Hashable) -> int:
        """Forget the jobs of a client; how many there were."""
        jobs = [*self._queues.pop(client, ()), *(job for owner, job in self._waiting if owner == client)]
        self._waiting = [(owner, job) for owner, job in self._waiting if owner != client]
        for job in jobs:
            job.parts.close()
        return len(jobs)

    def end(self, error: ImpactError, until: float) -> int:
        """Answer every job with an error while there is time; how many are left without an answer."""
        self.wake(all_of_them=True)
        jobs = [job for queue in self._queues.values() for job in queue]
        self._queues.clear()
        for number, job in enumerate(jobs):
            if self._clock() >= until:
                return len(jobs) - number
            job.end(error)
        return 0

    def _do_part(self, client: Hashable, queue: deque[Job]) -> float:
        """One part of the first job; the time at its end."""
        start = self._clock()
        job = queue[0]
        if (error := self._over_budget(job.spent)) is not None:
            queue.popleft().end(error)
            return self._clock()
        try:
            deadline = next(job.parts)
        except StopIteration:
            queue.popleft()
        else:
            if deadline is not None:
                job.deadline = deadline
                self._waiting.append((client, queue.popleft()))
        now = self._clock()
        job.spent += now - start
        return now
