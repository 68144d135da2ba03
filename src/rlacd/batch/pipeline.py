"""One mesh from its file to a row: tried in the process at hand, once more alone, and at last its convex hull."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any, Literal, TypeAlias

from rlacd.batch.assets import Asset
from rlacd.batch.context import BatchContext
from rlacd.batch.server import SERVER
from rlacd.batch.store import put_files, under
from rlacd.errors import MeshFileError
from rlacd.pool import Answer, MachineLostError, Request, WorkerDiedError

Status = Literal["done", "fallback", "failed"]

HULL_SECONDS = 60.0
"""A hull takes milliseconds; a limit meant for decompositions is not to stand in its way."""


@dataclass(frozen=True)
class MeshTask:
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

    @property
    def parent(self) -> str:
        """Where its result goes."""
        return str(PurePosixPath(self.asset.place).parent)


@dataclass
class MeshOutcome:
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

    def put(self, work: BatchContext) -> MeshOutcome:
        """Write the files."""
        self.outputs |= put_files(work.store, self.files)
        self.files = {}
        return self


@dataclass(frozen=True)
class Step:
    """What a mesh needs next.

    Attributes
    ----------
    request
        For the pool.
    last
        Whether it should wait until all other meshes of this machine are done, and then be alone on it.
    """

    request: Request
    last: bool = False


Pipeline: TypeAlias = Generator[Step, "Answer | WorkerDiedError", MeshOutcome]


def pipeline(task: MeshTask, work: BatchContext, *, brought: bool) -> Pipeline:
    """Take a mesh to its outcome: yields what it needs, and is sent what came of that.

    Parameters
    ----------
    task : Task
    work : Work
    brought : bool
        Whether the mesh's files travel with every request, and results for a shared place are written where they are
        made.
    """
    try:
        request = _request(task, work, brought)
    except MeshFileError as error:
        return MeshOutcome("failed", error=str(error), unusable=True)
    died = None
    answer = yield Step(request)
    if isinstance(answer, WorkerDiedError) and not isinstance(answer, MachineLostError):
        died = answer
        answer = yield Step(replace(request, fresh=True), last=True)
    outcome = _outcome(answer, task)
    if outcome.status == "failed" and not outcome.unusable and work.fallback:
        patient = replace(work.limits, seconds=max(work.limits.seconds, HULL_SECONDS))
        values = {**request.values, "hull_only": True}
        hull = _outcome((yield Step(replace(request, values=values, limits=patient, fresh=True))), task)
        if hull.status == "done":
            outcome = replace(hull, status="fallback", error=outcome.error, timing={**hull.timing, **outcome.timing})
    if died is not None:
        last = answer if isinstance(answer, WorkerDiedError) else died
        outcome.timing |= {"attempts": 2, "died": last.reason, "last_words": last.last_words}
    return outcome


def _request(task: MeshTask, work: BatchContext, brought: bool) -> Request:
    values = {
        "order": work.order.as_plain(),
        "path": None if brought else str(task.asset.path),
        "name": task.asset.name,
        "stem": task.stem,
        "parent": task.parent,
        "hull_only": False,
        "out": work.out if brought and work.store.shared else None,
    }
    files = task.asset.files() if brought else {}
    return Request(SERVER, values, files, work.shared, work.limits, work.order.threads)


def _outcome(answer: Answer | WorkerDiedError, task: MeshTask) -> MeshOutcome:
    if isinstance(answer, WorkerDiedError):
        return MeshOutcome("failed", error=answer.reason)
    said = answer.values
    timing = {**{what: said[what] for what in ("seconds", "cpu", "peak_mb")}, "worker": answer.worker}
    if "error" in said:
        return MeshOutcome("failed", error=said["error"], unusable=said.get("unusable", False), timing=timing)
    files = under(task.parent, answer.blobs)
    return MeshOutcome("done", said["report"], files=files, outputs=said.get("outputs", {}), timing=timing)
