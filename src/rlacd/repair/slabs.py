"""Slabs: what has no volume of its own, made a little thick."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from rlacd._native import poll_stop
from rlacd.repair.union import as_manifold, unite
from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import IntArray

HALF_THICKNESS = 1e-3
"""Half the thickness of the slab a sheet becomes, in frame units."""


def hull_of_points(points: FloatArray, half_thickness: float = HALF_THICKNESS) -> Manifold:
    """Return the hull of points ``[N, 3]``, thickened along the axes in which they have no extent."""
    poll_stop()
    points = np.unique(points, axis=0)
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(np.concatenate([points - middle, np.zeros((3, 3))]), full_matrices=False)
    extent = np.ptp((points - middle) @ axes.T, axis=0)
    for axis in axes[extent < half_thickness]:
        points = np.concatenate([points - half_thickness * axis, points + half_thickness * axis])
    return Manifold.hull_points(points)


def slab_of_faces(vertices: FloatArray, faces: IntArray) -> Manifold:
    """Return the union of triangles, each of them thickened."""
    return as_manifold(unite([hull_of_points(vertices[face]) for face in faces]))
