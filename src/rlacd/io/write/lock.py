"""One run at a time in a folder of results."""

from __future__ import annotations

from pathlib import Path

from filelock import FileLock, Timeout

from rlacd.errors import OutputError


def lock_folder(folder: Path, file: Path) -> FileLock:
    """Lock `folder` for this run by holding `file`; the system releases it when the process ends, however it does.

    Raises
    ------
    OutputError
        Another run holds it.
    OSError
        The file cannot be created.
    """
    lock = FileLock(file, blocking=False, thread_local=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise OutputError(f"another run is writing to {folder}; wait for it or choose another folder.") from error
    return lock
