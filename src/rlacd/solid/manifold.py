"""Closed meshes as solids of manifold3d, without the faces it would move.

Its operations cannot be interrupted, so the time left is checked before each.
"""

from __future__ import annotations

import math
import time
from typing import TypeAlias

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray

from rlacd._native import Stopped, face_areas, poll_stop, seconds_left, signed_tetrahedra
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import ROUNDING

Faces: TypeAlias = NDArray[np.int64] | NDArray[np.int32]

# If manifold3d moves faces by more than this on average, corners are moved by less than `ROUNDING`.
_MOVED = 1e-5
_HAIRS = 4  # about one in a hundred leaves two faces so nearly coplanar that it does not help


def to_manifold(vertices: FloatArray, faces: Faces) -> Manifold:
    """Return the solid a closed, oriented mesh bounds; the solid is empty if the mesh is not closed.

    manifold3d treats a face folded back onto its neighbour, in one plane, as degenerate and flips its edges and those
    around it: surfaces came back up to 0.1 away. Such a solid is rebuilt with each corner moved by a hair, so that no
    two faces are coplanar.
    """
    manifold = _taken_over(vertices, faces)
    if manifold.is_empty():
        return manifold
    moved = _moved(manifold, vertices, faces)
    for seed in range(_HAIRS):
        if moved <= _MOVED:
            break
        hair = np.random.default_rng(seed).uniform(-ROUNDING / 2, ROUNDING / 2, np.shape(vertices))
        other = _taken_over(vertices + hair, faces)
        if not other.is_empty() and (less := _moved(other, vertices, faces)) < moved:
            manifold, moved = other, less
    return manifold


def _taken_over(vertices: FloatArray, faces: Faces) -> Manifold:
    require_time_for(len(faces))
    mesh = Mesh64(np.require(vertices, np.float64, ["C", "W"]), np.require(faces, np.uint64, ["C", "W"]))
    manifold = Manifold(mesh)
    return manifold if manifold.status() == Error.NoError else Manifold()


def _moved(manifold: Manifold, vertices: FloatArray, faces: Faces) -> float:
    """How far manifold3d moved the faces on average, estimated from the volume."""
    faces = faces.astype(np.int64)
    area = float(face_areas(vertices, faces).sum())
    return abs(manifold.volume() - float(signed_tetrahedra(vertices, faces).sum())) / area if area > 0 else 0.0


LONG_BOOLEAN = 50_000
"""A number of triangles that manifold3d processes in some tenths of a second."""

LATE = 0.3
"""Seconds by which a boolean, or hulls of what was not repaired, may overrun the time left."""

_SEGMENTS = 64


def require_time_for(triangles: int) -> None:
    """Raise `Stopped` if the work must stop, or would have to before a boolean of this many triangles could finish.

    How long a boolean takes depends on the machine and its load, so a small task of the same kind is timed.
    """
    poll_stop()
    left = seconds_left()
    if triangles < LONG_BOOLEAN or math.isinf(left):
        return
    ball = Manifold.sphere(1.0, _SEGMENTS).to_mesh64()
    start = time.perf_counter()
    some = Manifold(ball).num_tri()
    if (time.perf_counter() - start) * triangles / some > left + LATE:
        raise Stopped
