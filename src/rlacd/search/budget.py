"""The time and work a search may take, within the limits of the whole decomposition."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rlacd.clock import Clock
from rlacd.work import Work


class SearchBudget(Clock):
    """A clock nested in another: when it runs out, the search ends but the decomposition is not cut short.

    Parameters
    ----------
    clock : Clock
        The outer clock; it handles timeout, progress and cancellation.
    seconds : float or None
        Wall time available; unlimited if None.
    parts : int
        Number of parts so far, reported to the outer clock.
    patient : bool
        Ignore the time limit until `hurry` is called.
    work : Work, optional
        The work allowed; unlimited by default.
    """

    def __init__(
        self, clock: Clock, seconds: float | None, parts: int, patient: bool = False, work: Work | None = None
    ) -> None:
        super().__init__(work=work)
        self._outer = clock
        self._end = math.inf if seconds is None else time.perf_counter() + seconds
        self.parts = parts
        self.steps = 0
        self._patient = patient

    @property
    def is_over(self) -> bool:
        """Whether the search has to stop: the outer clock was stopped, or the time or the work is used up."""
        return self._outer.stopped_by is not None or self.left <= 0 or self.work.is_spent

    @property
    def left(self) -> float:
        """Seconds left on this clock; infinite if there is no time limit."""
        return math.inf if self._patient else self._end - time.perf_counter()

    def hurry(self) -> None:
        """From now on, limit time instead of work."""
        self._patient = False
        done, self.work = self.work.done, Work()
        self.work.pay(done)

    def trial(self, units: float) -> Clock:
        """Get a clock for one of several parallel trials: the seconds left, and a separate work account of `units`."""
        return Clock(self.left if math.isfinite(self.left) else None, work=Work(units))

    def step(self, done: int, total: int | None, parts: int) -> bool:
        """Report to the outer clock; True if the search may continue."""
        return self._outer.step(self.steps, None, self.parts) and not self.is_over

    def note_stop(self) -> None:
        """Forward the stop to the outer clock."""
        self._outer.note_stop()

    @contextmanager
    def share(self, among: int) -> Iterator[None]:
        """Limit the time inside the context to 1 / `among` of the time left."""
        end = self._end
        now = time.perf_counter()
        self._end = now + (end - now) / among
        try:
            yield
        finally:
            self._end = end
