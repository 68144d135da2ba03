"""Decompose a mesh as a batch does: in a watched process, or in this one."""

from __future__ import annotations

import math
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from rlacd.batch import JobSpec
from rlacd.batch.server import SERVER, MeshServer
from rlacd.pool import ProcessLimits, Request, WorkerDiedError
from rlacd.pool.local import Worker

Answered = tuple[dict[str, Any], dict[str, bytes]]
"""The answer of `rlacd.batch.server.MeshServer`."""


class Watched:
    """A process that is ended when a mesh exceeds the limits.

    Parameters
    ----------
    limits : ProcessLimits
    cpu_seconds : float
        CPU seconds allowed per mesh, independent of the load of the machine.
    """

    def __init__(self, limits: ProcessLimits, cpu_seconds: float = math.inf) -> None:
        self.limits = limits
        self.cpu_seconds = cpu_seconds
        self._worker = Worker()

    @property
    def pid(self) -> int:
        """Process id; 0 if there is no process."""
        return int(self._worker.name.partition("@")[0].replace("-", "0"))

    def run(self, spec: JobSpec, mesh: Path, name: str, stem: str) -> Answered:
        """Decompose a mesh.

        Raises
        ------
        WorkerDiedError
            The process died or was ended; the next mesh gets a new one.
        """
        watch = _Watch(self)
        try:
            answer = self._worker.ask(Request(SERVER, _values(spec, mesh, name, stem), limits=self.limits))
        except WorkerDiedError as error:
            self._worker.close()
            if watch.too_long:
                reason = f"it took more than {self.cpu_seconds:g} s of a processor"
                raise WorkerDiedError(reason, error.last_words) from None
            raise
        finally:
            watch.stop()
        return answer.values, answer.blobs

    def close(self) -> None:
        """End the process."""
        self._worker.close()


class _Watch:
    """Ends the process of a `Watched` that uses too much CPU time."""

    def __init__(self, watched: Watched) -> None:
        self.too_long = False
        self._watched = watched
        self._stopped = threading.Event()
        self._begun = self._spent()
        if math.isfinite(watched.cpu_seconds):
            threading.Thread(target=self._look, daemon=True).start()

    def stop(self) -> None:
        self._stopped.set()

    def _look(self) -> None:
        while not self._stopped.wait(0.5):
            if self._spent() - self._begun > self._watched.cpu_seconds:
                self.too_long = True
                psutil.Process(self._watched.pid).kill()
                return

    def _spent(self) -> float:
        try:
            times = psutil.Process(self._watched.pid).cpu_times() if self._watched.pid else None
        except psutil.Error:
            return 0.0
        return float(times.user + times.system) if times else 0.0


class InProcess:
    """Does the same in this process, so that sanitizer output stays readable; a crash ends everything."""

    def run(self, spec: JobSpec, mesh: Path, name: str, stem: str) -> Answered:
        """Decompose a mesh."""
        print(f"seed {mesh.stem}", file=sys.stderr, flush=True)
        with TemporaryDirectory() as staging:
            return MeshServer(Path(staging))(_values(spec, mesh, name, stem), {}, {})

    def close(self) -> None:
        """Do nothing."""


def _values(spec: JobSpec, mesh: Path, name: str, stem: str) -> dict[str, Any]:
    return {"spec": asdict(spec), "path": str(mesh), "name": name, "stem": stem, "hull_only": False}
