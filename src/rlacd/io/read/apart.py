"""Decoders written in C++ that a damaged file may crash: they run in a process of their own, which may die instead."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from rlacd.errors import MeshFileError, MissingExtraError
from rlacd.io.read import function_of
from rlacd.io.read.contents import Contents
from rlacd.memory import memory_left
from rlacd.pool import Answer, Blobs, ProcessLimits, Request, Values, WorkerDiedError
from rlacd.pool.local import Worker

LIMITS = ProcessLimits(seconds=600.0, memory=8 * 2**30)
"""Of one file."""

EXTRAS = {
    "rlacd.io.read.cad:CadReader": ("cascadio", "cad"),
    "rlacd.io.read.draco:DracoDecoder": ("DracoPy", "draco"),
    "rlacd.io.read.fbx:FbxReader": ("ufbx", "fbx"),
    "rlacd.io.read.usd_stage:StageReader": ("pxr", "usd"),
}
"""The servers: the package that each needs, and the extra that installs it."""


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
        raise MissingExtraError(f"{path} needs an extra: run  pip install 'rlacd[{extra}]'  and try again.")
    worker = Worker()
    limits = replace(LIMITS, memory=max(min(LIMITS.memory or 0, memory_left()), 1))
    try:
        return worker.ask(Request(server, values, blobs, limits=limits))
    except WorkerDiedError as error:
        raise MeshFileError(
            f"{path} cannot be read as {kind}: it is damaged or cut off ({error.reason}); export it again"
        ) from error
    finally:
        worker.close()


def read_apart(server: str, path: Path, kind: str, blobs: Blobs) -> Contents:
    """Ask a server that answers as `rlacd.io.read.trimesh_scene.contents_of` describes."""
    contents_of = function_of("read.trimesh_scene:contents_of")  # trimesh, which the servers do without
    contents: Contents = contents_of(answer_of(server, path, kind, {"path": str(path)}, blobs), path)
    return contents
