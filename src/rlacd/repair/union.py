"""Solids as manifolds, and their union: overlapping ones united, enclosed cavities filled."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from manifold3d import Manifold, OpType

from rlacd import _native
from rlacd._native import poll_stop
from rlacd.repair.soup import FLAT, MOST_UNITED
from rlacd.solid.arrays import FloatArray, Int64Array, IntArray, dots
from rlacd.solid.component import concatenated
from rlacd.solid.frame import thickened
from rlacd.solid.manifold import require_time_for, to_manifold
from rlacd.solid.solid import Shape, mesh_of, surface_of
from rlacd.solid.topology import compacted

# manifold3d collapses edges shorter than 1e-12, and swaps those of faces that are no higher, or folded back onto a
# neighbour in a plane within 1e-12.
_FLAT_MESH = 1e-11

# Number of triangles united at once; the work may be stopped between batches.
_MESHES_UNITED = 5 * MOST_UNITED

# Crossing pairs, or corners of their arrangement, united at once. Solids with more pairs than this, plus so many per
# triangle, are not united exactly: manifold3d takes about 6 microseconds for each, and unions of solids that cross
# themselves have ever more of them.
_MOST_CROSSINGS, _PER_TRIANGLE = 200_000, 5

# Depth of the points that tell where a solid lies: far more than rounding, far less than a slab is thick.
_HAIR = 1e-6


Walls: TypeAlias = tuple[FloatArray, IntArray]
"""Vertices float64 ``[V, 3]`` and faces int32 ``[F, 3]`` around cavities and what stands in them."""


class CrossingsError(Exception):
    """Solids cross each other so often that uniting them would take too long."""


def to_arrays(solid: Shape) -> tuple[FloatArray, Int64Array]:
    """Return vertices float64 ``[V, 3]`` and faces int64 ``[F, 3]`` of a solid."""
    vertices, faces = mesh_of(solid)
    return vertices, faces.astype(np.int64)


def one_body(vertices: FloatArray, faces: IntArray) -> tuple[tuple[FloatArray, IntArray], bool] | None:
    """One closed and oriented body as it is, and whether it was wound inside out; None for anything else.

    Where manifold3d moves no edge, it makes the same vertices and faces in the same order, in twenty times the time.
    """
    found = _native.closed_bodies(vertices, faces)
    if found is None:
        return None
    _, (volume, *others), (area, *_), _, has_no_pinch, least_height, least_fold = found
    if others or not has_no_pinch:
        return None
    if abs(volume) <= 2 * FLAT * area or least_height * min(least_fold, 1.0) <= _FLAT_MESH:
        return None
    outward = faces if volume > 0 else np.ascontiguousarray(faces[:, ::-1])
    return _native.along_a_curve(vertices, outward), volume < 0


def hull_of_points(points: FloatArray) -> Manifold:
    """Return the hull of points ``[N, 3]``, thickened along the axes in which they have no extent."""
    poll_stop()
    return Manifold.hull_points(thickened(np.unique(points, axis=0)))


def slab_of_faces(vertices: FloatArray, faces: Int64Array) -> Manifold:
    """Return the union of triangles, each of them thickened."""
    return unite([hull_of_points(vertices[face]) for face in faces])


def unite(solids: Sequence[Shape], *, keep_cavities: bool = False) -> Manifold:
    """Unite solids and fill the cavities nothing can reach; see `filled`."""
    whole = united([solid if isinstance(solid, Manifold) else to_manifold(*solid) for solid in solids])
    # More cavity than solid means shells that came out inside out, not cavities.
    return whole if keep_cavities and whole.volume() > 0 else filled(whole)[0]


def emptied(whole: Manifold, bounded: Sequence[Manifold]) -> Walls:
    """Walls of what is solid only in the whole, also where it opens to the outside, at a wall without thickness."""
    vertices, faces = surface_of(whole - united(bounded))
    return vertices, np.ascontiguousarray(faces[:, ::-1])


def cavities_in(walls: Walls) -> int:
    """Return the number of cavities that walls bound."""
    shells = _native.closed_bodies(*walls)
    assert shells is not None, "two faces of a manifold share an edge"
    return int((shells[1] <= 0).sum())


def united(solids: Sequence[Manifold]) -> Manifold:
    """The union of solids, with its cavities; raises `CrossingsError` if they cross each other too often."""
    some = [solid for solid in solids if not solid.is_empty()]
    if not some:
        return Manifold()
    return Manifold.compose(some) if len(some) > MOST_UNITED else _by_size(some)


def hollowed(solids: list[Manifold], inward: list[bool]) -> list[Manifold]:
    """Cut cavities out of solids where others, wound inside out, bound them; what stands in a cavity stays.

    Parameters
    ----------
    solids
        None of them is empty.
    inward
        Which of them the input winds inside out: cavities are wound opposite to the outermost solid around them.

    Returns
    -------
    list of Manifold
        The same if there are no cavities.
    """
    if len(set(inward)) < 2:
        return solids
    around = _around(solids)
    outermost = [max(others, key=lambda j: solids[j].volume(), default=i) for i, others in enumerate(around)]
    cavities = [i for i, one in enumerate(outermost) if inward[i] != inward[one]]
    if not cavities:
        return solids
    inside = [[solids[i] for i in cavities if j in around[i]] for j in range(len(solids))]
    return [solids[j] - unite(some) if some else solids[j] for j, some in enumerate(inside) if j not in cavities]


def _around(solids: list[Manifold]) -> list[list[int]]:
    """The solids that contain each solid, if it crosses none."""
    boxes = np.reshape([solid.bounding_box() for solid in solids], (-1, 2, 3))
    points = np.stack([_point_in(solid) for solid in solids])
    around: list[list[int]] = [[] for _ in solids]
    for j, solid in enumerate(solids):
        poll_stop()
        inner = (boxes[:, 0] >= boxes[j, 0]).all(axis=1) & (boxes[:, 1] <= boxes[j, 1]).all(axis=1)
        inner[j] = False
        if inner.any():
            winding = _native.Surface(*surface_of(solid)).winding(points[inner], is_closed=True)
            for i in np.flatnonzero(inner)[winding > 0]:
                around[i].append(j)
    return around


def _point_in(solid: Manifold) -> FloatArray:
    """A point a hair below the middle of the largest face: corners may touch what is around."""
    vertices, faces = to_arrays(solid)
    normals = _native.long_normals(vertices, faces)
    largest = dots(normals, normals).argmax()
    down = normals[largest] / -np.sqrt(dots(normals[largest], normals[largest]))
    return np.asarray(vertices[faces[largest]].mean(axis=0) + _HAIR * down)


def filled(solid: Manifold) -> tuple[Manifold, Walls | None]:
    """Fill the cavities: drop the shells that bound them, and what stands in them.

    manifold3d's own decomposition takes time in proportion to the number of shells times that of the faces, and noise
    between overlapping walls leaves hundreds of tiny cavities.
    """
    vertices, faces = surface_of(solid)
    shells = _native.closed_bodies(vertices, faces)
    if shells is None:  # there are no faces
        return solid, None
    shell, volume, _, boxes = shells[:4]
    is_cavity = volume <= 0
    if not is_cavity.any() or is_cavity.all():
        return solid, None
    kept = ~is_cavity
    order = np.argsort(shell, kind="stable")
    begin = np.searchsorted(shell[order], np.arange(len(volume) + 1))  # where the faces of each shell begin
    for cavity in np.flatnonzero(is_cavity):
        poll_stop()
        inner = (boxes[:, :3] >= boxes[cavity, :3]).all(axis=1) & (boxes[:, 3:] <= boxes[cavity, 3:]).all(axis=1)
        some = np.flatnonzero(kept & inner)
        if len(some) == 0:
            continue
        around = _native.Surface(vertices, np.ascontiguousarray(faces[order[begin[cavity] : begin[cavity + 1]]]))
        standing = around.winding(vertices[faces[order[begin[some]], 0]], is_closed=True) < 0
        kept[some[standing]] = False
    is_kept = kept[shell]
    return to_manifold(*compacted(vertices, faces[is_kept])), compacted(vertices, faces[~is_kept])


def _by_size(solids: list[Manifold]) -> Manifold:
    """Unite solids, always those with the fewest triangles first: what is large takes part in few booleans.

    manifold3d cannot be interrupted: how long a union takes is known by its crossings before it is begun.
    """
    waiting = [(solid.num_tri(), i, solid) for i, solid in enumerate(solids)]
    heapq.heapify(waiting)
    left = _MOST_CROSSINGS + _PER_TRIANGLE * sum(triangles for triangles, *_ in waiting)
    at_once, newest = _MESHES_UNITED, len(solids)
    while len(waiting) > 1:
        group = [heapq.heappop(waiting), heapq.heappop(waiting)]
        triangles = group[0][0] + group[1][0]
        while waiting and triangles + waiting[0][0] <= at_once:
            group.append(heapq.heappop(waiting))
            triangles += group[-1][0]
        some = [solid for *_, solid in group]
        pairs, corners = _crossings(some, left)
        if len(group) > 2 and (pairs > left or corners > _MOST_CROSSINGS):
            at_once = 0  # two at a time from here on
            for one in group:
                heapq.heappush(waiting, one)
            continue
        left -= pairs
        if left < 0:
            raise CrossingsError
        require_time_for(triangles)
        union = Manifold.batch_boolean(some, OpType.Add)
        heapq.heappush(waiting, (union.num_tri(), newest, union))
        newest += 1
    return waiting[0][2]


def _crossings(solids: list[Manifold], most: int) -> tuple[int, int]:
    """How many pairs of triangles of different solids touch, and a bound on the corners of their arrangement."""
    meshes = [surface_of(solid) for solid in solids]
    body = np.repeat(np.arange(len(meshes)), [len(faces) for _, faces in meshes])
    return _native.crossings(*concatenated(meshes), body, most)
