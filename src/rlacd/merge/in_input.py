"""Hulls in the input's unit, where coordinates may tell less apart than in the frame."""

from __future__ import annotations

import itertools

import numpy as np
import trimesh

from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull

_BOX_VERTICES, _BOX_FACES = 8, 12


def in_input(
    hull: Hull, frame: Frame, max_vertices: int | None = None, max_faces: int | None = None
) -> trimesh.Trimesh:
    """Carry a hull from the frame to the input's unit: rounded there first, so that it is exactly convex there.

    Parameters
    ----------
    hull : Hull
        In the frame, inside the limits.
    frame : Frame
    max_vertices, max_faces : int, optional
        Hold for what stands in for hulls that are thinner than coordinates can resolve, too.

    Returns
    -------
    trimesh.Trimesh
        Convex, closed, with volume.
    """
    points = frame.to_input(hull.vertices)
    there = Hull.of(points)
    if there is None:
        there = plain_hull(points, max_vertices, max_faces)
    return trimesh.Trimesh(there.vertices, there.faces, process=False)


def plain_hull(points: FloatArray, max_vertices: int | None, max_faces: int | None) -> Hull:
    """Take a box around points [N, 3], or a tetrahedron where a box has too many vertices or triangles."""
    fits = (max_vertices or _BOX_VERTICES) >= _BOX_VERTICES and (max_faces or _BOX_FACES) >= _BOX_FACES
    hull = Hull.of(_box_around(points) if fits else _tetrahedron_around(points))
    assert hull is not None
    return hull


def _box_around(points: FloatArray) -> FloatArray:
    """Corners [8, 3] of a box around the points, just as thick everywhere as their largest coordinate can resolve.

    One step of floating point along an axis may be nothing beside a large coordinate on another.
    """
    limits = np.finfo(np.float64)
    step = np.abs(points).max() * limits.eps + limits.smallest_subnormal
    lower = np.maximum(points.min(axis=0), step - limits.max) - step
    upper = np.minimum(points.max(axis=0), limits.max - step) + step
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))


def _tetrahedron_around(points: FloatArray) -> FloatArray:
    """Corners [4, 3] of a tetrahedron around that box: one corner of the box, and three on the edges from there."""
    box = _box_around(points)
    lower, upper = box[0], box[-1]
    to_lower = lower / 2 + upper / 2 > 0  # edges lead towards the origin, where coordinates do not overflow
    corner, edge = np.where(to_lower, upper, lower), np.where(to_lower, lower - upper, upper - lower)
    # 1/4 + 1/4 + 1/4 < 1: the far corner of the box stays inside, whatever is rounded.
    return np.concatenate([corner[None], corner + np.diag(4 * edge)])
