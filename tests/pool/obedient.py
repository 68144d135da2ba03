"""A server that does what it is told, well or badly, in whatever process it is."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rlacd.errors import OptionError
from rlacd.pool import Blobs, Shared

SERVER = "tests.pool.obedient:Obedient"


class Obedient:
    def __init__(self, staging: Path) -> None:
        assert staging.is_dir()
        self._staging = staging

    def __call__(
        self, values: dict[str, Any], blobs: Blobs, shared: Mapping[str, Shared]
    ) -> tuple[dict[str, Any], dict[str, bytes]]:
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
        if what == "outlive":
            Path(values["mark"]).write_text(str(os.getpid()))
            os.kill(os.getppid(), signal.SIGKILL)
            ctypes.PyDLL(None).sleep(3600)  # holds the interpreter
        if what == "refuse":
            raise OptionError("that is too much; ask for less.")
        if what == "bug":
            raise ZeroDivisionError("a surprise")
        seen = {name: {part: len(blob) for part, blob in given.blobs.items()} for name, given in shared.items()}
        return {"pid": os.getpid(), "echo": values, "shared": seen}, dict(blobs)
