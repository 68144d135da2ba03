"""Bodies that cross themselves so badly that their solid is inside out in places, and cannot be cut.

Both sides of a cut are closed along rims. Where a solid is inside out, rims cross each other, and caps add as many
faces as the cut has removed: the pieces have ever less volume, but no fewer faces, and none of them becomes convex.
"""

from __future__ import annotations

import numpy as np
import trimesh

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.soup import NO_AREA, winding_beside
from rlacd.repair.union import to_arrays
from rlacd.solid.frame import FloatArray
from rlacd.solid.solid import Solid
from rlacd.solid.topology import IntArray, face_areas

INSIDE_OUT = 0.03
"""Share of a body's area that is inside out from which it is taken for a tangle. Meshes that people have made have up
to 0.012, tangles found by fuzzing 0.056 and more."""

INSIDE_OUT_IF_FAILING = 0.0125
"""The same for a solid whose cutting seems to fail. Fuzzing found tangles with 0.015 and 0.024."""


PLACES, MOST_DIVISIONS = 2000, 4
"""Number of places where a surface is looked at, and of times that a face is divided into four for it."""


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


def refuse_tangles(solid: Solid, threads: int | None, failing: bool) -> None:
    """Raise `TangledError` if bodies of a repaired solid are inside out in places, few if cutting seems to fail."""
    bodies = tangled_bodies(solid, threads, INSIDE_OUT_IF_FAILING if failing else INSIDE_OUT)
    if len(bodies):
        raise TangledError(bodies)


def tangled_bodies(solid: Solid, threads: int | None = None, share: float = INSIDE_OUT) -> IntArray:
    """Return the numbers of the bodies of which more than a share of the repaired surface is inside out."""
    vertices, faces = _divided(solid.vertices, solid.faces.astype(np.int64))
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
    return np.flatnonzero(wrong > share * np.maximum(own, NO_AREA))


def _divided(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Divide faces into equal ones until there are about `PLACES`: each is looked at in one place."""
    for _ in range(MOST_DIVISIONS):
        if 2 * len(faces) > PLACES:
            break
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return vertices, np.asarray(faces, dtype=np.int64)
