"""One mesh from file to row: try it in a shared process, retry alone in a new one, and fall back to its convex hull."""

from __future__ import annotations

import os
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal, TypeAlias

from rlacd.batch.assets import Asset
from rlacd.batch.context import BatchContext
from rlacd.batch.server import SERVER
from rlacd.batch.store import put_files, under
from rlacd.errors import MeshFileError, OutputNameError
from rlacd.pool import Answer, MachineLostError, Request, TimeLimitError, WorkerDiedError

Status = Literal["done", "fallback", "failed"]

HULL_SECONDS = 60.0
"""A hull takes milliseconds; a time limit meant for decompositions must not prevent it."""


@dataclass(frozen=True)
class MeshTask:
    """A mesh to process.

    Attributes
    ----------
    asset
        The mesh.
    key
        Key of its result.
    """

    asset: Asset
    key: str

    @property
    def stem(self) -> str:
        """Name of its result's file or folder."""
        return PurePosixPath(self.asset.place).name

    @property
    def parent(self) -> str:
        """Folder of its result."""
        return str(PurePosixPath(self.asset.place).parent)


@dataclass
class MeshOutcome:
    """Outcome of a mesh.

    Attributes
    ----------
    status
        ``fallback``: its convex hull replaces the decomposition.
    report
        Facts about the hulls.
    error
        Why the decomposition failed.
    unusable
        Whether the mesh itself is at fault; then there is no fallback either.
    name_taken
        Whether its result could not be written for its name; it is tried again by every run.
    files
        Files still to be written, by name relative to the results.
    outputs
        Length of each file written.
    timing
        What differs between runs: ``seconds`` and ``cpu`` of the mesh, ``peak_mb`` and the name of its ``worker``;
        if its process died, also the number of ``attempts``, why it ``died``, and its ``last_words``.
    """

    status: Status
    report: dict[str, Any] = field(default_factory=dict)
    error: str | None = None
    unusable: bool = False
    name_taken: bool = False
    files: dict[str, bytes] = field(default_factory=dict)
    outputs: dict[str, int] = field(default_factory=dict)
    timing: dict[str, Any] = field(default_factory=dict)

    def put(self, work: BatchContext) -> MeshOutcome:
        """Write the files; a name that cannot be used fails this mesh only."""
        try:
            self.outputs |= put_files(work.store, self.files, work.owns)
        except OutputNameError as error:
            said = str(error).replace(f"{Path(work.out)}{os.sep}", "")  # the same wherever the results are
            return MeshOutcome("failed", error=said, name_taken=True, timing=self.timing)
        self.files = {}
        return self


@dataclass(frozen=True)
class Step:
    """The next step of a mesh.

    Attributes
    ----------
    request
        Request for the pool.
    last
        Whether it must wait until all other meshes on this machine are done, and then run alone.
    """

    request: Request
    last: bool = False


Pipeline: TypeAlias = Generator[Step, "Answer | WorkerDiedError", MeshOutcome]


def pipeline(task: MeshTask, work: BatchContext, *, brought: bool) -> Pipeline:
    """Take a mesh to its outcome: yields steps, and is sent the answer to each.

    Parameters
    ----------
    task : MeshTask
    work : BatchContext
    brought : bool
        Whether the mesh's files travel with every request, and results for a shared place are written by the process
        that made them.
    """
    if brought and task.asset.is_robot:
        return MeshOutcome("failed", error="robots are not sent to other machines; leave out --ray", unusable=True)
    try:
        request = _request(task, work, brought)
    except MeshFileError as error:
        return MeshOutcome("failed", error=str(error), unusable=True)
    answer = yield Step(request)
    deaths = [answer] if isinstance(answer, WorkerDiedError) else []
    attempts = 2 if deaths and not isinstance(answer, MachineLostError | TimeLimitError) else 1
    if attempts == 2:
        answer = yield Step(replace(request, fresh=True), last=True)
        deaths += [answer] if isinstance(answer, WorkerDiedError) else []
    outcome = _outcome(answer, task)
    if outcome.status == "failed" and not outcome.unusable and work.fallback:
        lost_time = isinstance(answer, TimeLimitError)
        limits = replace(work.limits, seconds=HULL_SECONDS if lost_time else max(work.limits.seconds, HULL_SECONDS))
        values = {**request.values, "hull_only": True}
        hull = _outcome((yield Step(replace(request, values=values, limits=limits, fresh=True))), task)
        if hull.status == "done":
            outcome = replace(hull, status="fallback", error=outcome.error, timing={**hull.timing, **outcome.timing})
    if deaths:
        spent = outcome.timing.get("seconds", 0.0) + sum(died.seconds for died in deaths)
        outcome.timing |= {"seconds": round(spent, 4), "attempts": attempts}
        outcome.timing |= {"died": deaths[-1].reason, "last_words": deaths[-1].last_words}
    return outcome


def _request(task: MeshTask, work: BatchContext, brought: bool) -> Request:
    values = {
        "spec": work.spec.as_plain(),
        "path": None if brought else str(task.asset.path),
        "name": task.asset.name,
        "stem": task.stem,
        "parent": task.parent,
        "hull_only": False,
        "out": work.out if brought and work.store.shared else None,
    }
    files = task.asset.files() if brought else {}
    return Request(SERVER, values, files, work.shared, work.limits, work.spec.threads)


def _outcome(answer: Answer | WorkerDiedError, task: MeshTask) -> MeshOutcome:
    if isinstance(answer, WorkerDiedError):
        return MeshOutcome("failed", error=answer.reason)
    values = answer.values
    timing = {**{what: values[what] for what in ("seconds", "cpu", "peak_mb")}, "worker": answer.worker}
    if "error" in values:
        return MeshOutcome("failed", error=values["error"], unusable=values.get("unusable", False), timing=timing)
    files = under(task.parent, answer.blobs)
    return MeshOutcome("done", values["report"], files=files, outputs=values.get("outputs", {}), timing=timing)
