"""Several components at a time: the kernels release the GIL, so plain threads do."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from manifold3d import Manifold

_T = TypeVar("_T")
_R = TypeVar("_R")


class Workers:
    """A pool of threads whose results come in the order of the items, whatever their number."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or available_cpus()
        _start_booleans(self.threads)
        self._pool = ThreadPoolExecutor(self.threads)

    def map(self, function: Callable[[_T], _R], items: Iterable[_T]) -> list[_R]:
        """Apply `function` to every item."""
        items = list(items)
        if self.threads == 1 or len(items) < 2:
            return [function(item) for item in items]
        return list(self._pool.map(function, items))

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
