"""Caps: triangles that close the holes of a soup, without new vertices.

Input: a soup and the loops around its holes. Output: a cap for each. Nothing here decides whether it is justified.
"""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from rlacd._native import least_bent, poll_stop
from rlacd.repair.rims import Rims
from rlacd.repair.soup import Soup, face_normals
from rlacd.solid.arrays import FloatArray, dots
from rlacd.solid.topology import BoolArray, IntArray, nondegenerate

# Optimal triangulation considers all triples of corners; longer loops are cut by ears.
_EXACT_LOOP = 60
# Where a cap turns by less than this from a face beside it, it continues the face (cosine of 45 degrees).
_SMOOTH_RIM = 0.7


def caps_of(soup: Soup, rims: Rims) -> tuple[IntArray, IntArray]:
    """Triangulate the loops, no two across the same edge if possible.

    Returns the faces ``[C, 3]``, without those with a repeated vertex, and the loop ``[C]`` of each.
    """
    count = len(soup.vertices)
    edges = soup.edges.vertices @ np.array([count, 1])  # in ascending order
    across: dict[int, list[int]] = {}
    caps = []
    for loop, beside in zip(rims.loops, rims.beside, strict=True):
        poll_stop()
        taken = None
        if 3 < len(loop) <= _EXACT_LOOP:
            low, high = np.minimum(loop[:, None], loop), np.maximum(loop[:, None], loop)
            at = np.minimum(np.searchsorted(edges, low * count + high), len(edges) - 1)
            taken = (edges[at] == low * count + high) | (low == high)
            places: dict[int, list[int]] = {}
            for i, vertex in enumerate(loop.tolist()):
                places.setdefault(vertex, []).append(i)
            for i, vertex in enumerate(loop.tolist()):
                taken[i, [place for other in across.get(vertex, ()) for place in places.get(other, ())]] = True
        caps.append(loop[cap(soup.vertices[loop], rims.normals[beside], taken)])
        for a, b, c in caps[-1].tolist() if len(loop) > 3 else ():
            for here, there in ((a, (b, c)), (b, (c, a)), (c, (a, b))):
                across.setdefault(here, []).extend(there)
    owner = np.repeat(np.arange(len(caps)), [len(some) for some in caps])
    faces = np.concatenate(caps)
    real = nondegenerate(faces)
    return faces[real], owner[real]


def cap(points: FloatArray, beside: FloatArray, taken: BoolArray | None = None) -> IntArray:
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

    Returns
    -------
    IntArray
        ``[N - 2, 3]`` corners, all of them points of the loop, oriented against the loop to match the adjacent faces.
    """
    if len(points) <= 3:
        return np.array([[0, 2, 1]])
    if len(points) <= _EXACT_LOOP:
        return least_bent(points, beside, taken)[:, ::-1].astype(np.int64)
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    flat = np.ascontiguousarray((points - middle) @ axes[:2].T)
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3)
    if len(ears) != len(points) - 2:  # the loop's projection crosses itself: no plane fits
        return np.array([(0, i + 1, i) for i in range(1, len(points) - 1)], dtype=np.int64)
    triangles: IntArray = ears.astype(np.int64)
    a, b, c = triangles.T
    along = ((b - a) % len(points) < (c - a) % len(points)).sum() * 2 > len(triangles)
    return triangles[:, ::-1] if along else triangles


def smooth_share(soup: Soup, rims: Rims, caps: IntArray, owner: IntArray) -> FloatArray:
    """Return ``[L]`` the share of each loop along which its cap continues the adjacent faces."""
    normal = face_normals(soup.vertices, caps)
    # The cap's face at each edge of the rim, found by loop and edge.
    count = len(soup.vertices)
    key = ((caps * count + np.roll(caps, -1, axis=1)) + owner[:, None] * count**2).ravel()
    tail = np.concatenate(rims.loops)
    head = np.concatenate([np.roll(loop, -1) for loop in rims.loops])
    loop_of = np.repeat(np.arange(len(rims.loops)), [len(loop) for loop in rims.loops])
    order = np.argsort(key, kind="stable")
    wanted = head * count + tail + loop_of * count**2
    at = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
    cosine = dots(rims.normals[np.concatenate(rims.beside)], normal[order[at] // 3])
    smooth = (cosine > _SMOOTH_RIM) & (key[order][at] == wanted)
    length = np.linalg.norm(soup.vertices[head] - soup.vertices[tail], axis=1)
    share: FloatArray = np.bincount(loop_of, length * smooth) / np.bincount(loop_of, length)
    return share
