"""The engine of one machine: a thread a worker process; meshes whose worker died are tried again at the end, alone."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from typing import TypeAlias

from rlacd.errors import OptionError
from rlacd.fleet.attempt import Outcome, Task, attempt, or_hull, second_chance
from rlacd.fleet.work import Work
from rlacd.fleet.worker import Worker, WorkerDiedError

_Done: TypeAlias = tuple[Task, Outcome]


class LocalEngine:
    """Worker processes on this machine.

    Parameters
    ----------
    jobs : int
        How many.

    Raises
    ------
    OptionError
        `jobs` is not positive.
    """

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise OptionError(f"jobs is {jobs!r}; it has to be at least 1.")
        self._jobs = jobs
        self._workers: list[Worker] = []
        self._closed = threading.Event()

    def run(self, tasks: Iterator[Task], work: Work) -> Iterator[_Done]:
        """See `rlacd.fleet.batch.Engine`."""
        died: list[tuple[Task, WorkerDiedError]] = []
        answers: queue.SimpleQueue[_Done | BaseException | None] = queue.SimpleQueue()
        taking = threading.Lock()

        def serve(worker: Worker) -> None:
            try:
                while not self._closed.is_set():
                    with taking:
                        task = next(tasks, None)
                    if task is None:
                        break
                    try:
                        outcome = attempt(worker, work.order, task, task.asset.path)
                    except WorkerDiedError as error:
                        died.append((task, error))
                        continue
                    answers.put((task, or_hull(outcome, work, task, task.asset.path).put(work.store)))
            except BaseException as error:
                answers.put(error)
            finally:
                worker.close()
                answers.put(None)

        self._workers = [Worker(work.limits) for _ in range(self._jobs)]
        for worker in self._workers:
            threading.Thread(target=serve, args=(worker,), daemon=True).start()
        yield from _answers(answers, self._jobs)
        for task, error in died:
            if work.stop.is_set():
                break
            outcome = second_chance(work, task, task.asset.path, error)
            yield task, or_hull(outcome, work, task, task.asset.path).put(work.store)

    def close(self) -> None:
        """End all workers."""
        self._closed.set()
        for worker in self._workers:
            worker.close()


def _answers(answers: queue.SimpleQueue[_Done | BaseException | None], threads: int) -> Iterator[_Done]:
    while threads:
        answer = answers.get()
        if answer is None:
            threads -= 1
        elif isinstance(answer, BaseException):
            raise answer
        else:
            yield answer
