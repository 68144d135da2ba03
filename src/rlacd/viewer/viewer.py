"""The viewer: a session on a mesh, and the server that shows it."""

from __future__ import annotations

import atexit
import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rlacd.options import Options, with_criterion
from rlacd.viewer.controls import read_controls, read_subject
from rlacd.viewer.picture import check_up
from rlacd.viewer.server import Read, ViewServer
from rlacd.viewer.session import Decompose, Session

AT_EXIT = 30.0
"""Seconds that work may take to end when Python exits."""


@contextlib.contextmanager
def open_viewer(
    mesh: str | os.PathLike[str],
    decompose: Decompose,
    options: dict[str, Any] | None = None,
    *,
    read: Read = read_subject,
    up: str | None = None,
    port: int | None = None,
    threads: int | None = None,
) -> Iterator[ViewServer]:
    """Serve a page that shows a mesh and its hulls, until the block ends.

    The first decomposition starts at once. The page is only reachable from this machine and needs no network.

    Parameters
    ----------
    mesh : path-like
        Any file `rlacd.decompose` takes; it is read again for every decomposition, so that changes to it take effect.
    decompose : callable
        `rlacd.decompose`.
    read : callable
        Reads the file; `rlacd.io.robots.shown` has both functions for robots too.
    options : dict, optional
        Initial values of the page's controls, by their names.
    up : {"x", "y", "z"}, optional
        The axis of the mesh that points up; by default what the file or its format says, else a guess.
    port : int, optional
        Port to listen on; 8765, or any free one, by default.
    threads : int, optional
        Threads to use; all processors by default.

    Yields
    ------
    ViewServer
        Its session does the work.

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    OptionError
        An option is out of range, or the port is in use.
    """
    check_up(up)
    controls = read_controls(options or {})
    Options.of({**with_criterion(options or {}), "threads": threads})
    subject = read(Path(mesh), up)
    session = Session(lambda **given: decompose(**given, threads=threads))
    try:
        server = ViewServer(session, subject, read, port=port, options=controls)
    except BaseException:
        session.close()
        raise
    server.decompose(controls)
    try:
        yield server
    finally:
        until = time.monotonic() + 0.8  # for current work to end
        session.close(0.0)  # first, so that event streams end
        if not server.end(until - time.monotonic()):
            atexit.register(server.end, AT_EXIT)  # an answer is still being computed
        if not session.close(max(0.0, until - time.monotonic())):
            atexit.register(session.close, AT_EXIT)  # its thread holds objects that C++ libraries report as leaked
