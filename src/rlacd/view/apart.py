"""Rendering in a process of its own.

The renderer keeps Python's lock, and all other threads would stand still; and other libraries disturb it: CoACD hides
its plugins.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rlacd.errors import OutputError
from rlacd.io.read.apart import Answered, served
from rlacd.pool import Blobs, ProcessLimits, Request, Values, WorkerDiedError
from rlacd.pool.local import Worker
from rlacd.view.render import Body, Spheres, render

SERVER = "rlacd.view.apart:draw"


def render_apart(
    scenes: Sequence[tuple[Sequence[Body], Spheres | None]], width: int, height: int, samples: int
) -> list[npt.NDArray[np.uint8]]:
    """Do what `render` does for each scene; spheres are half transparent.

    Raises
    ------
    MissingExtraError
        Mitsuba is not installed.
    OutputError
        The process died.
    """
    how = {"width": width, "height": height, "samples": samples}
    worker, drawn = Worker(), []
    try:
        for bodies, spheres in scenes:
            arrays = [*bodies, *([] if spheres is None else [spheres])]
            blobs = {
                f"{i} {name}": array.tobytes() for i, body in enumerate(arrays) for name, array in vars(body).items()
            }
            values = {"bodies": len(bodies), "spheres": spheres is not None, "how": how}
            pixels = worker.ask(Request(SERVER, values, blobs, limits=ProcessLimits(memory=0))).blobs["pixels"]
            drawn.append(np.frombuffer(pixels, dtype=np.uint8).reshape(height, width, 4))
    except WorkerDiedError as died:
        raise OutputError(f"the picture could not be drawn: {died}.") from died
    finally:
        worker.close()
    return drawn


@served
def draw(values: Values, blobs: Blobs) -> Answered:
    """Render one scene, and leave processors to whoever else needs them."""
    if hasattr(os, "nice") and os.nice(0) == 0:
        os.nice(10)
    arrays = {name: np.frombuffer(blob) for name, blob in blobs.items()}
    count = values["bodies"]
    bodies = [Body(arrays[f"{i} triangles"].reshape(-1, 3, 3), arrays[f"{i} color"]) for i in range(count)]
    pixels = render(bodies, **values["how"])
    if values["spheres"]:
        balls = Spheres(*(arrays[f"{count} {name}"] for name in ("centres", "radii", "color")))
        pixels = ((pixels.astype(np.uint16) + render(bodies, spheres=balls, **values["how"]) + 1) // 2).astype(np.uint8)
    return {}, {"pixels": pixels.tobytes()}
