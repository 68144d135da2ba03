"""What each thread of a run did, when and for how long, in the trace format that Chrome and Perfetto show."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Literal, TypeVar

from rlacd.errors import OutputError

_R = TypeVar("_R")
_Begun = TypeVar("_Begun", bound=Hashable)

Kind = Literal["run", "stage", "map", "item", "begin", "begun", "wait"]
"""Items belong to the map of that time; what is begun has the number with which it is waited for."""


class Trace:
    """Spans of work, kept if there is a file for them."""

    def __init__(self, path: str = "") -> None:
        self._path = path
        self._spans: list[dict[str, Any]] = []
        self._numbers: dict[Hashable, int] = {}
        if path:
            try:
                Path(path).open("a").close()  # before the work: writing comes after it
            except OSError as error:
                raise OutputError(f"cannot write the trace {path} ({error.strerror}): correct RLACD_TRACE.") from error

    @contextmanager
    def span(self, kind: Kind, name: str, number: int | None = None) -> Iterator[None]:
        """Record what is done inside: wall and CPU time."""
        if not self._path:
            yield
            return
        start, used = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            times = {"ts": start, "dur": time.perf_counter() - start, "tts": used, "tdur": time.thread_time() - used}
            where = {"pid": os.getpid(), "tid": threading.get_ident(), "name": name, "cat": kind, "ph": "X"}
            microseconds = {key: round(1e6 * seconds, 1) for key, seconds in times.items()}
            self._spans.append(where | microseconds | {"args": {"number": number}})

    def each(self, name: str, function: Callable[..., _R]) -> Callable[..., _R]:
        """The function, with a span for each item it is called for."""
        return self.span("item", name)(function) if self._path else function

    def begin(self, name: str, work: Callable[[], _R], start: Callable[[Callable[[], _R]], _Begun]) -> _Begun:
        """Start some work."""
        if not self._path:
            return start(work)
        number = len(self._numbers)
        with self.span("begin", name, number):
            begun = start(self.span("begun", name, number)(work))
        self._numbers[begun] = number
        return begun

    def wait(self, name: str, begun: Hashable) -> AbstractContextManager[None]:
        """The span of waiting for something."""
        return self.span("wait", name, self._numbers.get(begun))

    def write(self) -> None:
        """Write the spans to the file."""
        if self._path:
            Path(self._path).write_text(json.dumps({"traceEvents": self._spans}))
