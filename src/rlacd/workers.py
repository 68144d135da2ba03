"""Several components at a time: the kernels release the GIL, so plain threads do."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

from manifold3d import Manifold

from rlacd._native import Stop, Stopped, poll_stop, use_stop

BETWEEN_POLLS = 0.05
"""Seconds between two looks, while others work, at whether they have to stop."""

SHARES = 16
"""Portions per thread into which many items are split."""

_T = TypeVar("_T")
_R = TypeVar("_R")


class Workers:
    """A pool of threads whose results come in the order of the items, whatever their number.

    Parameters
    ----------
    threads : int, optional
        All processors by default.
    stop : Stop, optional
        What interrupts them; it has to live as long as they do.
    """

    def __init__(self, threads: int | None = None, stop: Stop | None = None) -> None:
        self.threads = threads or available_cpus()
        self._stop = stop
        _start_booleans(self.threads)
        self._pool = ThreadPoolExecutor(self.threads, initializer=use_stop, initargs=(stop,))

    def map(self, function: Callable[[_T], _R], items: Iterable[_T]) -> list[_R]:
        """Apply `function` to every item; when an exception leaves this, no thread works on any of them any more."""
        items = list(items)
        if self.threads == 1 or len(items) < 2:
            return self._each(function, items)
        some = max(1, len(items) // (SHARES * self.threads))  # thousands of small ones are not handed over one by one
        futures = [self._pool.submit(self._each, function, items[i : i + some]) for i in range(0, len(items), some)]
        try:
            self._watch(futures)
            return [result for future in futures for result in future.result()]
        except BaseException as error:
            for future in futures:
                future.cancel()
            if self._stop is not None and not isinstance(error, (Exception, Stopped)):  # Ctrl-C does not wait
                self._stop.trip()
            wait(futures)
            raise

    @staticmethod
    def _each(function: Callable[[_T], _R], items: list[_T]) -> list[_R]:
        results = []
        for item in items:
            poll_stop()
            results.append(function(item))
        return results

    def _watch(self, futures: list[Future[_R]]) -> None:
        """Wait until all are done or one has failed; only this thread can look whether they have to stop."""
        waiting: set[Future[_R]] = set(futures)
        while waiting:
            done, waiting = wait(waiting, None if self._stop is None else BETWEEN_POLLS, "FIRST_EXCEPTION")
            if any(future.exception() is not None for future in done):
                return
            poll_stop()

    def share(self, count: int) -> int:
        """Threads for each of `count` items that run at the same time."""
        return max(1, self.threads // max(1, count))

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()


def available_cpus() -> int:
    """Count the processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _start_booleans(threads: int) -> None:
    """Let manifold3d have no more threads of its own than we may use: idle ones spin, for a seventh of the CPU time.

    It counts the processors of the process when it is first used, and never again: only the first call matters, and
    only where a process can be given fewer of them.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    process = os.getpid()
    with contextlib.suppress(OSError):  # not allowed to: then it has as many as it likes
        allowed = os.sched_getaffinity(process)
        if threads < len(allowed):
            os.sched_setaffinity(process, set(sorted(allowed)[:threads]))
        try:
            Manifold.tetrahedron()
        finally:
            os.sched_setaffinity(process, allowed)
