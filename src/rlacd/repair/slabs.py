"""Slabs: what has no volume of its own, made a little thick."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from rlacd._native import poll_stop
from rlacd.repair.union import as_manifold, unite
from rlacd.solid.frame import FloatArray
from rlacd.solid.thickness import thickened
from rlacd.solid.topology import IntArray


def hull_of_points(points: FloatArray) -> Manifold:
    """Return the hull of points ``[N, 3]``, thickened along the axes in which they have no extent."""
    poll_stop()
    return Manifold.hull_points(thickened(np.unique(points, axis=0)))


def slab_of_faces(vertices: FloatArray, faces: IntArray) -> Manifold:
    """Return the union of triangles, each of them thickened."""
    return as_manifold(unite([hull_of_points(vertices[face]) for face in faces]))
