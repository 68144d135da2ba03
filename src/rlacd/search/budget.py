"""The time a search may take, within that of the whole decomposition."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rlacd.clock import Clock
from rlacd.work import Work


class SearchBudget(Clock):
    """A clock within another: it runs out sooner, and that is not an early end of the work.

    Parameters
    ----------
    clock : Clock
        Timeout, progress and cancel are its own.
    seconds : float or None
        Wall time that is left.
    parts : int
        Told to the other clock as the number of parts so far.
    patient : bool
        Time does not matter until `hurry` is called.
    work : Work, optional
        What may be done; without bound by default.
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
        """Whether the work has to stop, for this clock or for the other."""
        return self._outer.stopped_by is not None or self.left <= 0 or self.work.is_spent

    @property
    def left(self) -> float:
        """Seconds left on this clock; infinite where it never runs out."""
        return math.inf if self._patient else self._end - time.perf_counter()

    def hurry(self) -> None:
        """Let time matter from now on, and work no longer."""
        self._patient = False
        done, self.work = self.work.done, Work()
        self.work.pay(done)

    def trial(self, units: float) -> Clock:
        """Get a clock for one of several trials made side by side: the seconds left, and an account of its own."""
        return Clock(self.left if math.isfinite(self.left) else None, work=Work(units))

    def step(self, done: int, total: int | None, parts: int) -> bool:
        """Report to the other clock; True when the work may go on."""
        return self._outer.step(self.steps, None, self.parts) and not self.is_over

    def note_stop(self) -> None:
        """Tell the other clock."""
        self._outer.note_stop()

    @contextmanager
    def share(self, among: int) -> Iterator[None]:
        """Leave only an equal share of the time that is left to what is done inside."""
        end = self._end
        now = time.perf_counter()
        self._end = now + (end - now) / among
        try:
            yield
        finally:
            self._end = end
