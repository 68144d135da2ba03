"""A mesh decomposed as a batch does it: in a watched process, or in this one."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rlacd.fleet import Order
from rlacd.fleet.server import SERVER, MeshServer
from rlacd.pool import Limits, Request
from rlacd.pool.worker import Worker

Said = tuple[dict[str, Any], dict[str, bytes]]
"""What `rlacd.fleet.server.MeshServer` answers."""


class Watched:
    """A process that is ended when a mesh takes more than the limits.

    Parameters
    ----------
    limits : Limits
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._worker = Worker()

    @property
    def pid(self) -> int:
        """Of the process; 0 where there is none."""
        return int(self._worker.name.partition("@")[0].replace("-", "0"))

    def run(self, order: Order, mesh: Path, name: str, stem: str) -> Said:
        """Have a mesh decomposed.

        Raises
        ------
        WorkerDiedError
            The process died or was ended; the next mesh gets a new one.
        """
        answer = self._worker.ask(Request(SERVER, _values(order, mesh, name, stem), limits=self.limits))
        return answer.values, answer.blobs

    def close(self) -> None:
        """End the process."""
        self._worker.close()


class Here:
    """Does the same in this process, so that a sanitizer's words can be read; a crash ends everything."""

    def run(self, order: Order, mesh: Path, name: str, stem: str) -> Said:
        """Decompose a mesh."""
        print(f"seed {mesh.stem}", file=sys.stderr, flush=True)
        with TemporaryDirectory() as staging:
            return MeshServer(Path(staging))(_values(order, mesh, name, stem), {}, {})

    def close(self) -> None:
        """Nothing is open."""


def _values(order: Order, mesh: Path, name: str, stem: str) -> dict[str, Any]:
    values = {"order": order.as_plain(), "path": str(mesh), "name": name, "stem": stem}
    return {**values, "hull_only": False, "out": None, "parent": ""}
