"""Rigid transforms ``[4, 4]``: a pose carries points of its own frame to where they stand in the outer one.

Entries are rounded, so that the last bits of a machine's sines do not reach the points that are decomposed.
"""

from __future__ import annotations

import numpy as np

from rlacd.solid.arrays import FloatArray, heights

DIGITS = 12
"""Decimals that are kept of each entry."""


def moved(pose: FloatArray, points: FloatArray) -> FloatArray:
    """Points ``[N, 3]`` of the frame whose pose is given, where that stands."""
    return np.ascontiguousarray(heights(points, pose[:3, :3]) + pose[:3, 3])


def product(*poses: FloatArray) -> FloatArray:
    """The pose of the last in a chain, each given in the frame of the one before."""
    whole = np.eye(4)
    for pose in poses:
        whole[:3, 3] = moved(whole, pose[None, :3, 3])[0]
        whole[:3, :3] = heights(np.ascontiguousarray(whole[:3, :3]), np.ascontiguousarray(pose[:3, :3].T))
    return rounded(whole)


def inverse(pose: FloatArray) -> FloatArray:
    """The pose of the outer frame in the one whose pose is given."""
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -heights(pose[None, :3, 3], back[:3, :3])[0]
    return back


def rounded(pose: FloatArray) -> FloatArray:
    """The same without its last bits, nor negative zeros."""
    return np.asarray(np.round(pose, DIGITS) + 0.0, dtype=np.float64)
