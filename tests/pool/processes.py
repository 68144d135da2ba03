"""The processes of pools that this process has started."""

from __future__ import annotations

import contextlib

import psutil


def pool_processes() -> list[psutil.Process]:
    """Those that run, the oldest first; not what other tests have left, such as a server of forks."""
    found = []
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has just ended
            if "rlacd.pool.child" in child.cmdline():
                found.append(child)
    return sorted(found, key=lambda child: (child.create_time(), child.pid))
