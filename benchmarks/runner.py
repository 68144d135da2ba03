"""Runs every method on every mesh, in processes of their own, with limits; finished tasks are not repeated."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.methods import make_method
from benchmarks.store import Row, Task, load_row, save_row
from rlacd.errors import MeshFileError
from rlacd.pool import Pool, ProcessLimits, Request, WorkerDiedError, open_pool

ENDINGS = {".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"}


@dataclass(frozen=True)
class Limits:
    """Limits of a task.

    Attributes
    ----------
    process : ProcessLimits
        Wall time for running a method and measuring its hulls, and again for measuring alone if that ran out of it.
    jobs : int
        Number of concurrent processes.
    fresh : bool
        Whether each task gets a process of its own; otherwise peak memory is that of a process's largest so far.
    threads : int
        Above 1, each task is done once more with so many threads, for its wall time.
    """

    process: ProcessLimits = field(default_factory=ProcessLimits)
    jobs: int = 1
    fresh: bool = True
    threads: int = 1


@dataclass
class Bench:
    """A folder of meshes, a folder of results, and the limits.

    Attributes
    ----------
    meshes : Path
        Folder that mesh names are relative to.
    names : list of str
        The meshes.
    folder : Path
        Where results are kept.
    limits : Limits
    say : callable
        Receives lines of progress.
    """

    meshes: Path
    names: Sequence[str]
    folder: Path
    limits: Limits = field(default_factory=Limits)
    say: Callable[[str], None] = print

    def run(self, method: str, setting: float | None = None) -> list[Row]:
        """Run one method on all meshes, by default at its own setting; rows in the order of the names."""
        number = make_method(method).default if setting is None else setting
        return self.run_tasks([Task(name, method, number) for name in self.names])

    def run_together(self, settings: Mapping[str, tuple[str, float]]) -> dict[str, list[Row]]:
        """Run several methods at their settings, by label: mesh by mesh, so that all meet the same machine."""
        self.run_tasks(Task(name, *pair) for name in self.names for pair in settings.values())
        return {label: self.run(*pair) for label, pair in settings.items()}

    def run_tasks(self, tasks: Iterable[Task]) -> list[Row]:
        """Run unfinished tasks, and return the rows of all tasks in order."""
        rows = {task: self.known(task) for task in tasks}
        waiting = [task for task, row in rows.items() if row is None]
        with ThreadPoolExecutor(self.limits.jobs) as threads, open_pool(self.limits.jobs) as pool:
            running = {threads.submit(self._finish, pool, task): task for task in waiting}
            for number, done in enumerate(as_completed(running), 1):
                task, row = running[done], done.result()
                save_row(self.folder, task, row)
                rows[task] = row
                what = row.get("error") or f"{row['parts']} parts, {row['cpu']:.1f} s, D_h {row['hausdorff']:.3f}"
                self.say(f"{number}/{len(waiting)} {task.mesh}  {task.method} {task.setting:g}  {what}")
        return [row for row in rows.values() if row is not None]

    def known(self, task: Task) -> Row | None:
        """The row of a finished task, unless another version of its tool made it or other threads were timed."""
        row = load_row(self.folder, task)
        is_timed = row is not None and self.limits.threads in (1, row.get("threads", 1))
        return row if row is not None and is_timed and not is_outdated(row) else None

    def hulls_of(self, task: Task) -> Path:
        """Path of the hulls of a task, whether they exist yet or not."""
        return task.file_in(self.folder, ".npz")

    def _finish(self, pool: Pool, task: Task) -> Row:
        row: Row = {"mesh": task.mesh, "method": task.method, "setting": task.setting, "threads": self.limits.threads}
        begun, hulls, before = time.perf_counter(), self.hulls_of(task), load_row(self.folder, task)
        hulls.parent.mkdir(parents=True, exist_ok=True)
        if before is not None and is_outdated(before):
            hulls.unlink(missing_ok=True)
        found = self._ask(pool, task)
        if "error" in found and hulls.exists():  # the tool has finished; measuring gets its own limits
            found = self._ask(pool, task)
        if self.limits.threads > 1 and "error" not in found:
            found |= self._ask(pool, task, self.limits.threads)
        return {**row, **found, "seconds": time.perf_counter() - begun}

    def _ask(self, pool: Pool, task: Task, threads: int = 1) -> Row:
        values = {**vars(task), "mesh": str(self.meshes / task.mesh), "hulls": str(self.hulls_of(task))}
        fresh = self.limits.fresh or threads > 1
        server, limits = "benchmarks.child:make_server", self.limits.process
        request = Request(server, {**values, "threads": threads}, limits=limits, threads=threads, fresh=fresh)
        try:
            return pool.submit(request).result().values
        except WorkerDiedError as died:
            return {"error": " ".join([str(died), *died.last_words.splitlines()[-1:]])}


def is_outdated(row: Row) -> bool:
    """Tell whether a row was made by another version of its tool than the installed one."""
    return "version" in row and row["version"] != make_method(row["method"]).version


def find_meshes(folder: Path, listed: Path | None = None) -> list[str]:
    """Names of the meshes in a folder, at any depth, or of those in a list, one per line.

    Raises
    ------
    MeshFileError
        The folder or the list does not exist, lists what is not in the folder, or there are no meshes.
    """
    if not folder.is_dir():
        raise MeshFileError(f"{folder} is not a folder; give the folder that holds the meshes.")
    if listed is None:
        names = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.suffix.lower() in ENDINGS)
    elif listed.is_file():
        lines = listed.read_text(encoding="utf-8").splitlines()
        names = [line for line in lines if line.strip() and not line.startswith("#")]
    else:
        raise MeshFileError(f"the list {listed} does not exist; give a file with one mesh a line.")
    missing = [name for name in names if not (folder / name).is_file()]
    if missing:
        raise MeshFileError(f"{len(missing)} of the meshes listed, such as {missing[0]}, are not in {folder}.")
    if not names:
        raise MeshFileError(f"there are no meshes in {folder}.")
    return names
