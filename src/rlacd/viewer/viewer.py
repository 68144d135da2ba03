"""The viewer: a session on a mesh, and the server that shows it."""

from __future__ import annotations

import atexit
import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rlacd.options import Options
from rlacd.options.criterion import with_criterion
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

    `rlacd.view` says what is given and raised.

    Parameters
    ----------
    decompose : callable
        `rlacd.decompose`.
    options : dict, optional
        Initial values of the page's controls, by their names.
    read : callable
        Reads the file; `rlacd.io.robots.viewed` has both functions for robots too.
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
