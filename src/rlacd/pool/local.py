"""The pools of one machine: processes, each watched by a thread and ended when it exceeds its time or memory."""

from __future__ import annotations

import contextlib
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import psutil

from rlacd import errors
from rlacd.errors import OptionError, RlacdError
from rlacd.pool import Answer, Pool, Request, Server, TimeLimitError, Values, WorkerDiedError
from rlacd.pool.child import END_SECONDS, READY, find_server, receive, send
from rlacd.pool.process import kill_group, start, why_it_ended

LOOK_EVERY = 0.05
"""Seconds between checks of a busy process."""

START_SECONDS = 300.0
"""Seconds a process may take to start, on a busy machine."""

Message = tuple[Values, dict[str, bytes]]


class _Child:
    """A running process and the pipes to it."""

    def __init__(self, server: str) -> None:
        self.server = server
        self.folder = tempfile.TemporaryDirectory(prefix="rlacd-")
        self.stderr = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        command = [sys.executable, "-m", "rlacd.pool.child", server, self.folder.name]
        temporary = dict.fromkeys(("TMPDIR", "TMP", "TEMP"), self.folder.name)  # a library's report of its crash too
        environment = {"OMP_NUM_THREADS": "1", **temporary}
        self.process = start(command, subprocess.PIPE, subprocess.PIPE, self.stderr, environment)
        self.messages: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        """Pass on what the process says, then None; a thread, since not every system can poll a pipe."""
        assert self.process.stdout is not None
        try:
            with self.process.stdout as pipe, contextlib.suppress(EOFError, OSError, ValueError):
                while True:
                    self.messages.put(receive(pipe))
        finally:
            self.messages.put(None)

    def send(self, request: Request) -> None:
        """Send a request."""
        assert self.process.stdin is not None
        self.stderr.seek(0)
        self.stderr.truncate()
        send(self.process.stdin, {"values": request.values, "seconds": request.limits.seconds}, request.blobs)

    def receive(self, until: float, too_late: WorkerDiedError, memory: int) -> Message:
        """Wait for a message; raise EOFError if the process has ended instead."""
        while True:
            with contextlib.suppress(queue.Empty):
                message = self.messages.get(timeout=LOOK_EVERY)
                if message is None:
                    raise EOFError
                return message
            if time.monotonic() > until:
                raise too_late
            if memory and self.memory() > memory:
                raise WorkerDiedError(f"it needed more than {memory / 2**30:g} GB of memory")

    def memory(self) -> int:
        """Bytes that it holds."""
        try:
            return int(psutil.Process(self.process.pid).memory_info().rss)
        except psutil.Error:
            return 0  # it has just ended; reading the pipe will show that

    def death(self) -> WorkerDiedError:
        """Why it ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(END_SECONDS)  # the pipe closes a moment before the process exits
        self.stderr.seek(0)
        last_words = self.stderr.read().decode(errors="replace")[-500:].strip()
        return WorkerDiedError(f"its process {why_it_ended(self.process.poll())}", last_words)

    def close(self) -> None:
        """End it and its children."""
        kill_group(self.process)
        self.process.wait()
        self.reader.join()
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):  # what it did not read in time is lost
            self.process.stdin.close()
        self.stderr.close()
        self.folder.cleanup()


class Worker:
    """One process; it starts at its first request, and restarts after it was ended."""

    def __init__(self) -> None:
        self._child: _Child | None = None
        self._killed = False
        self._starting = threading.Lock()

    @property
    def name(self) -> str:
        """Process and machine."""
        return f"{self._child.process.pid if self._child else '-'}@{socket.gethostname()}"

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
            if isinstance(died, TimeLimitError) or request.tries <= 1:
                raise
        return self.ask(replace(request, fresh=True, tries=request.tries - 1))

    def _ask(self, request: Request) -> Answer:
        if self._child is not None and (request.fresh or request.server != self._child.server):
            self.close()
        limits = request.limits
        try:
            child = self._child or self._start(request.server)
            child.send(request)
            too_late = TimeLimitError(f"it took more than {limits.seconds:g} s")
            header, blobs = child.receive(time.monotonic() + limits.seconds, too_late, limits.memory)
        except BaseException as error:
            died = self._child.death() if self._child and isinstance(error, (EOFError, OSError)) else error
            self.close()
            if died is error:
                raise
            raise died from error
        name = self.name
        if limits.memory and child.memory() > limits.memory // 2:
            self.close()  # memory left over from earlier requests must not count against the next one
        if "error" in header:
            kind, sentence = header["error"]
            raise getattr(errors, kind, RlacdError)(sentence)
        return Answer(header["values"], blobs, name)

    def close(self) -> None:
        """End the process; only for the thread that calls `ask`."""
        if self._child is not None:
            child, self._child = self._child, None
            child.close()

    def kill(self) -> None:
        """End the process for good, even while `ask` waits for it; `ask` then raises and closes."""
        with self._starting:
            self._killed = True
            if self._child is not None:
                kill_group(self._child.process)

    def _start(self, server: str) -> _Child:
        with self._starting:
            if self._killed:
                raise WorkerDiedError("its pool was closed")
            self._child = child = _Child(server)
        too_late = WorkerDiedError(f"its process did not start within {START_SECONDS:g} s")
        header, _ = child.receive(time.monotonic() + START_SECONDS, too_late, 0)
        if header != READY:
            raise EOFError
        return child


class LocalPool(Pool):
    """Worker processes on this machine.

    Parameters
    ----------
    jobs : int
        Number of processes.

    Raises
    ------
    OptionError
        `jobs` is not positive.
    """

    def __init__(self, jobs: int) -> None:
        if jobs < 1:
            raise OptionError(f"jobs is {jobs!r}; it has to be at least 1.")
        self._workers = [Worker() for _ in range(jobs)]
        self._idle: queue.LifoQueue[Worker] = queue.LifoQueue()  # who has worked has a process already
        for worker in self._workers:
            self._idle.put(worker)
        self._threads = ThreadPoolExecutor(jobs)

    @property
    def room(self) -> int:
        """See `Pool`."""
        return len(self._workers)

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`."""
        return self._threads.submit(self._ask, request)

    def close(self) -> None:
        """See `Pool`."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown()
        for worker in self._workers:
            worker.close()

    def _ask(self, request: Request) -> Answer:
        worker = self._idle.get()
        try:
            return worker.ask(request)
        finally:
            self._idle.put(worker)


class InProcessPool(Pool):
    """Answers each request in the calling process, during `submit`; limits are not enforced."""

    room = 1

    def __init__(self) -> None:
        self._servers: dict[str, Server] = {}
        self._folder = tempfile.TemporaryDirectory(prefix="rlacd-")

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`."""
        future: Future[Answer] = Future()
        if request.server not in self._servers:
            self._servers[request.server] = find_server(request.server)(Path(self._folder.name))
        try:
            values, blobs = self._servers[request.server](request.values, request.blobs)
        except RlacdError as error:
            future.set_exception(error)
        else:
            future.set_result(Answer(values, blobs, "here"))
        return future

    def close(self) -> None:
        """See `Pool`."""
        self._servers.clear()
        self._folder.cleanup()
