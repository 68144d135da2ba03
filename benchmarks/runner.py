"""Runs every method on every mesh, in processes of their own, with limits; finished tasks are not repeated."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.methods import make_method
from benchmarks.store import Row, Store, Task
from rlacd.errors import MeshFileError
from rlacd.pool.process import kill_group, start, why_it_ended

ENDINGS = {".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"}

LAST_WORDS = 300
"""Characters of a failed process's last line that are kept."""


@dataclass(frozen=True)
class Limits:
    """Limits of a task.

    Attributes
    ----------
    seconds : float
        Wall time for running a method, and again for measuring its hulls in a second process.
    memory : int
        Bytes of address space, on Linux; 0 for no limit.
    jobs : int
        Number of concurrent processes.
    tasks : int
        Tasks that a process does before it is replaced. Peak memory is that of its largest so far.
    threads : int
        Above 1, each task is done once more with so many threads, for its wall time.
    """

    seconds: float = 600.0
    memory: int = 12 * 2**30
    jobs: int = 1
    tasks: int = 1
    threads: int = 1


class Bench:
    """A folder of meshes, a folder of results, and the limits.

    Parameters
    ----------
    meshes : Path
        Folder that mesh names are relative to.
    names : sequence of str
        The meshes.
    store : Store
    limits : Limits
    say : callable
        Receives lines of progress.
    """

    def __init__(
        self,
        meshes: Path,
        names: Sequence[str],
        store: Store,
        limits: Limits | None = None,
        say: Callable[[str], None] = print,
    ) -> None:
        self.meshes = meshes
        self.names = list(names)
        self.store = store
        self.limits = limits or Limits()
        self.say = say
        self._children: set[_Child] = set()
        self._own = threading.local()
        self._stopping = False

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
        tasks = list(tasks)
        waiting = [task for task in dict.fromkeys(tasks) if self.known(task) is None]
        self._stopping = False
        pool = ThreadPoolExecutor(self.limits.jobs)
        try:
            for number, row in enumerate(pool.map(self._finish, waiting), 1):
                what = row.get("error") or f"{row['parts']} parts, {row['cpu']:.1f} s, D_h {row['hausdorff']:.3f}"
                self.say(f"{number}/{len(waiting)} {row['mesh']}  {row['method']} {row['setting']:g}  {what}")
        finally:
            self._stopping = True  # processes killed from here on have not failed
            for child in list(self._children):
                child.kill()
            self._children.clear()
            pool.shutdown(cancel_futures=True)
        return [found for task in tasks if (found := self.store.get(task)) is not None]

    def known(self, task: Task) -> Row | None:
        """The row of a finished task, unless another version of its tool made it or other threads were timed."""
        row = self.store.get(task)
        is_timed = row is not None and self.limits.threads in (1, row.get("threads", 1))
        return row if row is not None and is_timed and not is_outdated(row) else None

    def _finish(self, task: Task) -> Row:
        threads = self.limits.threads
        row: Row = {"mesh": task.mesh, "method": task.method, "setting": task.setting, "threads": threads}
        hulls = self.store.hulls_of(task)
        before = self.store.get(task)
        if before is not None and is_outdated(before):
            hulls.unlink(missing_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            answer = Path(folder) / "answer.json"
            failure = self._ask(task, hulls, answer)
            if failure is not None and hulls.exists():  # the tool has finished; measuring gets its own limits
                failure = self._ask(task, hulls, answer)
                failure = failure and f"measuring: {failure}"
            row |= {"error": failure} if failure else json.loads(answer.read_text(encoding="utf-8"))
            if threads > 1 and "error" not in row:
                failure = self._ask(task, hulls, answer, threads)
                row |= {"error": failure} if failure else json.loads(answer.read_text(encoding="utf-8"))
        if not self._stopping:
            self.store.add(row)
        return row

    def _ask(self, task: Task, hulls: Path, answer: Path, threads: int = 1) -> str | None:
        """Give a task to a process, which reuses hulls that exist; returns None, or a description of its failure."""
        own: dict[int, _Child] = self._own.__dict__.setdefault("children", {})
        child = own.get(threads)
        if child is None or child.process.poll() is not None or child.done >= self.limits.tasks:
            if child is not None:
                child.kill()
                self._children.discard(child)
            child = own[threads] = _Child(threads)
            self._children.add(child)
        job = {
            "mesh": str(self.meshes / task.mesh),
            "method": task.method,
            "setting": task.setting,
            "memory": self.limits.memory,
            "hulls": str(hulls),
            "answer": str(answer),
            "threads": threads,
        }
        return child.do(job, self.limits.seconds)


class _Child:
    """A process that does tasks one after the other, and exits when this one does."""

    def __init__(self, threads: int) -> None:
        root = str(Path(__file__).resolve().parents[1])
        path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {"OMP_NUM_THREADS": str(threads), "PYTHONPATH": path}
        command = [sys.executable, "-m", "benchmarks.child"]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self.process = start(command, subprocess.PIPE, subprocess.PIPE, self._said, environment)
        self.done = 0

    def do(self, job: dict[str, Any], seconds: float) -> str | None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        late = threading.Event()

        def give_up() -> None:
            late.set()
            kill_group(self.process)

        watch = threading.Timer(seconds, give_up)
        watch.start()
        try:
            self.process.stdin.write(json.dumps(job).encode() + b"\n")
            self.process.stdin.flush()
            is_done = bool(self.process.stdout.readline())
        except BrokenPipeError:
            is_done = False
        finally:
            watch.cancel()
        self.done += 1
        if is_done:
            return None
        code = self.process.wait()
        if late.is_set():
            return f"more than {seconds:g} s"
        self._said.seek(0)
        last = (self._said.read().decode(errors="replace").strip().splitlines() or [""])[-1][-LAST_WORDS:]
        return f"{why_it_ended(code)} {last}".strip()

    def kill(self) -> None:
        kill_group(self.process)
        self.process.wait()


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
