"""A server that does what it is told, well or badly, in whatever process it is, and the processes of pools."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import psutil

from rlacd.errors import OptionError
from rlacd.pool import Blobs

SERVER = "tests.pool.obedient:Obedient"


class Obedient:
    def __init__(self, staging: Path) -> None:
        assert staging.is_dir()
        self._staging = staging

    def __call__(self, values: dict[str, Any], blobs: Blobs) -> tuple[dict[str, Any], dict[str, bytes]]:
        what = values.get("what", "echo")
        if what == "die once":
            mark = Path(values["mark"])
            what = "echo" if mark.exists() else "die"
            mark.touch()
        if what == "die":
            print("last words", file=sys.stderr, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "hang":
            time.sleep(3600)
        if what in ("outlive", "outlive, holding the interpreter"):
            Path(values["mark"]).write_text(str(os.getpid()))
            os.kill(os.getppid(), signal.SIGKILL)
            (time if what == "outlive" else ctypes.PyDLL(None)).sleep(3600)
        if what == "refuse":
            raise OptionError("that is too much; ask for less.")
        if what == "bug":
            raise ZeroDivisionError("a surprise")
        return {"pid": os.getpid(), "echo": values}, dict(blobs)


def pool_processes() -> list[psutil.Process]:
    """Those that run, the oldest first; not what other tests have left, such as a server of forks."""
    found = []
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has just ended
            if "rlacd.pool.child" in child.cmdline():
                found.append(child)
    return sorted(found, key=lambda child: (child.create_time(), child.pid))
