"""Runs every method on every mesh, each in its own process, with limits; finished tasks are not repeated."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from benchmarks.methods import make_method
from benchmarks.store import BenchStore, BenchTask, Row
from rlacd.pool.process import kill_group, start, why_it_ended

Say = Callable[[str], None]


@dataclass(frozen=True)
class BenchLimits:
    """Limits of a task.

    Attributes
    ----------
    seconds : float
        Wall time of each process: for running a method, and again for measuring its hulls in a second process.
    memory : int
        Bytes of address space, on Linux; 0 for no limit.
    threads : int
        Threads per process.
    jobs : int
        Number of concurrent processes.
    """

    seconds: float = 600.0
    memory: int = 12 * 2**30
    threads: int = 1
    jobs: int = 1


class Bench:
    """A folder of meshes, a folder of results, and the limits.

    Parameters
    ----------
    meshes : Path
        Folder that mesh names are relative to.
    names : sequence of str
        The meshes.
    store : BenchStore
    limits : BenchLimits
    say : callable
        Receives lines of progress.
    """

    def __init__(
        self, meshes: Path, names: Sequence[str], store: BenchStore, limits: BenchLimits | None = None, say: Say = print
    ) -> None:
        self.meshes = meshes
        self.names = list(names)
        self.store = store
        self.limits = limits or BenchLimits()
        self._say = say
        self._running: set[subprocess.Popen[bytes]] = set()
        self._stopping = False

    def run(self, method: str, setting: float) -> list[Row]:
        """Run one method on all meshes; rows in the order of the names."""
        return self.run_tasks([BenchTask(name, method, setting) for name in self.names])

    def run_tasks(self, tasks: Iterable[BenchTask]) -> list[Row]:
        """Run unfinished tasks, and return the rows of all tasks in order."""
        tasks = list(tasks)
        waiting = [task for task in dict.fromkeys(tasks) if self.known(task) is None]
        self._stopping = False
        pool = ThreadPoolExecutor(self.limits.jobs)
        try:
            for number, row in enumerate(pool.map(self._finish, waiting), 1):
                what = row.get("error") or f"{row['parts']} parts, {row['cpu']:.1f} s, D_h {row['hausdorff']:.3f}"
                self._say(f"{number}/{len(waiting)} {row['mesh']}  {row['method']} {row['setting']:g}  {what}")
        except BaseException:
            self._stopping = True  # processes killed from here on have not failed
            for process in list(self._running):
                kill_group(process)
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        return [found for task in tasks if (found := self.store.get(task)) is not None]

    def known(self, task: BenchTask) -> Row | None:
        """The row of a finished task, unless another version of its tool made it."""
        row = self.store.get(task)
        return None if row is None or is_outdated(row) else row

    def _finish(self, task: BenchTask) -> Row:
        row: Row = {"mesh": task.mesh, "method": task.method, "setting": task.setting}
        hulls = self.store.hulls_of(task)
        if self.store.get(task) is not None:
            hulls.unlink(missing_ok=True)  # made by another version
        with tempfile.TemporaryDirectory() as folder:
            answer = Path(folder) / "answer.json"
            failure = self._child(task, hulls, answer)
            if failure is not None and hulls.exists():  # the tool has finished; measuring gets its own limits
                failure = self._child(task, hulls, answer)
                failure = failure and f"measuring: {failure}"
            row |= {"error": failure} if failure else json.loads(answer.read_text(encoding="utf-8"))
        if not self._stopping:
            self.store.add(row)
        return row

    def _child(self, task: BenchTask, hulls: Path, answer: Path) -> str | None:
        """Run one process, which reuses hulls that exist; returns None, or a description of its failure."""
        job = {
            "mesh": str(self.meshes / task.mesh),
            "method": task.method,
            "setting": task.setting,
            "threads": self.limits.threads,
            "memory": self.limits.memory,
            "hulls": str(hulls),
            "answer": str(answer),
        }
        command = [sys.executable, "-m", "benchmarks.child", json.dumps(job)]
        # The child reads a pipe that is never written to: when this process dies, the pipe closes and the child exits.
        read_end, write_end = os.pipe()
        try:
            environment = {"OMP_NUM_THREADS": str(self.limits.threads), "PYTHONPATH": _with_root()}
            process = start(command, read_end, subprocess.DEVNULL, subprocess.PIPE, environment)
            os.close(read_end)
            self._running.add(process)
            try:
                _, complaint = process.communicate(timeout=self.limits.seconds)
            except subprocess.TimeoutExpired:
                kill_group(process)
                process.communicate()
                return f"more than {self.limits.seconds:g} s"
            finally:
                self._running.discard(process)
        finally:
            os.close(write_end)
        last = (complaint.decode(errors="replace").strip().splitlines() or [""])[-1][-300:]
        if process.returncode < 0:
            return f"{why_it_ended(process.returncode)} {last}".strip()
        return (last or why_it_ended(process.returncode)) if process.returncode else None


def _with_root() -> str:
    """PYTHONPATH with the folder of this package in front, wherever the command was started."""
    root = str(Path(__file__).resolve().parents[1])
    return os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])


def is_outdated(row: Row) -> bool:
    """Tell whether a row was made by another version of its tool than the installed one."""
    return "version" in row and row["version"] != make_method(row["method"]).version


def find_meshes(folder: Path, listed: Path | None = None) -> list[str]:
    """Names of the meshes in a folder, at any depth, or of those in a list, one per line.

    ShapeNetCore (v1 and v2), HumanBody and COSEG are read as distributed: nested folders with voxels, pictures and
    labels between the meshes.
    """
    if listed is not None:
        return [
            line
            for line in listed.read_text(encoding="utf-8").splitlines()
            if line.strip() and not line.startswith("#")
        ]
    endings = {".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"}
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.suffix.lower() in endings)
