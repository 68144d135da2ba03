"""Quick imports: trimesh without the libraries that it imports only because they are installed."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
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
    """End the process at Ctrl-C or SIGTERM, with nothing to write yet: libraries catch what is raised in an import."""

    def end(*_: object) -> NoReturn:
        say(f"rlacd: {INTERRUPTED}")
        leave(ExitCode.INTERRUPTED)

    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    with handling(end):
        yield


@contextmanager
def handling(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Handle Ctrl-C and SIGTERM, by which clusters and containers end a process; only the main thread can."""
    main = threading.current_thread() is threading.main_thread()
    previous = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM) if main}
    try:
        yield
    finally:
        for number, before in previous.items():
            signal.signal(number, before)
