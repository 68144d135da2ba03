"""Open boundaries of a surface: flaps that stick to it, the loops of edges around its holes, and caps for these.

Input: a soup. Output: its flaps, loops of vertices around its holes, and triangles that close these without new
vertices; nothing is decided or changed here.

Two faces that share an edge are mates; where more share it, those that continue each other best. Faces connected by
mates form a patch, and all faces of a patch are wound alike, whatever the file says. A flap is a small patch attached
to others at edges that these mate without it, or a flat patch within one loop: its free edges bound no hole. At a
vertex where several holes meet, a loop turns from a free edge to the next one across the hole, so loops never run
around existing faces. An island that touches its hole's rim joins that hole's loop, which visits the vertex twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import mapbox_earcut
import numpy as np

from rlacd._native import angles, components, least_bent, long_normals, poll_stop, principal_axes_of_points
from rlacd.repair.soup import FLAPS, Soup, across, face_normals
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots, heights, length
from rlacd.solid.topology import marked, nondegenerate

_NEXT = np.array([1, 2, 0])


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
    flap
        ``[F]``, whether a face belongs to a flap.
    """

    loops: list[Int64Array]
    beside: list[Int64Array]
    normals: FloatArray
    inverted: BoolArray
    flap: BoolArray


def rims_of(soup: Soup) -> Rims:
    """Find the flaps of a soup and the loops around its holes."""
    mate, label = _mated(soup)
    poll_stop()
    low = np.minimum(label[0::2], label[1::2])
    patch = (np.cumsum(marked(low, len(label))) - 1)[low]
    flap = _flaps(soup, patch)
    inverted = label[0::2] > low
    poll_stop()
    weighted = long_normals(soup.vertices, soup.faces)
    weighted[inverted] *= -1
    weighted[flap] = 0
    rim = np.flatnonzero((mate < 0) & np.repeat(~flap, 3))
    tail, follower = _continued(soup, mate, rim, inverted[rim // 3], weighted)
    # Most edges around a hole are free: a loop of edges that touch other bodies bounds none.
    free = soup.edges.face_count[soup.edges.of_halfedge[rim]] == 1
    loops = [loop for loop in _cycles(follower) if len(loop) > 2 and 2 * free[loop].sum() > len(loop)]
    normals = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), np.finfo(float).tiny)
    return Rims([tail[loop] for loop in loops], [rim[loop] // 3 for loop in loops], normals, inverted, flap)


def _mated(soup: Soup) -> tuple[Int64Array, Int64Array]:
    """Return the mate ``[3F]`` of every halfedge, and the component ``[2F]`` of every side."""
    mate = _mates(soup)
    poll_stop()
    label = _sides(soup, mate)
    one_sided = label[0::2] == label[1::2]
    if one_sided.any():
        # Where faces are missing, the remaining two can be mated wrongly: use the windings of the file there.
        forward = (soup.faces < soup.faces[:, _NEXT]).ravel()
        wrong = (mate >= 0) & np.repeat(one_sided, 3) & (forward == forward[mate])
        mate[wrong] = -1
        label = _sides(soup, mate)
    return mate, label


def _continued(
    soup: Soup, mate: Int64Array, rim: Int64Array, swap: BoolArray, weighted: FloatArray
) -> tuple[Int64Array, Int64Array]:
    """Return the vertex ``[N]`` where each free halfedge begins, seen from outside, and the one that continues it.

    `swap` marks halfedges of inverted faces; the normals ``[F, 3]`` are as long as areas.
    """
    corners, following = soup.faces.ravel(), rim - rim % 3 + _NEXT[rim % 3]
    tail, head = corners[rim], corners[following]
    sums = [np.bincount(corners, np.repeat(weighted[:, k], 3), len(soup.vertices)) for k in range(3)]
    normal_of_vertex: FloatArray = np.stack(sums, axis=1)
    fan = _fans(soup.faces, mate)
    tail_fan, head_fan = fan[rim], fan[following]
    tail, head = np.where(swap, head, tail), np.where(swap, tail, head)
    tail_fan, head_fan = np.where(swap, head_fan, tail_fan), np.where(swap, tail_fan, head_fan)
    return tail, _followers(soup.vertices, normal_of_vertex, tail, head, tail_fan, head_fan)


def _sides(soup: Soup, mate: Int64Array) -> Int64Array:
    """Return ``[2F]`` the component that the front and the back of every face belong to, joined across mates."""
    mated = np.flatnonzero(mate >= 0)
    forward = (soup.faces < soup.faces[:, _NEXT]).ravel()
    # Mates wound alike run along their edge in opposite directions; then fronts continue fronts.
    turned = forward[mated] == forward[mate[mated]]
    front, other = 2 * (mated // 3), 2 * (mate[mated] // 3)
    return components(
        2 * len(soup.faces), np.concatenate([front, front + 1]), np.concatenate([other + turned, other + 1 - turned])
    )[1]


def _fans(faces: Int64Array, mate: Int64Array) -> Int64Array:
    """Return ``[3F]`` the fan of each corner: the corners around a vertex that the mates of faces connect."""
    here = np.flatnonzero(mate >= 0)
    there = mate[here]
    here_next, there_next = (h - h % 3 + _NEXT[h % 3] for h in (here, there))
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
    face_count = edge.face_count[edge.of_halfedge]
    if (face_count <= 2).all():
        return mate
    order = np.flatnonzero(face_count > 2)
    order = order[np.argsort(edge.of_halfedge[order], kind="stable")]
    face_count = face_count[order]
    free = soup.at_edges(edge.face_count == 1)
    for number in np.unique(face_count).tolist():
        around = order[face_count == number].reshape(-1, number)
        away = across(soup.vertices, soup.faces, around.ravel()).reshape(-1, number, 3)
        folded = dots(away[:, :, None], away[:, None])
        # A flap attached to the others has free edges.
        hanging = 2 * free[around // 3]
        folded += hanging[:, :, None] + hanging[:, None, :]
        folded[:, np.arange(number), np.arange(number)] = np.inf
        row = np.arange(len(around))
        for _ in range(number // 2):
            first, second = np.divmod(folded.reshape(len(around), -1).argmin(axis=1), number)
            mate[around[row, first]], mate[around[row, second]] = around[row, second], around[row, first]
            for gone in (first, second):
                folded[row, gone, :] = np.inf
                folded[row, :, gone] = np.inf
    return mate


def _flaps(soup: Soup, patch: Int64Array) -> BoolArray:
    """Return ``[F]`` whether a face belongs to a small patch with free edges that is attached to other patches."""
    count = int(patch.max(initial=-1)) + 1
    hangs, free = (
        np.bincount(patch[soup.at_edges(some)], minlength=count) > 0
        for some in (soup.edges.face_count > 2, soup.edges.face_count == 1)
    )
    small = np.bincount(patch, soup.area, count)[patch] <= FLAPS * np.bincount(soup.body, soup.area)[soup.body]
    return np.asarray(small & hangs[patch] & free[patch])


def _followers(
    vertices: FloatArray,
    normals: FloatArray,
    tail: Int64Array,
    head: Int64Array,
    tail_fan: Int64Array,
    head_fan: Int64Array,
) -> Int64Array:
    """Return ``[N]`` the free edge that continues each at its head, -1 for none.

    Seen from outside, going counter-clockwise around a vertex, a fan is followed by a hole, then the next fan.
    """
    follower = np.full(len(tail), -1, dtype=np.int64)
    ends, begins = np.argsort(head, kind="stable"), np.argsort(tail, kind="stable")
    vertex = np.unique(head)
    first_in, last_in = (np.searchsorted(head[ends], vertex, side=side) for side in ("left", "right"))
    first_out, last_out = (np.searchsorted(tail[begins], vertex, side=side) for side in ("left", "right"))
    single = (last_in - first_in == 1) & (last_out - first_out == 1)
    follower[ends[first_in[single]]] = begins[first_out[single]]
    free = np.ones(len(tail), dtype=bool)
    for at in np.flatnonzero(~single & (last_out > first_out)).tolist():
        poll_stop()
        # All pairs of an edge that arrives at the vertex and one that leaves it.
        come, go = ends[first_in[at] : last_in[at]], begins[first_out[at] : last_out[at]]
        arriving, leaving = np.repeat(come, len(go)), np.tile(go, len(come))
        turn = _turns(vertices[tail[arriving]], vertices[vertex[at]], vertices[head[leaving]], normals[vertex[at]])
        turn[head_fan[arriving] == tail_fan[leaving]] += 2 * np.pi  # all the way around
        order = np.argsort(turn, kind="stable")
        for edge, next_edge in zip(arriving[order].tolist(), leaving[order].tolist(), strict=True):
            if follower[edge] < 0 and free[next_edge]:
                follower[edge] = next_edge
                free[next_edge] = False
    return follower


def _turns(came_from: FloatArray, here: FloatArray, goes_to: FloatArray, axis: FloatArray) -> FloatArray:
    """Angles [N] around an axis, from 0 to 2 pi, from where edges came to where others go."""
    axis = axis / max(length(axis), np.finfo(float).tiny)
    came, goes = came_from - here, goes_to - here
    flat = came - heights(came, axis)[:, None] * axis
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


def caps_of(soup: Soup, rims: Rims) -> tuple[Int64Array, Int64Array]:
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


def cap(points: FloatArray, beside: FloatArray, taken: BoolArray | None = None) -> Int64Array:
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
    Int64Array
        ``[N - 2, 3]`` corners, all of them points of the loop, oriented against the loop to match the adjacent faces.
    """
    if len(points) <= 3:
        return np.array([[0, 2, 1]])
    if len(points) <= _EXACT_LOOP:
        return least_bent(points, beside, taken)[:, ::-1].astype(np.int64)
    flat = heights(points - points.mean(axis=0), principal_axes_of_points(points)[:2])
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3)
    if len(ears) != len(points) - 2:  # the loop's projection crosses itself: no plane fits
        return np.array([(0, i + 1, i) for i in range(1, len(points) - 1)], dtype=np.int64)
    triangles: Int64Array = ears.astype(np.int64)
    a, b, c = triangles.T
    along = ((b - a) % len(points) < (c - a) % len(points)).sum() * 2 > len(triangles)
    return triangles[:, ::-1] if along else triangles


def smooth_share(soup: Soup, rims: Rims, caps: Int64Array, owner: Int64Array) -> FloatArray:
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
    lengths = np.linalg.norm(soup.vertices[head] - soup.vertices[tail], axis=1)
    share: FloatArray = np.bincount(loop_of, lengths * smooth) / np.bincount(loop_of, lengths)
    return share
