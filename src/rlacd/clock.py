"""The time a decomposition takes and when it has to stop: stages, timeout, progress, cancel."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

from rlacd.progress import Progress, ProgressCallback

StoppedBy = Literal["timeout", "cancel"]


class Clock:
    """Seconds per stage, and whether the work has to stop.

    Parameters
    ----------
    timeout : float or None
        Seconds after which `stopped_by` becomes "timeout".
    progress : callable or None
        Told about every step; when it returns False, `stopped_by` becomes "cancel".
    """

    def __init__(self, timeout: float | None = None, progress: ProgressCallback | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self.stopped_by: StoppedBy | None = None
        self.stopped_in: str | None = None
        self._timeout = timeout
        self._progress = progress
        self._start = time.perf_counter()
        self._stage = ""
        self._done = self._parts = 0
        self._total: int | None = None
        self._nothing_left_to_stop = False

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the time inside towards stage `name`."""
        self._stage = name
        start = time.perf_counter()
        self.step(0, None, self._parts)
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self._start

    def step(self, done: int, total: int | None, parts: int) -> bool:
        """Report a step of the current stage; True when the work may go on."""
        self._done, self._total, self._parts = done, total, parts
        if self.stopped_by is None:
            told_to_stop = (
                self._progress is not None
                and self._progress(Progress(self._stage, done, total, parts, self.elapsed)) is False
            )
            if self._nothing_left_to_stop:
                return True
            if self._timeout is not None and self.elapsed > self._timeout:
                self.stopped_by = "timeout"
            elif told_to_stop:
                self.stopped_by = "cancel"
            if self.stopped_by is not None:
                self.stopped_in = self._stage
        return self.stopped_by is None

    def goes_on(self) -> bool:
        """Whether the work may go on, between two steps."""
        return self.step(self._done, self._total, self._parts)

    def nothing_left_to_stop(self) -> None:
        """Say that the decomposition is reached: from here on the work is only written up, and cannot be incomplete."""
        self._nothing_left_to_stop = True
