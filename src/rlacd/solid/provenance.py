"""Which part of the input each hull stands for: its node, its body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

from rlacd._native import ConvexBody, HullUnion, poll_stop, sample_surface
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.distance import PLACES
from rlacd.solid.frame import Frame

SURFACE_SAMPLES = 5 * PLACES
LEAST_OF_LABEL = 32
"""Points spread over the surface, and at least over each label's share of it."""

OUTSIDE_HULL = 1e-3
"""How far outside a hull a point of the surface may lie, as a share of the hull's size."""


def owners(
    hulls: Sequence[trimesh.Trimesh], vertices: FloatArray, faces: NDArray[np.integer], label_of: Int64Array
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
    found = []
    for hull in hulls:
        poll_stop()
        body = ConvexBody(frame.to_frame(hull.vertices), hull.faces.astype(np.int32))
        lower, upper = body.box
        slack = OUTSIDE_HULL * float((upper - lower).max())
        near = np.flatnonzero(((points >= lower - slack) & (points <= upper + slack)).all(axis=1))
        inside = near[HullUnion([body]).distance(points[near], 1) <= slack]
        if len(inside) == 0:
            inside = np.array([((points - (lower + upper) / 2) ** 2).sum(axis=1).argmin()])
        found.append(int(np.bincount(labels[inside]).argmax()))
    return found


def _spread(vertices: FloatArray, faces: NDArray[np.integer], label_of: Int64Array) -> tuple[FloatArray, Int64Array]:
    """Points spread over the surface in proportion to its area, with their labels; the same for the same surface."""
    area = trimesh.triangles.area(vertices[faces])
    order = np.argsort(label_of, kind="stable")
    points, labels = [], []
    for mine in np.split(order, np.flatnonzero(np.diff(label_of[order])) + 1):
        poll_stop()
        own, own_faces = float(area[mine].sum()), np.ascontiguousarray(faces[mine], dtype=np.int32)
        if own > 0:
            count = max(LEAST_OF_LABEL, round(SURFACE_SAMPLES * own / float(area.sum())))
            points.append(sample_surface(vertices, own_faces, count, 0)[0])
        else:
            points.append(vertices[own_faces[:, 0]])
        labels.append(np.full(len(points[-1]), label_of[mine[0]], dtype=np.int64))
    return np.concatenate(points), np.concatenate(labels)
