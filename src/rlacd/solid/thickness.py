"""How thick a sheet is made: what has no volume of its own gets this much."""

from __future__ import annotations

import numpy as np

from rlacd.solid.arrays import FloatArray

HALF_THICKNESS = 1e-3
"""Half the thickness of the slab a sheet becomes, in frame units."""


def thickened(points: FloatArray) -> FloatArray:
    """Return points ``[N, 3]``, with copies to both sides along the axes in which they have no extent."""
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(np.concatenate([points - middle, np.zeros((3, 3))]), full_matrices=False)
    extent = np.ptp((points - middle) @ axes.T, axis=0)
    for axis in axes[extent < HALF_THICKNESS]:
        points = np.concatenate([points - HALF_THICKNESS * axis, points + HALF_THICKNESS * axis])
    return np.ascontiguousarray(points)
