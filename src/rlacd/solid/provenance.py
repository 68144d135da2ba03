"""Which part of the input each hull stands for: its node, its body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

from rlacd._native import FlushBody, poll_stop
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import Frame
from rlacd.solid.topology import IntArray

SURFACE_SAMPLES = 10_000
LEAST_OF_LABEL = 32
"""Points spread over the surface, and at least over each label's share of it."""

OUTSIDE_HULL = 1e-3
"""How far outside a hull a point of the surface may lie, as a share of the hull's size."""


def owners(
    hulls: Sequence[trimesh.Trimesh], vertices: FloatArray, faces: NDArray[np.integer], label_of: IntArray
) -> list[int]:
    """Find for each hull the label of most of the surface inside it.

    Parameters
    ----------
    hulls : sequence of trimesh.Trimesh
        Convex, in the same coordinates as the surface.
    vertices, faces : arrays [V, 3], [F, 3]
        The surface; at least one face.
    label_of : array [F]
        The label of each face, counted from 0.

    Returns
    -------
    list of int
        For hulls without any surface inside, the label of the nearest sample.
    """
    if (label_of == label_of[0]).all():
        return [int(label_of[0])] * len(hulls)
    frame = Frame.of(vertices)  # areas and squares of any finite coordinates fit in a double there
    points, labels = _spread(frame.to_frame(vertices), faces, label_of)
    order = np.argsort(points[:, 0], kind="stable")
    points, labels = points[order], labels[order]
    found = []
    for hull in hulls:
        poll_stop()
        corners = frame.to_frame(hull.vertices)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        slack = OUTSIDE_HULL * float((upper - lower).max())
        first, last = np.searchsorted(points[:, 0], (lower[0] - slack, upper[0] + slack))
        some = points[first:last]
        near = first + np.flatnonzero(((some >= lower - slack) & (some <= upper + slack)).all(axis=1))
        body = FlushBody(corners, np.ascontiguousarray(hull.faces, dtype=np.int32))
        inside = near[body.depths(points[near]) >= -slack]
        if len(inside) == 0:
            inside = np.array([((points - (lower + upper) / 2) ** 2).sum(axis=1).argmin()])
        found.append(int(np.bincount(labels[inside]).argmax()))
    return found


def _spread(vertices: FloatArray, faces: NDArray[np.integer], label_of: IntArray) -> tuple[FloatArray, IntArray]:
    """Points spread over the surface in proportion to its area, with their labels; the same for the same surface."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    draw = np.random.default_rng(0)
    whole = area.sum()
    chosen = []
    order = np.argsort(label_of, kind="stable")
    for mine in np.split(order, np.flatnonzero(np.diff(label_of[order])) + 1):
        poll_stop()
        weight = area[mine]
        count = max(LEAST_OF_LABEL, round(SURFACE_SAMPLES * weight.sum() / whole)) if whole > 0 else LEAST_OF_LABEL
        share = weight / weight.sum() if weight.sum() > 0 else None
        chosen.append(draw.choice(mine, count, p=share))
    face = np.concatenate(chosen)
    u, v = draw.random((2, len(face)))
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    a, b, c = corners[face].swapaxes(0, 1)
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return points, np.asarray(label_of[face], dtype=np.int64)
