"""Second chances: a process may have died of what it had done before, or of its neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import replace
from typing import TypeVar

from rlacd.pool.request import Answer, MachineLostError, Pool, Request, WorkerDiedError

_K = TypeVar("_K")

AHEAD = 2
"""Requests handed over for each that there is room for, so that no process waits for the next one."""


def submit_with_retry(pool: Pool, request: Request) -> Future[Answer]:
    """Have a request done, and if its process dies once more in a new one; see `Pool.submit`."""
    outcome: Future[Answer] = Future()
    outcome.set_running_or_notify_cancel()

    def settle(done: Future[Answer], last: bool) -> None:
        try:
            outcome.set_result(done.result())
        except WorkerDiedError as died:
            if last or isinstance(died, MachineLostError):
                outcome.set_exception(died)
            else:
                again(replace(request, fresh=True), last=True)
        except (CancelledError, Exception) as error:
            outcome.set_exception(error)

    def again(what: Request, last: bool) -> None:
        pool.submit(what).add_done_callback(lambda done: settle(done, last))

    again(request, last=False)
    return outcome


def answers(pool: Pool, requests: Iterable[tuple[_K, Request]]) -> Iterator[tuple[_K, Answer | WorkerDiedError]]:
    """Have many requests done, each with a second chance; yields what came of each as it comes.

    Parameters
    ----------
    pool : Pool
    requests : iterable of (key, Request)
        No more are taken than can be done soon.

    Raises
    ------
    RlacdError
        Whatever a server has raised.
    """
    waiting, asked = iter(requests), dict[Future[Answer], _K]()
    while True:
        while len(asked) < AHEAD * pool.room and (following := next(waiting, None)) is not None:
            key, request = following
            asked[submit_with_retry(pool, request)] = key
        if not asked:
            return
        for done in wait(asked, return_when=FIRST_COMPLETED).done:
            died = done.exception()
            yield asked.pop(done), died if isinstance(died, WorkerDiedError) else done.result()
