"""Cracks are welded and holes get caps: new faces that connect the free edges of a soup.

Input: a soup and its edges. Output: changed faces, or extra ones. Nothing here decides whether a cap is honest; the
caller measures that.
"""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np
from scipy.spatial import cKDTree

from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import Edges, IntArray, components, first_of_doubled, nondegenerate

# Minimum-area triangulation looks at every pair of corners; longer loops are cut by ears or spanned from the middle.
_EXACT_LOOP = 60


# Tracing loops is the one step of a repair that walks edge by edge; a soup with more free edges is no scan with holes.
MOST_FREE_EDGES = 500_000


def close_cracks(vertices: FloatArray, faces: IntArray, tolerances: Sequence[float]) -> tuple[IntArray, IntArray]:
    """Merge free edges that nearly coincide, trying ever wider tolerances.

    A try that closes nothing, or leaves no face, is undone.

    Returns the faces ``[G, 3]`` and ``[G]`` the given face each comes from.
    """
    origin = np.arange(len(faces))
    free = len(free_edges(faces, len(vertices)))
    for tolerance in tolerances:
        if free == 0 or free > MOST_FREE_EDGES:
            break
        split, parent = split_at_free_vertices(vertices, weld_free_vertices(vertices, faces, tolerance), tolerance)
        keep = nondegenerate(split)
        keep[keep] = first_of_doubled(split[keep], len(vertices))
        left = len(free_edges(split[keep], len(vertices)))
        if left < free and keep.any():
            faces, origin, free = split[keep], origin[parent[keep]], left
    return faces, origin


def weld_free_vertices(vertices: FloatArray, faces: IntArray, tolerance: float) -> IntArray:
    """Merge vertices of free edges that lie within `tolerance` of each other; returns faces of the same number.

    A face may come out degenerate. Vertices keep their places: each group is represented by its first vertex.
    """
    free = free_edges(faces, len(vertices))
    ends = np.unique(free)
    pairs = (
        cKDTree(vertices[ends]).query_pairs(tolerance, output_type="ndarray") if len(ends) else np.empty((0, 2), int)
    )
    if len(pairs) == 0:
        return faces
    _, label = components(len(ends), pairs[:, 0], pairs[:, 1])
    _, first = np.unique(label, return_index=True)
    target = np.arange(len(vertices))
    target[ends] = ends[first[label]]
    return target[faces]


def split_at_free_vertices(vertices: FloatArray, faces: IntArray, tolerance: float) -> tuple[IntArray, IntArray]:
    """Insert free vertices into the free edges they lie on (T-junctions).

    Returns the faces ``[G, 3]``, split ones replaced by several, and ``[G]`` the old face each comes from.
    """
    edges = Edges.of(faces, len(vertices))
    halfedge = np.flatnonzero(edges.valence[edges.of_halfedge] == 1)
    # One edge per face and round, so that the pieces of a face do not depend on each other.
    _, first = np.unique(halfedge // 3, return_index=True)
    halfedge = halfedge[first]
    free = np.unique(edges.vertices[edges.valence == 1])
    none = faces, np.arange(len(faces))
    if len(halfedge) == 0:
        return none
    face, corner = halfedge // 3, halfedge % 3
    a, b, c = faces[face, corner], faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
    span = vertices[b] - vertices[a]
    length = np.linalg.norm(span, axis=1)
    tree = cKDTree(vertices[free])
    found = tree.query_ball_point((vertices[a] + vertices[b]) / 2, length / 2 + tolerance, return_sorted=True)
    count = np.array([len(x) for x in found])
    if count.sum() > 50_000_000 or count.sum() == 0:
        return none
    edge = np.repeat(np.arange(len(halfedge)), count)
    vertex = free[np.concatenate([np.asarray(x, dtype=np.int64) for x in found])]
    offset = vertices[vertex] - vertices[a[edge]]
    along = np.einsum("ij,ij->i", offset, span[edge]) / np.maximum(length[edge] ** 2, np.finfo(float).tiny)
    away = np.linalg.norm(offset - along[:, None] * span[edge], axis=1)
    margin = tolerance / np.maximum(length[edge], tolerance)
    on = (away <= tolerance) & (along > margin) & (along < 1 - margin) & (vertex != c[edge])
    edge, vertex, along = edge[on], vertex[on], along[on]
    if len(edge) == 0:
        return none
    order = np.lexsort((vertex, along, edge))
    edge, vertex = edge[order], vertex[order]
    split = np.unique(edge)
    # The corners along each split edge: a, the inserted vertices, b; every consecutive pair makes a face with c.
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
    good = nondegenerate(new)
    return new[good], origin[good]


def free_edges(faces: IntArray, count: int) -> IntArray:
    """Return the directed edges ``[B, 2]`` that only one face uses, as that face runs along them."""
    edges = Edges.of(faces, count)
    halfedge = np.flatnonzero(edges.valence[edges.of_halfedge] == 1)
    face, corner = halfedge // 3, halfedge % 3
    return np.stack([faces[face, corner], faces[face, (corner + 1) % 3]], axis=1)


def free_loops(edges: IntArray) -> list[IntArray]:
    """Trace edges ``[B, 2]``, in any direction, into closed loops of distinct vertices.

    A walk that meets itself sheds the loop it has closed, so holes that touch in a vertex come out apart. Chains that
    do not close are left out.
    """
    around: dict[int, list[tuple[int, int]]] = {}
    ends = edges.tolist()
    for i, (a, b) in enumerate(ends):
        around.setdefault(a, []).append((i, b))
        around.setdefault(b, []).append((i, a))
    taken = [False] * len(ends)
    loops: list[IntArray] = []
    for start, (first, _) in enumerate(ends):
        if taken[start]:
            continue
        walk, place = [first], {first: 0}
        while walk:
            step = next(((i, b) for i, b in around[walk[-1]] if not taken[i]), None)
            if step is None:
                del place[walk.pop()]
                continue
            taken[step[0]] = True
            there = step[1]
            if there in place:
                loop = walk[place[there] :]
                for vertex in loop[1:]:
                    del place[vertex]
                del walk[place[there] + 1 :]
                if len(loop) > 2:
                    loops.append(np.array(loop, dtype=np.int64))
            else:
                place[there] = len(walk)
                walk.append(there)
    return loops


def cap(points: FloatArray) -> IntArray:
    """Triangulate a closed loop of points ``[N, 3]``; returns ``[N - 2, 3]`` corners, none of them new."""
    if len(points) <= 3:
        return np.arange(3, dtype=np.int64)[None]
    if len(points) <= _EXACT_LOOP:
        return _least_area(points)
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    flat = np.ascontiguousarray((points - middle) @ axes[:2].T)
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3)
    if len(ears) == len(points) - 2:
        return ears.astype(np.int64)
    # The loop's shadow crosses itself: no plane is right, so span it in strips between opposite points.
    return _strips(len(points))


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


def _least_area(points: FloatArray) -> IntArray:
    """Triangulate a loop with the least total area, by dynamic programming (Barequet & Sharir 1995)."""
    n = len(points)
    cost = np.zeros((n, n))
    choice = np.zeros((n, n), dtype=np.int64)
    for span in range(2, n):
        first = np.arange(n - span)[:, None]
        middle, last = first + np.arange(1, span), first + span
        areas = np.linalg.norm(np.cross(points[middle] - points[first], points[last] - points[first]), axis=2)
        total = cost[first, middle] + cost[middle, last] + areas
        best = total.argmin(axis=1)[:, None]
        cost[first, last] = np.take_along_axis(total, best, axis=1)
        choice[first, last] = np.take_along_axis(middle, best, axis=1)
    triangles, open_spans = [], [(0, n - 1)]
    while open_spans:
        i, k = open_spans.pop()
        if k - i < 2:
            continue
        j = int(choice[i, k])
        triangles.append((i, j, k))
        open_spans += [(i, j), (j, k)]
    return np.array(triangles, dtype=np.int64)
