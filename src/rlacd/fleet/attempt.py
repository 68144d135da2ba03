"""One mesh from its file to a row: tried in the worker at hand, once more alone, and at last its convex hull."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from rlacd.fleet.assets import Asset
from rlacd.fleet.order import Order
from rlacd.fleet.store import Store
from rlacd.fleet.work import Work
from rlacd.fleet.worker import Limits, Worker, WorkerDiedError

Status = Literal["done", "fallback", "failed"]

HULL_SECONDS = 60.0
"""A hull takes milliseconds; a limit meant for decompositions is not to stand in its way."""


@dataclass(frozen=True)
class Task:
    """A mesh that is to be done.

    Attributes
    ----------
    asset
        The mesh.
    key
        Of its result.
    """

    asset: Asset
    key: str

    @property
    def stem(self) -> str:
        """What its result's file or folder is called."""
        return PurePosixPath(self.asset.place).name


@dataclass
class Outcome:
    """What became of a mesh.

    Attributes
    ----------
    status
        ``fallback``: its convex hull stands in for a decomposition.
    report
        What is said of the hulls.
    error
        Why there is no decomposition.
    unusable
        Whether the mesh is at fault: then there is no hull either.
    files
        What is to be written, by name relative to the results.
    outputs
        What was written: the length of each file.
    timing
        What differs from run to run: ``seconds`` and ``cpu`` of the mesh, ``peak_mb`` and name of its ``worker``,
        and where it died once, ``attempts``, why it ``died``, and its ``last_words``.
    """

    status: Status
    report: dict[str, Any] = field(default_factory=dict)
    error: str | None = None
    unusable: bool = False
    files: dict[str, bytes] = field(default_factory=dict)
    outputs: dict[str, int] = field(default_factory=dict)
    timing: dict[str, Any] = field(default_factory=dict)

    def put(self, store: Store) -> Outcome:
        """Write the files, the one that names others last."""
        for name, data in self.files.items():
            store.write(name, data)
            self.outputs[name] = len(data)
        self.files = {}
        return self


def attempt(worker: Worker, order: Order, task: Task, path: Path, *, hull_only: bool = False) -> Outcome:
    """Have a worker do a mesh.

    Raises
    ------
    WorkerDiedError
        It ended, or had to be ended, before it was done.
    """
    said, files = worker.run(order, path, task.asset.name, task.stem, hull_only)
    parent = PurePosixPath(task.asset.place).parent
    timing = {"seconds": said["seconds"], "cpu": said["cpu"], "peak_mb": said["peak_mb"], "worker": worker.name}
    if "error" in said:
        return Outcome("failed", error=said["error"], unusable=said.get("unusable", False), timing=timing)
    placed = {str(parent / name): data for name, data in files.items()}
    return Outcome("done", said["report"], files=placed, timing=timing)


def second_chance(work: Work, task: Task, path: Path, died: WorkerDiedError) -> Outcome:
    """Do a mesh whose worker died once more, in a process of its own."""
    with fresh(work.limits) as worker:
        try:
            outcome = attempt(worker, work.order, task, path)
        except WorkerDiedError as error:
            outcome = Outcome("failed", error=error.reason)
            died = error
    outcome.timing |= {"attempts": 2, "died": died.reason, "last_words": died.last_words}
    return outcome


def or_hull(outcome: Outcome, work: Work, task: Task, path: Path) -> Outcome:
    """Give a mesh that failed its convex hull instead, if it may have one and not even that fails."""
    if outcome.status != "failed" or outcome.unusable or not work.fallback:
        return outcome
    patient = replace(work.limits, seconds=max(work.limits.seconds, HULL_SECONDS))
    with fresh(patient) as worker, contextlib.suppress(WorkerDiedError):
        hull = attempt(worker, work.order, task, path, hull_only=True)
        if hull.status == "done":
            timing = {**hull.timing, **outcome.timing}
            return Outcome("fallback", hull.report, outcome.error, files=hull.files, timing=timing)
    return outcome


@contextlib.contextmanager
def fresh(limits: Limits) -> Iterator[Worker]:
    """A worker for one mesh."""
    worker = Worker(limits)
    try:
        yield worker
    finally:
        worker.close()
