"""Retries: a process may have died because of an earlier request or of other processes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import replace
from typing import TypeVar

from rlacd.pool.request import Answer, MachineLostError, Pool, Request, TimeLimitError, WorkerDiedError

_K = TypeVar("_K")

AHEAD = 2
"""Requests submitted per free place, so that no process waits for the next one."""


def submit_with_retry(pool: Pool, request: Request) -> Future[Answer]:
    """Submit a request; if its process dies before its time is up, retry once in a new one. See `Pool.submit`."""
    outcome: Future[Answer] = Future()
    outcome.set_running_or_notify_cancel()

    def settle(done: Future[Answer], last: bool) -> None:
        try:
            outcome.set_result(done.result())
        except WorkerDiedError as died:
            if last or isinstance(died, MachineLostError | TimeLimitError):
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
    """Submit many requests, each with one retry; yields each answer or death as it arrives.

    Parameters
    ----------
    pool : Pool
    requests : iterable of (key, Request)
        Taken only as the pool has room for them.

    Raises
    ------
    RlacdError
        Raised by a server.
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
