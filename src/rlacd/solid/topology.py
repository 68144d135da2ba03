"""The topology of a triangle soup: shared vertices, edges, the two sides of every face, and how sides connect.

Input: vertices float64 ``[V, 3]`` and faces int64 ``[F, 3]`` in any order and orientation. Output: index arrays only;
nothing here moves a vertex.

The central idea is the *side*. Every face has two: side ``2f`` is the front of face f (from where its corners run
counter-clockwise) and ``2f + 1`` its back. Around an edge with k faces there are k wedges of empty space, each between
the facing sides of two neighbouring faces (for k = 1, between both sides of the same face). Joining sides across wedges
gives the boundary of every region of space the faces separate: a closed surface that is oriented by construction,
whatever windings, doubled edges or missing orientability the soup has. The side component of the outside has positive
volume, those of enclosed spaces negative; a face with both sides in one component is a sheet, without inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd._native import components, face_areas, poll_stop, signed_tetrahedra
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array
from rlacd.solid.hull import TOLERANCE

Index = TypeVar("Index", bound=np.signedinteger)
NEXT = np.array([1, 2, 0])


def nondegenerate(faces: Int64Array) -> BoolArray:
    """Return ``[F]`` whether a face has three different corners."""
    a, b, c = faces.T
    result: BoolArray = (a != b) & (b != c) & (c != a)
    return result


def marked(items: NDArray[np.integer], count: int) -> BoolArray:
    """Return ``[count]`` which numbers are among the items."""
    found = np.zeros(count, dtype=bool)
    found[items] = True
    return found


def compacted(vertices: FloatArray, faces: NDArray[Index]) -> tuple[FloatArray, NDArray[Index]]:
    """The vertices that faces use, in the same order, and the faces; of a cloud of points, which has none, all."""
    used = marked(faces, len(vertices))
    if used.all() or len(faces) == 0:
        return vertices, faces
    return vertices[used], (np.cumsum(used, dtype=faces.dtype) - 1).astype(faces.dtype)[faces]


def first_of_doubled(faces: Int64Array, count: int) -> BoolArray:
    """Return ``[F]`` whether a face is the first with its three corners, in any order; ``count`` vertices exist."""
    return _native.first_of_doubled(np.ascontiguousarray(faces), count)


def point_bodies(vertices: FloatArray, faces: NDArray[np.integer]) -> Int64Array:
    """The body ``[V]`` of each vertex: faces are connected by corners they share, or that are in one place."""
    first = _native.first_in_place(vertices)
    a, b, c = first[faces].T
    return components(len(vertices), np.concatenate([a, a]), np.concatenate([b, c]))[1][first]


@dataclass(frozen=True)
class Edges:
    """The undirected edges of a face list.

    Attributes
    ----------
    of_halfedge
        ``[3F]``, the edge of halfedge ``3f + c``, which runs from corner c of face f to its next corner.
    vertices
        ``[E, 2]``, the end vertices, smaller index first.
    face_count
        ``[E]``, how many faces use the edge.
    """

    of_halfedge: Int64Array
    vertices: Int64Array
    face_count: Int64Array

    @classmethod
    def of(cls, faces: Int64Array, count: int) -> Edges:
        """Collect the edges of faces ``[F, 3]`` over ``count`` vertices."""
        return cls(*_native.edges(faces, count))

    @property
    def halfedges(self) -> Int64Array:
        """The first and the last halfedge of each edge, ``[2, E]``."""
        number = np.arange(len(self.of_halfedge))
        first, last = ends = np.empty((2, len(self.face_count)), dtype=np.int64)
        first[self.of_halfedge[::-1]], last[self.of_halfedge] = number[::-1], number
        return ends


def bodies_of(faces: Int64Array, edges: Edges) -> tuple[int, Int64Array]:
    """Group faces that share edges: the number of bodies, and ``[F]`` the body of each face."""
    face = np.repeat(np.arange(len(faces)), 3)
    first = np.empty(len(edges.face_count), dtype=np.int64)
    first[edges.of_halfedge[::-1]] = face[::-1]
    return components(len(faces), face, first[edges.of_halfedge])


def is_balanced(faces: Int64Array, edges: Edges) -> BoolArray:
    """Return ``[E]`` whether as many faces run along an edge in one direction as in the other."""
    forward = np.bincount(edges.of_halfedge, (faces < faces[:, NEXT]).ravel(), len(edges.face_count))
    return np.asarray(2 * forward == edges.face_count)


NO_AREA = TOLERANCE**2
"""Faces of less area than this are folds that rounding has closed."""


def detach_slivers(vertices: FloatArray, faces: Int64Array, is_sliver: BoolArray) -> tuple[FloatArray, Int64Array]:
    """Give slivers their own vertices if the bodies they hang on are closed without them; drop those without an area.

    A sliver stands for equally many faces of either winding: a sheet with two sides, or a pocket closed by rounding.

    Parameters
    ----------
    vertices, faces
        ``[V, 3]`` and ``[F, 3]``.
    is_sliver
        ``[F]``.

    Returns
    -------
    tuple
        The vertices, copies last, and the faces.
    """
    if is_sliver.all() or not is_sliver.any():
        return vertices, faces
    edges = Edges.of(faces, len(vertices))
    halfedge = edges.of_halfedge.reshape(-1, 3)
    rest_edges = Edges.of(faces[~is_sliver], len(vertices))
    bodies, body = bodies_of(faces[~is_sliver], rest_edges)
    uneven = ~is_balanced(faces[~is_sliver], rest_edges)
    is_open = marked(body[uneven[rest_edges.of_halfedge].reshape(-1, 3).any(axis=1)], bodies)
    beside_body = marked(halfedge[~is_sliver], len(edges.face_count))
    beside_open = marked(halfedge[~is_sliver][is_open[body]], len(edges.face_count))
    patches, patch = bodies_of(faces[is_sliver], Edges.of(faces[is_sliver], len(vertices)))
    hangs = np.bincount(patch, beside_body[halfedge[is_sliver]].any(axis=1), patches) > 0
    needed = np.bincount(patch, beside_open[halfedge[is_sliver]].any(axis=1), patches) > 0
    detached = np.flatnonzero(is_sliver)[(hangs & ~needed)[patch]]
    corners, index = np.unique(faces[detached], return_inverse=True)
    result = faces.copy()
    result[detached] = len(vertices) + index.reshape(-1, 3)
    nothing = detached[face_areas(vertices, faces[detached]) < NO_AREA]
    return np.concatenate([vertices, vertices[corners]]), np.delete(result, nothing, axis=0)


@dataclass(frozen=True)
class Sides:
    """How the sides of the faces connect around the edges.

    Attributes
    ----------
    wedges
        Pairs of halfedges ``(h, g)``, ``[W, 2]``. Going around their edge from its smaller to its larger vertex by the
        right-hand rule, g follows h with nothing in between. A boundary edge gives ``h == g``. Faces at equal angles,
        to the precision of float32 files, and all around edges of trusted faces alternate as their windings require.
    facing
        The sides that bound each wedge ``[W, 2]``, on its first and on its second halfedge.
    label
        ``[2F]``, the component of every side.
    volume
        ``[C]``, the signed volume each component encloses.
    area
        ``[C]``, the area of its sides.
    sheet
        ``[F]``, whether both sides of the face lie in one component.
    """

    wedges: Int64Array
    facing: Int64Array
    label: Int64Array
    volume: FloatArray
    area: FloatArray
    sheet: BoolArray


def _sums(group: Int64Array, values: FloatArray, number: int) -> FloatArray:
    return np.bincount(group, values, number).astype(np.float64)


def sides_of(vertices: FloatArray, faces: Int64Array, edges: Edges, trusted: BoolArray | None = None) -> Sides:
    """Join the sides of all faces across their wedges, except where ``trusted`` ``[F]`` faces meet by their angles."""
    wedges, facing = _native.wedges(vertices, faces, edges.of_halfedge, len(edges.face_count), trusted)
    number, label = components(2 * len(faces), *np.ascontiguousarray(facing.T))
    poll_stop()
    tetrahedra = signed_tetrahedra(vertices, faces)
    area = face_areas(vertices, faces)
    front, back = label[0::2], label[1::2]
    return Sides(
        wedges=wedges,
        facing=facing,
        label=label,
        volume=_sums(front, tetrahedra, number) - _sums(back, tetrahedra, number),
        area=_sums(front, area, number) + _sums(back, area, number),
        sheet=front == back,
    )
