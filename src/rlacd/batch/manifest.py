"""One JSON row per mesh: appended to a journal during the run, written as a sorted file at its end."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import PurePosixPath
from types import TracebackType
from typing import Any, TypeAlias

from rlacd.batch.store import PRIVATE, ResultStore
from rlacd.errors import OutputError

Row: TypeAlias = dict[str, Any]
"""``mesh``, the asset's name, and facts about it; in the manifest also ``outputs``, the length of each of its files."""


class Ledger(AbstractContextManager["Ledger"]):
    """The rows of a folder of results; rows of meshes outside this run are kept.

    Parameters
    ----------
    store : Store
    name : str
        Name of the file.

    Raises
    ------
    OutputError
        A line is damaged.
    """

    def __init__(self, store: ResultStore, name: str) -> None:
        self._store, self._name, self._journal = store, name, f"{PRIVATE}/{name}"
        self._waiting: list[bytes] = []  # for the journal, at most `append_every` seconds
        self._written = time.monotonic()
        self._rows: dict[str, Row] = {}
        self._owner: dict[str, str] = {}
        kept = {name: store.read(name) or b"", f"the journal of {name}": store.appended(self._journal)}
        for row in (row for where, content in kept.items() for row in _read(where, content.splitlines())):
            self._put(row)

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
        self._waiting.append(_line(row))
        if time.monotonic() - self._written >= self._store.append_every:
            self._write_journal()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Write the sorted file and remove the journal; after an error, leave the journal for the next run."""
        if error is not None:
            return self._write_journal()
        content = b"".join(_line(self._rows[mesh]) for mesh in sorted(self._rows))
        if content != (self._store.read(self._name) or b""):
            self._store.write(self._name, content)
        self._store.remove_appended(self._journal)

    def _write_journal(self) -> None:
        """Write the lines that wait."""
        if self._waiting:
            self._store.append(self._journal, b"".join(self._waiting))
        self._waiting, self._written = [], time.monotonic()

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


def _read(where: str, lines: Iterable[bytes]) -> Iterable[Row]:
    for number, line in enumerate(lines, 1):
        try:
            row: Row = json.loads(line)
            if not isinstance(row["mesh"], str):
                raise TypeError("no name")
            if not all(_is_inside(output) for output, _ in row.get("outputs", {}).items()):
                raise ValueError("an output outside of the results")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise OutputError(f"line {number} of {where} is damaged ({error}); delete the line.") from error
        yield row


def _is_inside(output: str) -> bool:
    """Tell whether a name stays inside the results; outputs of recomputed meshes are deleted, so this must hold."""
    parts = PurePosixPath(output).parts
    return bool(parts) and "\0" not in output and parts[0] != "/" and ".." not in parts
