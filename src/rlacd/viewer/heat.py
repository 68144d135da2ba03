"""Error heat map: the distance of the hulls' surface from the input's surface, point by point.

Hulls have few vertices, so their facets are subdivided first. Where a hull touches or enters another one, its surface
is an inner wall of the union and not an error: those vertices are marked instead of measured.
"""

from __future__ import annotations

from typing import NamedTuple

import manifold3d
import numpy as np
import trimesh

from rlacd import _native
from rlacd.result import Result
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.frame import Frame

FINEST = 0.02
"""Facets are not subdivided below this edge length: 1% of the input's longest side."""

INNER = -1.0
"""Marks a vertex on an inner wall, in place of its distance."""

ON_HULL = 1e-5
"""A point this close to another hull lies on an inner wall: above rounding error, below what is visible."""


class HeatMesh(NamedTuple):
    """A hull's surface, subdivided, with its distances to the input's surface."""

    vertices: FloatArray
    """``[N, 3]``."""
    faces: IntArray
    """``[F, 3]``."""
    distance: FloatArray
    """``[N]``, `INNER` on inner walls. All in the frame of `frame_of`."""


def heat_map(decomposition: Result, *, triangles: int = 60_000, threads: int | None = None) -> list[HeatMesh]:
    """Measure the distance of the hulls' surface to the input's, point by point.

    Parameters
    ----------
    decomposition : Result
    triangles : int
        Approximate number of triangles for all hulls together; fewer if `FINEST` limits the subdivision.
    threads : int, optional
        All processors by default; the result does not depend on it.

    Returns
    -------
    list of HeatMesh
        In the order of the hulls; empty if the input is a cloud of points, which has no surface.
    """
    source, frame = decomposition.source, frame_of(decomposition)
    if len(source.faces) == 0:
        return []
    surface = _native.Surface(frame.to_frame(source.vertices), np.ascontiguousarray(source.faces, dtype=np.int32))
    hulls = [(frame.to_frame(hull.vertices), np.asarray(hull.faces)) for hull in decomposition]
    # Equilateral triangles of edge h have the area sqrt(3)/4 h²; narrow facets give smaller ones, hence more of them.
    area = sum(float(trimesh.triangles.area(corners[faces]).sum()) for corners, faces in hulls)
    edge = max(FINEST, float(np.sqrt(4.0 * area / max(triangles, 1))))
    bodies = [_native.ConvexBody(corners, faces.astype(np.int32)) for corners, faces in hulls]
    result = []
    for index, hull in enumerate(hulls):
        vertices, faces = _divided(*hull, edge)
        distance = surface.distance(vertices, threads or 0)
        others = _native.HullUnion(bodies[:index] + bodies[index + 1 :])
        distance[others.distance(vertices, threads or 0) <= ON_HULL] = INNER
        result.append(HeatMesh(vertices, faces, distance))
    return result


def frame_of(decomposition: Result) -> Frame:
    """Return a frame in the scale of the report, centred on the bounding box of the input and the hulls."""
    corners = [np.asarray(hull.bounds, dtype=np.float64) for hull in decomposition]
    if len(decomposition.source.faces):
        corners.append(np.asarray(decomposition.source.bounds, dtype=np.float64))
    return Frame(Frame.of(np.concatenate(corners)).center, decomposition.report.scale)


def _divided(vertices: FloatArray, faces: IntArray, edge: float) -> tuple[FloatArray, IntArray]:
    """Subdivide a closed mesh until no edge is much longer than `edge`; its surface stays the same."""
    solid = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces.astype(np.uint64)))
    fine = solid.refine_to_length(edge).to_mesh64()
    if len(fine.tri_verts) < len(faces):  # too thin to count as a solid
        return vertices, np.ascontiguousarray(faces, dtype=np.int32)
    corners = np.ascontiguousarray(fine.vert_properties[:, :3], dtype=np.float64)
    return corners, np.ascontiguousarray(fine.tri_verts, dtype=np.int32)
