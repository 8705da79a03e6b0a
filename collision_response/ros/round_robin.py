"""Round robin between clients: which request is worked on next.

A client with thousands of requests, or with one long request, does not keep the other clients waiting.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Hashable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from ..status import ImpactError

Result = TypeVar("Result")

Steps = Generator["float | Future[Any] | None", None, Result]
"""Work for a request, as a generator. It yields ``None`` where another client may have its turn. If it cannot
go on before something happens, it yields the time [s] of the clock at which it gives up waiting. If it needs
what another thread computes, it yields the future."""

TIME_SLICE = 0.002
"""How long [s] a client is served before the next client has its turn."""


@dataclass(slots=True)
class Job:
    """The work for one request: the steps that send its answer, and what sends an error instead.

    ``spent`` is its computing time so far [s], ``has_budget`` whether that is limited, ``deadline`` when it
    stops waiting [s], if it waits, and ``has_waited`` whether it has been resumed.
    """

    steps: Steps[None]
    send_refusal: Callable[[ImpactError], None]
    has_budget: bool = True
    spent: float = 0.0
    deadline: float = 0.0
    has_waited: bool = False

    def refuse(self, error: ImpactError) -> None:
        """Abandon the work and answer with an error."""
        self.steps.close()
        self.send_refusal(error)


class RoundRobin:
    """The jobs of all clients. The clients take turns, and each client's jobs begin in order.

    A job that waits lets the client's next jobs pass. The first time that it is resumed, it goes on before
    them, and later behind them: jobs that look again and again keep none waiting. One that needs what another
    thread computes keeps its place, so the next jobs wait for it.

    ``over_budget`` returns the error with which to end a job that has used this much computing time [s], or
    ``None`` if it may go on. ``on_computed`` is called, by another thread, when that thread has computed what
    a job needs.
    """

    def __init__(
        self,
        over_budget: Callable[[float], ImpactError | None],
        on_computed: Callable[[], None],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._over_budget = over_budget
        self._on_computed = on_computed
        self._clock = clock
        self._queues: dict[Hashable, deque[Job]] = {}  # in the order of their turns; none is empty
        self._waiting: list[tuple[Hashable, Job]] = []
        self._computing: dict[Hashable, Future[Any]] = {}  # what clients wait for, with all of their jobs
        self._resumes_after_slice = False

    def __len__(self) -> int:
        """Number of jobs that are not finished."""
        return sum(map(len, self._queues.values())) + len(self._waiting)

    @property
    def is_ready(self) -> bool:
        """Whether :meth:`run_slice` has anything to do."""
        return self._next_client() is not None

    @property
    def is_waiting(self) -> bool:
        """Whether any job waits to be resumed."""
        return bool(self._waiting)

    def add(self, client: Hashable, job: Job) -> None:
        """Append a job to the client's queue."""
        self._queues.setdefault(client, deque()).append(job)

    def run_slice(self) -> None:
        """Serve the client whose turn it is for one time slice."""
        client = self._next_client()
        if client is None:
            return
        queue = self._queues.pop(client)
        self._computing.pop(client, None)
        end = self._clock() + TIME_SLICE
        try:
            while queue and self._run_step(client, queue) < end and client not in self._computing:
                pass
        finally:  # a KeyboardInterrupt may end the slice
            if queue:
                self._queues[client] = queue
            if self._resumes_after_slice:
                self._resumes_after_slice = False
                self.resume()

    def resume_after_slice(self) -> None:
        """Let all jobs that wait go on, once the present slice has ended: a step may call this."""
        self._resumes_after_slice = True

    def resume(self, *, overdue_only: bool = False) -> None:
        """Let the jobs that wait go on: all, or only those that have waited until their deadline."""
        latest = self._clock() if overdue_only else math.inf
        resumed = [(client, job) for client, job in self._waiting if job.deadline <= latest]
        self._waiting = [(client, job) for client, job in self._waiting if job.deadline > latest]
        for client, job in resumed:
            if job.has_waited:
                self.add(client, job)
        for client, job in reversed(resumed):
            if not job.has_waited:
                job.has_waited = True
                self._queues.setdefault(client, deque()).appendleft(job)

    def drop(self, client: Hashable) -> int:
        """Drop all jobs of a client without an answer, and return how many there were."""
        if client in self._computing:
            self._computing.pop(client).cancel()
        jobs = [*self._queues.pop(client, ()), *(job for owner, job in self._waiting if owner == client)]
        self._waiting = [(owner, job) for owner, job in self._waiting if owner != client]
        for job in jobs:
            job.steps.close()
        return len(jobs)

    def refuse_all(self, error: ImpactError, until: float) -> None:
        """Answer every job with an error, until a time [s]."""
        self.resume()
        for client, queue in [*self._queues.items()]:
            while queue and self._clock() < until:
                queue[0].refuse(error)
                queue.popleft()
            if not queue:
                del self._queues[client]

    def _next_client(self) -> Hashable | None:
        """Return the client whose turn it is, or ``None`` if no client has anything to do."""
        for client in self._queues:
            if client not in self._computing or self._computing[client].done():
                return client
        return None

    def _run_step(self, client: Hashable, queue: deque[Job]) -> float:
        """Run one step of the first job in the queue, and return the time at its end."""
        start = self._clock()
        job = queue[0]
        if job.has_budget and (error := self._over_budget(job.spent)) is not None:
            queue.popleft().refuse(error)
            return self._clock()
        try:
            pause = next(job.steps)
        except StopIteration:
            queue.popleft()
        else:
            if isinstance(pause, Future):
                self._computing[client] = pause
                pause.add_done_callback(lambda _: self._on_computed())
            elif pause is not None:
                job.deadline = pause
                self._waiting.append((client, queue.popleft()))
        now = self._clock()
        job.spent += now - start
        return now
