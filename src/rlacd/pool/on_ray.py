"""The pool of many machines: every request is a task of Ray, which finds it a machine, and another if that is lost.

On each machine a request is done as on one: in a worker process with limits, watched by the process that Ray runs. What
requests share lies in the object store once; a machine fetches it for the first process that has not been given it.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
import weakref
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any

from rlacd import __version__
from rlacd.errors import MissingExtraError, OptionError
from rlacd.pool.request import Answer, MachineLostError, ProcessLimits, Request, Shared
from rlacd.pool.worker import Worker

LOCAL = "local"
"""The address of a cluster that is this machine alone."""

LOST = 5
"""Machines a request may be lost with before the last one."""

QUEUE = 2
"""Requests handed over per processor: one to work on, and one so that nobody waits for the next."""

RECOUNT = 10.0
"""Seconds between two looks at how many processors there are."""

ANSWER = 10.0
"""Seconds in which a cluster has to answer."""


class RayPool:
    """Tasks on a cluster.

    Parameters
    ----------
    address : str
        Of the cluster, as ``ray.init`` takes it: ``local`` for one on this machine, ``auto``, ``ray://host:10001``.
    jobs : int, optional
        Processors of a local cluster, all by default.

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    OptionError
        There is no cluster at the address, or `jobs` is given for one that knows its own size.
    """

    many_machines = True

    def __init__(self, address: str, jobs: int | None = None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is sent anywhere
        try:
            import ray
        except ImportError as error:
            raise MissingExtraError(
                "a cluster needs an extra: run  pip install 'rlacd[fleet]'  and try again."
            ) from error
        if jobs is not None and address != LOCAL:
            raise OptionError("--jobs belongs to one machine; a cluster knows how many processors it has.")
        if jobs is not None and jobs < 1:
            raise OptionError(f"jobs is {jobs!r}; it has to be at least 1.")
        _require_answer(address)
        self._ray = ray
        self._ours = not ray.is_initialized()
        if self._ours:
            size = {"num_cpus": jobs, "include_dashboard": False} if address == LOCAL else {}
            try:
                ray.init(address=address, log_to_driver=False, logging_level="ERROR", **size)
            except (ConnectionError, ValueError, RuntimeError) as error:
                reason = (str(error).strip().splitlines() or ["no answer"])[0]
                raise OptionError(
                    f"there is no Ray cluster at {address} ({reason}); start one or use local."
                ) from error
        self._remote = ray.remote(max_retries=LOST, retry_exceptions=False)(_do)
        self._running: set[Any] = set()
        self._finishing = ThreadPoolExecutor(1)  # what Ray calls back must not call Ray, and a callback of ours may
        self._stored: weakref.WeakKeyDictionary[Shared, Any] = weakref.WeakKeyDictionary()
        self._processors, self._counted = 0.0, -RECOUNT

    @property
    def room(self) -> int:
        """Requests of one thread that are worth handing over at a time; clusters grow and shrink."""
        if time.monotonic() - self._counted > RECOUNT:
            self._processors = self._ray.cluster_resources().get("CPU", 0)
            self._counted = time.monotonic()
        return max(1, int(QUEUE * self._processors))

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`; the request is cheaper the less of it is not shared.

        Raises
        ------
        OptionError
            No machine has so many processors.
        """
        self._require_processors(request.threads)
        shared = {name: (given.key, [self._store(given)]) for name, given in request.shared.items()}
        plain = {name: getattr(request, name) for name in ("server", "values", "blobs", "fresh")}
        limits = (request.limits.seconds, request.limits.memory)
        task = self._remote.options(num_cpus=request.threads).remote(__version__, plain, shared, limits)
        self._running.add(task)
        future: Future[Answer] = Future()
        future.set_running_or_notify_cancel()
        task.future().add_done_callback(lambda done: self._hand_over(task, done, future))
        return future

    def close(self) -> None:
        """End the tasks, and the cluster if it was started here."""
        for task in list(self._running):
            self._ray.cancel(task, force=True)
        self._running.clear()
        if self._ours:
            self._ray.shutdown()

    def __enter__(self) -> RayPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _hand_over(self, task: Any, done: Future[Any], future: Future[Answer]) -> None:
        with contextlib.suppress(RuntimeError):  # the interpreter ends, and nobody waits
            self._finishing.submit(self._finish, task, done, future)

    def _finish(self, task: Any, done: Future[Any], future: Future[Answer]) -> None:
        self._running.discard(task)
        exceptions = self._ray.exceptions
        try:
            future.set_result(Answer(*done.result()))
        except exceptions.RayTaskError as error:
            future.set_exception(getattr(error, "cause", None) or error)
        except exceptions.RayError:
            future.set_exception(MachineLostError(f"it was lost with its machine {LOST + 1} times"))
        except BaseException as error:
            future.set_exception(error)

    def _store(self, shared: Shared) -> Any:
        if shared not in self._stored:
            self._stored[shared] = self._ray.put(dict(shared.blobs))
        return self._stored[shared]

    def _require_processors(self, threads: int) -> None:
        if threads == 1:
            return
        most = max((node["Resources"].get("CPU", 0) for node in self._ray.nodes() if node["Alive"]), default=0)
        if 0 < most < threads:
            raise OptionError(f"no machine of the cluster has {threads} processors; ask for fewer threads.")


def _require_answer(address: str) -> None:
    """Find out in seconds whether anyone is there; Ray itself tries for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdecimal()):
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER).close()
    except (OSError, OverflowError) as error:
        raise OptionError(f"there is no Ray cluster at {address} ({error}); start one or use local.") from error


_worker = Worker()
_fetched: dict[str, Shared] = {}


def _do(
    version: str, plain: dict[str, Any], shared: Mapping[str, tuple[str, list[Any]]], limits: tuple[float, int]
) -> tuple[dict[str, Any], dict[str, bytes], str]:
    """Do a request on whatever machine this is; plain values in and out."""
    global _fetched
    if version != __version__:
        raise OptionError(
            f"a machine of the cluster has rlacd {__version__}, not {version}: install the same everywhere."
        )
    _fetched = {name: _fetch(name, *given) for name, given in shared.items()}
    answer = _worker.ask(Request(**plain, shared=_fetched, limits=ProcessLimits(*limits)))
    return answer.values, answer.blobs, answer.worker


def _fetch(name: str, key: str, stored: list[Any]) -> Shared:
    """What is shared, from the object store unless this process has it; refs in lists are not fetched by Ray itself."""
    import ray

    if name in _fetched and _fetched[name].key == key:
        return _fetched[name]
    return Shared(ray.get(stored[0]), key)
