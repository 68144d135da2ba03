"""One JSON row per mesh: appended during the run, sorted at its end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import PurePosixPath
from types import TracebackType
from typing import Any, TypeAlias

from rlacd.batch.store import Store
from rlacd.errors import OutputError

Row: TypeAlias = dict[str, Any]
"""``mesh``, the asset's name, and facts about it; in the manifest also ``outputs``, the length of each of its files."""


class Ledger(AbstractContextManager["Ledger"]):
    """The rows of a folder of results, the last one of each mesh; rows of meshes outside this run are kept.

    A shard knows all rows and writes its own to a file of its own; a run of all meshes joins these files.

    Parameters
    ----------
    store : Store
    name : str
        Name of the file.

    Raises
    ------
    OutputError
        A line is damaged. An incomplete one at the end is left by a kill, and dropped.
    """

    def __init__(self, store: Store, name: str) -> None:
        self._store, self._file = store, store.own(name)
        self._rows: dict[str, Row] = {}
        self._owner: dict[str, str] = {}
        self._mine: set[str] = set()  # meshes whose rows this run writes
        self._files = store.all_of(name)
        for file in self._files:
            for row in _read(file, store.read(file) or b""):
                self._put(row)
                if file == self._file or not store.shard:
                    self._mine.add(row["mesh"])

    def get(self, mesh: str) -> Row | None:
        """The row of a mesh."""
        return self._rows.get(mesh)

    def owns(self, output: str) -> bool:
        """Whether a row names this file."""
        return output in self._owner

    def add(self, row: Row) -> None:
        """Add a row, replacing an older one of the same mesh; files listed only in the old row are removed first."""
        old = self._rows.get(row["mesh"], {})
        for output in sorted(set(old.get("outputs", {})) - set(row.get("outputs", {}))):
            self._store.remove(output)
        self._put(row)
        self._mine.add(row["mesh"])
        self._store.append(self._file, _line(row))

    def __enter__(self) -> Ledger:
        """Cut off an incomplete line, so that rows can be appended."""
        content = self._store.read(self._file) or b""
        if not content.endswith(b"\n"):
            self._write(content[: content.rfind(b"\n") + 1])
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Write the sorted file, and remove those of shards it holds; after an error, leave all to the next run."""
        if error is not None:
            return
        self._write(b"".join(_line(self._rows[mesh]) for mesh in sorted(self._mine & self._rows.keys())))
        if not self._store.shard:
            for file in self._files:
                if file != self._file:
                    self._store.remove(file)

    def _write(self, content: bytes) -> None:
        if content != (self._store.read(self._file) or b""):
            self._store.write(self._file, content)

    def _put(self, row: Row) -> None:
        """Store a row, and drop the row of any other mesh (deleted since) that claims the same outputs."""
        mesh = row["mesh"]
        for output in self._rows.pop(mesh, {}).get("outputs", {}):
            self._owner.pop(output, None)
        for output in row.get("outputs", {}):
            if output in self._owner:
                self._rows.pop(self._owner[output], None)
            self._owner[output] = mesh
        self._rows[mesh] = row


def _line(row: Row) -> bytes:
    text = json.dumps(row, allow_nan=False, ensure_ascii=False)
    try:
        return text.encode() + b"\n"
    except UnicodeEncodeError:  # a file name that is not valid Unicode: escapes keep Python's surrogates
        return json.dumps(row, allow_nan=False).encode() + b"\n"


def _read(file: str, content: bytes) -> Iterator[Row]:
    for number, line in enumerate(content.split(b"\n")[:-1], 1):
        try:
            row: Row = json.loads(line)
            if not isinstance(row["mesh"], str):
                raise TypeError("no name")
            if not all(_is_inside(output) for output, _ in row.get("outputs", {}).items()):
                raise ValueError("an output outside of the results")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise OutputError(f"line {number} of {file} is damaged ({error}); delete the line.") from error
        yield row


def _is_inside(output: str) -> bool:
    """Tell whether a name stays inside the results; outputs of recomputed meshes are deleted, so this must hold."""
    parts = PurePosixPath(output).parts
    return bool(parts) and "\0" not in output and parts[0] != "/" and ".." not in parts
