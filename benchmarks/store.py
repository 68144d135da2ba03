"""Results on disk: one JSON line per mesh, method and setting, and the hulls beside it, so that no task is repeated."""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from benchmarks.methods import RawHull
from rlacd.errors import OutputError
from rlacd.io.write.atomic import lock_folder, output_errors

Row: TypeAlias = dict[str, Any]
"""A finished task: ``mesh``, ``method``, ``setting``, and either ``error`` or the metrics."""


@dataclass(frozen=True)
class Task:
    """One mesh, one method and its setting.

    Attributes
    ----------
    mesh : str
        Path relative to the folder of meshes.
    method : str
        A name accepted by `make_method`.
    setting : float
        The method's setting.
    """

    mesh: str
    method: str
    setting: float

    @property
    def key(self) -> tuple[str, str, float]:
        """Identity of the task."""
        return self.mesh, self.method, self.setting

    @property
    def file_name(self) -> str:
        """File name for its hulls."""
        digest = hashlib.sha256(repr(self.key).encode()).hexdigest()[:16]
        return f"{Path(self.mesh).stem[:40]}-{digest}.npz"


class Store:
    """A folder of results: ``results.jsonl`` and ``hulls/``.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.

    Raises
    ------
    OutputError
        The folder cannot be created or written to, another run is writing to it, or a line of its file is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lines = folder / "results.jsonl"
        self._lock = threading.Lock()
        with output_errors(folder):
            (folder / "hulls").mkdir(parents=True, exist_ok=True)
            self._run = lock_folder(folder, folder / ".lock")
            try:
                self._held = self._lines.open("a", encoding="utf-8")
            except OSError:
                self._run.release()
                raise
        try:
            self._rows = {_key(row): row for row in _whole_lines(self._lines)}
        except BaseException:
            self.close()
            raise

    def get(self, task: Task) -> Row | None:
        """The row of a task; None if it is not finished."""
        return self._rows.get(task.key)

    def rows(self) -> list[Row]:
        """All rows, in the order in which they finished."""
        return list(self._rows.values())

    def add(self, row: Row) -> None:
        """Write a row, replacing one of the same task."""
        with self._lock:
            line = json.dumps(row, allow_nan=False) + "\n"
            self._held.write(line)
            self._held.flush()
            os.fsync(self._held.fileno())
            self._rows[_key(row)] = row

    def close(self) -> None:
        """Release the folder to other runs."""
        self._held.close()
        self._run.release()

    def hulls_of(self, task: Task) -> Path:
        """Path of the hulls of a task, whether they exist yet or not."""
        return self.folder / "hulls" / task.file_name


def save_hulls(path: Path, hulls: Sequence[RawHull], account: Row) -> None:
    """Write hulls and facts about how they were made, atomically."""
    temporary = path.with_suffix(".part.npz")
    np.savez_compressed(
        temporary,
        vertices=np.concatenate([np.empty((0, 3)), *(v for v, _ in hulls)]),
        faces=np.concatenate([np.empty((0, 3), dtype=np.int32), *(f for _, f in hulls)]),
        counts=np.array([(len(v), len(f)) for v, f in hulls], dtype=np.int64).reshape(-1, 2),
        account=np.array(json.dumps(account)),
    )
    temporary.replace(path)


def load_hulls(path: Path) -> tuple[list[RawHull], Row]:
    """Read what `save_hulls` wrote."""
    with np.load(path, allow_pickle=False) as file:
        ends = np.cumsum(file["counts"], axis=0)
        vertices = np.split(file["vertices"], ends[:, 0])[:-1]  # nothing follows the last hull
        faces = np.split(file["faces"], ends[:, 1])[:-1]
        account: Row = json.loads(str(file["account"]))
    return list(zip(vertices, faces, strict=True)), account


def _key(row: Row) -> tuple[str, str, float]:
    return row["mesh"], row["method"], float(row["setting"])


def _whole_lines(path: Path) -> Iterable[Row]:
    """Read the rows of a file; an incomplete last line left by a killed run is cut off."""
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        os.truncate(path, whole)
    for number, line in enumerate(content[:whole].splitlines(), 1):
        try:
            row: Row = json.loads(line)
            _key(row)
        except (ValueError, KeyError, TypeError) as error:
            raise OutputError(f"line {number} of {path} is damaged ({error}); delete the line.") from error
        yield row
