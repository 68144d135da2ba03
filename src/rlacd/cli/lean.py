"""Quick imports: trimesh without the libraries that it imports only because they are installed."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from rlacd.cli.exit_codes import INTERRUPTED, ExitCode, leave, say

NOT_OURS = ("scipy", "shapely", "rtree", "cascadio", "embreex", "fcl", "svg")
"""What trimesh uses where it is installed, and rlacd never needs: half of a command's time."""

NEEDLESS = {
    **dict.fromkeys((".obj", ".glb", ".gltf"), ("networkx", "lxml", "importlib.metadata")),
    **dict.fromkeys((".stl", ".ply", ".off"), ("networkx", "lxml", "importlib.metadata", "PIL")),
}
"""What trimesh reads formats without; networkx needs importlib.metadata, so both are hidden or neither."""


def import_trimesh(mesh: Path) -> None:
    """Import trimesh with what it needs to read a file like this; for commands that end with this mesh."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy would start threads for products that nothing here uses
    unused = (*NOT_OURS, *NEEDLESS.get(mesh.suffix.lower(), ()))
    hidden = [name for name in unused if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    with ctrl_c_at_once():
        import trimesh  # noqa: F401

    for name in hidden:
        del sys.modules[name]


@contextmanager
def ctrl_c_at_once() -> Iterator[None]:
    """End the process at Ctrl-C, before there is anything to write: libraries catch whatever is raised in an import."""

    def end(*_: object) -> NoReturn:
        say(f"rlacd: {INTERRUPTED}")
        leave(ExitCode.INTERRUPTED)

    previous = signal.getsignal(signal.SIGINT)
    if previous is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
