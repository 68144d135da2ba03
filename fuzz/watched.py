"""A process that answers requests, and is ended when one of them takes too much time or memory."""

from __future__ import annotations

import math
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

import psutil

from rlacd.batch import JobSpec
from rlacd.batch.server import SERVER
from rlacd.pool import Answer, ProcessLimits, Request, WorkerDiedError
from rlacd.pool.local import Worker


class Watched:
    """A process that is replaced when it exceeds the limits, or dies.

    Parameters
    ----------
    limits : ProcessLimits
    cpu_seconds : float
        CPU seconds allowed per request, independent of the load of the machine.
    """

    def __init__(self, limits: ProcessLimits, cpu_seconds: float = math.inf) -> None:
        self._limits, self._cpu_seconds = limits, cpu_seconds
        self._worker = Worker()

    def ask(self, server: str, values: dict[str, Any], **given: Any) -> Answer:
        """Send a request (see `rlacd.pool.Request`).

        Raises
        ------
        WorkerDiedError
            The process died or was ended; the next request gets a new one.
        """
        begun, is_done, too_long = self._spent(), threading.Event(), threading.Event()

        def look() -> None:
            while not is_done.wait(0.5):
                if self._spent() - begun > self._cpu_seconds:
                    too_long.set()
                    psutil.Process(self._pid).kill()
                    return

        threading.Thread(target=look, daemon=True).start()
        try:
            return self._worker.ask(Request(server, values, limits=self._limits, **given))
        except WorkerDiedError as error:
            self._worker.close()
            if too_long.is_set():
                reason = f"it took more than {self._cpu_seconds:g} s of a processor"
                raise WorkerDiedError(reason, error.last_words) from None
            raise
        finally:
            is_done.set()

    def decompose(self, spec: JobSpec, mesh: Path, stem: str) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Decompose a mesh as a batch does; the answer of `rlacd.batch.server.MeshServer`."""
        where = {"path": str(mesh), "name": mesh.name, "stem": stem, "home": str(mesh.parent)}
        values = {"spec": asdict(spec), **where, "hull_only": False}
        answer = self.ask(SERVER, values)
        return answer.values, answer.blobs

    def close(self) -> None:
        """End the process."""
        self._worker.close()

    @property
    def _pid(self) -> int:
        """0 if there is no process."""
        return int(self._worker.name.partition("@")[0].replace("-", "0"))

    def _spent(self) -> float:
        try:
            times = psutil.Process(self._pid).cpu_times() if self._pid else None
        except psutil.Error:
            return 0.0
        return float(times.user + times.system) if times else 0.0


def end_of(error: WorkerDiedError) -> tuple[str, list[str]]:
    """What a death is called, and what is said of it."""
    end = {"it needed": "memory", "it took m": "hang"}.get(error.reason[:9], "crash")
    return end, [f"{error.reason} {error.last_words[-500:]}".strip()]
