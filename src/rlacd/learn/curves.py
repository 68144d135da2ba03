"""The curves of a run: one JSON line per point, and the same for TensorBoard."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter


class Curves:
    """Curves that a resumed run continues from its checkpoint as if it had never been interrupted.

    Parameters
    ----------
    run : Path
        Folder for ``curves.jsonl`` and ``tensorboard/``.
    """

    def __init__(self, run: Path) -> None:
        self._folder = run
        self._path = run / "curves.jsonl"
        self._board: SummaryWriter | None = None

    def restart(self, count: int) -> None:
        """Drop the points after `count`: they will be recomputed."""
        kept = []
        if self._path.exists():
            lines = self._path.read_text(encoding="utf-8").splitlines(keepends=True)
            kept = [line for line in lines if line.endswith("\n") and json.loads(line)["cuts"] <= count]
        if count == 0:
            kept = []
        self._path.write_text("".join(kept), encoding="utf-8")
        self._board = SummaryWriter(str(self._folder / "tensorboard"), purge_step=count + 1)

    def add(self, count: int, values: Mapping[str, float], seconds: float) -> None:
        """Append a point to several curves."""
        with open(self._path, "a", encoding="utf-8") as file:
            file.write(json.dumps({"cuts": count, **values, "seconds": round(seconds, 3)}) + "\n")
        if self._board is not None:
            for name, value in {**values, "seconds": seconds}.items():
                group = "validation/" + name[11:] if name.startswith("validation_") else "training/" + name
                self._board.add_scalar(group, value, count)

    def close(self) -> None:
        """Flush TensorBoard."""
        if self._board is not None:
            self._board.close()
