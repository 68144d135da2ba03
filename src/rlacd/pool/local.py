"""The pool of one machine: a thread watches each worker process."""

from __future__ import annotations

import queue
import threading
from concurrent.futures import Future
from types import TracebackType

from rlacd.errors import OptionError
from rlacd.pool.request import Answer, Request
from rlacd.pool.worker import Worker

PATIENCE = 10.0
"""Seconds for threads to notice that their processes have ended."""


class LocalPool:
    """Worker processes on this machine.

    Parameters
    ----------
    jobs : int
        Number of processes.

    Raises
    ------
    OptionError
        `jobs` is not positive.
    """

    many_machines = False

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise OptionError(f"jobs is {jobs!r}; it has to be at least 1.")
        self.room = jobs
        self._waiting: queue.SimpleQueue[tuple[Request, Future[Answer]] | None] = queue.SimpleQueue()
        self._closed = False
        self._workers = [Worker() for _ in range(jobs)]
        self._threads = [threading.Thread(target=self._serve, args=(w,), daemon=True) for w in self._workers]
        for thread in self._threads:
            thread.start()

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`."""
        future: Future[Answer] = Future()
        self._waiting.put((request, future))
        return future

    def close(self) -> None:
        """See `Pool`."""
        self._closed = True
        for worker in self._workers:
            worker.kill()
            self._waiting.put(None)
        for thread in self._threads:
            thread.join(PATIENCE)

    def __enter__(self) -> LocalPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _serve(self, worker: Worker) -> None:
        while (waiting := self._waiting.get()) is not None:
            request, future = waiting
            if self._closed:
                future.cancel()
            elif future.set_running_or_notify_cancel():
                try:
                    future.set_result(worker.ask(request))
                except BaseException as error:
                    future.set_exception(error)
        worker.close()
