"""Running a function in a process of its own that may take only so much memory and time."""

from __future__ import annotations

import importlib
import math
import multiprocessing
import os
import re
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

resource = pytest.importorskip("resource")

PRELOADED = [
    "tests.bounded",
    "rlacd.io.read.load",
    "rlacd.io.robots",
    "rlacd.policies.network",
    "trimesh.exchange.load",
]

_server = multiprocessing.get_context("forkserver")


PATIENCE = 900.0
"""Seconds by the clock after which a process is taken to be stuck."""


class Died(AssertionError):
    """The process crashed, or was ended because it took too long."""


def bounded(
    function: Callable[..., Any], *args: Any, memory: int = 2**30, seconds: int = 60, needs: str | None = None
) -> Any:
    """What `function` returns or raises, called in a process that may take `memory` more bytes of address space.

    It may use this many `seconds` of CPU time; time spent waiting for a processor does not count.
    A module that it `needs` is imported before that is counted.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # each of its threads reserves memory of its own
    _server.set_forkserver_preload(PRELOADED)
    here, there = _server.Pipe(duplex=False)
    process = _server.Process(target=_answer, args=(there, memory, seconds, needs, function, args))
    process.start()
    there.close()
    try:
        if not here.poll(PATIENCE):
            raise Died(f"no answer within {PATIENCE:g} s")
        kind, value = here.recv()
    except EOFError:
        process.join()
        raise Died(f"ended with code {process.exitcode}") from None
    finally:
        process.kill()
        process.join()
    if kind == "raised":
        raise value
    return value


def _answer(
    pipe: Connection, memory: int, seconds: int, needs: str | None, function: Callable[..., Any], args: tuple[Any, ...]
) -> None:
    if needs is not None:
        importlib.import_module(needs)
    held = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text(encoding="utf-8"))[1]) * 1024  # type: ignore[index]
    resource.setrlimit(resource.RLIMIT_AS, (held + memory, held + memory))
    spent = math.ceil(time.process_time())
    resource.setrlimit(resource.RLIMIT_CPU, (spent + seconds, spent + seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        answer: tuple[str, Any] = ("returned", function(*args))
    except BaseException as error:  # which one it is, is what is tested
        error.__cause__ = error.__context__ = None
        answer = ("raised", error)
    pipe.send(answer)
