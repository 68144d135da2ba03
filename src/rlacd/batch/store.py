"""Where results go: a local folder, or any address that fsspec supports (``s3://``, ``gs://``, ``memory://``)."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from filelock import FileLock, Timeout

from rlacd.errors import MissingExtraError, OptionError, OutputError, OutputNameError, import_extra
from rlacd.io.read.open_file import read_file
from rlacd.io.write.atomic import output_errors, write_file

PRIVATE = ".rlacd"
"""Folder inside the results for files that only the next run needs."""

APPEND_SECONDS = 10.0
"""Seconds between objects that hold a journal's lines at an address."""


def open_store(place: str) -> ResultStore:
    """Open the store for a folder or an address.

    Raises
    ------
    MissingExtraError
        The place is an address, and fsspec or its driver is not installed.
    OptionError
        fsspec does not support the address.
    """
    folder = place.removeprefix("file://")
    return AddressStore(place) if "://" in folder else FolderStore(Path(folder))


def put_files(store: ResultStore, files: Mapping[str, bytes], owns: Callable[[str], bool]) -> dict[str, int]:
    """Write files; one that refers to others is written last. Returns their lengths.

    Raises
    ------
    OutputNameError
        A file with other bytes is there that this batch does not own. The same bytes are left by a killed run.
    """
    for name, data in files.items():
        if not owns(name) and store.read(name) not in (None, data):
            raise OutputNameError(f"{name} is there already, but not by this batch: move it or choose another folder.")
    for name, data in files.items():
        store.write(name, data)
    return {name: len(data) for name, data in files.items()}


class FolderStore:
    """A folder on this machine; names are relative to it, with forward slashes.

    Attributes
    ----------
    append_every : float
        Seconds that lines of a journal may wait.
    """

    append_every = 0.0

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock: FileLock | None = None

    def write(self, name: str, data: bytes) -> None:
        """Write a file atomically."""
        path = self.folder / name
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, data)

    def read(self, name: str) -> bytes | None:
        """Return the content of a file; None if it does not exist."""
        path = self.folder / name
        try:
            return read_file(path, sys.maxsize)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise OutputNameError(f"cannot read {path} ({error.strerror}); move it away.") from error

    def size(self, name: str) -> int | None:
        """Return the length of a file; None if it does not exist."""
        try:
            return (self.folder / name).stat().st_size
        except OSError:
            return None

    def remove(self, name: str) -> None:
        """Remove a file, and any folders left empty."""
        path = self.folder / name
        if path.is_dir() and not path.is_symlink():
            return  # somebody has put a folder there since
        with output_errors(path), contextlib.suppress(NotADirectoryError):
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # stops at the first folder that is not empty
            for parent in path.parents:
                if parent == self.folder:
                    break
                parent.rmdir()

    def append(self, name: str, data: bytes) -> None:
        """Append lines to a file, and flush them to disk."""
        path = self.folder / name
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("ab") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())

    def appended(self, name: str) -> bytes:
        """Return all complete lines that were appended; an incomplete one is left by a kill and dropped."""
        content = self.read(name) or b""
        whole = content[: content.rfind(b"\n") + 1]
        if whole != content:
            self.write(name, whole)
        return whole

    def remove_appended(self, name: str) -> None:
        """Remove all lines that were appended."""
        (self.folder / name).unlink(missing_ok=True)

    def open(self) -> None:
        """Lock the folder for this run, and remove files left incomplete by a killed one.

        The system releases the lock when the process ends, however it does.

        Raises
        ------
        OutputError
            The folder cannot be made or written to, or another run is writing to it.
        """
        held = self.folder / PRIVATE / "lock"
        with output_errors(self.folder):
            held.parent.mkdir(parents=True, exist_ok=True)
            self._lock = FileLock(held, blocking=False, thread_local=False)
            try:
                self._lock.acquire()
            except Timeout as error:
                told = f"another run is writing to {self.folder}; wait for it or choose another folder."
                raise OutputError(told) from error
        for at, _, files in os.walk(self.folder):
            for file in files:
                if file.startswith(".rlacd-") and file.endswith(".tmp"):
                    Path(at, file).unlink(missing_ok=True)

    def close(self) -> None:
        """Release the store to other runs."""
        if self._lock is not None:
            self._lock.release()


class AddressStore:
    """Any address that fsspec has a driver for; the driver finds credentials its usual way (environment, files)."""

    append_every = APPEND_SECONDS

    def __init__(self, address: str) -> None:
        fsspec = import_extra("fsspec", "an address", "fleet")
        try:
            self._system, self._root = fsspec.core.url_to_fs(address)
        except ImportError as error:
            raise MissingExtraError(f"{address} needs another package: {str(error).splitlines()[0]}") from error
        except ValueError as error:
            raise OptionError(f"{address} is not an address that fsspec knows: {error}.") from error

    def write(self, name: str, data: bytes) -> None:
        """See `FolderStore`; atomic where the system writes objects atomically, as all object stores do."""

        def put(path: str) -> None:
            self._system.makedirs(path.rpartition("/")[0], exist_ok=True)
            self._system.pipe_file(path, data)

        self._ask(name, put)

    def read(self, name: str) -> bytes | None:
        """See `FolderStore`."""
        found = self._ask(name, self._system.cat_file, absent=None)
        return None if found is None else bytes(found)

    def size(self, name: str) -> int | None:
        """See `FolderStore`."""
        found = self._ask(name, self._system.size, absent=None)
        return None if found is None else int(found)

    def remove(self, name: str) -> None:
        """See `FolderStore`."""
        self._ask(name, self._system.rm_file, absent=None)

    def names(self, folder: str) -> list[str]:
        """List the files of a folder, sorted."""
        self._system.invalidate_cache()
        found = self._ask(folder, partial(self._system.ls, detail=False), absent=())
        return sorted(f"{folder}/{str(path).rstrip('/').rpartition('/')[2]}" for path in found)

    def append(self, name: str, data: bytes) -> None:
        """See `FolderStore`; an object store cannot append, so the lines of each call are an object."""
        folder = f"{name}.parts"
        self.write(f"{folder}/{len(self.names(folder)):08d}.jsonl", data)

    def appended(self, name: str) -> bytes:
        """See `FolderStore`."""
        return b"".join(self.read(part) or b"" for part in self.names(f"{name}.parts"))

    def remove_appended(self, name: str) -> None:
        """See `FolderStore`."""
        for part in self.names(f"{name}.parts"):
            self.remove(part)

    def open(self) -> None:
        """Do nothing: an object store has no locks, so two runs must not write to one address at the same time."""

    def close(self) -> None:
        """Do nothing."""

    def _ask(self, name: str, ask: Callable[[str], Any], **otherwise: Any) -> Any:
        """Call a function of the driver with a path; `absent`, if it is given, is the answer where there is no file."""
        path = f"{self._root.rstrip('/')}/{name}"
        try:
            return ask(path)
        except (MemoryError, RecursionError):
            raise
        except Exception as error:  # drivers pass on any exception of their clients
            if isinstance(error, FileNotFoundError) and "absent" in otherwise:
                return otherwise["absent"]
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise OutputError(
                f"cannot reach {path} ({reason}); check the address and your permissions there."
            ) from error


ResultStore: TypeAlias = FolderStore | AddressStore
