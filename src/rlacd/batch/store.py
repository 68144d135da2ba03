"""The folder of results: files that are there completely or not at all, and the locks of its runs."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from filelock import FileLock, Timeout

from rlacd.errors import OutputError, OutputNameError
from rlacd.io.read.open_file import read_file
from rlacd.io.write.atomic import output_errors, write_file

PRIVATE = ".rlacd"
"""Folder inside the results for locks, and for the rows of shards until a run of all meshes joins them."""

LOCK_SECONDS = 10.0
"""Seconds that a shard waits for other shards, each of which holds the lock of the folder for a moment."""


class Store:
    """A folder of results; names are relative to it, with forward slashes.

    Parameters
    ----------
    folder : Path
    shard : tuple of int
        This run does this one, from 1, of so many parts of the meshes; a single part is a run of all meshes.
    """

    def __init__(self, folder: Path, shard: tuple[int, int] = (1, 1)) -> None:
        self.folder = folder
        self.shard = "" if shard[1] == 1 else "shard-{}-of-{}".format(*shard)
        self._locks = contextlib.ExitStack()

    def own(self, name: str) -> str:
        """The name of a file of rows that this run writes."""
        return f"{PRIVATE}/{self.shard}.{name}" if self.shard else name

    def all_of(self, name: str) -> list[str]:
        """That file as written by runs of all meshes and by shards, the latest last."""
        there = [self.folder / name, *self.folder.glob(f"{PRIVATE}/shard-*.{name}")]
        with output_errors(self.folder):
            latest = sorted((file for file in there if file.exists()), key=lambda file: file.stat().st_mtime_ns)
        return [file.relative_to(self.folder).as_posix() for file in latest]

    def write(self, name: str, data: bytes) -> None:
        """Write a file atomically."""
        write_file(self.folder / name, data)

    def put(self, files: Mapping[str, bytes], owns: Callable[[str], bool]) -> dict[str, int]:
        """Write files; one that refers to others comes last. Returns their lengths.

        Raises
        ------
        OutputNameError
            A file with other bytes is there that no row names. The same bytes are left by a killed run.
        """
        for name, data in files.items():
            if not owns(name) and self.read(name) not in (None, data):
                raise OutputNameError(
                    f"{name} is there already, but not by this batch: move it, or choose another folder."
                )
        for name, data in files.items():
            self.write(name, data)
        return {name: len(data) for name, data in files.items()}

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

    def append(self, name: str, line: bytes) -> None:
        """Append a line to a file, and flush it to disk."""
        path = self.folder / name
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())

    def open(self) -> None:
        """Lock the folder for this run; the system releases the lock when the process ends, however it does.

        Shards work beside each other, but not beside a run of all meshes, which removes what killed ones left
        incomplete.

        Raises
        ------
        OutputError
            The folder cannot be made or written to, or another run is writing to it.
        """
        private = self.folder / PRIVATE
        with output_errors(self.folder):
            private.mkdir(parents=True, exist_ok=True)
            try:
                if self.shard:
                    self._hold(private / f"{self.shard}.lock")
                    with FileLock(private / "lock", LOCK_SECONDS):
                        return
                self._hold(private / "lock")
                for lock in private.glob("shard-*.lock"):
                    self._hold(lock)
            except Timeout as error:
                self.close()
                told = f"another run is writing to {self.folder}; wait for it or choose another folder."
                raise OutputError(told) from error
        for at, _, files in os.walk(self.folder):
            for file in files:
                if file.startswith(".rlacd-") and file.endswith(".tmp"):
                    Path(at, file).unlink(missing_ok=True)

    def _hold(self, lock: Path) -> None:
        self._locks.enter_context(FileLock(lock, blocking=False, thread_local=False))

    def close(self) -> None:
        """Release the folder to other runs."""
        self._locks.close()
