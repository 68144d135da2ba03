"""Decoders written in C++ that a damaged file may crash: they run in a process of their own, which may die instead."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

from rlacd.errors import MeshFileError, MissingExtraError, extra_needed
from rlacd.io.read import function_of
from rlacd.io.read.contents import MOST_PLACES, Contents, Triangles, damaged
from rlacd.memory import memory_left
from rlacd.pool import Answer, Blobs, MakeServer, ProcessLimits, Request, Server, Values, WorkerDiedError
from rlacd.pool.local import Worker
from rlacd.solid.arrays import FloatArray

LIMITS = ProcessLimits(seconds=600.0, memory=8 * 2**30)
"""Of one file."""

EXTRAS = {
    "rlacd.io.read.cad:triangulate": ("cascadio", "cad"),
    "rlacd.io.read.draco:decode": ("DracoPy", "draco"),
    "rlacd.io.read.fbx:read_scene": ("ufbx", "fbx"),
    "rlacd.io.read.usd_stage:read_stage": ("pxr", "usd"),
}
"""The servers: the package that each needs, and the extra that installs it."""


Answered: TypeAlias = "tuple[Values, dict[str, bytes]]"


def served(answer: Callable[[Values, Blobs], Answered]) -> MakeServer:
    """Make a server of a function."""

    def make(_: Path) -> Server:
        return answer

    return make


def answer_of(server: str, path: Path, kind: str, values: Values, blobs: Blobs) -> Answer:
    """Ask a new process, which ends with its answer.

    Parameters
    ----------
    server : str
        ``module:name`` of a factory, as of `rlacd.pool.MakeServer`.
    path : Path
        Of the file, for messages.
    kind : str
        What it is read as, for messages.
    values, blobs
        The request.

    Raises
    ------
    MeshFileError
        The process died, or took more than `LIMITS`.
    MissingExtraError
        The package that the server needs is not installed.
    RlacdError
        Raised by the server.
    """
    package, extra = EXTRAS.get(server, ("", ""))
    if package and find_spec(package) is None:
        raise MissingExtraError(extra_needed(str(path), extra))
    worker = Worker()
    limits = replace(LIMITS, memory=max(min(LIMITS.memory or 0, memory_left()), 1))
    try:
        return worker.ask(Request(server, values, blobs, limits=limits))
    except WorkerDiedError as error:
        raise damaged(path, kind, error.reason) from error
    finally:
        worker.close()


class ToldNodes:
    """The nodes of a file as a server tells them: what `values` say of each, and ``INDEX.points``, ``INDEX.faces``."""

    def __init__(self, path: Path) -> None:
        self.values: list[Values] = []
        self.blobs: dict[str, bytes] = {}
        self._path, self._names = path, set[str]()

    def add(self, names: Sequence[str], to_world: FloatArray, look: Values | None, shape: Triangles) -> None:
        """Add a node by the first of its names that no other has; raises MeshFileError if there are too many."""
        if len(self.values) >= MOST_PLACES:
            raise MeshFileError(f"{self._path} places more than {MOST_PLACES} meshes: join them first")
        index = len(self.values)
        name = next((name for name in names if name and name not in self._names), f"{names[-1]}:{index}")
        self._names.add(name)
        self.values.append({"name": name, "transform": to_world.ravel().tolist(), "look": look})
        self.blobs |= {f"{index}.points": shape.vertices.tobytes(), f"{index}.faces": shape.faces.tobytes()}


def read_apart(server: str, path: Path, kind: str, blobs: Blobs) -> Contents:
    """Ask a server that answers with `ToldNodes`, ``up``, ``metres`` and maybe ``warnings``."""
    contents_of = function_of("read.trimesh_scene:contents_of")  # trimesh, which the servers do without
    contents: Contents = contents_of(answer_of(server, path, kind, {"path": str(path)}, blobs), path)
    return contents
