"""The time a decomposition takes and when it has to stop: stages, timeout, progress, cancel."""

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
"""Seconds after a stop, and share of the timeout, that writing up the result may take, and seconds it has in any case;
then what can be left out is. The promise is 1 s and 10 %: the rest is for what cannot be left out."""

_T = TypeVar("_T")


class Clock:
    """Seconds per stage, and whether the work has to stop.

    Work is stopped in two ways: between steps, where `step` returns False; and in the middle of one, where kernels and
    whatever else asks `rlacd._native.poll_stop` raise `Stopped`, as long as the clock is `running`. Whoever can go on
    from an interrupted step with what was reached before catches it and calls `note_stop`.

    Parameters
    ----------
    timeout : float or None
        Seconds after which `stopped_by` becomes "timeout".
    progress : callable or None
        Told about every step, and several times a second in long ones; when it returns False, `stopped_by` becomes
        "cancel".
    work : Work, optional
        What may be done; without bound by default. When it is spent, steps say so.
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
        self._nothing_left_to_stop = False
        self._end = math.inf  # of writing up, once there is nothing left to stop

    @contextmanager
    def running(self) -> Iterator[None]:
        """Let the clock stop what this thread does inside, in the middle of steps too."""
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
        """Leave no more than so many units of work to what is done inside; running out of them is not the end."""
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
        """Report a step of the current stage; True when the work may go on."""
        self._done, self._total, self._parts = done, total, parts
        if self.stopped_by is None:
            told_to_stop = (
                self._progress is not None
                and self._progress(Progress(self._stage, done, total, parts, self.elapsed)) is False
            )
            if self._nothing_left_to_stop:
                if told_to_stop:
                    self._hurry()
                return True
            if (self._timeout is not None and self.elapsed > self._timeout) or self.stop.is_tripped:
                self._stop_by("timeout")
            elif told_to_stop:
                self._stop_by("cancel")
        return self._nothing_left_to_stop or (self.stopped_by is None and not self.work.is_spent)

    def goes_on(self) -> bool:
        """Whether the work may go on, between two steps."""
        return self.step(self._done, self._total, self._parts)

    def note_stop(self) -> None:
        """Record that a step was interrupted."""
        if self.stopped_by is None:
            self._stop_by("timeout")

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Do what has to be done, in a stopped decomposition too: nothing raises `Stopped` inside."""
        self.stop.shield(True)
        try:
            yield
        finally:
            self.stop.shield(False)

    def nothing_left_to_stop(self) -> None:
        """Say that the decomposition is reached: from here on the work is only written up, and cannot be incomplete.

        For that there is some time after a stop, and after the timeout; then `if_in_time` gives up.
        """
        self._nothing_left_to_stop = True
        self._end = math.inf if self._timeout is None else self._timeout * (1 + GRACE_SHARE) + GRACE
        if self.stopped_by == "cancel":
            self._end = min(self._end, self.elapsed + GRACE)
        self.stop.arm(max(self._end - self.elapsed, LEAST_GRACE))

    def if_in_time(self, work: Callable[[], _T], otherwise: Callable[[], _T]) -> _T:
        """Do some work; where there is no time left for it, something quick that is not interrupted."""
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
        self.stopped_by, self.stopped_in = reason, self._stage
        self.stop.trip()

    def _look(self) -> None:
        self.goes_on()
