"""Timing and stopping a decomposition: stages, timeout, progress, cancellation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal, TypeVar

from rlacd._native import Stop, Stopped, use_stop
from rlacd.progress import Progress, ProgressCallback
from rlacd.work import Work

StoppedBy = Literal["timeout", "cancel"]

GRACE, GRACE_SHARE, LEAST_GRACE = 0.4, 0.04, 0.1
"""After a stop, writing up the result may take `GRACE` seconds plus `GRACE_SHARE` of the timeout, and always at least
`LEAST_GRACE` seconds; then optional work is skipped. After a cancellation it may take half as long: the command line
then still has to write files. The promise is 1 s and 10 %: the rest is for what cannot be skipped."""

_T = TypeVar("_T")


class Clock:
    """Measures seconds per stage and decides when the work has to stop.

    Work is stopped in two ways: between steps, `step` returns False; within a step, kernels and all other code that
    calls `rlacd._native.poll_stop` raise `Stopped` while the clock is `running`. Code that can continue with the result
    of earlier steps catches it and calls `note_stop`.

    Parameters
    ----------
    timeout : float or None
        Seconds after which `stopped_by` becomes "timeout".
    progress : callable or None
        Called at every step, and several times a second during long ones; when it returns False, `stopped_by` becomes
        "cancel".
    work : Work, optional
        The work allowed; unlimited by default. When it is spent, `step` returns False.
    """

    def __init__(
        self, timeout: float | None = None, progress: ProgressCallback | None = None, work: Work | None = None
    ) -> None:
        self.work = work or Work()
        self.seconds: dict[str, float] = {}
        self.stopped_by: StoppedBy | None = None
        self.stopped_in: str | None = None
        self.cut_short: set[str] = set()  # stages that ran out of their allowance of work
        self.stop = Stop()
        self._timeout = timeout
        self._progress = progress
        self._start = time.perf_counter()
        self._stage = ""
        self._done = self._parts = 0
        self._total: int | None = None
        self._stopped_at = math.inf
        self._nothing_left_to_stop = False
        self._end = math.inf  # deadline for writing up, set once there is nothing left to stop

    @contextmanager
    def running(self) -> Iterator[None]:
        """Let the clock interrupt what this thread does inside, within steps too."""
        before = use_stop(self.stop)
        self.stop.begin(self._look)
        self.stop.arm(math.inf if self._timeout is None else self._timeout - self.elapsed)
        try:
            yield
        finally:
            self.stop.end()
            use_stop(before)

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

    @contextmanager
    def allowance(self, units: float) -> Iterator[None]:
        """Limit the work inside the context to `units`; running out of them does not end the work outside."""
        account = self.work
        self.work = Work(min(units, account.left))
        try:
            yield
        finally:
            if self.work.is_spent:
                self.cut_short.add(self._stage)
            account.pay(self.work.done)
            self.work = account

    def step(self, done: int, total: int | None, parts: int) -> bool:
        """Report a step of the current stage; True if the work may continue."""
        self._done, self._total, self._parts = done, total, parts
        if self.stopped_by is None:
            go_on = self._progress and self._progress(Progress(self._stage, done, total, parts, self.elapsed))
            cancelled = go_on is not None and not go_on
            if self._nothing_left_to_stop:
                if cancelled:
                    self._hurry()
                return True
            if (self._timeout is not None and self.elapsed > self._timeout) or self.stop.is_tripped:
                self._stop_by("timeout")
            elif cancelled:
                self._stop_by("cancel")
        return self._nothing_left_to_stop or (self.stopped_by is None and not self.work.is_spent)

    def may_continue(self) -> bool:
        """Report the last step again; True if the work may continue."""
        return self.step(self._done, self._total, self._parts)

    def note_stop(self) -> None:
        """Record that a step was interrupted."""
        if self.stopped_by is None:
            self._stop_by("timeout")

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Run work that must be completed even after a stop: nothing raises `Stopped` inside."""
        self.stop.shield(True)
        try:
            yield
        finally:
            self.stop.shield(False)

    def nothing_left_to_stop(self) -> None:
        """Declare the decomposition finished: from here on it is only written up, and a stop cannot make it incomplete.

        Writing up has some extra time after a stop or the timeout (see `GRACE`); then `if_in_time` takes its fallback.
        """
        self._nothing_left_to_stop = True
        self._end = math.inf if self._timeout is None else self._timeout * (1 + GRACE_SHARE) + GRACE
        if self.stopped_by == "cancel":
            self._end = min(self._end, self._stopped_at + GRACE / 2)
        self.stop.arm(max(self._end - self.elapsed, LEAST_GRACE))

    def if_in_time(self, work: Callable[[], _T], otherwise: Callable[[], _T]) -> _T:
        """Do some work; if there is no time left for it, do something quick instead, without interruption."""
        try:
            return work()
        except Stopped:
            with self.shielded():
                return otherwise()

    def _hurry(self) -> None:
        if self.elapsed + GRACE < self._end:
            self._end = self.elapsed + GRACE
            self.stop.arm(GRACE)

    def _stop_by(self, reason: StoppedBy) -> None:
        self.stopped_by, self.stopped_in, self._stopped_at = reason, self._stage, self.elapsed
        self.stop.trip()

    def _look(self) -> None:
        self.may_continue()
