"""A process for requests, watched from outside: it is ended when it exceeds its time or memory.

Pools of the standard library and of other packages share a pipe or a lock between their processes; killing one that
holds it stops the whole pool. Here every process has its own pipe, so that its death affects no other.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time

import psutil

from rlacd import errors
from rlacd.pool.child import READY
from rlacd.pool.message import receive, send
from rlacd.pool.process import end, kill_group, why_it_ended
from rlacd.pool.request import Answer, Request, WorkerDiedError

POLL_SECONDS = 0.05
"""Seconds between checks of a busy process."""

START = 300.0
"""Seconds a process may take to start."""


class Worker:
    """One process; it starts at its first request, and restarts after it was ended."""

    def __init__(self) -> None:
        self._server = ""
        self._process: subprocess.Popen[bytes] | None = None
        self._given: dict[str, str] = {}
        self._killed = False
        self._starting = threading.Lock()

    @property
    def name(self) -> str:
        """Process and machine."""
        return f"{self._process.pid if self._process else '-'}@{socket.gethostname()}"

    def ask(self, request: Request) -> Answer:
        """Send a request and wait for its answer.

        Raises
        ------
        WorkerDiedError
            The process died or was ended; the next request gets a new process.
        RlacdError
            Raised by the server.
        """
        if request.fresh or request.server != self._server:
            self.close()
        if self._process is None:
            self._start(request.server)
        limits = request.limits
        self._stderr.seek(0)
        self._stderr.truncate()
        try:
            self._send(request)
            self._await(time.monotonic() + limits.seconds, f"it took more than {limits.seconds:g} s", limits.memory)
            header, blobs = receive(self._pipe)
        except (EOFError, OSError) as error:
            raise self._death() from error
        except BaseException:
            self.close()
            raise
        name = self.name
        if limits.memory and self._memory() > limits.memory // 2:
            self.close()  # memory left over from earlier requests must not count against the next one
        if "error" in header:
            kind, sentence = header["error"]
            raise getattr(errors, kind, errors.RlacdError)(sentence)
        return Answer(header["values"], blobs, name)

    def close(self) -> None:
        """End the process; only for the thread that calls `ask`."""
        if self._process is None:
            return
        process, self._process = self._process, None
        end(process)
        self._given = {}
        self._pipe.close()
        self._stderr.close()
        self._folder.cleanup()

    def kill(self) -> None:
        """End the process for good, even while `ask` waits for it; `ask` then raises and closes."""
        with self._starting:
            self._killed = True
            if (process := self._process) is not None:
                kill_group(process)

    def _start(self, server: str) -> None:
        self._server = server
        self._pipe, there = multiprocessing.Pipe()
        self._folder = tempfile.TemporaryDirectory(prefix="rlacd-")
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        with self._starting:
            if self._killed:
                raise WorkerDiedError("its pool was closed")
            self._process = subprocess.Popen(
                [sys.executable, "-m", "rlacd.pool.child", str(there.fileno()), server, self._folder.name],
                pass_fds=[there.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._stderr,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                start_new_session=True,
            )
        there.close()
        try:
            self._await(time.monotonic() + START, f"its process did not start within {START:g} s", 0)
            if self._pipe.recv_bytes() != READY:
                raise EOFError
        except (EOFError, OSError) as error:
            raise self._death() from error
        except BaseException:
            self.close()
            raise

    def _send(self, request: Request) -> None:
        for name, shared in request.shared.items():
            if self._given.get(name) != shared.key:
                send(self._pipe, {"shares": name, "key": shared.key}, shared.blobs)
        self._given = {name: shared.key for name, shared in request.shared.items()}
        send(self._pipe, {"shares": "", "values": request.values, "shared": list(request.shared)}, request.blobs)

    def _await(self, until: float, too_late: str, memory: int) -> None:
        """Wait until there is something to read or the process has ended."""
        while not self._pipe.poll(POLL_SECONDS):
            if time.monotonic() > until:
                raise WorkerDiedError(too_late)
            if memory and self._memory() > memory:
                raise WorkerDiedError(f"it needed more than {memory / 2**30:g} GB of memory")

    def _memory(self) -> int:
        if self._process is None:
            return 0
        try:
            return int(psutil.Process(self._process.pid).memory_info().rss)
        except psutil.Error:
            return 0  # it has just ended; reading the pipe will show that

    def _death(self) -> WorkerDiedError:
        assert self._process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=10)  # the pipe closes a moment before the process exits
        code = self._process.poll()
        self._stderr.seek(0)
        last_words = self._stderr.read().decode(errors="replace")[-500:].strip()
        self.close()
        return WorkerDiedError(f"its process {why_it_ended(code)}", last_words)
