"""Child processes: starting one, ending it with its children, how it ended, and how much memory it took."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import IO

import psutil


def start(
    command: Sequence[str],
    stdin: int,
    stdout: int,
    stderr: int | IO[bytes],
    environment: Mapping[str, str],
) -> subprocess.Popen[bytes]:
    """Start a process that leads its own process group, so that Ctrl-C in the terminal does not reach it."""
    return subprocess.Popen(
        command,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        env={**os.environ, **environment},
        start_new_session=True,  # ignored by Windows, as the flag is by all others
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )


def why_it_ended(code: int | None) -> str:
    """Describe an exit status: ``died of SIGSEGV``, ``ended with code 3``."""
    if code is None:
        return "closed its pipe"
    if code < 0:
        with contextlib.suppress(ValueError):
            return f"died of {signal.Signals(-code).name}"
        return f"died of signal {-code}"
    return f"ended with code {code}" if code < 2**16 else f"ended with code {code:#x}"  # a crash on Windows


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process made by `start` and its children."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    elif process.poll() is None:  # Windows has no process groups to kill, but its processes know their parents
        with contextlib.suppress(psutil.NoSuchProcess):
            for child in psutil.Process(process.pid).children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    child.kill()
        process.kill()


def peak_memory() -> int:
    """Return the bytes of memory that this process held at most so far."""
    try:
        import resource
    except ImportError:  # Windows
        used = psutil.Process().memory_info()
        return int(getattr(used, "peak_wset", used.rss))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 2**10)
