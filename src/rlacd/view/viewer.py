"""The viewer: a session on a mesh, and the server that shows it."""

from __future__ import annotations

import atexit
import contextlib
import dataclasses
import functools
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rlacd.decompose_mesh import decompose
from rlacd.errors import OptionError
from rlacd.io.read.load import load_mesh
from rlacd.options import Options
from rlacd.view.picture import check_up
from rlacd.view.server import ViewServer
from rlacd.view.session import AT_EXIT, Session
from rlacd.view.wishes import Subject, ViewerControls

LEAVING = 0.8  # seconds that work under way has to end when the viewer is closed


@contextlib.contextmanager
def open_viewer(
    mesh: str | os.PathLike[str],
    options: dict[str, Any] | None = None,
    *,
    up: str | None = None,
    port: int | None = None,
    threads: int | None = None,
) -> Iterator[Viewer]:
    """Serve a page that shows a mesh and its hulls, until the block ends.

    The first decomposition begins at once. The page is for this machine alone and needs no network.

    Parameters
    ----------
    mesh : path-like
        Any file `rlacd.decompose` takes; it is read anew for every decomposition, so that changes to it are seen.
    options : dict, optional
        What the page's controls hold at first: fields of `ViewerControls`.
    up : {"x", "y", "z"}, optional
        The axis of the mesh that points up; y for glTF and z for all else by default.
    port : int, optional
        Where to listen; 8765, or any free one, by default.
    threads : int, optional
        Threads to use; all processors by default.

    Yields
    ------
    Viewer

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    OptionError
        An option is out of range, or the port is in use.
    """
    check_up(up)
    wishes = read_controls(options or {})
    wishes.options()
    Options(threads=threads)
    subject = read_subject(mesh, up)
    session = Session(functools.partial(decompose, threads=threads))
    try:
        server = ViewServer(session, subject, port=port, options=wishes, accept=read_controls, read=read_subject)
    except BaseException:
        session.close()
        raise
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), name="rlacd-view-server", daemon=True)
    thread.start()
    server.decompose(wishes)
    try:
        yield Viewer(session, server, thread)
    finally:
        until = time.monotonic() + LEAVING
        session.close(0.0)  # first, so that pages that follow it are let go
        if not server.end(until - time.monotonic()):
            atexit.register(server.end, AT_EXIT)  # an answer is being worked out
        session.close(max(0.0, until - time.monotonic()))


@dataclasses.dataclass(frozen=True)
class Viewer:
    """A viewer that is open.

    Attributes
    ----------
    session : Session
        What it works on.
    """

    session: Session
    _server: ViewServer
    _thread: threading.Thread

    @property
    def address(self) -> str:
        """Where the page is."""
        return self._server.address

    @property
    def connections(self) -> int:
        """How many connections are open."""
        return self._server.connections

    @property
    def folder(self) -> Path | None:
        """Where the mesh lies that a page has sent; None before."""
        return self._server.folder

    @property
    def at_work(self) -> bool:
        """Whether work goes on, even after the viewer is closed: a kernel ends what it has begun."""
        return not self.session.ended or self.connections > 0

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        with contextlib.suppress(KeyboardInterrupt):
            while self._thread.is_alive():  # a wait without end would not hear Ctrl-C on Windows
                self._thread.join(0.5)


def read_subject(mesh: str | os.PathLike[str], up: str | None = None) -> Subject:
    """Read the mesh that is to be looked at.

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    """
    read = load_mesh(mesh)
    is_gltf = Path(mesh).suffix.lower() in (".glb", ".gltf")
    return Subject(Path(mesh), Path(read.name).stem, up or ("y" if is_gltf else "z"), "m" if is_gltf else "", read)


def read_controls(given: dict[str, Any]) -> ViewerControls:
    """Take what a page or a command line gave.

    Raises
    ------
    OptionError
        An option is unknown or not of its kind.
    """
    known = {field.name for field in dataclasses.fields(ViewerControls)}
    for name in given:
        if name not in known:
            raise OptionError(f"{name!r} is no option of the viewer; choose from {', '.join(sorted(known))}.")
    return ViewerControls(**given)
