"""Reading untrusted files: regular files only, and none that would not fit into memory."""

from __future__ import annotations

import errno
import os
import stat

LARGEST_FILE = 2**30
"""Bytes of the largest file that is read. A binary STL of this length has 21 million triangles."""

# Opening a pipe would wait for a writer; Windows has no such files, and would translate line ends.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def read_file(path: str | os.PathLike[str], most: int = LARGEST_FILE) -> bytes:
    """Read the content of a file as of opening it, even if it grows meanwhile.

    Parameters
    ----------
    path : path-like
        Links are followed.
    most : int
        Bytes of the largest file that is read.

    Raises
    ------
    OSError
        The file cannot be opened, is no regular one (pipes and devices may never end), or is too large; ``strerror``
        says which.
    """
    _check(os.stat(path), path, most)  # opening a device may have side effects
    handle = os.open(path, _FLAGS)
    try:
        opened = os.fstat(handle)  # the name may refer to another file by now
        _check(opened, path, most)
    except OSError:
        os.close(handle)
        raise
    with os.fdopen(handle, "rb") as file:
        return file.read(opened.st_size)


def _check(status: os.stat_result, path: str | os.PathLike[str], most: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe or a device, not a regular file", os.fspath(path))
    if status.st_size > most:
        raise OSError(errno.EFBIG, f"it is larger than {most / 2**20:g} MB", os.fspath(path))
