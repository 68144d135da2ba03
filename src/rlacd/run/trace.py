"""What each thread of a run did, when and for how long, in the trace format that Chrome and Perfetto show.

`python -m benchmarks replay` tells from it what other numbers of cores would take.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeVar

from rlacd._native import kernel_times, time_kernels

_R = TypeVar("_R")

Kind = Literal["run", "stage", "map", "item", "begin", "begun", "wait"]
"""Items belong to the map of that time; what is begun is waited for in the same order."""


class Trace:
    """Spans of work, kept if there is a file for them."""

    def __init__(self, path: str = "") -> None:
        self._path = path
        self._spans: list[dict[str, Any]] = []
        if self._path:
            time_kernels(True)

    @contextmanager
    def span(self, kind: Kind, name: str) -> Iterator[None]:
        """Record what is done inside: wall and CPU time, and what `kernel_times` counts at both ends."""
        if not self._path:
            yield
            return
        start, used, kernels = time.perf_counter(), time.thread_time(), kernel_times()
        try:
            yield
        finally:
            times = {"ts": start, "dur": time.perf_counter() - start, "tts": used, "tdur": time.thread_time() - used}
            where = {"pid": os.getpid(), "tid": threading.get_ident(), "name": name, "cat": kind, "ph": "X"}
            microseconds = {key: round(1e6 * seconds, 1) for key, seconds in times.items()}
            self._spans.append(where | microseconds | {"args": {"begin": kernels, "end": kernel_times()}})

    def each(self, kind: Kind, name: str, function: Callable[..., _R]) -> Callable[..., _R]:
        """The function, with a span for each call."""
        return self.span(kind, name)(function) if self._path else function

    def write(self) -> None:
        """Write the spans to the file."""
        if self._path:
            Path(self._path).write_text(json.dumps({"traceEvents": self._spans}))
