"""Decoders written in C++ that a damaged file may crash: they run in a process of their own, which may die instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.memory import memory_left
from rlacd.pool import Answer, Blobs, ProcessLimits, Request, Values, WorkerDiedError
from rlacd.pool.local import Worker

LIMITS = ProcessLimits(seconds=600.0, memory=8 * 2**30)
"""Of one file."""


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
    RlacdError
        Raised by the server.
    """
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
