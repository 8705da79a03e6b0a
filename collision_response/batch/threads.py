"""Share the contacts of a batch among threads."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from typing import TypeVar

T = TypeVar("T")

CACHE_LINE = 64
"""Contacts whose status fills a cache line. Parts begin at multiples, so no two threads write one line."""


def run_in_parts(work: Callable[[int, int], T], start: int, stop: int, threads: int) -> list[T]:
    """Return the results of ``work(start, stop)`` for parts of a range, in any order.

    The calling thread does one part, and those for which the system starts no more threads. It waits for the
    others, also if it is interrupted. Executors of the standard library would refuse to work after the main
    thread has ended.
    """
    if threads <= 1:
        return [work(start, stop)]
    cuts = [start + (stop - start) * i // threads // CACHE_LINE * CACHE_LINE for i in range(threads)]
    results: list[T] = []
    errors: list[BaseException] = []

    def run(*part: int) -> None:
        try:
            results.append(work(*part))
        except BaseException as error:  # raised again below
            errors.append(error)

    parts = zip(cuts[1:], [*cuts[2:], stop], strict=True)
    started: list[Thread] = []
    try:
        for part in parts:
            thread = Thread(target=run, args=part)
            try:
                thread.start()
            except RuntimeError:
                run(part[0], stop)
                break
            started.append(thread)
        run(cuts[0], cuts[1])
        _join(started)
    finally:  # an interrupt may have ended the wait
        _join(started)
    if errors:
        raise errors[0]
    return results


def _join(threads: list[Thread]) -> None:
    for thread in threads:
        thread.join()
