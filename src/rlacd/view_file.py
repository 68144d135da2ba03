"""The public function that opens the viewer: on a mesh, or on a robot with its joints."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

from rlacd.io.robots.read import is_robot, robot_or_none
from rlacd.io.robots.viewed import USUAL, decompose_viewed, read_viewed
from rlacd.options.output import Axis
from rlacd.viewer.server import ViewServer
from rlacd.viewer.viewer import open_viewer


def view(
    path: str | os.PathLike[str],
    *,
    up: Axis | None = None,
    port: int | None = None,
    threads: int | None = None,
    package_dirs: Sequence[str] = (),
    **options: Any,
) -> AbstractContextManager[ViewServer]:
    """Serve a page that shows a mesh or a robot and its hulls, until the ``with`` block ends.

    The first decomposition starts at once. The page is only reachable from this machine and needs no network.

    Parameters
    ----------
    path : path-like
        Any file that `rlacd.decompose` or `rlacd.rewrite_robot` takes; it is read again for every decomposition, so
        that changes to it take effect.
    up : {"x", "y", "z"}, optional
        The axis of the mesh that points up; by default what the file or its format says, else a guess.
    port : int, optional
        Port to listen on; 8765, or any free one, by default.
    threads : int, optional
        Threads to use; all processors by default.
    package_dirs : sequence of str
        Of a robot, as for `rlacd.rewrite_robot`.
    **options
        First values of the page's controls, named as the options of `rlacd.decompose` and `rlacd.NavigableSpace`;
        ``criterion="navigable"`` by its name.

    Returns
    -------
    context manager of ViewServer
        Its ``address`` is the page's; ``wait()`` returns on Ctrl-C.

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    OptionError
        An option is out of range, or the port is in use.
    """
    robot = is_robot(Path(path)) or robot_or_none(Path(path)) is not None
    read = partial(read_viewed, package_dirs=package_dirs)
    decompose = partial(decompose_viewed, package_dirs=package_dirs)
    first = {**USUAL, **options} if robot else options
    return open_viewer(path, decompose, first, read=read, up=up, port=port, threads=threads)
