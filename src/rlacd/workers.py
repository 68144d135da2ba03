"""Several components at a time: the kernels release the GIL, so plain threads do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_T = TypeVar("_T")
_R = TypeVar("_R")


class Workers:
    """A pool of threads whose results come in the order of the items, whatever their number."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or os.cpu_count() or 1
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
