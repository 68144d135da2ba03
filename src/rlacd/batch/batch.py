"""Many meshes: what is finished is passed over, the rest goes through a pool, and every outcome becomes a row."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from rlacd.batch.assets import EVERYTHING, Asset, content_hash, find_assets
from rlacd.batch.context import BatchContext
from rlacd.batch.engine import Engine
from rlacd.batch.job_spec import JobSpec
from rlacd.batch.ledger import Ledger, Row
from rlacd.batch.pipeline import MeshOutcome, MeshTask
from rlacd.batch.store import FolderStore, ResultStore, open_store
from rlacd.errors import MeshFileError, OptionError
from rlacd.pool import Pool, ProcessLimits

MANIFEST, TIMINGS = "manifest.jsonl", "timings.jsonl"

Redo = Literal["none", "failed", "all"]
REDO: tuple[Redo, ...] = ("none", "failed", "all")


LARGE = 5_000_000
"""Bytes of 100,000 triangles in a binary STL file: larger meshes may take longer than the others by far."""


class Watcher(Protocol):
    """Is told how the work goes on."""

    def begin(self, meshes: int) -> None:
        """So many meshes were found."""

    def passed_over(self, asset: Asset) -> None:
        """The mesh's result is there already."""

    def finished(self, row: Row, timing: Row) -> None:
        """A mesh has its row."""


@dataclass
class Summary:
    """How a run went.

    Attributes
    ----------
    meshes
        How many were found.
    passed_over
        How many had their result already; whatever it is, it is counted in `status` too.
    status
        How many meshes there are of each status by now.
    stopped
        Whether the run was stopped before the last mesh.
    seconds
        Wall time.
    failures
        Rows of the meshes found that failed or were given their hull.
    slowest
        Names and seconds of the slowest meshes of this run.
    """

    meshes: int
    passed_over: int = 0
    status: Counter[str] = field(default_factory=Counter)
    stopped: bool = False
    seconds: float = 0.0
    failures: list[Row] = field(default_factory=list)
    slowest: list[tuple[str, float]] = field(default_factory=list)


@dataclass(frozen=True)
class Batch:
    """A folder of meshes and where their results go.

    Attributes
    ----------
    assets
        Folder of the meshes.
    out
        Folder or address of the results.
    order
        What is done to each mesh.
    limits
        What each may take.
    fallback
        Whether a mesh that fails is given its convex hull.
    glob
        Which of the meshes; see `find_assets`.
    redo
        Which results are made again: none, those that failed, or all.
    """

    assets: Path
    out: str
    order: JobSpec
    limits: ProcessLimits = field(default_factory=ProcessLimits)
    fallback: bool = True
    glob: str = EVERYTHING
    redo: Redo = "none"

    def large(self) -> list[tuple[Asset, int]]:
        """List the meshes to do whose files hold more than `LARGE` bytes, with their sizes, the largest first.

        Raises
        ------
        RlacdError
            As for `run`.
        """
        sizes = [(asset, asset.path.stat().st_size) for asset in self._find() if asset.path.exists()]
        return sorted((entry for entry in sizes if entry[1] > LARGE), key=lambda entry: (-entry[1], entry[0].name))

    def plan(self) -> list[tuple[Asset, bool]]:
        """List all meshes, and whether the result of each is there; writes nothing.

        Raises
        ------
        RlacdError
            As for `run`.
        """
        assets, store = self._find(), open_store(self.out)
        manifest = Ledger(store, MANIFEST)
        return [(asset, self._task(asset, manifest, store)[1]) for asset in assets]

    def run(self, pool: Pool, watcher: Watcher, stop: threading.Event | None = None) -> Summary:
        """Do all meshes that are not done.

        Parameters
        ----------
        pool : Pool
            Where meshes are done.
        watcher : Watcher
        stop : threading.Event, optional
            Once it is set no further mesh is begun.

        Returns
        -------
        Summary

        Raises
        ------
        MeshFileError
            There are no meshes.
        OptionError
            The results would lie among the meshes.
        OutputError
            The results cannot be written, or another run is writing there.
        """
        assets, store = self._find(), open_store(self.out)
        store.open()
        try:
            shared = self.order.shared()
            work = BatchContext(
                self.order, self.limits, self.fallback, self.out, store, stop or threading.Event(), shared
            )
            return self._run(assets, work, pool, watcher)
        finally:
            store.close()

    def _run(self, assets: list[Asset], work: BatchContext, pool: Pool, watcher: Watcher) -> Summary:
        summary, start = Summary(len(assets)), time.monotonic()
        manifest, timings = Ledger(work.store, MANIFEST), Ledger(work.store, TIMINGS)
        seen: list[str] = []

        def waiting() -> Iterator[MeshTask]:
            for asset in assets:
                if work.stop.is_set():
                    return
                task, finished = self._task(asset, manifest, work.store)
                if finished:
                    summary.passed_over += 1
                    seen.append(asset.name)
                    watcher.passed_over(asset)
                else:
                    yield task

        watcher.begin(len(assets))
        try:
            for task, outcome in Engine(pool, work).run(waiting()):
                row = self._row(task, outcome)
                timing = {"mesh": task.asset.name, **outcome.timing}
                timings.add(timing)
                manifest.add(row)
                seen.append(task.asset.name)
                watcher.finished(row, timing)
                spent = (task.asset.name, float(timing.get("seconds", 0.0)))
                summary.slowest = sorted([*summary.slowest, spent], key=lambda entry: -entry[1])[:3]
        except BaseException:
            manifest.close()
            timings.close()
            raise
        manifest.finish()
        timings.finish()
        rows = [found for name in sorted(seen) if (found := manifest.get(name)) is not None]
        summary.status = Counter(row["status"] for row in rows)
        summary.failures = [row for row in rows if row["status"] != "done"]
        summary.stopped = len(seen) < len(assets)
        summary.seconds = time.monotonic() - start
        return summary

    def _find(self) -> list[Asset]:
        store = open_store(self.out)
        here = store.folder if isinstance(store, FolderStore) else None
        if here is not None and here.resolve() == self.assets.resolve():
            raise OptionError(f"the results would lie among the meshes of {self.assets}; choose another folder.")
        assets = find_assets(self.assets, self.glob, here)
        if not assets:
            which = "" if self.glob == EVERYTHING else f" whose name fits {self.glob!r}"
            raise MeshFileError(
                f"there is no mesh{which} in {self.assets}; give a folder with obj, stl, glb, ... files."
            )
        return assets

    def _task(self, asset: Asset, manifest: Ledger, store: ResultStore) -> tuple[MeshTask, bool]:
        """A mesh with the key of its result, and whether that is there."""
        try:
            content = content_hash(asset.files())
        except MeshFileError as error:  # what is wrong with the file is then said by whoever loads it
            content = str(error)
        task = MeshTask(asset, self.order.key(content, asset.name))
        return task, self.redo != "all" and self._is_finished(task, manifest.get(asset.name), store)

    def _is_finished(self, task: MeshTask, row: Row | None, store: ResultStore) -> bool:
        if row is None or row.get("key") != task.key or row.get("place") != task.asset.place:
            return False  # where a result is put depends on the meshes beside it
        status = row.get("status")
        if status != "done" and (self.redo == "failed" or row.get("limits") != self._refusal()):
            return False
        return status is not None and all(store.size(name) == size for name, size in row.get("outputs", {}).items())

    def _row(self, task: MeshTask, outcome: MeshOutcome) -> Row:
        """All that does not differ from run to run."""
        row: Row = {"mesh": task.asset.name, "status": outcome.status, "place": task.asset.place, "key": task.key}
        if outcome.error is not None:
            row |= {"error": outcome.error, "limits": self._refusal()}
        return {**row, **outcome.report, "outputs": dict(sorted(outcome.outputs.items()))}

    def _refusal(self) -> Row:
        """On what a failure rests: with other limits it may be none."""
        return {"seconds": self.limits.seconds, "memory": self.limits.memory, "fallback": self.fallback}
