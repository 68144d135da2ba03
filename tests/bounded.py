"""Running a function in a process of its own that may take only so much memory and time."""

from __future__ import annotations

import importlib
import math
import multiprocessing
import os
import re
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
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


def bounded(
    function: Callable[..., Any], *args: Any, memory: int = 2**30, seconds: int = 60, needs: str = "rlacd"
) -> Any:
    """What `function` returns or raises, called in a process that may take `memory` more bytes of address space.

    It may use this many `seconds` of CPU time; time spent waiting for a processor does not count.
    The module that it `needs` is imported before that is counted.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # each of its threads reserves memory of its own
    _server.set_forkserver_preload(PRELOADED)
    pool = ProcessPoolExecutor(1, _server, _limit, (memory, seconds, needs))
    try:
        return pool.submit(function, *args).result(PATIENCE)
    except BrokenProcessPool as error:
        raise AssertionError("it crashed, or was ended because it took too long") from error
    finally:
        for process in list(pool._processes.values()):
            process.kill()
        pool.shutdown()


def _limit(memory: int, seconds: int, needs: str) -> None:
    importlib.import_module(needs)
    held = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text(encoding="utf-8"))[1]) * 1024  # type: ignore[index]
    resource.setrlimit(resource.RLIMIT_AS, (held + memory, held + memory))
    spent = math.ceil(time.process_time())
    resource.setrlimit(resource.RLIMIT_CPU, (spent + seconds, spent + seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
