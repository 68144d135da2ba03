"""One mesh from its file to its results: in a shared process, again in a new one, and as its convex hull."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

from rlacd.batch.assets import Asset
from rlacd.batch.server import SERVER
from rlacd.batch.store import Store
from rlacd.errors import MeshFileError, OutputNameError
from rlacd.pool import Pool, Request, TimeLimitError, WorkerDiedError
from rlacd.report import COVERAGE_TOLERANCE

if TYPE_CHECKING:
    from rlacd.batch.batch import Batch

Status = Literal["done", "warned", "uncovered", "fallback", "failed"]

FAILED = ("fallback", "failed")
"""Statuses of meshes without a decomposition."""

HULL_SECONDS = 60.0
"""A hull takes milliseconds; a time limit meant for decompositions must not prevent it."""


@dataclass(frozen=True)
class Work:
    """What all meshes of a run share."""

    batch: Batch
    store: Store
    """The folder of results."""
    pool: Pool
    """Where meshes are processed."""
    owns: Callable[[str], bool]
    """Tells of a file among the results whether an earlier run wrote it."""


@dataclass(frozen=True)
class Task:
    """A mesh to process, and the key of its result."""

    asset: Asset
    key: str


@dataclass
class Outcome:
    """Outcome of a mesh."""

    status: Status
    """``warned``: with warnings; ``uncovered``: hulls miss some of the surface;
    ``fallback``: its convex hull replaces the decomposition."""
    report: dict[str, Any] = field(default_factory=dict)
    """Facts about the hulls."""
    error: str | None = None
    """Why the decomposition failed."""
    unusable: bool = False
    """Whether the mesh itself is at fault; then there is no fallback either."""
    name_taken: bool = False
    """Whether its result could not be written for its name; it is tried again by every run."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Files still to be written, by name relative to the results."""
    outputs: dict[str, int] = field(default_factory=dict)
    """Length of each file written."""
    timing: dict[str, Any] = field(default_factory=dict)
    """What differs between runs: ``seconds`` and ``cpu`` of the mesh, ``peak_mb`` and the name of its ``worker``; if
    its process died, also the number of ``attempts``, why it ``died``, and its ``last_words``."""

    def put(self, work: Work) -> Outcome:
        """Write the files; a name that cannot be used fails this mesh only."""
        try:
            outputs = work.store.put(self.files, work.owns)
        except OutputNameError as error:
            said = str(error).replace(f"{work.store.folder}{os.sep}", "")  # the same wherever the results are
            return Outcome("failed", error=said, name_taken=True, timing=self.timing)
        return replace(self, files={}, outputs=outputs)


def process(task: Task, work: Work, died: WorkerDiedError | None = None) -> Outcome:
    """Take a mesh to its outcome; waits for the pool.

    Parameters
    ----------
    task : Task
    work : Work
    died : WorkerDiedError, optional
        How an earlier attempt ended: the last one is made in a new process.

    Raises
    ------
    WorkerDiedError
        Its process died, and another attempt may succeed.
    """
    elsewhere, spec = work.pool.many_machines, work.batch.spec
    if elsewhere and task.asset.is_robot:
        return Outcome("failed", error="robots are not sent to other machines; leave out --ray", unusable=True)
    try:
        path, files = (None, task.asset.files()) if elsewhere else (str(task.asset.path), {})
    except MeshFileError as error:
        return Outcome("failed", error=str(error), unusable=True)
    name, stem = task.asset.name, PurePosixPath(task.asset.place).name
    home = str((work.store.folder / task.asset.place).absolute().parent)
    values = {"spec": asdict(spec), "path": path, "name": name, "stem": stem, "home": home, "hull_only": False}
    blobs = files | spec.network
    request = Request(SERVER, values, blobs, work.batch.limits, spec.options["threads"], died is not None)
    outcome, last = _attempt(request, task, work.pool)
    if last is not None and died is None and not isinstance(last, TimeLimitError):
        raise last
    if outcome.status == "failed" and not outcome.unusable and work.batch.fallback:
        outcome = _as_hull(outcome, request, task, work.pool, isinstance(last, TimeLimitError))
    deaths = [death for death in (died, last) if death is not None]
    if deaths:
        spent = outcome.timing.get("seconds", 0.0) + sum(death.seconds for death in deaths)
        outcome.timing |= {"seconds": round(spent, 4), "attempts": 1 if died is None else 2}
        outcome.timing |= {"died": deaths[-1].reason, "last_words": deaths[-1].last_words}
    return outcome


def _attempt(request: Request, task: Task, pool: Pool) -> tuple[Outcome, WorkerDiedError | None]:
    """The outcome of one request, and how its process died."""
    try:
        answer = pool.submit(request).result()
    except WorkerDiedError as died:
        return Outcome("failed", error=died.reason), died
    values = answer.values
    timing = {**{what: values[what] for what in ("seconds", "cpu", "peak_mb")}, "worker": answer.worker}
    if "error" in values:
        return Outcome("failed", error=values["error"], unusable=values["unusable"], timing=timing), None
    parent = PurePosixPath(task.asset.place).parent
    files = {str(parent / name): data for name, data in answer.blobs.items()}
    return Outcome(_status(values["report"]), values["report"], files=files, timing=timing), None


def _status(report: dict[str, Any]) -> Status:
    if (report.get("hausdorff", {}).get("missed") or 0.0) > COVERAGE_TOLERANCE:
        return "uncovered"
    return "warned" if report["warnings"] else "done"


def _as_hull(failed: Outcome, request: Request, task: Task, pool: Pool, lost_time: bool) -> Outcome:
    """The mesh as its convex hull; as it failed if that fails too."""
    seconds = HULL_SECONDS if lost_time else max(request.limits.seconds, HULL_SECONDS)
    limits, values = replace(request.limits, seconds=seconds), {**request.values, "hull_only": True}
    hull, _ = _attempt(replace(request, values=values, limits=limits, fresh=True), task, pool)
    if hull.status == "failed":
        return failed
    return replace(hull, status="fallback", error=failed.error, timing={**hull.timing, **failed.timing})
