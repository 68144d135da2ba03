"""Rendering in a process of its own: the renderer keeps Python's lock, and all other threads would stand still."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd.errors import OutputError
from rlacd.pool import Blobs, ProcessLimits, Request, Shared, Values, WorkerDiedError
from rlacd.pool.local import Worker
from rlacd.view.render import Body, Render, Spheres, render

SERVER = "rlacd.view.apart:RenderServer"


@contextlib.contextmanager
def renderer() -> Iterator[Render]:
    """Open a process that does what `render` does; it ends with the block.

    The function raises `OutputError` if the process dies.
    """
    worker = Worker()

    def render_apart(
        bodies: Sequence[Body], width: int, height: int, *, spheres: Spheres | None = None, **how: Any
    ) -> npt.NDArray[np.uint8]:
        arrays = {f"{name} {index}": array for index, body in enumerate(bodies) for name, array in vars(body).items()}
        arrays |= {} if spheres is None else vars(spheres)
        blobs = {name: np.asarray(array, dtype=np.float64).tobytes() for name, array in arrays.items()}
        values = {"bodies": len(bodies), "width": width, "height": height, "how": how}
        try:
            answer = worker.ask(Request(SERVER, values, blobs, limits=ProcessLimits(memory=0)))
        except WorkerDiedError as died:
            raise OutputError(f"the picture could not be drawn: {died}.") from died
        return np.frombuffer(answer.blobs["pixels"], dtype=np.uint8).reshape(height, width, -1)

    try:
        yield render_apart
    finally:
        worker.close()


class RenderServer:
    """Renders in a process of the pool, which leaves processors to whoever else needs them."""

    def __init__(self, staging: Path) -> None:
        if hasattr(os, "nice"):
            os.nice(10)

    def __call__(self, values: Values, blobs: Blobs, shared: Mapping[str, Shared]) -> tuple[Values, dict[str, bytes]]:
        """Render one picture."""
        arrays = {name: np.frombuffer(blob) for name, blob in blobs.items()}
        shapes = [(arrays[f"triangles {index}"], arrays[f"color {index}"]) for index in range(values["bodies"])]
        bodies = [Body(triangles.reshape(-1, 3, 3), color) for triangles, color in shapes]
        centres = arrays.get("centres")
        spheres = None if centres is None else Spheres(centres.reshape(-1, 3), arrays["radii"], arrays["color"])
        pixels = render(bodies, values["width"], values["height"], spheres=spheres, **values["how"])
        return {}, {"pixels": pixels.tobytes()}
