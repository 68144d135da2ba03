"""Welding cracks: free edges that nearly coincide become one.

Input: a soup and its edges. Output: changed faces.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rlacd._native import components, points_within, poll_stop
from rlacd.solid.arrays import FloatArray, Int64Array, dots
from rlacd.solid.topology import Edges, first_of_doubled, nondegenerate

MOST_FREE_EDGES = 500_000
"""A soup with more free edges keeps its cracks and holes: loops are traced edge by edge."""

MOST_NEAR = 100 * MOST_FREE_EDGES
"""Pairs of a free edge and a free vertex near it; where there are more, none is split."""


def close_cracks(
    vertices: FloatArray, faces: Int64Array, tolerances: Sequence[float]
) -> tuple[Int64Array, Int64Array, Edges]:
    """Merge free edges that nearly coincide, with increasing tolerances.

    An attempt that closes nothing, or leaves no face, is undone. No two of the faces have the same three corners.

    Returns the faces ``[G, 3]``, ``[G]`` the given face each comes from, and their edges.
    """
    origin, edges = np.arange(len(faces)), Edges.of(faces, len(vertices))
    for tolerance in tolerances:
        poll_stop()
        free = edges.face_count == 1
        if not 0 < free.sum() <= MOST_FREE_EDGES:
            break
        welded = weld_free_vertices(vertices, faces, np.unique(edges.vertices[free]), tolerance)
        split, parent = split_at_free_vertices(vertices, welded, tolerance)
        poll_stop()
        keep = nondegenerate(split)
        keep[keep] = first_of_doubled(split[keep], len(vertices))
        left = Edges.of(split[keep], len(vertices))
        if (left.face_count == 1).sum() < free.sum() and keep.any():
            faces, origin, edges = split[keep], origin[parent[keep]], left
    return faces, origin, edges


def weld_free_vertices(vertices: FloatArray, faces: Int64Array, ends: Int64Array, tolerance: float) -> Int64Array:
    """Merge vertices at the ends ``[B]`` of free edges that lie within `tolerance` of each other.

    Returns faces of the same number, of which some may be degenerate. Vertices keep their places: each group is
    represented by its first vertex.
    """
    counts, near = points_within(vertices[ends], vertices[ends], np.full(len(ends), tolerance))
    _, label = components(len(ends), np.repeat(np.arange(len(ends)), counts), near.astype(np.int64))
    _, first = np.unique(label, return_index=True)
    target = np.arange(len(vertices))
    target[ends] = ends[first[label]]
    return target[faces]


def split_at_free_vertices(vertices: FloatArray, faces: Int64Array, tolerance: float) -> tuple[Int64Array, Int64Array]:
    """Insert free vertices into the free edges they lie on (T-junctions).

    Returns the faces ``[G, 3]``, split ones replaced by several, and ``[G]`` the old face each comes from.
    """
    edges = Edges.of(faces, len(vertices))
    is_free = edges.face_count == 1
    halfedge = np.flatnonzero(is_free[edges.of_halfedge])
    # Split one edge of a face per round, so that its pieces do not depend on each other.
    face, corner = np.divmod(halfedge[np.unique(halfedge // 3, return_index=True)[1]], 3)
    a, b, c = (faces[face, (corner + i) % 3] for i in range(3))
    edge, vertex = _on_edges(vertices, np.stack([a, b, c], axis=1), np.unique(edges.vertices[is_free]), tolerance)
    split = np.unique(edge)
    # The corners along each split edge: a, the inserted vertices, b; every consecutive pair forms a face with c.
    chain_edge = np.concatenate([split, edge, split])
    order = np.argsort(chain_edge, kind="stable")
    chain_edge, chain_vertex = chain_edge[order], np.concatenate([a[split], vertex, b[split]])[order]
    pair = np.flatnonzero(chain_edge[1:] == chain_edge[:-1])
    pieces = np.stack([chain_vertex[pair], chain_vertex[pair + 1], c[chain_edge[pair]]], axis=1)
    whole = np.delete(np.arange(len(faces)), face[split])
    return np.concatenate([faces[whole], pieces]), np.concatenate([whole, face[chain_edge[pair]]])


def _on_edges(
    vertices: FloatArray, corners: Int64Array, free: Int64Array, tolerance: float
) -> tuple[Int64Array, Int64Array]:
    """Find the `free` vertices on the edge from the first to the second of the corners ``[N, 3]`` of each face.

    Returns pairs of an edge and a vertex, in order along each edge.
    """
    poll_stop()
    a, b, c = corners.T
    span = vertices[b] - vertices[a]
    length = np.linalg.norm(span, axis=1)
    middle = (vertices[a] + vertices[b]) / 2
    count, near = points_within(vertices[free], middle, length / 2 + tolerance, MOST_NEAR)
    if len(near) > MOST_NEAR:
        return corners[:0, 0], corners[:0, 0]
    poll_stop()
    edge, vertex = np.repeat(np.arange(len(corners)), count), free[near]
    offset = vertices[vertex] - vertices[a[edge]]
    along = dots(offset, span[edge]) / np.maximum(length[edge] ** 2, np.finfo(float).tiny)
    away = np.linalg.norm(offset - along[:, None] * span[edge], axis=1)
    margin = tolerance / np.maximum(length[edge], tolerance)
    on = np.flatnonzero((away <= tolerance) & (along > margin) & (along < 1 - margin) & (vertex != c[edge]))
    poll_stop()
    on = on[np.lexsort((vertex[on], along[on], edge[on]))]
    return edge[on], vertex[on]
