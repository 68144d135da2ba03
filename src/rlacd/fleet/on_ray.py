"""The engine of many machines: every mesh is a task of Ray, which finds it a machine, and another if that one is lost.

On each machine a mesh is done as on one: in a worker process with limits, watched by the process that Ray runs. The
cluster needs no file system in common: a task brings the bytes of its mesh, and results at an address (``s3://...``)
are written by the machine that made them; those for a folder come back, since a folder is one machine's own.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rlacd import __version__
from rlacd.errors import MeshFileError, MissingExtraError, OptionError, RlacdError
from rlacd.fleet.assets import Asset
from rlacd.fleet.attempt import Outcome, Task, attempt, or_hull, second_chance
from rlacd.fleet.order import Order
from rlacd.fleet.store import open_store
from rlacd.fleet.work import Work
from rlacd.fleet.worker import Limits, Worker, WorkerDiedError

LOCAL = "local"
"""The address of a cluster that is this machine alone."""

LOST = 5
"""Machines a mesh may be lost with before it is given up."""

QUEUE = 2
"""Tasks handed over per processor: one to work on, and one so that nobody waits for the next."""

RECOUNT = 10.0
"""Seconds between two looks at how many processors there are."""


ANSWER = 10.0
"""Seconds in which a cluster has to answer."""


class RayEngine:
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
        _require_answer(address)
        self._ray = ray
        self._ours = not ray.is_initialized()
        self._running: dict[Any, Task] = {}
        if self._ours:
            size = {"num_cpus": jobs, "include_dashboard": False} if address == LOCAL else {}
            try:
                ray.init(address=address, log_to_driver=False, logging_level="ERROR", **size)
            except (ConnectionError, ValueError, RuntimeError) as error:
                reason = (str(error).strip().splitlines() or ["no answer"])[0]
                raise OptionError(
                    f"there is no Ray cluster at {address} ({reason}); start one or use local."
                ) from error

    def run(self, tasks: Iterator[Task], work: Work) -> Iterator[tuple[Task, Outcome]]:
        """See `rlacd.fleet.batch.Engine`."""
        ray = self._ray
        most = max((node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"]), default=0)
        if 0 < most < work.order.threads:
            raise OptionError(f"no machine of the cluster has {work.order.threads} processors; ask for fewer threads.")
        setting = ray.put(_setting(work))
        remote = ray.remote(num_cpus=work.order.threads, max_retries=LOST, retry_exceptions=False)(_do)
        room, counted, more = 0, -RECOUNT, True
        while more or self._running:
            if time.monotonic() - counted > RECOUNT:
                processors = ray.cluster_resources().get("CPU", 0)
                room, counted = max(1, int(QUEUE * processors / work.order.threads)), time.monotonic()
            while more and len(self._running) < room:
                task = next(tasks, None)
                if task is None:
                    more = False
                    break
                try:
                    content = task.asset.files()
                except MeshFileError as error:
                    yield task, Outcome("failed", error=str(error), unusable=True)
                    continue
                self._running[remote.remote(setting, task.asset.name, task.asset.place, task.key, content)] = task
            ready, _ = ray.wait(list(self._running), num_returns=1, timeout=1.0) if self._running else ([], [])
            for done in ready:
                yield self._running.pop(done), self._outcome(done).put(work.store)

    def close(self) -> None:
        """End the tasks, and the cluster if it was started here."""
        for task in self._running:
            self._ray.cancel(task, force=True)
        self._running.clear()
        if self._ours:
            self._ray.shutdown()

    def _outcome(self, done: Any) -> Outcome:
        exceptions = self._ray.exceptions
        try:
            return Outcome(**self._ray.get(done))
        except exceptions.RayTaskError as error:
            cause = getattr(error, "cause", None)
            raise (cause if isinstance(cause, RlacdError) else error) from error
        except exceptions.RayError:
            return Outcome("failed", error=f"it was lost with its machine {LOST + 1} times")


def _require_answer(address: str) -> None:
    """Find out in seconds whether anyone is there; Ray itself tries for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdecimal()):
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER).close()
    except (OSError, OverflowError) as error:
        raise OptionError(f"there is no Ray cluster at {address} ({error}); start one or use local.") from error


def _setting(work: Work) -> dict[str, Any]:
    """What is the same for all tasks, once in the object store."""
    policy = work.order.policy_file()
    return {
        "version": __version__,
        "order": work.order.as_plain(),
        "limits": asdict(work.limits),
        "fallback": work.fallback,
        "out": work.out if work.store.shared else None,
        "weights": None if policy is None else policy.read_bytes(),
    }


_worker: Worker | None = None
_policies = TemporaryDirectory(prefix="rlacd-policy-")


def _do(setting: dict[str, Any], name: str, place: str, key: str, content: dict[str, bytes]) -> dict[str, Any]:
    """Do one mesh on whatever machine this is; plain values in and out."""
    global _worker
    if setting["version"] != __version__:
        raise OptionError(
            f"a machine of the cluster has rlacd {__version__}, not {setting['version']}: install the same everywhere."
        )
    limits = Limits(**setting["limits"])
    if _worker is None or _worker.limits != limits:
        _worker = Worker(limits)
    with TemporaryDirectory(prefix="rlacd-") as folder:
        order, path = Order(**setting["order"]), Path(folder, "mesh", next(iter(content)))
        if setting["weights"] is not None:
            order = order.with_policy(_policy(order.weights, setting["weights"]))
        for file, data in content.items():
            target = path.parent / file
            if target.resolve().is_relative_to(path.parent.resolve()):
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(data)
        task, store = Task(Asset(name, path, place), key), open_store(setting["out"] or folder)
        work = Work(order, limits, setting["fallback"], "", store)
        try:
            outcome = attempt(_worker, order, task, path)
        except WorkerDiedError as error:
            outcome = second_chance(work, task, path, error)
        outcome = or_hull(outcome, work, task, path)
        if setting["out"] is not None:
            outcome.put(store)
    return asdict(outcome)


def _policy(digest: str, network: bytes) -> Path:
    """Put a network where it stays as long as this process, so that the worker reads it once."""
    path = Path(_policies.name, f"{digest}.onnx")
    if not path.exists():
        path.write_bytes(network)
    return path
