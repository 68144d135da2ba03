"""Open boundaries of a surface: flaps, as opposed to the surface they stick to, and the loops of edges around holes.

Input: a soup. Output: its flaps, and loops of vertices around its holes; nothing is decided or changed here.

Faces are mated across edges: if two share an edge, with each other; if more do, those that continue each other best.
Faces connected by mates form a patch, and all faces of a patch are wound alike, whatever the file says. A small patch
attached to others by edges that those mate without it is a flap, as is a flat one of any size with one loop around it:
its free edges bound no hole. On request, nor do those of a fin whose edge lies on the rim of a hole, where it is mated
with what is left there (`_fins`). At a vertex where several holes meet, a loop turns from a free edge to the next one
across the hole, so loops never run around existing faces. An island that touches its hole's rim at a vertex joins that
hole's loop, which visits the vertex twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.soup import Soup, across
from rlacd.solid.frame import FloatArray
from rlacd.solid.products import dots
from rlacd.solid.topology import BoolArray, IntArray, both_sides, components, has_marked, long_normals, marked

# A flap has at most this share of its body's area.
_FLAP = 0.05

# A lid is flat if its faces turn by less than this (cosine).
_FLAT_LID = 1 - 1e-6

# A fin on the rim of a hole is at most so many faces long.
_FIN_FACES = 8

# Edges that meet at vertices are paired for so many pairs at once.
_PAIRS_AT_ONCE = 1_000_000

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
    fins
        Whether fins on the rims of holes were found; they are flaps.
    """

    loops: list[IntArray]
    beside: list[IntArray]
    normals: FloatArray
    inverted: BoolArray
    flap: BoolArray
    fins: bool


def rims_of(soup: Soup, fins: bool = False) -> Rims:
    """Find the flaps of a soup and the loops around its holes.

    With `fins`, what hangs on the rim of a hole is a flap; otherwise it is what is left of a side.
    """
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
    fin = _fins(soup, mate) if fins else np.zeros(len(soup.faces), dtype=bool)
    if fin.any():
        label = _sides(soup, mate)
    poll_stop()
    low = np.minimum(label[0::2], label[1::2])
    patch = (np.cumsum(marked(low, len(label))) - 1)[low]
    flap = _flaps(soup, patch) | fin
    inverted = label[0::2] > low
    poll_stop()
    weighted = long_normals(soup.vertices, soup.faces)
    weighted[inverted] *= -1
    inverted ^= _against_main(soup, patch, flap, weighted)
    weighted[flap] = 0
    rim = np.flatnonzero((mate < 0) & np.repeat(~flap, 3))
    tail, head = soup.faces.ravel()[rim], soup.faces[rim // 3, _NEXT[rim % 3]]
    on_rim = marked(np.concatenate([tail, head]), len(soup.vertices))
    beside_rim = np.flatnonzero(has_marked(on_rim, soup.faces))  # only these faces count at vertices of the rim
    normal_of_vertex: FloatArray = np.stack(
        [
            np.bincount(soup.faces[beside_rim].ravel(), np.repeat(weighted[beside_rim, k], 3), len(soup.vertices))
            for k in range(3)
        ],
        axis=1,
    )
    swap = inverted[rim // 3]
    fan = _fans(soup.faces, mate, beside_rim)
    place = np.searchsorted(beside_rim, rim // 3)
    tail_fan, head_fan = fan[place, rim % 3], fan[place, _NEXT[rim % 3]]
    tail, head = np.where(swap, head, tail), np.where(swap, tail, head)
    tail_fan, head_fan = np.where(swap, head_fan, tail_fan), np.where(swap, tail_fan, head_fan)
    follower = _followers(soup.vertices, normal_of_vertex, tail, head, tail_fan, head_fan)
    # Faces between bodies are open at free edges; a hole is free all around, or nearly.
    free = soup.edges.valence[soup.edges.of_halfedge[rim]] == 1
    loops = [loop for loop in _cycles(follower) if len(loop) > 2 and 2 * free[loop].sum() > len(loop)]
    normals = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), np.finfo(float).tiny)
    lid = _lids(soup, patch, normals, rim, loops)
    loops = [loop for loop in loops if not lid[patch[rim[loop[0]] // 3]]]
    flap |= lid[patch]
    beside = [rim[loop] // 3 for loop in loops]
    return Rims([tail[loop] for loop in loops], beside, normals, inverted, flap, bool(fin.any()))


def _sides(soup: Soup, mate: IntArray) -> IntArray:
    """Return ``[2F]`` the component that the front and the back of every face belong to, joined across mates."""
    mated = np.flatnonzero(mate >= 0)
    forward = (soup.faces < soup.faces[:, _NEXT]).ravel()
    # Mates wound alike run along their edge in opposite directions; then fronts continue fronts.
    turned = forward[mated] == forward[mate[mated]]
    if not turned.any():  # fronts join fronts, and backs backs
        _, patch = components(len(soup.faces), mated // 3, mate[mated] // 3)
        return both_sides(patch)
    front, other = 2 * (mated // 3), 2 * (mate[mated] // 3)
    return components(
        2 * len(soup.faces), np.concatenate([front, front + 1]), np.concatenate([other + turned, other + 1 - turned])
    )[1]


def _fans(faces: IntArray, mate: IntArray, some: IntArray) -> IntArray:
    """Return ``[S, 3]`` the fan of each corner of some faces: the corners around a vertex that their mates connect.

    The faces ``[S]`` ascend.
    """
    slot = np.full(len(faces), -1, dtype=np.int64)
    slot[some] = 3 * np.arange(len(some))
    here = (3 * some[:, None] + np.arange(3)).ravel()
    here = here[(mate[here] >= 0) & (slot[mate[here] // 3] >= 0)]
    there = mate[here]
    here_next, there_next = (h - h % 3 + _NEXT[h % 3] for h in (here, there))
    flat = faces.ravel()
    same = flat[here] == flat[there]  # mates wound differently begin at the same vertex
    begins, ends = np.where(same, there, there_next), np.where(same, there_next, there)
    here, here_next, begins, ends = (slot[h // 3] + h % 3 for h in (here, here_next, begins, ends))
    links = np.concatenate([here, here_next]), np.concatenate([begins, ends])
    return components(3 * len(some), *links)[1].reshape(-1, 3)


def _mates(soup: Soup) -> IntArray:
    """Return ``[3F]`` the halfedge that continues each across its edge, -1 for none."""
    edge = soup.edges
    mate = np.full(3 * len(soup.faces), -1, dtype=np.int64)
    first, last = edge.halfedges[:, edge.valence == 2]
    mate[first], mate[last] = last, first
    valence = edge.valence[edge.of_halfedge]
    if (valence <= 2).all():
        return mate
    order = np.flatnonzero(valence > 2)
    order = order[np.argsort(edge.of_halfedge[order], kind="stable")]
    valence = valence[order]
    free = soup.at_valence(edge.valence == 1)
    for number in np.unique(valence).tolist():
        around = order[valence == number].reshape(-1, number)
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


def _flaps(soup: Soup, patch: IntArray) -> BoolArray:
    """Return ``[F]`` whether a face belongs to a small patch with free edges that is attached to other patches."""
    count = int(patch.max(initial=-1)) + 1
    hangs, free = (
        np.bincount(patch[soup.at_valence(some)], minlength=count) > 0
        for some in (soup.edges.valence > 2, soup.edges.valence == 1)
    )
    small = np.bincount(patch, soup.area, count)[patch] <= _FLAP * np.bincount(soup.body, soup.area)[soup.body]
    return np.asarray(small & hangs[patch] & free[patch])


def _lids(soup: Soup, patch: IntArray, normals: FloatArray, rim: IntArray, loops: list[IntArray]) -> BoolArray:
    """Return for each patch whether it is flat, hangs on others, and one loop runs all around it.

    So hangs a lid that stands open: a cap of that loop would lie on the lid itself, and close nothing.
    """
    count = int(patch.max(initial=-1)) + 1
    lid = np.zeros(count, dtype=bool)
    hangs = np.bincount(patch[soup.at_valence(soup.edges.valence > 2)], minlength=count) > 0
    edges = np.bincount(patch[rim // 3], minlength=count)
    for loop in loops:
        on = patch[rim[loop] // 3]
        if (on == on[0]).all() and hangs[on[0]] and edges[on[0]] == len(loop):
            some = normals[patch == on[0]]
            lid[on[0]] = bool((some @ some[0] > _FLAT_LID).all())
    return lid


def _fins(soup: Soup, mate: IntArray) -> BoolArray:
    """Return ``[F]`` whether a face belongs to a fin that hangs on the rim of a hole; takes fins out of `mate`.

    Such a fin hangs by one edge, and no other face has its corners. What missing faces left of a surface shares them.
    """
    fin = np.zeros(len(soup.faces), dtype=bool)
    edge = _hanging(mate)
    users = np.bincount(soup.faces.ravel(), minlength=len(soup.vertices))
    # A fin may hang on a face that hangs itself: take off what shares corners from the near end.
    for _ in range(_FIN_FACES):
        root = _roots(edge, mate)
        hung = np.flatnonzero(root >= 0)
        if len(hung) == 0:
            return fin
        roots, at = np.unique(root[hung], return_inverse=True)
        keys, inside = np.unique((at[:, None] * len(users) + soup.faces[hung]).ravel(), return_counts=True)
        tree, vertex = np.divmod(keys, len(users))
        first, second = (soup.faces.ravel()[h[roots]] for h in (edge, edge - edge % 3 + _NEXT[edge % 3]))
        shared = (inside < users[vertex]) & (vertex != first[tree]) & (vertex != second[tree])
        bound = np.bincount(tree, shared, len(roots)) > 0
        if not bound.any():
            break
        edge[roots[bound]] = -1
    small = np.bincount(at, soup.area[hung]) <= _FLAP * np.bincount(soup.body, soup.area)[soup.body[roots]]
    chosen = small & ~bound
    fin[hung[chosen[at]]] = True
    for side in (mate[edge[roots[chosen]]], edge[roots[chosen]]):
        mate[side] = -1
    return fin


def _hanging(mate: IntArray) -> IntArray:
    """Return ``[F]`` the edge by which a face hangs on the rest, -1 for none.

    Faces with one mate are taken off, again and again: trees that hang on the rest by one edge, not longer than a fin.
    """
    count = len(mate) // 3
    left = np.ones(count, dtype=bool)
    edge = np.full(count, -1, dtype=np.int64)
    mated = mate >= 0
    for _ in range(_FIN_FACES):
        linked = (mated & np.repeat(left, 3) & left[mate // 3]).reshape(-1, 3)
        leaf = linked.sum(axis=1) == 1
        by = 3 * np.arange(count) + linked.argmax(axis=1)
        leaf &= ~leaf[mate[by] // 3]
        if not leaf.any():
            break
        left[leaf], edge[leaf] = False, by[leaf]
    return edge


def _roots(edge: IntArray, mate: IntArray) -> IntArray:
    """Return ``[F]`` the face nearest the rest of the tree that a face hangs in, -1 for none."""
    root = np.where(edge < 0, -1, np.arange(len(edge)))
    hung = np.flatnonzero(edge >= 0)
    for _ in range(_FIN_FACES):
        above = mate[edge[root[hung]]] // 3
        root[hung] = np.where(edge[above] < 0, root[hung], above)
    return root


def _against_main(soup: Soup, patch: IntArray, left_out: BoolArray, weighted: FloatArray) -> BoolArray:
    """Return ``[F]`` which patches are wound against the largest one they touch at a vertex; flips `weighted`.

    The inside has the greater winding number, so a patch is wound like the rest if the inside is at its back.
    """
    turned = np.zeros(len(soup.faces), dtype=bool)
    count = int(patch.max(initial=-1)) + 1
    if count == 1:
        return turned
    corner = np.repeat(np.arange(len(soup.faces)), 3)
    _, cluster = components(len(soup.faces) + len(soup.vertices), corner, len(soup.faces) + soup.faces.ravel())
    area = np.bincount(patch, np.where(left_out, 0, soup.area), count)
    cluster_of = np.zeros(count, dtype=np.int64)
    cluster_of[patch] = cluster[: len(soup.faces)]
    largest = np.lexsort((np.arange(count), -area, cluster_of))
    main = np.zeros(count, dtype=bool)
    main[largest[np.unique(cluster_of[largest], return_index=True)[1]]] = True
    island = np.flatnonzero(~main[patch] & ~left_out)
    there = main[patch] & ~left_out
    if len(island) == 0 or not there.any():  # faces without an area may leave nothing but flaps to compare with
        return turned
    # The largest face of each island represents it.
    island = island[np.lexsort((-soup.area[island], patch[island]))]
    island = island[np.unique(patch[island], return_index=True)[1]]
    corners = soup.faces[there].copy()
    flipped = dots(long_normals(soup.vertices, corners), weighted[there]) < 0
    corners[flipped] = corners[flipped, ::-1]
    query = SurfaceQuery(soup.vertices, corners)
    middle = soup.vertices[soup.faces[island]].mean(axis=1)
    step = weighted[island] / np.maximum(np.sqrt(2 * soup.area[island]), np.finfo(float).tiny)[:, None] / 2
    wrong = query.winding(middle + step) > query.winding(middle - step)
    turned = np.isin(patch, patch[island[wrong]])
    weighted[turned] *= -1
    return turned


def _followers(
    vertices: FloatArray, normals: FloatArray, tail: IntArray, head: IntArray, tail_fan: IntArray, head_fan: IntArray
) -> IntArray:
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
    several = np.flatnonzero(~single & (last_out > first_out))
    ways_in, ways_out = last_in - first_in, last_out - first_out
    batch = np.cumsum(ways_in[several] * ways_out[several]) // _PAIRS_AT_ONCE
    free = np.ones(len(tail), dtype=bool)
    for some in np.split(several, np.flatnonzero(np.diff(batch)) + 1):
        poll_stop()
        # All pairs of an edge that arrives at a vertex and one that leaves it, vertex by vertex.
        pairs = ways_in[some] * ways_out[some]
        at = np.repeat(some, pairs)
        place = np.arange(len(at)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
        arriving = ends[first_in[at] + place // ways_out[at]]
        leaving = begins[first_out[at] + place % ways_out[at]]
        turn = _turns(vertices, normals[vertex[at]], tail[arriving], vertex[at], head[leaving])
        turn[head_fan[arriving] == tail_fan[leaving]] += 2 * np.pi  # all the way around
        order = np.lexsort((turn, at))
        for edge, next_edge in zip(arriving[order].tolist(), leaving[order].tolist(), strict=True):
            if follower[edge] < 0 and free[next_edge]:
                follower[edge] = next_edge
                free[next_edge] = False
    return follower


def _turns(vertices: FloatArray, axes: FloatArray, tail: IntArray, here: IntArray, head: IntArray) -> FloatArray:
    """Angles [N] around axes [N, 3], from 0 to 2 pi, from where an edge came to where another goes."""
    axes = axes / np.maximum(np.sqrt(dots(axes, axes)), np.finfo(float).tiny)[:, None]
    came, goes = vertices[tail] - vertices[here], vertices[head] - vertices[here]
    flat = came - dots(came, axes)[:, None] * axes
    return np.arctan2(dots(np.cross(axes, flat), goes), dots(flat, goes)) % (2 * np.pi)


def _cycles(follower: IntArray) -> list[IntArray]:
    """Return the cycles of a partial permutation."""
    seen = [False] * len(follower)
    step = follower.tolist()
    cycles: list[IntArray] = []
    for start in range(len(step)):
        walk, at = [], start
        while at >= 0 and not seen[at]:
            seen[at] = True
            walk.append(at)
            at = step[at]
        if walk and at == start:
            cycles.append(np.array(walk, dtype=np.int64))
    return cycles
