"""Concave edges in numpy, written before the kernel and independently of it: the reference it is compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rlacd.planes.candidates import Candidates
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray
from rlacd.solid.component import Component

REFLEX = float(np.radians(10))
"""An edge is concave when it exceeds a straight angle by more than this (radians); flatter ones tessellate curves."""

FOLD = float(np.radians(0.1))
"""Two faces this close to lying on each other: rounding decides whether they enclose a slit or a film of the solid."""

THINNEST_FACE = 1e-6
"""Faces lower than this above an edge are needles whose normals say nothing in single precision."""

TURN = float(np.cos(np.radians(30)))
"""Reflex edges that meet and turn by less than 30 degrees continue each other: the pieces of one tessellated crease."""

CONTENDERS = 256
"""So many edges, those with the best bounds, are weighed exactly; scans have thousands."""

FACETS = 64
"""So many facets of the hull, the largest, bound the depth of all edges."""

FLAT = 1e-6
"""Corners this close to a face's plane belong to the same flat region: single precision cannot tell them apart."""

HAIR = 1e-9
"""How far a slanted face plane is moved off its face: above rounding (1e-15), below the clean-up of hulls (1e-6)."""

SAME_DIRECTION = 3e-7
"""Normals within this angle of a coordinate axis are that axis, so that cuts along it are exact and sweeps shared."""

SAME_PLANE = 1e-4
"""Planes whose coordinates (see `_coordinates`) differ by less than this are one."""

TIE = 1e-9
"""Edges whose scores are this close in proportion are alike: the first one goes, not the one that rounding prefers."""


@dataclass(frozen=True, eq=False)
class ConcaveEdges:
    """Reflex edges of a component.

    Attributes
    ----------
    ends : int32 [E, 2]
        Vertices of the component.
    faces : int32 [E, 2]
        The faces on both sides; the first one runs from the first end to the second.
    normals : float64 [E, 2, 3]
        Their outward unit normals.
    angle : float64 [E]
        By how much the dihedral angle inside the solid exceeds a straight one, in (0, pi).
    """

    ends: IntArray
    faces: IntArray
    normals: FloatArray
    angle: FloatArray

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, which: NDArray[np.intp] | BoolArray) -> ConcaveEdges:
        """Get some of the edges, by indices or a mask."""
        return ConcaveEdges(self.ends[which], self.faces[which], self.normals[which], self.angle[which])


def reflex_edges(component: Component) -> ConcaveEdges:
    """Find all edges whose dihedral angle exceeds 180 degrees by more than `REFLEX`, folds and needles left out."""
    vertices, faces = component.vertices, component.faces
    first, second = _halfedge_pairs(faces, len(vertices))
    corners = vertices[faces]
    scaled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled_area = np.linalg.norm(scaled, axis=1)
    normals = scaled / np.maximum(doubled_area, np.finfo(np.float64).tiny)[:, None]
    ends = np.stack([faces.ravel()[first], faces.ravel()[second]], axis=1)
    f, g = first // 3, second // 3
    along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    length = np.linalg.norm(along, axis=1)
    # Seen along the edge, outward normals turn to the left over a ridge and to the right in a valley.
    turn = np.einsum("ij,ij->i", np.cross(normals[g], normals[f]), along)
    angle = np.arctan2(turn, length * np.einsum("ij,ij->i", normals[f], normals[g]))
    lowest = np.minimum(doubled_area[f], doubled_area[g])
    reflex = (angle > REFLEX) & (angle < np.pi - FOLD) & (lowest > THINNEST_FACE * length)
    sides = np.stack([f[reflex], g[reflex]], axis=1).astype(np.int32)
    return ConcaveEdges(ends[reflex], sides, normals[sides], angle[reflex])


def concave_edges(component: Component, count: int = 4) -> ConcaveEdges:
    """Choose up to `count` reflex edges of a component: deep, sharp ones of long creases first, and spread out.

    The first has the greatest depth x angle x length; depth is how far its midpoint lies below the hull's surface,
    length that of its whole crease. For each further one the product is multiplied by its distance from the nearest
    chosen one, and by how much its planes differ from those chosen; edges that offer no new plane are never chosen.

    Returns
    -------
    ConcaveEdges
        In the order of choice.
    """
    found = reflex_edges(component)
    if len(found) == 0 or count <= 0:
        return found[np.arange(0)]
    middle = component.vertices[found.ends].mean(axis=1)
    normals, offsets = _facets(component)
    worth = found.angle * _crease_lengths(component, found)
    bound = worth * _depth(middle, normals[:FACETS], offsets[:FACETS])
    if len(found) > CONTENDERS:
        kept = np.argsort(-bound, kind="stable")[:CONTENDERS]
        found, middle, worth, bound = found[kept], middle[kept], worth[kept], bound[kept]
    weight = bound if len(normals) <= FACETS else worth * _depth(middle, normals, offsets)
    return found[_spread_out(component, found, middle, weight, count)]


def concave_edge_planes(component: Component, count: int = 4) -> Candidates:
    """Candidates of one component: three planes for each of `count` concave edges, near-duplicates left out.

    Per edge, the plane that halves the reflex angle, and the planes of its two faces. A face plane is moved outwards
    until its face, and what is coplanar with it in single precision, lies wholly below: by nothing where the plane is
    normal to a coordinate axis (such cuts are exact), else by `HAIR`. On the face itself, rounding would decide for
    every corner on which side it comes to lie, and the part beyond would carry the face along as a film.

    Returns
    -------
    Candidates
        K <= 3 * `count` directions with one plane each, in the order of choice; K = 0 for a convex component.
    """
    edges = concave_edges(component, count)
    normals, offsets = _planes_of(component, edges)
    offsets[:, 1:] = _above_faces(component, edges.faces.reshape(-1), normals[:, 1:].reshape(-1, 3)).reshape(-1, 2)
    normals, offsets = normals.reshape(-1, 3), offsets.reshape(-1)
    sign = np.sign(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)])
    normals, offsets = normals * sign[:, None] + 0.0, offsets * sign
    different = _differences(*[_coordinates(component, normals, offsets)] * 2) > SAME_PLANE
    kept: list[int] = []
    for i in range(len(normals)):
        if different[i, kept].all():
            kept.append(i)
    return Candidates(normals[kept], offsets[kept, None])


def _halfedge_pairs(faces: IntArray, count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Halfedges (h, g), [E] each, of the edges that exactly two faces use in opposite directions.

    Halfedge 3 f + c runs from corner c of face f to its next; h runs from the smaller vertex to the larger.
    """
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    key = np.minimum(start, end) * count + np.maximum(start, end)
    up, down = (_sorted_single(key, np.flatnonzero(way)) for way in (start < end, start > end))
    if np.array_equal(key[up], key[down]):
        return up, down
    return up[np.isin(key[up], key[down])], down[np.isin(key[down], key[up])]


def _sorted_single(key: NDArray[np.int64], halfedges: NDArray[np.intp]) -> NDArray[np.intp]:
    """Sort halfedges by their key, those left out that share it."""
    halfedges = halfedges[np.argsort(key[halfedges], kind="stable")]
    same = key[halfedges[1:]] == key[halfedges[:-1]]
    single: NDArray[np.intp] = halfedges[~(np.append(same, False) | np.insert(same, 0, False))]
    return single


def _facets(component: Component) -> tuple[FloatArray, FloatArray]:
    """Planes of the hull's facets, outward unit normals [H, 3] and offsets [H], the largest triangles first."""
    corners = component.hull.vertices[component.hull.faces]
    scaled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(scaled, axis=1)
    order = np.argsort(-size, kind="stable")
    order = order[size[order] > 0]
    normals = scaled[order] / size[order, None]
    return normals, np.einsum("ij,ij->i", normals, corners[order, 0])


def _depth(points: FloatArray, normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Distance [N] from points in a convex polytope to the nearest of its facets' planes, which is to its surface.

    In strips that BLAS does not think worth its threads: they would fight with ours, and wait for them.
    """
    depth = np.full(len(points), np.inf)
    for i in range(0, len(normals), 16):
        np.minimum(depth, (offsets[i : i + 16] - points @ normals[i : i + 16].T).min(axis=1), out=depth)
    return np.asarray(np.maximum(depth, 0))


def _crease_lengths(component: Component, edges: ConcaveEdges) -> FloatArray:
    """Length [E] of the whole crease that each edge is a piece of, but no more than the component's largest extent."""
    ends = component.vertices[edges.ends]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    outgoing = np.concatenate([along, -along]) / np.tile(length, 2)[:, None]
    edge_of = np.tile(np.arange(len(edges)), 2)
    vertex = edges.ends.T.ravel()
    order = np.argsort(vertex, kind="stable")
    links = []
    for step in (1, 2, 3):  # more than four reflex edges at a vertex are not a crease but a rough surface
        a, b = order[:-step], order[step:]
        on = (vertex[a] == vertex[b]) & (np.einsum("ij,ij->i", outgoing[a], outgoing[b]) < -TURN)
        links.append(np.stack([edge_of[a[on]], edge_of[b[on]]]))
    rows, columns = np.concatenate(links, axis=1)
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(len(edges), len(edges)))
    crease = connected_components(graph, directed=False)[1]
    return np.asarray(np.minimum(np.bincount(crease, length)[crease], np.ptp(component.box, axis=0).max()))


def _spread_out(
    component: Component, edges: ConcaveEdges, middle: FloatArray, weight: FloatArray, count: int
) -> NDArray[np.intp]:
    """Indices of up to `count` edges with positive weight, by weight x distance x novelty."""
    planes = _coordinates(component, *_planes_of(component, edges))
    chosen: list[int] = []
    distance = np.ones(len(edges))
    novelty = np.ones((len(edges), 3))
    for _ in range(count):
        score = np.where(novelty.max(axis=1) > SAME_PLANE, weight * distance * novelty.mean(axis=1), 0)
        best = int((score >= (1 - TIE) * score.max()).argmax())
        if score[best] <= 0:
            break
        from_best = np.linalg.norm(middle - middle[best], axis=1)
        distance = from_best if not chosen else np.minimum(distance, from_best)
        from_planes = _differences(planes.reshape(-1, 4), planes[best]).min(axis=1)
        novelty = np.minimum(novelty, from_planes.reshape(-1, 3))
        chosen.append(best)
    return np.array(chosen, dtype=np.intp)


def _coordinates(component: Component, normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Coordinates [..., 4] of planes up to sign: unit normal, and height over the component's centre in radii of it."""
    centre, radius = component.box.mean(axis=0), np.linalg.norm(np.ptp(component.box, axis=0)) / 2
    return np.concatenate([normals, ((offsets - normals @ centre) / radius)[..., None]], axis=-1)


def _differences(planes: FloatArray, others: FloatArray) -> FloatArray:
    """Distance [A, B] between the coordinates [A, 4] and [B, 4] of planes, whichever way their normals point."""
    ways = [np.linalg.norm(planes[:, None] - sign * others, axis=2) for sign in (1, -1)]
    return np.asarray(np.minimum(*ways))


def _planes_of(component: Component, edges: ConcaveEdges) -> tuple[FloatArray, FloatArray]:
    """Normals [E, 3, 3] and offsets [E, 3] of the three planes of each edge: bisector, first face, second face.

    All contain the edge, and the normals of the face planes point outwards.
    """
    across = edges.normals[:, 0] - edges.normals[:, 1]  # at least 0.17 long
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    normals = _snapped(np.concatenate([across[:, None], edges.normals], axis=1))
    middle = component.vertices[edges.ends].mean(axis=1)
    return normals, np.einsum("ekj,ej->ek", normals, middle)


def _snapped(normals: FloatArray) -> FloatArray:
    nearest = np.sign(normals) * (np.abs(normals) == np.abs(normals).max(axis=-1, keepdims=True))
    aligned = np.linalg.norm(normals - nearest, axis=-1) < SAME_DIRECTION
    return np.asarray(np.where(aligned[..., None], nearest, normals) + 0.0)  # no -0.0


def _above_faces(component: Component, faces: IntArray, outward: FloatArray) -> FloatArray:
    """Offsets [N] of planes with normals [N, 3] that have the faces [N], and what is flat with them, below."""
    heights = np.einsum("vj,nj->vn", component.vertices, outward)
    face = np.take_along_axis(heights, component.faces[faces].T, axis=0).max(axis=0)
    flat = np.where(heights <= face + FLAT, heights, -np.inf).max(axis=0)
    exact = (np.abs(outward) == 1).any(axis=1)
    return np.asarray(np.where(exact, flat, flat + HAIR))
