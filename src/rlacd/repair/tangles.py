"""Bodies that cross themselves so badly that their solid is inside out in places, and cannot be cut.

Both sides of a cut are closed along rims. Where a solid is inside out, rims cross each other, and caps add as many
faces as the cut has removed: the pieces have ever less volume, but no fewer faces, and none of them becomes convex.
"""

from __future__ import annotations

import numpy as np

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.soup import NO_AREA, winding_beside
from rlacd.repair.union import to_arrays
from rlacd.solid.solid import Solid
from rlacd.solid.topology import IntArray, face_areas

INSIDE_OUT = 0.03
"""Share of a body's area that is inside out from which it is taken for a tangle. Meshes that people have made have up
to 0.012, tangles found by fuzzing 0.056 and more."""


class TangledError(Exception):
    """A solid that cannot be cut as it is.

    Attributes
    ----------
    bodies : int64 [N]
        The bodies of the input to be built another way (`rlacd.repair.repair.repair`).
    """

    def __init__(self, bodies: IntArray) -> None:
        super().__init__(bodies)
        self.bodies = bodies


def refuse_tangles(solid: Solid, threads: int | None = None) -> None:
    """Raise `TangledError` if bodies of a repaired solid are inside out in places."""
    bodies = tangled_bodies(solid, threads)
    if len(bodies):
        raise TangledError(bodies)


def tangled_bodies(solid: Solid, threads: int | None = None) -> IntArray:
    """Return the numbers of the bodies of which more than `INSIDE_OUT` of the repaired surface is inside out."""
    vertices, faces = solid.vertices, solid.faces.astype(np.int64)
    inside_out = winding_beside(vertices, faces).min(axis=0) < -0.25
    if not inside_out.any():
        return np.empty(0, dtype=np.int64)
    poll_stop()
    area = face_areas(vertices, faces)
    body = np.zeros(len(faces), dtype=np.int64)
    if solid.body_of is not None:
        _, nearest = SurfaceQuery(*to_arrays(solid.surface), threads).closest(vertices[faces].mean(axis=1))
        body = solid.body_of[nearest]
    wrong, own = np.bincount(body, area * inside_out), np.bincount(body, area)
    return np.flatnonzero(wrong > INSIDE_OUT * np.maximum(own, NO_AREA))
