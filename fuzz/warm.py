"""A warm process that runs light trials one after the other, and is replaced when it dies, hangs or grows.

A new process is forked from a server that has imported everything, so that a death costs a few milliseconds.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psutil

from fuzz.light import LightTrials, Options, enter_worker
from fuzz.mutations import Seed
from fuzz.recipes import Shape
from fuzz.trials import Trial

CPU_SECONDS = 30.0
"""CPU seconds that a light trial may take."""

PATIENCE = 600.0
"""Seconds by the clock after which a trial is taken to be stuck, whatever it does."""

MEMORY = 2 * 2**30
"""Resident bytes that the process may reach."""

LIFE = 5000
"""Number of trials after which the process is replaced."""

LOOK = 0.5
"""Seconds between two looks at a process that has not answered."""

PRELOADED = ["fuzz.light", "rlacd.decompose_mesh", "rlacd.io.read.load", "trimesh.exchange.load", "scipy.spatial"]

_server = multiprocessing.get_context("forkserver")


@dataclass(frozen=True)
class _Death:
    """How a process ended that did not answer."""

    end: str
    said: str


class WarmTrials:
    """Light trials in a warm process; has the methods of `fuzz.light.LightTrials`.

    Parameters
    ----------
    seed : int
    seeds : dict
        Valid files to damage, by format.
    cpu_seconds : float
        Limit of a trial.
    """

    def __init__(self, seed: int, seeds: dict[str, list[Seed]], cpu_seconds: float = CPU_SECONDS) -> None:
        self.seed = seed
        self._seeds = seeds
        self._cpu_seconds = cpu_seconds
        self._scratch = tempfile.TemporaryDirectory(prefix="rlacd-light-")
        self._here = LightTrials(seed, seeds, Path(self._scratch.name))
        self._process: Any = None
        self._pipe: Connection | None = None
        self._next: int | None = None
        self._life = 0
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        _server.set_forkserver_preload(PRELOADED)

    def kind(self, number: int) -> str:
        """The kind of trial of a number."""
        return self._here.kind(number)

    def shape(self, number: int) -> tuple[Shape, Options]:
        """Shape and options of a trial of the kind ``small``."""
        return self._here.shape(number)

    def damaged(self, number: int) -> tuple[str, Seed]:
        """The format and content of a trial of the kind ``read``."""
        return self._here.damaged(number)

    def trial(self, number: int) -> Trial:
        """Run a trial; the process goes on with the numbers that follow while this one is looked at."""
        if number != self._next or self._life >= LIFE or self._process is None:
            self._start()
            self._send("trials", number)
        answer = self._answer()
        self._next, self._life = number + 1, self._life + 1
        if isinstance(answer, Trial):
            return answer
        counts = Counter(files=1) if self.kind(number) == "read" else Counter()
        return Trial(self.seed, number, self.kind(number), answer.end, [answer.said], counts=counts)

    def retry(self, trial: Trial, shape: Shape, options: Options) -> Trial:
        """Decompose another shape with other options."""
        return self._once(trial, "retry", trial, shape, options)

    def reread(self, trial: Trial, kind: str, file: Seed) -> Trial:
        """Read another file."""
        return self._once(trial, "reread", trial, kind, file)

    def close(self) -> None:
        """End the process."""
        self._stop()
        self._scratch.cleanup()

    def _once(self, trial: Trial, *request: Any) -> Trial:
        self._start()
        self._send(*request)
        answer = self._answer()
        self._stop()
        if isinstance(answer, Trial):
            return answer
        return Trial(trial.seed, trial.number, trial.kind, answer.end, [answer.said], options=trial.options)

    def _start(self) -> None:
        self._stop()
        self._pipe, there = _server.Pipe()
        log = Path(self._scratch.name) / "log"
        log.write_bytes(b"")
        given = (there, self.seed, self._seeds, Path(self._scratch.name), log)
        self._process = _server.Process(target=_serve, args=given, daemon=True)
        self._process.start()
        there.close()
        self._life = 0

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._pipe is not None:
            self._pipe.close()
        self._process, self._pipe, self._next = None, None, None

    def _send(self, *request: Any) -> None:
        assert self._pipe is not None
        self._pipe.send(request)

    def _answer(self) -> Trial | _Death:
        """Wait for the next answer; a process that exceeds a limit is ended."""
        assert self._pipe is not None
        begun, spent = time.monotonic(), None
        try:
            while not self._pipe.poll(LOOK):
                now = _spent(self._process.pid)
                spent = now if spent is None else spent
                if time.monotonic() - begun > PATIENCE:
                    return self._ended("hang", f"no answer within {PATIENCE:g} s, {now - spent:.1f} of a processor")
                if now - spent > self._cpu_seconds:
                    return self._ended("hang", f"it took more than {self._cpu_seconds:g} s of a processor")
                if _resident(self._process.pid) > MEMORY:
                    return self._ended("memory", f"it took more than {MEMORY / 2**30:g} GB")
            answer: Trial = self._pipe.recv()
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode
            return self._ended("crash", f"it ended with {code}: {self._last_words()}")
        return answer

    def _ended(self, end: str, said: str) -> _Death:
        self._stop()
        return _Death(end, said)

    def _last_words(self) -> str:
        return (Path(self._scratch.name) / "log").read_text(encoding="utf-8", errors="replace")[-600:]


def _serve(pipe: Connection, seed: int, seeds: dict[str, list[Seed]], folder: Path, log: Path) -> None:
    """Answer requests until the other end is closed."""
    words = os.open(log, os.O_WRONLY | os.O_APPEND)
    os.dup2(words, 1)
    os.dup2(words, 2)
    enter_worker()
    with tempfile.TemporaryDirectory(dir=folder) as place:
        light = LightTrials(seed, seeds, Path(place))
        request, *given = pipe.recv()
        if request != "trials":
            pipe.send(getattr(light, request)(*given))
            return
        for number in range(given[0], given[0] + LIFE):
            pipe.send(light.trial(number))
            if number % 1000 == 0:
                os.truncate(log, 0)


def _spent(pid: int) -> float:
    try:
        times = psutil.Process(pid).cpu_times()
    except psutil.Error:
        return 0.0
    return float(times.user + times.system)


def _resident(pid: int) -> int:
    try:
        return int(psutil.Process(pid).memory_info().rss)
    except psutil.Error:
        return 0
