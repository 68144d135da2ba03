"""The pool of many machines: every request is a Ray task; Ray picks the machine, and another if that one is lost.

On each machine a request runs as in a local pool: in a worker process with limits, watched by Ray's process.

Any Ray from 2.40 on will do. The tests keep to 2.46 (`constraints-dev.txt`), the last that can be told to wait longer
than 15 seconds for a node to start.
"""

from __future__ import annotations

import os
import socket
from concurrent.futures import Future
from typing import Any

from rlacd._version import __version__
from rlacd.errors import OptionError, import_extra
from rlacd.pool import Answer, Pool, ProcessLimits, Request, Values, WorkerDiedError
from rlacd.pool.local import Worker

LOCAL = "local"
"""The address of a cluster on this machine alone."""

MACHINES = 5
"""Times a request is resent after its machine was lost."""

CLUSTER_SECONDS = 10.0
"""Seconds allowed for a cluster to answer."""


class RayPool(Pool):
    """Tasks on a cluster.

    Parameters
    ----------
    address : str
        Cluster address, as ``ray.init`` takes it: ``local`` for one on this machine, ``auto``, ``ray://host:10001``.
    jobs : int, optional
        Number of processors of a local cluster; all by default.

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    OptionError
        There is no cluster at the address, or `jobs` is given for an existing cluster.
    """

    many_machines = True

    def __init__(self, address: str, jobs: int | None = None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # disables usage reports
        ray = import_extra("ray", "a cluster", "fleet")
        if jobs is not None and address != LOCAL:
            raise OptionError("--jobs is for one machine; Ray decides how many processes a cluster runs.")
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
                raise OptionError(f"there is no Ray cluster at {address} ({reason}); use local.") from error
        self._remote = ray.remote(max_retries=MACHINES, retry_exceptions=False)(_do)
        self._running: set[Any] = set()

    @property
    def room(self) -> int:
        """Single-threaded requests worth submitting at once; clusters grow and shrink."""
        processors = self._ray.cluster_resources().get("CPU", 0)
        return max(1, int(2 * processors))  # one running, and one queued so that the processor never waits

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`.

        Raises
        ------
        OptionError
            No machine has enough processors.
        """
        self._require_processors(request.threads)
        plain = {name: getattr(request, name) for name in ("server", "values", "blobs", "fresh", "tries")}
        limits = (request.limits.seconds, request.limits.memory)
        task = self._remote.options(num_cpus=request.threads).remote(__version__, plain, limits)
        self._running.add(task)
        future: Future[Answer] = Future()
        future.set_running_or_notify_cancel()
        task.future().add_done_callback(lambda done: self._finish(task, done, future))
        return future

    def close(self) -> None:
        """Stop the tasks, and the cluster if it was started here."""
        for task in list(self._running):
            self._ray.cancel(task, force=True)
        self._running.clear()
        if self._ours:
            self._ray.shutdown()

    def _finish(self, task: Any, done: Future[Any], future: Future[Answer]) -> None:
        self._running.discard(task)
        exceptions = self._ray.exceptions
        try:
            future.set_result(Answer(*done.result()))
        except exceptions.RayTaskError as error:
            future.set_exception(getattr(error, "cause", None) or error)
        except exceptions.RayError:
            future.set_exception(WorkerDiedError(f"it was lost with its machine {MACHINES + 1} times"))
        except BaseException as error:
            future.set_exception(error)

    def _require_processors(self, threads: int) -> None:
        if threads == 1:
            return
        most = max((node["Resources"].get("CPU", 0) for node in self._ray.nodes() if node["Alive"]), default=0)
        if 0 < most < threads:
            raise OptionError(f"no machine of the cluster has {threads} processors; ask for fewer threads.")


def _require_answer(address: str) -> None:
    """Fail within seconds if no cluster answers; Ray itself keeps trying for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdecimal()):
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=CLUSTER_SECONDS).close()
    except (OSError, OverflowError) as error:
        raise OptionError(f"there is no Ray cluster at {address} ({error}); start one or use local.") from error


_worker = Worker()


def _do(version: str, plain: Values, limits: tuple[float, int]) -> tuple[Values, dict[str, bytes], str]:
    """Run a request on the current machine, with plain values in and out."""
    if version != __version__:
        raise OptionError(f"a machine of the cluster has rlacd {__version__}, not {version}: install the same.")
    answer = _worker.ask(Request(**plain, limits=ProcessLimits(*limits)))
    return answer.values, answer.blobs, answer.worker
