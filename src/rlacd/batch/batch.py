"""Run a batch: skip finished meshes, send the rest through a pool, and record a row for every outcome."""

from __future__ import annotations

import re
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from rlacd.batch.assets import EVERYTHING, MANIFEST, TIMINGS, Asset, content_hash, matches, scan
from rlacd.batch.job_spec import JobSpec
from rlacd.batch.manifest import Ledger, Row
from rlacd.batch.mesh import FAILED, Outcome, Task, Work, process
from rlacd.batch.store import Store
from rlacd.errors import MeshFileError, OptionError
from rlacd.pool import Pool, ProcessLimits, WorkerDiedError
from rlacd.report import kind_of

Redo = Literal["none", "failed", "all"]


_NUMBER = re.compile(r"\d[\d.,]*(e[+-]?\d+)?( (units|µm|mm|cm|m|ft)\b)?")

_CLAUSE = re.compile(r"[:;] | \(")

WRITERS = 4
"""Results written concurrently; each waits for the disk, not for a processor."""


class Watcher(Protocol):
    """Receives the progress of a batch."""

    def begin(self, meshes: int) -> None:
        """Report the number of meshes found."""

    def passed_over(self, asset: Asset) -> None:
        """Report a mesh whose result already exists."""

    def started(self, asset: Asset) -> None:
        """Report a mesh whose turn has come."""

    def finished(self, row: Row, timing: Row) -> None:
        """Report a mesh whose row is complete."""


@dataclass
class Summary:
    """Outcome of a run."""

    meshes: int
    """Number of meshes found."""
    passed_over: int = 0
    """Number of meshes whose result already existed, whatever its status; `status` counts them too."""
    status: Counter[str] = field(default_factory=Counter)
    """Number of meshes of each status at the end of the run."""
    stopped: bool = False
    """Whether the run was stopped before the last mesh."""
    seconds: float = 0.0
    """Wall time."""
    failures: list[Row] = field(default_factory=list)
    """Rows of the meshes found that failed or fell back to their convex hull."""
    uncovered: list[Row] = field(default_factory=list)
    """Rows of the meshes whose hulls miss some of the surface."""
    warnings: Counter[str] = field(default_factory=Counter)
    """How many meshes have each kind of warning: the first clause of one, with numbers and units left out."""
    slowest: list[tuple[str, float]] = field(default_factory=list)
    """Names and seconds of the slowest meshes of this run."""
    others: Counter[str] = field(default_factory=Counter)
    """Number of files that are not meshes, by ending."""


def _outcomes(work: Work, tasks: Iterator[Task], stop: threading.Event) -> Generator[tuple[Task, Outcome], None, None]:
    """Process tasks in any order, as the pool has room; an outcome is written before it is yielded.

    A mesh whose process died is tried again alone, after all others: on this machine they may have taken its memory.
    """
    running: dict[Future[Outcome], Task] = {}
    writing: dict[Future[Outcome], Task] = {}
    again: deque[tuple[Task, WorkerDiedError]] = deque()
    with ThreadPoolExecutor(1024) as threads:  # they start as needed, and wait for answers
        try:
            while True:
                room = max(1, work.pool.room // work.batch.spec.options["threads"])
                while len(running) < room and len(running) + len(writing) < room + WRITERS:
                    if (task := next(tasks, None)) is None:
                        break
                    running[threads.submit(process, task, work)] = task
                if again and not stop.is_set() and (work.pool.many_machines or not (running or writing)):
                    task, death = again.popleft()
                    running[threads.submit(process, task, work, death)] = task
                if not (running or writing):
                    return
                # Every second, since a cluster grows and shrinks.
                for done in wait([*running, *writing], 1.0, FIRST_COMPLETED).done:
                    if done in writing:
                        yield writing.pop(done), done.result()
                        continue
                    task = running.pop(done)
                    try:
                        writing[threads.submit(done.result().put, work)] = task
                    except WorkerDiedError as died:
                        again.append((task, died))
        except BaseException:
            work.pool.close()  # threads wait for it
            raise


def _kinds(warnings: Iterable[Sequence[str]]) -> Counter[str]:
    """How many meshes have each kind of warning, by the first clause of one of them, with numbers left out."""
    named: dict[str, str] = {}
    count = Counter[str]()
    for said in warnings:
        kinds = {kind_of(sentence): sentence for sentence in reversed(said)}
        for kind, sentence in sorted(kinds.items()):
            count[named.setdefault(kind, _NUMBER.sub("…", _CLAUSE.split(sentence, maxsplit=1)[0]))] += 1
    return count


@dataclass(frozen=True)
class Batch:
    """A folder of meshes and the folder of their results."""

    assets: Path
    """Folder of the meshes."""
    out: Path
    """Folder of the results."""
    spec: JobSpec
    """What is done to each mesh."""
    limits: ProcessLimits = field(default_factory=ProcessLimits)
    """Limits for each mesh."""
    fallback: bool = True
    """Whether a mesh that fails gets its convex hull instead."""
    glob: str = EVERYTHING
    """Pattern that selects meshes; see `find_assets`."""
    redo: Redo = "none"
    """Which existing results are recomputed: none, those that failed, or all."""
    shard: tuple[int, int] = (1, 1)
    """Which one, from 1, of how many parts of the meshes is done."""

    def plan(self) -> list[tuple[Asset, bool]]:
        """List all meshes, and whether the result of each exists; writes nothing.

        Raises
        ------
        RlacdError
            As for `run`.
        """
        store = Store(self.out, self.shard)
        manifest = Ledger(store, MANIFEST)
        return [(asset, self._task(asset, manifest, store)[1]) for asset in self._find()[0]]

    def run(self, pool: Pool, watcher: Watcher, stop: threading.Event | None = None) -> Summary:
        """Process all meshes whose result does not exist yet.

        Parameters
        ----------
        pool : Pool
            Where meshes are processed.
        watcher : Watcher
        stop : threading.Event, optional
            Once set, no further mesh is started.

        Returns
        -------
        Summary

        Raises
        ------
        MeshFileError
            There are no meshes.
        OptionError
            The results would lie inside the folder of meshes.
        OutputError
            The results cannot be written, or another run is writing there.
        """
        (assets, others), store = self._find(), Store(self.out, self.shard)
        summary, start, stop = Summary(len(assets), others=others), time.monotonic(), stop or threading.Event()
        seen: list[str] = []
        store.open()
        with closing(store), Ledger(store, MANIFEST) as manifest, Ledger(store, TIMINGS) as timings:

            def pending() -> Iterator[Task]:
                for asset in assets:
                    if stop.is_set():
                        return
                    task, finished = self._task(asset, manifest, store)
                    if finished:
                        seen.append(asset.name)
                        summary.passed_over += 1
                        watcher.passed_over(asset)
                    else:
                        watcher.started(asset)
                        yield task

            watcher.begin(len(assets))
            with closing(_outcomes(Work(self, store, pool, manifest.owns), pending(), stop)) as outcomes:
                for task, outcome in outcomes:
                    row, timing = self._row(task, outcome), {"mesh": task.asset.name, **outcome.timing}
                    timings.add(timing)
                    manifest.add(row)
                    watcher.finished(row, timing)
                    summary.slowest.append((task.asset.name, float(timing.get("seconds", 0.0))))
                    summary.slowest = sorted(summary.slowest, key=lambda entry: -entry[1])[:3]
                    seen.append(task.asset.name)
        rows = [found for name in sorted(seen) if (found := manifest.get(name)) is not None]
        summary.status = Counter(row["status"] for row in rows)
        summary.failures = [row for row in rows if row["status"] in FAILED]
        summary.uncovered = [row for row in rows if row["status"] == "uncovered"]
        summary.warnings = _kinds([row.get("warnings", ()) for row in rows])
        summary.stopped = len(seen) < len(assets)
        summary.seconds = time.monotonic() - start
        return summary

    def _find(self) -> tuple[list[Asset], Counter[str]]:
        """The meshes of this run, and how many other files `glob` selects, by kind."""
        here = self.out.resolve()
        if here == self.assets.resolve():
            raise OptionError(f"the results would lie among the meshes of {self.assets}; choose another folder.")
        every, others = scan(self.assets, here, self.spec.ending)
        assets = [asset for asset in every if matches(asset.name, self.glob)]
        if not assets:
            which = "" if self.glob == EVERYTHING else f" whose name fits {self.glob!r}"
            raise MeshFileError(f"there is no mesh{which} in {self.assets}; give a folder with obj, stl, glb, … files.")
        places = {here / asset.place for asset in assets}
        for asset in every:  # the folder of results may be above that of the meshes
            for path in (asset.path, asset.path.resolve()):
                if path.parent.resolve() / path.stem in places:
                    raise OptionError(f"a result would overwrite the input {asset.path}; choose another folder.")
        kinds = Counter(kind for name, kind in others.items() if matches(name, self.glob))
        return [asset for asset in assets if asset.is_of(self.shard)], kinds

    def _task(self, asset: Asset, manifest: Ledger, store: Store) -> tuple[Task, bool]:
        """Return the mesh with the key of its result, and whether that result exists."""
        try:
            content = content_hash(asset.files())
        except MeshFileError as error:  # loading the mesh reports what is wrong with the file
            content = str(error)
        task = Task(asset, self.spec.key(content, asset.name))
        return task, self.redo != "all" and self._is_finished(task, manifest.get(asset.name), store)

    def _is_finished(self, task: Task, row: Row | None, store: Store) -> bool:
        if row is None or row.get("key") != task.key or row.get("place") != task.asset.place:
            return False  # the place of a result depends on the neighbouring meshes
        status = row.get("status")
        if status in FAILED and (self.redo == "failed" or row.get("limits") != self._refusal()):
            return False
        return status is not None and all(store.size(name) == size for name, size in row.get("outputs", {}).items())

    def _row(self, task: Task, outcome: Outcome) -> Row:
        """Collect everything that is the same in every run."""
        row: Row = {"mesh": task.asset.name, "status": outcome.status, "place": task.asset.place, "key": task.key}
        if outcome.error is not None:
            row |= {"error": outcome.error, "limits": None if outcome.name_taken else self._refusal()}
        return {**row, **outcome.report, "outputs": dict(sorted(outcome.outputs.items()))}

    def _refusal(self) -> Row:
        """The settings a failure depends on; with others the mesh may succeed."""
        return {"seconds": self.limits.seconds, "memory": self.limits.memory, "fallback": self.fallback}
