"""Bodies that cross themselves so badly that their solid is inside out in places, and cannot be cut.

Both sides of a cut are closed along rims. Where a solid is inside out, rims cross each other, and caps add as many
faces as the cut has removed: the pieces have ever less volume, but no fewer faces, and none of them becomes convex.
"""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.soup import face_normals
from rlacd.repair.windings import BESIDE
from rlacd.solid.arrays import FloatArray
from rlacd.solid.topology import BoolArray, IntArray

TANGLED = 0.02
"""Share of a surface that is inside out from which it is a tangle. Of 600 meshes that people have made, all have up to
0.012 but for one with 0.042, which became 1,408 hulls; tangles found by fuzzing have 0.027 and more."""

# Number of places where a surface is looked at.
_PLACES = 1000

MOST_TANGLED = 10 * _PLACES
"""A body of more triangles is no tangle: it is noise that turns some of them over, and its proxy averages that."""


def is_tangle(solid: SurfaceQuery) -> bool:
    """Whether a closed surface is inside out in too many places."""
    return bool(_inside_out(solid, _PLACES)[1].mean() > TANGLED)


def tangled_bodies(solid: SurfaceQuery, vertices: FloatArray, faces: IntArray, body: IntArray) -> IntArray:
    """Return the bodies of which too much is inside out, given the faces that the solid was built from."""
    points, is_wrong = _inside_out(solid, MOST_TANGLED)  # enough to tell in which bodies
    at = body[SurfaceQuery(vertices, faces, solid.threads).closest(points)[1]]
    count = len(np.bincount(body))
    is_tangled = np.bincount(at, is_wrong, count) > TANGLED * np.bincount(at, minlength=count)
    return np.flatnonzero(is_tangled & (np.bincount(body) <= MOST_TANGLED))


def _inside_out(solid: SurfaceQuery, count: int) -> tuple[FloatArray, BoolArray]:
    """Points ``[N, 3]`` spread evenly over a closed surface, and whether it is inside out there."""
    points, on = _native.sample_surface(solid.vertices, solid.faces.astype(np.int32), count, 0)
    step = BESIDE * face_normals(solid.vertices, solid.faces[on].astype(np.int64))
    beside = (solid.winding(points + way * step, is_closed=True) for way in (1, -1))
    return points, np.minimum(*beside) < 0
