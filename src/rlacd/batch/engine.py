"""Runs all meshes through a pool: as many at a time as it has room for, each written as it finishes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, TypeAlias

from rlacd.batch.context import BatchContext
from rlacd.batch.pipeline import MeshOutcome, MeshTask, Pipeline, pipeline
from rlacd.pool import Answer, Pool, Request, WorkerDiedError

POLL_SECONDS = 1.0
"""Seconds between checks for free room in the pool."""

WRITERS = 4
"""Results written concurrently; each waits for the disk, not for a processor."""

_Running: TypeAlias = tuple[MeshTask, Pipeline]


class Engine:
    """Runs mesh tasks to completion.

    Parameters
    ----------
    pool : Pool
    work : BatchContext
    """

    def __init__(self, pool: Pool, work: BatchContext) -> None:
        self._pool, self._work = pool, work
        self._submitted: dict[Future[Answer], _Running] = {}
        self._writing: dict[Future[MeshOutcome], MeshTask] = {}
        self._last: deque[tuple[_Running, Request]] = deque()
        self._writers = ThreadPoolExecutor(WRITERS)

    def run(self, tasks: Iterator[MeshTask]) -> Iterator[tuple[MeshTask, MeshOutcome]]:
        """Run tasks in any order; the files in an outcome's ``outputs`` are in the store when it is yielded.

        Tasks are taken from the iterator only as the pool has room for them.

        Raises
        ------
        OutputError
            A result cannot be written.
        """
        with self._writers:
            while True:
                self._begin(tasks)
                if not (self._submitted or self._writing or self._begin_last()):
                    return
                waiting: list[Future[Any]] = [*self._submitted, *self._writing]
                wait(waiting, POLL_SECONDS, FIRST_COMPLETED)
                for written in [future for future in self._writing if future.done()]:
                    yield self._writing.pop(written), written.result()
                for future in [future for future in self._submitted if future.done()]:
                    self._advance(self._submitted.pop(future), _answer(future))

    def _begin(self, tasks: Iterator[MeshTask]) -> None:
        room = max(1, self._pool.room // self._work.spec.threads)
        while len(self._submitted) < room and len(self._writing) < WRITERS + room:
            if (task := next(tasks, None)) is None:
                return
            self._advance((task, pipeline(task, self._work, brought=self._pool.many_machines)), None)

    def _begin_last(self) -> bool:
        """Start one of the deferred meshes, which run alone; call only when nothing else is running."""
        if not self._last or self._work.stop.is_set():
            return False
        running, request = self._last.popleft()
        self._submitted[self._pool.submit(request)] = running
        return True

    def _advance(self, running: _Running, answer: Answer | WorkerDiedError | None) -> None:
        task, steps = running
        try:
            step = next(steps) if answer is None else steps.send(answer)
        except StopIteration as end:
            outcome: MeshOutcome = end.value
            self._writing[self._writers.submit(outcome.put, self._work)] = task
            return
        if step.last and not self._pool.many_machines:
            self._last.append((running, step.request))
        else:
            self._submitted[self._pool.submit(step.request)] = running


def _answer(done: Future[Answer]) -> Answer | WorkerDiedError:
    try:
        return done.result()
    except WorkerDiedError as died:
        return died
