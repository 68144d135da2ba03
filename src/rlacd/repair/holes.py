"""Welding cracks and capping holes: new faces that connect the free edges of a soup.

Input: a soup and its edges. Output: changed faces, or extra ones. Nothing here decides whether a cap is justified; the
caller measures that.
"""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np

from rlacd._native import PointTree, least_bent, poll_stop
from rlacd.solid.frame import FloatArray
from rlacd.solid.products import dots
from rlacd.solid.topology import (
    BoolArray,
    Edges,
    IntArray,
    components,
    first_of_doubled,
    has_marked,
    marked,
    nondegenerate,
)

# Optimal triangulation considers all triples of corners; longer loops are cut by ears, or up to a length if that fails.
_EXACT_LOOP = 60
LONGEST_EXACT_LOOP = 250
"""Loops of more edges than this are not triangulated optimally."""

MOST_NEAR = 50_000_000
"""Pairs of a free edge and a free vertex near it; where there are more, none is split."""

# Tracing loops is the one repair step that walks edge by edge; a soup with more free edges is not a scan with holes.
MOST_FREE_EDGES = 500_000


def close_cracks(
    vertices: FloatArray, faces: IntArray, edges: Edges, tolerances: Sequence[float]
) -> tuple[IntArray, IntArray]:
    """Merge free edges that nearly coincide, with increasing tolerances.

    An attempt that closes nothing, or leaves no face, is undone. No two of the faces have the same three corners.

    Returns the faces ``[G, 3]``, the given ones if nothing changed, and ``[G]`` the given face each comes from.
    """
    origin = np.arange(len(faces))
    free = free_edges(faces, edges)
    for tolerance in tolerances:
        poll_stop()
        if not 0 < len(free) <= MOST_FREE_EDGES:
            break
        # Only faces with free vertices change. All faces at their corners are needed, for the valence of their edges.
        changing = has_marked(marked(free, len(vertices)), faces)
        inner = marked(faces[changing], len(vertices))
        near = has_marked(inner, faces)
        welded = weld_free_vertices(vertices, faces[near], free, tolerance)
        split, parent, is_piece = split_at_free_vertices(vertices, welded, inner, tolerance)
        poll_stop()
        keep = nondegenerate(split)
        keep[keep] = first_of_doubled(split[keep], len(vertices))
        left = free_edges(split[keep], Edges.of(split[keep], len(vertices)), inner)
        if len(left) < len(free) and (keep.any() or not near.all()):
            whole = keep & ~is_piece
            changed, at = faces.copy(), np.flatnonzero(near)
            kept = np.logical_not(near)
            changed[at[parent[whole]]] = split[whole]
            kept[at[parent[whole]]] = True
            pieces = keep & is_piece
            faces = np.concatenate([changed[kept], split[pieces]])
            origin = np.concatenate([origin[kept], origin[at[parent[pieces]]]])
            free = left
    return faces, origin


def weld_free_vertices(vertices: FloatArray, faces: IntArray, free: IntArray, tolerance: float) -> IntArray:
    """Merge vertices of free edges ``[B, 2]`` that lie within `tolerance` of each other.

    Returns faces of the same number, of which some may be degenerate. Vertices keep their places: each group is
    represented by its first vertex.
    """
    ends = np.unique(free)
    counts, near = PointTree(vertices[ends]).within(vertices[ends], np.full(len(ends), tolerance))
    if len(near) == len(ends):  # each is near itself only
        return faces
    _, label = components(len(ends), np.repeat(np.arange(len(ends)), counts), near.astype(np.int64))
    _, first = np.unique(label, return_index=True)
    target = np.arange(len(vertices))
    target[ends] = ends[first[label]]
    return target[faces]


def split_at_free_vertices(
    vertices: FloatArray, faces: IntArray, inner: BoolArray, tolerance: float
) -> tuple[IntArray, IntArray, BoolArray]:
    """Insert free vertices into the free edges they lie on (T-junctions).

    Returns the faces ``[G, 3]``, split ones replaced by several; ``[G]`` the old face each comes from; and ``[G]``
    whether it is a piece of it. Edges without an end among the `inner` vertices ``[V]`` are not looked at.
    """
    edges = Edges.of(faces, len(vertices))
    is_free = (edges.valence == 1) & inner[edges.vertices].any(axis=1)
    halfedge = np.flatnonzero(is_free[edges.of_halfedge])
    # One edge per face and round, so that the pieces of a face do not depend on each other.
    _, first = np.unique(halfedge // 3, return_index=True)
    halfedge = halfedge[first]
    poll_stop()
    free = np.unique(edges.vertices[is_free])
    none = faces, np.arange(len(faces)), np.zeros(len(faces), dtype=bool)
    if len(halfedge) == 0:
        return none
    face, corner = halfedge // 3, halfedge % 3
    a, b, c = faces[face, corner], faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
    span = vertices[b] - vertices[a]
    length = np.linalg.norm(span, axis=1)
    tree = PointTree(vertices[free])
    count, near = tree.within((vertices[a] + vertices[b]) / 2, length / 2 + tolerance, MOST_NEAR)
    if len(near) > MOST_NEAR or len(near) == 0:
        return none
    poll_stop()
    edge = np.repeat(np.arange(len(halfedge)), count)
    vertex = free[near]
    offset = vertices[vertex] - vertices[a[edge]]
    along = dots(offset, span[edge]) / np.maximum(length[edge] ** 2, np.finfo(float).tiny)
    away = np.linalg.norm(offset - along[:, None] * span[edge], axis=1)
    margin = tolerance / np.maximum(length[edge], tolerance)
    on = (away <= tolerance) & (along > margin) & (along < 1 - margin) & (vertex != c[edge])
    edge, vertex, along = edge[on], vertex[on], along[on]
    if len(edge) == 0:
        return none
    poll_stop()
    order = np.lexsort((vertex, along, edge))
    edge, vertex = edge[order], vertex[order]
    split = np.unique(edge)
    # The corners along each split edge: a, the inserted vertices, b; every consecutive pair forms a face with c.
    chain_edge = np.concatenate([split, edge, split])
    chain_vertex = np.concatenate([a[split], vertex, b[split]])
    place = np.concatenate([np.zeros(len(split)), np.ones(len(edge)), np.full(len(split), 2)])
    order = np.lexsort((np.arange(len(place)), place, chain_edge))
    chain_edge, chain_vertex = chain_edge[order], chain_vertex[order]
    pair = np.flatnonzero(chain_edge[1:] == chain_edge[:-1])
    pieces = np.stack([chain_vertex[pair], chain_vertex[pair + 1], c[chain_edge[pair]]], axis=1)
    whole = np.ones(len(faces), dtype=bool)
    whole[face[split]] = False
    new = np.concatenate([faces[whole], pieces])
    origin = np.concatenate([np.flatnonzero(whole), face[chain_edge[pair]]])
    is_piece = np.repeat([False, True], [len(new) - len(pieces), len(pieces)])
    good = nondegenerate(new)
    return new[good], origin[good], is_piece[good]


def free_edges(faces: IntArray, edges: Edges, inner: BoolArray | None = None) -> IntArray:
    """Return the directed edges ``[B, 2]`` that only one face uses, as that face runs along them.

    If `inner` vertices ``[V]`` are given, only edges with an end among them.
    """
    is_free = edges.valence == 1
    if inner is not None:
        is_free &= inner[edges.vertices].any(axis=1)
    halfedge = np.flatnonzero(is_free[edges.of_halfedge])
    face, corner = halfedge // 3, halfedge % 3
    return np.stack([faces[face, corner], faces[face, (corner + 1) % 3]], axis=1)


def cap(points: FloatArray, beside: FloatArray, taken: BoolArray | None = None, bend: float = 1.0) -> IntArray:
    """Triangulate a closed loop of points; a loop may visit a place twice.

    Parameters
    ----------
    points
        ``[N, 3]``.
    beside
        ``[N, 3]``, the unit normal of the face on the other side of the edge from each point to the next. It runs along
        that edge in the order of the loop.
    taken
        ``[N, N]``, pairs of points that must not get an edge, because one exists already or because they are equal.
    bend
        Weight of bending; with 0 the area is minimised.

    Returns
    -------
    IntArray
        ``[N - 2, 3]`` corners, all of them points of the loop, oriented against the loop to match the adjacent faces.
    """
    if len(points) <= 3:
        return np.array([[0, 2, 1]])
    if len(points) <= _EXACT_LOOP:
        return least_bent(points, beside, taken, bend)[:, ::-1].astype(np.int64)
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    flat = np.ascontiguousarray((points - middle) @ axes[:2].T)
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3)
    if len(ears) != len(points) - 2:  # the loop's projection crosses itself: no plane fits
        if len(points) <= LONGEST_EXACT_LOOP:
            return least_bent(points, beside, taken, bend)[:, ::-1].astype(np.int64)
        return _strips(len(points))[:, ::-1]
    triangles: IntArray = ears.astype(np.int64)
    a, b, c = triangles.T
    along = ((b - a) % len(points) < (c - a) % len(points)).sum() * 2 > len(triangles)
    return triangles[:, ::-1] if along else triangles


def _strips(count: int) -> IntArray:
    """Zigzag between both ends of the index range until they meet."""
    low, high, triangles = 0, count - 1, []
    while high - low > 1:
        triangles.append((low, low + 1, high))
        low += 1
        if high - low > 1:
            triangles.append((low, high - 1, high))
            high -= 1
    return np.array(triangles, dtype=np.int64)
