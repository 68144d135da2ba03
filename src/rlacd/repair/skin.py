"""From side components to closed triangle meshes: solids exactly as they are, sheets as thin slabs.

Input: a soup, its `Sides`, and the components to build. Output: one closed, oriented 2-manifold whose edges all have
exactly two faces. Every fan of corners that meets at a vertex within one region of space becomes a separate vertex, so
surfaces that merely touch at a vertex or an edge come apart. Fans on a sheet are moved `half_thickness` away from it;
the free edges of sheets get a rim.
"""

from __future__ import annotations

import numpy as np

from rlacd._native import poll_stop
from rlacd.solid.arrays import FloatArray, angles, dots
from rlacd.solid.topology import BoolArray, IntArray, Sides, components, nondegenerate

# A sharp fold would push its vertex far out to keep the distance to both flanks; stop at this multiple.
_LONGEST_MITER = 2.0


def skin(
    vertices: FloatArray, faces: IntArray, sides: Sides, keep: BoolArray, thin: BoolArray, half_thickness: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Build the surfaces of chosen side components.

    Parameters
    ----------
    vertices, faces
        The soup, ``[V, 3]`` and ``[F, 3]``.
    sides
        Its sides.
    keep
        ``[C]``, the side components to build.
    thin
        ``[F]``, the faces without an inside; their sides are moved outward.
    half_thickness
        Distance, in the unit of the vertices.

    Returns
    -------
    tuple
        New vertices ``[N, 3]``, faces ``[M, 3]`` and the side component ``[M]`` of each new face.
    """
    kept = np.flatnonzero(keep[sides.label])  # sides
    used = keep[sides.label[sides.facing[:, 0]]]
    wedges, facing = sides.wedges[used], sides.facing[used]
    is_rim = wedges[:, 0] == wedges[:, 1]
    poll_stop()
    # Corners of the first and of the second side of a wedge, at the smaller and at the larger end of its edge.
    slot = np.full(2 * len(faces), -1, dtype=np.int64)
    slot[kept] = 3 * np.arange(len(kept))
    ends = [_corners_at(faces, halfedge, slot[side]) for halfedge, side in zip(wedges.T, facing.T, strict=True)]
    low, high = (np.stack(some) for some in zip(*ends, strict=True))
    poll_stop()
    inner = ~is_rim
    number, fan = components(
        3 * len(kept), np.concatenate([low[0, inner], high[0, inner]]), np.concatenate([low[1, inner], high[1, inner]])
    )
    face, back = kept // 2, kept % 2 == 1
    base = np.empty(number, dtype=np.int64)
    base[fan] = faces[face].ravel()
    positions = vertices[base]
    poll_stop()
    if thin.any():
        positions += half_thickness * _fan_offsets(vertices, faces[face], back, thin[face], fan, number)
    triangles = fan.reshape(-1, 3).copy()
    triangles[back] = triangles[back][:, ::-1]
    if not is_rim.any():
        return positions, triangles, sides.label[kept]
    rim_label = sides.label[facing[is_rim, 0]]
    rim_faces, rim_faces_label, centers = _rims(fan[low[:, is_rim]], fan[high[:, is_rim]], rim_label, number)
    return (
        np.concatenate([positions, vertices[base[centers]]]),
        np.concatenate([triangles, rim_faces]),
        np.concatenate([sides.label[kept], rim_faces_label]),
    )


def _corners_at(faces: IntArray, halfedge: IntArray, slot: IntArray) -> tuple[IntArray, IntArray]:
    """Slots of the corners of sides at the smaller and the larger end of halfedges, given where those of each begin."""
    face, here = np.divmod(halfedge, 3)
    there = (here + 1) % 3
    forward = faces[face, here] < faces[face, there]
    return slot + np.where(forward, here, there), slot + np.where(forward, there, here)


def _rims(low: IntArray, high: IntArray, label: IntArray, number: int) -> tuple[IntArray, IntArray, IntArray]:
    """Close rims: the faces ``[M, 3]``, their labels, and for every new vertex (from `number` on) a fan at its place.

    A rim edge runs from low to high; its face shows one side to the wedge's beginning, fans ``low[0]`` and ``high[0]``,
    and the other to its end.
    """
    quads = [np.stack([high[0], low[0], low[1]], axis=1), np.stack([high[0], low[1], high[1]], axis=1)]
    caps, cap_label, centers = _rim_caps(
        np.concatenate([low[1], high[0]]), np.concatenate([low[0], high[1]]), np.tile(label, 2), number
    )
    poll_stop()
    rim_faces = np.concatenate([*quads, caps])
    real = nondegenerate(rim_faces)
    return rim_faces[real], np.concatenate([label, label, cap_label])[real], centers


def _fan_offsets(
    vertices: FloatArray, corners: IntArray, back: BoolArray, thin: BoolArray, fan: IntArray, number: int
) -> FloatArray:
    """Direction ``[number, 3]`` that leaves every face of a fan at speed 1; zero for fans without a sheet."""
    a, b, c = (vertices[corners[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    normal[back] *= -1
    poll_stop()
    weight = np.empty((len(corners), 3))
    for i, (p, q, r) in enumerate(((a, b, c), (b, c, a), (c, a, b))):
        poll_stop()
        along, across = q - p, r - p
        weight[:, i] = angles(np.linalg.norm(np.cross(along, across), axis=1), dots(along, across))
    poll_stop()
    corner_normal = np.repeat(normal, 3, axis=0)
    total = np.stack([np.bincount(fan, weight.ravel() * corner_normal[:, k], number) for k in range(3)], axis=1)
    poll_stop()
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean = np.where(length > 1e-6, total / np.maximum(length, np.finfo(float).tiny), 0.0)
    # The miter: far enough along the mean normal to be at distance 1 from the steepest face that has a direction.
    cosine = np.where(weight.ravel() > 0, dots(corner_normal, mean[fan]), 1.0)
    poll_stop()
    steepest = np.ones(number)
    np.minimum.at(steepest, fan, cosine)
    poll_stop()
    sees_sheet = np.bincount(fan, np.repeat(thin, 3), number) > 0
    speed = np.where(sees_sheet, 1 / np.maximum(steepest, 1 / _LONGEST_MITER), 0.0)
    offsets: FloatArray = mean * speed[:, None]
    return offsets


def _rim_caps(tail: IntArray, head: IntArray, label: IntArray, number: int) -> tuple[IntArray, IntArray, IntArray]:
    """Close the ends of rims where three or more free edges meet in a vertex.

    Each rim quad leaves a link between two fans at both of its ends. Two links between the same two fans match each
    other; longer cycles bound a small polygon, closed here with a fan of triangles around a new central vertex.

    Returns the triangles, their labels, and for every central vertex (numbered from `number` on) a fan at its place.
    """
    linked = tail != head
    tail, head, label = tail[linked], head[linked], label[linked]
    _, cycle = components(number, tail, head)
    cycle = cycle[tail]
    # Matched pairs need no cap: link (a, b) with (b, a).
    key, mate = tail * number + head, head * number + tail
    unmatched = ~np.isin(key, mate)
    tail, head, label, cycle = tail[unmatched], head[unmatched], label[unmatched], cycle[unmatched]
    _, first, center = np.unique(cycle, return_index=True, return_inverse=True)
    caps = np.stack([tail, head, number + center.reshape(-1)], axis=1) if len(tail) else np.empty((0, 3), np.int64)
    return caps, label, tail[first] if len(tail) else np.empty(0, np.int64)
