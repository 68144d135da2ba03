"""One decomposition under way: its threads, its time, its work, and when it has to stop."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from concurrent.futures import TimeoutError as NotYet
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from itertools import count
from typing import Any, Generic, Literal, TypeAlias, TypeVar

from manifold3d import Manifold

from rlacd._native import Stop, Stopped, poll_stop, use_stop
from rlacd.run.trace import Trace
from rlacd.run.work import Work


@dataclass(frozen=True)
class Progress:
    """One report from a running decomposition, sent between two steps.

    Attributes
    ----------
    stage : str
        What is being done: a key of ``Decomposition.report.seconds``.
    done : int
        Steps of this stage finished so far.
    total : int or None
        Steps of this stage in all; None where that cannot be known beforehand, as in all stages of a decomposition.
    parts : int
        Components the solid is in now.
    seconds : float
        Wall time since the decomposition began.
    """

    stage: str
    done: int
    total: int | None
    parts: int
    seconds: float


ProgressCallback = Callable[[Progress], object]
"""Called between steps and several times a second in long ones. To stop and keep what was reached it returns False, or
anything else that counts as false; None, as from a function that returns nothing, goes on."""


StoppedBy = Literal["timeout", "cancel"]

FINISH, FINISH_SHARE = 0.4, 0.04
LEAST_FINISH = FINISH / 4
"""After a stop, finishing may take `FINISH` seconds plus `FINISH_SHARE` of the timeout, and always at least
`LEAST_FINISH` seconds; then optional work is skipped. After a cancellation it may take half as long: the command line
then still has to write files. The promise is 1 s and 10%: the rest is for what cannot be skipped."""

_T = TypeVar("_T")
_R = TypeVar("_R")

Begun: TypeAlias = "Future[_R] | Callable[[], _R]"
"""Some work under way on another thread, or still to do on this one."""


@dataclass(frozen=True, eq=False)
class Apart(Generic[_R]):
    """Some work under way, and its own account."""

    account: Work
    begun: Begun[_R]


class Run:
    """Threads, time and work of one decomposition; a context that has to be entered before it is used.

    Work stops in two ways: between steps, `step` returns False; within a step, kernels and all other code that calls
    `rlacd._native.poll_stop` raise `Stopped`. Only `until_stopped` and `if_in_time` catch it.

    Parameters
    ----------
    threads : int, optional
        All processors by default. No result depends on it.
    timeout : float, optional
        Seconds after which `stopped_by` becomes "timeout".
    progress : callable, optional
        Called at every step, and several times a second during long ones; when it returns anything false but None,
        `stopped_by` becomes "cancel".

    Attributes
    ----------
    work : Work
        The account that pays for what is being done.
    seconds : dict of str to float
        Wall time of each stage so far.
    stopped_by : "timeout", "cancel" or None
        Why the run was stopped.
    stopped_in : str or None
        The stage in which that happened.
    cut_short : set of str
        Stages that ended because their work was used up.
    """

    def __init__(
        self,
        threads: int | None = None,
        timeout: float | None = None,
        progress: ProgressCallback | None = None,
    ) -> None:
        self.threads = threads or available_cpus()
        self.work = Work()
        self.seconds: dict[str, float] = {}
        self.stopped_by: StoppedBy | None = None
        self.stopped_in: str | None = None
        self.cut_short: set[str] = set()
        self.stop = Stop()
        self._timeout = math.inf if timeout is None else timeout
        self._progress = progress
        self._start = time.perf_counter()
        self._end = math.inf  # of the innermost time limit
        self._stage = ""
        self._done = self._parts = 0
        self._is_quiet = self._is_finishing = False
        self._stopped_at = self._finish_by = math.inf
        self._outer: Run | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._trace = Trace()

    def __enter__(self) -> Run:
        _start_booleans(self.threads)
        self._trace = Trace(os.environ.get("RLACD_TRACE", ""))
        self._whole = self._trace.span("run", "run")
        self._whole.__enter__()
        self._pool = ThreadPoolExecutor(self.threads, initializer=use_stop, initargs=(self.stop,))
        self._before = use_stop(self.stop)
        self.stop.begin(self.may_continue)
        self.stop.arm(self._timeout - self.elapsed)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop.end()
        use_stop(self._before)
        assert self._pool is not None
        self._pool.shutdown()
        self._whole.__exit__(None, None, None)
        self._trace.write()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the time inside towards stage `name`."""
        outer, start = self._stage, time.perf_counter()
        self._stage = outer if self._is_quiet else name
        self.step(0, self._parts)
        try:
            with self._trace.span("stage", name):
                yield
        finally:
            self._stage = outer
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self._start

    @property
    def is_over(self) -> bool:
        """Whether the work has to end: the run was stopped, or the time or the work allowed for it is used up."""
        stopped = self.stopped_by if self._outer is None else self._outer.stopped_by
        return stopped is not None or self.work.is_spent or time.perf_counter() >= self._end

    @contextmanager
    def limited(self, units: float = math.inf, seconds: float = math.inf, cuts: str | None = None) -> Iterator[None]:
        """Limit the work and the seconds inside; using them up does not end the work outside.

        Parameters
        ----------
        units : float
            Of work (see `rlacd.run.work`).
        seconds : float
        cuts : str, optional
            A stage to add to `cut_short` if the work is used up.
        """
        account, end = self.work, self._end
        self.work, self._end = Work(min(units, account.left)), min(end, time.perf_counter() + seconds)
        try:
            yield
        finally:
            if self.work.is_spent and cuts is not None:
                self.cut_short.add(cuts)
            account.pay(self.work.done)
            self.work, self._end = account, end

    @contextmanager
    def quietly(self) -> Iterator[None]:
        """Report the last step again in place of the steps inside."""
        before, self._is_quiet = self._is_quiet, True
        try:
            yield
        finally:
            self._is_quiet = before

    def apart(self, function: Callable[[Run], _R], units: float = math.inf) -> Apart[_R]:
        """`start` some work with a run of a single thread, and an account of `units` of its own that nobody pays."""
        own = Run(1)
        own.work, own._end, own._outer = Work(units), self._end, self
        return Apart(own.work, self.start(partial(function, own)))

    def abandon(self, apart: Iterable[Apart[Any]]) -> None:
        """Let work end at its next step, and wait for it."""
        apart = [*apart]
        for each in apart:
            each.account.close()
        self.drop([each.begun for each in apart])

    def step(self, done: int, parts: int) -> bool:
        """Report a step of the current stage; True if the work may continue."""
        if self._outer is not None:
            return not self.is_over
        if not self._is_quiet:
            self._done, self._parts = done, parts
        self._ask_caller()
        return self._is_finishing or not self.is_over

    def may_continue(self) -> bool:
        """Report the last step again; True if the work may continue."""
        return self.step(self._done, self._parts)

    @contextmanager
    def until_stopped(self) -> Iterator[None]:
        """Leave what is inside when a stop interrupts it, and record that; what it reached so far is gone on with."""
        try:
            yield
        except Stopped:
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

    @contextmanager
    def hurried(self, seconds: float) -> Iterator[None]:
        """After a stop, give what is inside some seconds before it is interrupted again."""
        self.stop.arm(seconds)
        try:
            yield
        finally:
            self.stop.trip()

    def begin_finishing(self) -> None:
        """Declare the parts found: from here on a stop cannot make the result incomplete.

        Finishing has some extra time after a stop or the timeout (see `FINISH`); then `if_in_time` takes its fallback.
        """
        self._is_finishing = True
        self._finish_by = self._timeout * (1 + FINISH_SHARE) + FINISH
        if self.stopped_by == "cancel":
            self._finish_by = min(self._finish_by, self._stopped_at + FINISH / 2)
        self.stop.arm(max(self._finish_by - self.elapsed, LEAST_FINISH))

    def if_in_time(self, work: Callable[[], _T], otherwise: Callable[[], _T]) -> _T:
        """Do some work; if there is no time left for it, do something quick instead, without interruption."""
        try:
            return work()
        except Stopped:
            with self.shielded():
                return otherwise()

    def map(self, function: Callable[[_T], _R], items: Iterable[_T]) -> list[_R]:
        """Apply `function` to every item; results come in the order of the items, whatever the number of threads.

        When an exception leaves this, no thread works on any of them any more.
        """
        items = list(items)
        results: list[Any] = [None] * len(items)
        numbers, end = count(), len(items)
        function = self._trace.each(self._stage, function)

        def work() -> None:
            nonlocal end
            try:
                while (i := next(numbers)) < end:
                    poll_stop()
                    results[i] = function(items[i])
            except BaseException:
                end = 0
                raise

        others: list[Future[None]] = []
        try:
            if self._pool is not None and self.threads > 1:
                others += (self._pool.submit(work) for _ in range(min(self.threads, len(items)) - 1))
            with self._trace.span("map", self._stage):
                work()
                others = [other for other in others if not other.cancel()]  # those behind other work come too late
                self._watch(others)
            for other in others:
                other.result()
        except BaseException as error:
            if not isinstance(error, (Exception, Stopped)):  # Ctrl-C does not wait
                self.stop.trip()
            self.drop(others)
            raise
        return results

    def start(self, function: Callable[[], _R]) -> Begun[_R]:
        """Begin some work on another thread; where there is only this one, it is done when its result is asked for."""
        return self._trace.begin(self._stage, function, self._started)

    def _started(self, function: Callable[[], _R]) -> Begun[_R]:
        return self._pool.submit(function) if self._pool is not None and self.threads > 1 else function

    def result(self, begun: Begun[_R]) -> _R:
        """Wait for what was begun."""
        with self._trace.wait(self._stage, begun):
            if not isinstance(begun, Future):
                return begun()
            self._watch([begun])
        return begun.result()

    @staticmethod
    def drop(begun: Iterable[Begun[_R]]) -> None:
        """Leave undone what has not been begun in earnest, and wait for the rest."""
        wait([each for each in begun if isinstance(each, Future) and not each.cancel()])

    @staticmethod
    def _watch(futures: Sequence[Future[_R]]) -> None:
        """Wait until all are done; only this thread can look whether they have to stop."""
        for future in futures:
            while not future.done():
                with contextlib.suppress(NotYet):
                    future.exception(0.05)
                poll_stop()

    def _ask_caller(self) -> None:
        """Report the last step, and note if the caller or the clock wants an end."""
        if self.stopped_by is not None:
            return
        answer = None
        if self._progress is not None:
            answer = self._progress(Progress(self._stage, self._done, None, self._parts, self.elapsed))
        cancelled = answer is not None and not answer
        if self._is_finishing:
            if cancelled:
                self._hurry()
        elif self.elapsed > self._timeout or self.stop.is_tripped:
            self._stop_by("timeout")
        elif cancelled:
            self._stop_by("cancel")

    def _hurry(self) -> None:
        if self.elapsed + FINISH < self._finish_by:
            self._finish_by = self.elapsed + FINISH
            self.stop.arm(FINISH)

    def _stop_by(self, reason: StoppedBy) -> None:
        self.stopped_by, self.stopped_in, self._stopped_at = reason, self._stage, self.elapsed
        self.stop.trip()


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
