"""Atomic file writes: no reader ever sees a partial file."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from rlacd.errors import OutputError, OutputNameError

_OF_NAMES = (errno.EISDIR, errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP)
"""Errors that another name would not have."""


def write_file(path: Path, data: bytes) -> None:
    """Write `data` to `path`, completely or not at all.

    The bytes go to a hidden file in the same folder, are flushed to disk, and only then renamed to `path`, which
    replaces an older file in one step. Missing folders are created.

    Raises
    ------
    OutputError
        The path is a link, the folder is read-only, the disk is full, ...; what was at `path` is untouched.
    """
    with output_errors(path):
        refuse_link(path)
        final = path.resolve()
        # Not derived from the final name, which may already have the maximum length.
        temporary = final.with_name(f".rlacd-{secrets.token_hex(8)}.tmp")
        final.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write_to_disk(temporary, data)
            os.replace(temporary, final)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        sync_folder(final.parent)


def refuse_link(path: Path) -> None:
    """Raise OutputNameError if `path` is a link: what it leads to may be somebody else's, anywhere on the disk."""
    if path.is_symlink():
        raise OutputNameError(f"cannot write {path}: it is a link; remove it, or name the file it points to.")


@contextlib.contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn an operating system error into an `OutputError` that names `path` and says what to do."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        kind = OutputNameError if error.errno in _OF_NAMES else OutputError
        raise kind(f"cannot write {path}: {_reason(error)}.") from error
    except (RuntimeError, ValueError) as error:  # raised by pathlib for circular links and null characters
        raise OutputNameError(f"cannot write {str(path)!r}: {error}; choose another name.") from error


def sync_folder(folder: Path) -> None:
    """Make renames inside `folder` survive a power cut, on systems that can."""
    with contextlib.suppress(OSError):  # Windows cannot open a folder; some network disks cannot sync one.
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _write_to_disk(path: Path, data: bytes) -> None:
    # The user's umask narrows 0o666, as for any file they create; tempfile's 0o600 would lock out their group.
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    with os.fdopen(os.open(path, flags, 0o666), "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _reason(error: OSError) -> str:
    known = {
        errno.ENOSPC: "the disk is full; free some space and run again",
        errno.EDQUOT: "your disk quota is used up; free some space and run again",
        errno.EACCES: "you may not write there; choose another place or change its permissions",
        errno.EPERM: "you may not write there; choose another place or change its permissions",
        errno.EROFS: "that disk is read-only; choose another place",
        errno.ENOENT: "its folder does not exist; create it first",
        errno.ENOTDIR: "a part of its path is a file, not a folder; choose another place",
        errno.EISDIR: "it is a folder; give a file name",
        errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
    }
    return known.get(error.errno or 0, f"{error.strerror or error}; choose another place")
