"""Open boundaries of a surface: the loops of edges around its holes, and caps for these.

Input: a soup. Output: loops of vertices around its holes, and triangles that close these without new
vertices; nothing is decided or changed here.

Two faces that share an edge are mates; where more share it, those that continue each other best. Faces connected by
mates form a patch, and all faces of a patch are wound alike, whatever the file says. At a vertex where several holes
meet, a loop turns from a free edge to the next one across the hole, so loops never run
around existing faces. An island that touches its hole's rim joins that hole's loop, which visits the vertex twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import mapbox_earcut
import numpy as np

from rlacd._native import angles, components, least_bent, long_normals, poll_stop, principal_axes_of_points
from rlacd.repair.soup import Soup, across, face_normals
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots, heights
from rlacd.solid.topology import NEXT, marked, nondegenerate


@dataclass(frozen=True)
class Rims:
    """The holes of a soup.

    Attributes
    ----------
    loops
        The vertices around each hole, in the direction of the adjacent faces.
    beside
        For each loop and each of its edges (from a vertex to the next), the adjacent face.
    normals
        ``[F, 3]``, unit normals with which all faces of a patch are wound alike.
    inverted
        ``[F]``, whether a face is wound the other way.
    """

    loops: list[Int64Array]
    beside: list[Int64Array]
    normals: FloatArray
    inverted: BoolArray


def rims_of(soup: Soup) -> Rims:
    """Find the loops around the holes of a soup."""
    mate = _mates(soup)
    poll_stop()
    inverted = _inverted(soup, mate)
    poll_stop()
    weighted = long_normals(soup.vertices, soup.faces)
    weighted[inverted] *= -1
    rim = np.flatnonzero(mate < 0)
    # Where each free halfedge begins and ends, seen from outside.
    corners, swap = soup.faces.ravel(), inverted[rim // 3]
    begin, end = np.where(swap, _following(rim), rim), np.where(swap, rim, _following(rim))
    follower = _followers(soup, weighted, _fans(soup.faces, mate), begin, end)
    # Most edges around a hole are free, and not all of one face: a loop of edges that touch other bodies bounds none.
    face, free = rim // 3, soup.edges.face_count[soup.edges.of_halfedge[rim]] == 1
    loops = [loop for loop in _cycles(follower) if np.ptp(face[loop]) > 0 and 2 * free[loop].sum() > len(loop) > 2]
    normals = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), np.finfo(float).tiny)
    return Rims([corners[begin[loop]] for loop in loops], [face[loop] for loop in loops], normals, inverted)


def _following(halfedge: Int64Array) -> Int64Array:
    """Return ``[N]`` the next halfedges around the same faces."""
    return np.asarray(halfedge - halfedge % 3 + NEXT[halfedge % 3])


def _inverted(soup: Soup, mate: Int64Array) -> BoolArray:
    """Return ``[F]`` whether a face is wound the other way than its patch: sides are joined across mates."""
    mated = np.flatnonzero(mate >= 0)
    forward = (soup.faces < soup.faces[:, NEXT]).ravel()
    # Mates wound alike run along their edge in opposite directions; then fronts continue fronts.
    turned = forward[mated] == forward[mate[mated]]
    front, other = 2 * (mated // 3), 2 * (mate[mated] // 3)
    fronts, backs = np.concatenate([front, front + 1]), np.concatenate([other + turned, other + 1 - turned])
    _, label = components(2 * len(soup.faces), fronts, backs)
    return np.asarray(label[0::2] > label[1::2])


def _fans(faces: Int64Array, mate: Int64Array) -> Int64Array:
    """Return ``[3F]`` the fan of each corner: the corners around a vertex that the mates of faces connect."""
    here = np.flatnonzero(mate >= 0)
    there = mate[here]
    here_next, there_next = _following(here), _following(there)
    corners = faces.ravel()
    same = corners[here] == corners[there]  # mates wound differently begin at the same vertex
    begins, ends = np.where(same, there, there_next), np.where(same, there_next, there)
    return components(3 * len(faces), np.concatenate([here, here_next]), np.concatenate([begins, ends]))[1]


def _mates(soup: Soup) -> Int64Array:
    """Return ``[3F]`` the halfedge that continues each across its edge, -1 for none."""
    edge = soup.edges
    mate = np.full(3 * len(soup.faces), -1, dtype=np.int64)
    first, last = edge.halfedges[:, edge.face_count == 2]
    mate[first], mate[last] = last, first
    around = np.flatnonzero(edge.face_count[edge.of_halfedge] > 2)
    around = around[np.argsort(edge.of_halfedge[around], kind="stable")]
    of_edge, here = edge.of_halfedge[around], np.arange(len(around))
    one, other = _in_ranges(here + 1, np.searchsorted(of_edge, of_edge, side="right") - here - 1)
    away = across(soup.vertices, soup.faces, around)
    # A flap attached to the others has free edges.
    hanging = 2 * soup.at_edges(edge.face_count == 1)[around // 3]
    match = _matched(one, other, dots(away[one], away[other]) + (hanging[one] + hanging[other]), len(around))
    mate[around] = np.where(match < 0, -1, around[match])
    return mate


def _in_ranges(first: Int64Array, count: Int64Array) -> tuple[Int64Array, Int64Array]:
    """All pairs of a range, given by its first number and how many it has ``[N]``, and a number in it."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) + (first + count - np.cumsum(count))[owner]


def _matched(one: Int64Array, other: Int64Array, cost: FloatArray, count: int) -> Int64Array:
    """Return ``[count]`` the number that each is matched with, the cheapest of the allowed pairs first; -1 for none."""
    match, order = [-1] * count, np.argsort(cost, kind="stable")
    for a, b in zip(one[order].tolist(), other[order].tolist(), strict=True):
        if match[a] < 0 and match[b] < 0:
            match[a], match[b] = b, a
    return np.array(match, dtype=np.int64)


def _followers(soup: Soup, normals: FloatArray, fan: Int64Array, begin: Int64Array, end: Int64Array) -> Int64Array:
    """Return ``[N]`` the free edge that continues each at its end, -1 for none.

    Seen from outside, going counter-clockwise around a vertex, a fan is followed by a hole, then the next fan.
    Edges run from corner to corner ``[3F]``, each of which has a vertex and a fan.
    """
    vertices, corners = soup.vertices, soup.faces.ravel()
    sums = [np.bincount(corners, np.repeat(normals[:, k], 3), len(vertices)) for k in range(3)]
    axes: FloatArray = np.stack(sums, axis=1, dtype=np.float64)
    tail, head, count = corners[begin], corners[end], len(begin)
    leaving = np.argsort(tail, kind="stable")
    first, last = (np.searchsorted(tail[leaving], head, side=side) for side in ("left", "right"))
    poll_stop()
    come, go = _in_ranges(first, last - first)
    go = leaving[go]
    turn = _turns(vertices[tail[come]], vertices[head[come]], vertices[head[go]], axes[head[come]])
    turn[fan[end[come]] == fan[begin[go]]] += 2 * np.pi  # all the way around
    match = _matched(come, count + go, turn, 2 * count)[:count]
    return np.asarray(np.where(match < 0, -1, match - count))


def _turns(came_from: FloatArray, here: FloatArray, goes_to: FloatArray, axis: FloatArray) -> FloatArray:
    """Angles [N] around axes ``[N, 3]``, from 0 to 2 pi, from where edges came to where others go."""
    axis = axis / np.maximum(np.sqrt(dots(axis, axis)), np.finfo(float).tiny)[:, None]
    came, goes = came_from - here, goes_to - here
    flat = came - dots(came, axis)[:, None] * axis
    return angles(dots(np.cross(axis, flat), goes), dots(flat, goes)) % (2 * np.pi)


def _cycles(follower: Int64Array) -> list[Int64Array]:
    """Return the cycles of a partial permutation."""
    seen = [False] * len(follower)
    step = follower.tolist()
    cycles: list[Int64Array] = []
    for start in range(len(step)):
        walk, at = [], start
        while at >= 0 and not seen[at]:
            seen[at] = True
            walk.append(at)
            at = step[at]
        if walk and at == start:
            cycles.append(np.array(walk, dtype=np.int64))
    return cycles


# Optimal triangulation considers all triples of corners; longer loops are cut by ears.
_EXACT_LOOP = 60
# Where a cap turns by less than this from a face beside it, it continues the face (cosine of 45 degrees).
_SMOOTH_RIM = 0.7


def caps_of(soup: Soup, rims: Rims) -> tuple[Int64Array, Int64Array, FloatArray]:
    """Triangulate the loops, no two across the same edge if possible.

    Returns the faces ``[C, 3]``, without those with a repeated vertex, the loop ``[C]`` of each, and ``[L]`` the share
    of each loop along which its cap continues the adjacent faces.
    """
    weights = np.array([len(soup.vertices), 1])
    on_rim = marked(np.concatenate(rims.loops), len(soup.vertices))
    used = set((soup.edges.vertices[on_rim[soup.edges.vertices].all(axis=1)] @ weights).tolist())  # edges
    caps, smooth = [], []
    for loop, beside in zip(rims.loops, rims.beside, strict=True):
        poll_stop()
        points = soup.vertices[loop]
        if len(loop) <= _EXACT_LOOP:
            chord = np.sort(np.stack(np.broadcast_arrays(loop[:, None], loop), axis=2), axis=2) @ weights
            is_used = [one in used for one in chord.ravel().tolist()]
            taken = np.reshape(is_used, chord.shape) | (loop[:, None] == loop)
            triangles = least_bent(points, rims.normals[beside], taken)[:, ::-1].astype(np.int64)
        else:
            triangles = _by_ears(points)
        caps.append(loop[triangles])
        smooth.append(_smooth_share(points, rims.normals[beside], triangles))
        used.update((np.sort(caps[-1][:, [[0, 1], [1, 2], [2, 0]]], axis=2) @ weights).ravel().tolist())
    owner = np.repeat(np.arange(len(caps)), [len(some) for some in caps])
    faces = np.concatenate(caps)
    real = nondegenerate(faces)
    return faces[real], owner[real], np.array(smooth)


def _smooth_share(points: FloatArray, beside: FloatArray, triangles: Int64Array) -> float:
    """The share of a loop along which its cap continues the faces beside it; see `cap`."""
    begin, end = np.roll(triangles, -1, axis=1).ravel(), triangles.ravel()
    rim = np.flatnonzero((end - begin) % len(points) == 1)
    begin, end = begin[rim], end[rim]
    is_smooth = dots(beside[begin], face_normals(points, triangles)[rim // 3]) > _SMOOTH_RIM
    lengths = np.linalg.norm(points[end] - points[begin], axis=1)
    return float(lengths[is_smooth].sum() / lengths.sum())


def _by_ears(points: FloatArray) -> Int64Array:
    """Triangulate a long loop, oriented against it; it may visit a place twice."""
    flat = heights(points - points.mean(axis=0), principal_axes_of_points(points)[:2])
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3)
    if len(ears) != len(points) - 2:  # the loop's projection crosses itself: no plane fits
        return np.array([(0, i + 1, i) for i in range(1, len(points) - 1)], dtype=np.int64)
    triangles: Int64Array = ears.astype(np.int64)
    a, b, c = triangles.T
    along = ((b - a) % len(points) < (c - a) % len(points)).sum() * 2 > len(triangles)
    return triangles[:, ::-1] if along else triangles
