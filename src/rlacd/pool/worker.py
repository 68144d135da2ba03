"""A process for requests, watched from outside: it is ended when it exceeds its time or memory.

Pools of the standard library and of other packages share a pipe or a lock between their processes; killing one that
holds it stops the whole pool. Here every process has its own pipe, so that its death affects no other.
"""

from __future__ import annotations

import contextlib
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time
from typing import IO

import psutil

from rlacd import errors
from rlacd.pool.child import READY
from rlacd.pool.message import receive, send
from rlacd.pool.process import end, kill_group, start, why_it_ended
from rlacd.pool.request import Answer, Request, TimeLimitError, Values, WorkerDiedError

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
        begun = time.monotonic()
        try:
            return self._ask(request)
        except WorkerDiedError as died:
            died.seconds = time.monotonic() - begun
            raise

    def _ask(self, request: Request) -> Answer:
        if request.fresh or request.server != self._server:
            self.close()
        if self._process is None:
            self._start(request.server)
        limits = request.limits
        self._stderr.seek(0)
        self._stderr.truncate()
        try:
            self._send(request)
            too_late = TimeLimitError(f"it took more than {limits.seconds:g} s")
            header, blobs = self._receive(time.monotonic() + limits.seconds, too_late, limits.memory)
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
        self._reader.join()
        with contextlib.suppress(OSError):  # what it did not read in time is lost
            self._requests.close()
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
        self._folder = tempfile.TemporaryDirectory(prefix="rlacd-")
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        with self._starting:
            if self._killed:
                raise WorkerDiedError("its pool was closed")
            command = [sys.executable, "-m", "rlacd.pool.child", server, self._folder.name]
            self._process = start(command, subprocess.PIPE, subprocess.PIPE, self._stderr, {"OMP_NUM_THREADS": "1"})
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests = self._process.stdin
        self._answers: queue.SimpleQueue[tuple[Values, dict[str, bytes]] | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=_read, args=(self._process.stdout, self._answers), daemon=True)
        self._reader.start()
        too_late = WorkerDiedError(f"its process did not start within {START:g} s")
        try:
            header, _ = self._receive(time.monotonic() + START, too_late, 0)
            if header != READY:
                raise EOFError
        except (EOFError, OSError) as error:
            raise self._death() from error
        except BaseException:
            self.close()
            raise

    def _send(self, request: Request) -> None:
        for name, shared in request.shared.items():
            if self._given.get(name) != shared.key:
                send(self._requests, {"shares": name, "key": shared.key}, shared.blobs)
        self._given = {name: shared.key for name, shared in request.shared.items()}
        send(self._requests, {"shares": "", "values": request.values, "shared": list(request.shared)}, request.blobs)

    def _receive(self, until: float, too_late: WorkerDiedError, memory: int) -> tuple[Values, dict[str, bytes]]:
        """Wait for a message; raise EOFError if the process has ended instead."""
        while True:
            with contextlib.suppress(queue.Empty):
                message = self._answers.get(timeout=POLL_SECONDS)
                if message is None:
                    raise EOFError
                return message
            if time.monotonic() > until:
                raise too_late
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


def _read(pipe: IO[bytes], answers: queue.SimpleQueue[tuple[Values, dict[str, bytes]] | None]) -> None:
    """Pass on what a process answers, then None; a thread, since not every system can wait for a pipe for a while."""
    try:
        with pipe, contextlib.suppress(EOFError, OSError, ValueError):
            while True:
                answers.put(receive(pipe))
    finally:
        answers.put(None)
