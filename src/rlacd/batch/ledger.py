"""A row of JSON a mesh: in a journal while the work goes on, sorted in a file when it ends."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import Any, TypeAlias

from rlacd.batch.store import ResultStore
from rlacd.errors import OutputError

Row: TypeAlias = dict[str, Any]
"""``mesh``, the asset's name, and what is known of it; in the manifest ``outputs``, the length of each of its files."""


class Ledger:
    """The rows of a folder of results; those of meshes that are not in this run are kept.

    Parameters
    ----------
    store : Store
    name : str
        Of the file.

    Raises
    ------
    OutputError
        A line is damaged.
    """

    def __init__(self, store: ResultStore, name: str) -> None:
        self._store = store
        self._name = name
        self._journal = store.journal(name)
        self._rows: dict[str, Row] = {}
        self._owner: dict[str, str] = {}
        for row in _read(name, (store.read(name) or b"").splitlines()):
            self._put(row)
        for row in _read(f"the journal of {name}", self._journal.lines()):
            self._put(row)

    def get(self, mesh: str) -> Row | None:
        """The row of a mesh."""
        return self._rows.get(mesh)

    def rows(self) -> list[Row]:
        """All rows, sorted by mesh."""
        return [self._rows[mesh] for mesh in sorted(self._rows)]

    def add(self, row: Row) -> None:
        """Keep a row in the place of an older one of the same mesh; files that only that one had are removed first."""
        old = self._rows.get(row["mesh"], {})
        for output in sorted(set(old.get("outputs", {})) - set(row.get("outputs", {}))):
            self._store.remove(output)
        self._journal.add(_line(row))
        self._put(row)

    def finish(self) -> None:
        """Write the sorted file; the journal has served."""
        content = b"".join(_line(row) for row in self.rows())
        if content != (self._store.read(self._name) or b""):
            self._store.write(self._name, content)
        self._journal.remove()

    def close(self) -> None:
        """Leave the journal to the next run."""
        self._journal.close()

    def _put(self, row: Row) -> None:
        """Take a row over; a mesh that is gone may have left its row, though its result's name is another's by now."""
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
    except UnicodeEncodeError:  # a file name that is no Unicode: escapes hold the odd bytes that Python keeps of it
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
    """Tell whether a name leads to a file of the results: outputs of meshes that are done again are removed."""
    parts = PurePosixPath(output).parts
    return bool(parts) and "\0" not in output and parts[0] != "/" and ".." not in parts
