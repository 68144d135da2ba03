"""Results on disk: a file per mesh, method and setting, and the hulls beside it, so that no task is repeated."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from benchmarks.methods import RawHull
from rlacd.io.write import write_file

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

    def file_in(self, folder: Path, ending: str) -> Path:
        """Where something of this task is kept in a folder of results."""
        digest = hashlib.sha256(repr((self.mesh, self.method, self.setting)).encode()).hexdigest()[:16]
        return folder / "tasks" / f"{Path(self.mesh).stem[:40]}-{digest}{ending}"


def load_row(folder: Path, task: Task) -> Row | None:
    """The row of a task; None if it is not finished."""
    path = task.file_in(folder, ".json")
    row: Row | None = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    return row


def save_row(folder: Path, task: Task, row: Row) -> None:
    """Write the row of a task, completely or not at all."""
    write_file(task.file_in(folder, ".json"), json.dumps(row, allow_nan=False, indent=1).encode())


def save_hulls(path: Path, hulls: Sequence[RawHull], account: Row) -> None:
    """Write hulls and facts about how they were made, completely or not at all."""
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
