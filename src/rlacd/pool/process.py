"""How a process ended, and how to end one."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess


def why_it_ended(code: int | None) -> str:
    """Describe an exit status: ``died of SIGSEGV``, ``ended with code 3``."""
    if code is None:
        return "closed its pipe"
    if code < 0:
        return f"died of {signal.Signals(-code).name}"
    return f"ended with code {code}"


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process and its children, and wait until it is gone."""
    kill_group(process)
    process.wait()


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and its children; it must lead its own process group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
