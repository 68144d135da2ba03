"""A process for meshes, watched from outside: it is ended when it takes too long or too much memory.

Pools of the standard library and of other packages share a pipe or a lock between their processes; one that is killed
while it holds it stops the whole pool. Here every process has a pipe of its own, and so its death is nobody else's.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from rlacd.errors import OptionError
from rlacd.fleet.child import READY
from rlacd.fleet.order import Order
from rlacd.fleet.process import end, why_it_ended

LOOK = 0.05
"""Seconds between two looks at a process that is busy."""

START = 300.0
"""Seconds that a process may take to start."""


@dataclass(frozen=True)
class Limits:
    """What one mesh may take.

    Attributes
    ----------
    seconds : float
        Wall time.
    memory : int
        Bytes of main memory that its process holds; 0 for no limit.

    Raises
    ------
    OptionError
        A limit is not positive.
    """

    seconds: float = 600.0
    memory: int = 4 * 2**30

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise OptionError(f"the limit of time is {self.seconds!r}; it has to be a positive number of seconds.")
        if self.memory < 0:
            raise OptionError(f"the limit of memory is {self.memory!r}; it has to be positive, or 0 for none.")


class WorkerDiedError(Exception):
    """A process has ended before its answer.

    Attributes
    ----------
    reason : str
        Why, in words that are the same every time.
    last_words : str
        The end of what it said on stderr.
    """

    def __init__(self, reason: str, last_words: str = "") -> None:
        super().__init__(reason)
        self.reason = reason
        self.last_words = last_words


class Worker:
    """One process; it starts with its first mesh, and again after it was ended.

    Parameters
    ----------
    limits : Limits
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def name(self) -> str:
        """Process and machine."""
        return f"{self._process.pid if self._process else '-'}@{socket.gethostname()}"

    def run(
        self, order: Order, mesh: Path, name: str, stem: str, hull_only: bool = False
    ) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Have a mesh decomposed; see `rlacd.fleet.child.make` for the parameters and `answer` for what comes back.

        Raises
        ------
        WorkerDiedError
            The process died or was ended; the next mesh gets a new one.
        """
        if self._process is None:
            self._start()
        request = {
            "order": order.as_plain(),
            "mesh": str(mesh),
            "name": name,
            "stem": stem,
            "staging": self._folder.name,
            "hull_only": hull_only,
        }
        self._said.seek(0)
        self._said.truncate()
        try:
            self._pipe.send_bytes(json.dumps(request).encode())
            self._await(time.monotonic() + self.limits.seconds, f"it took more than {self.limits.seconds:g} s")
            said: dict[str, Any] = json.loads(self._pipe.recv_bytes())
            files = {file: self._pipe.recv_bytes() for file in said.pop("files")}
        except (EOFError, OSError) as error:
            raise self._death() from error
        except BaseException:
            self.close()
            raise
        if self.limits.memory and self._memory() > self.limits.memory // 2:
            self.close()  # what earlier meshes have left behind is not to be held against the next
        return said, files

    def close(self) -> None:
        """End the process, whatever it is doing."""
        if self._process is None:
            return
        process, self._process = self._process, None
        end(process)
        self._pipe.close()
        self._said.close()
        self._folder.cleanup()

    def _start(self) -> None:
        self._pipe, there = multiprocessing.Pipe()
        self._folder = tempfile.TemporaryDirectory(prefix="rlacd-")
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        self._process = subprocess.Popen(
            [sys.executable, "-m", "rlacd.fleet.child", str(there.fileno())],
            pass_fds=[there.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            start_new_session=True,
        )
        there.close()
        try:
            self._await(time.monotonic() + START, f"its process did not start within {START:g} s", watch_memory=False)
            if self._pipe.recv_bytes() != READY:
                raise EOFError
        except (EOFError, OSError) as error:
            raise self._death() from error
        except BaseException:
            self.close()
            raise

    def _await(self, until: float, too_late: str, watch_memory: bool = True) -> None:
        """Wait for something to read, or for the end of the process."""
        while not self._pipe.poll(LOOK):
            if time.monotonic() > until:
                raise WorkerDiedError(too_late)
            if watch_memory and self.limits.memory and self._memory() > self.limits.memory:
                raise WorkerDiedError(f"it needed more than {self.limits.memory / 2**30:g} GB of memory")

    def _memory(self) -> int:
        if self._process is None:
            return 0
        try:
            return int(psutil.Process(self._process.pid).memory_info().rss)
        except psutil.Error:
            return 0  # it has just ended, which the pipe tells

    def _death(self) -> WorkerDiedError:
        assert self._process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=10)  # the pipe closes a moment before the process is gone
        code = self._process.poll()
        self._said.seek(0)
        last_words = self._said.read().decode(errors="replace")[-500:].strip()
        self.close()
        return WorkerDiedError(f"its process {why_it_ended(code)}", last_words)
