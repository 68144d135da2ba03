"""The topology of a triangle soup: shared vertices, edges, the two sides of every face, and how sides connect.

Input: vertices float64 ``[V, 3]`` and faces int64 ``[F, 3]`` in any order and orientation. Output: index arrays only;
nothing here moves a vertex.

The central idea is the *side*. Every face has two: side ``2f`` is the front of face f (from where its corners run
counter-clockwise) and ``2f + 1`` its back. Around an edge with k faces there are k wedges of empty space, each between
the facing sides of two neighbouring faces (for k = 1, between both sides of the same face). Joining sides across wedges
gives the boundary of every region of space the faces separate: a closed surface that is oriented by construction,
whatever windings, doubled edges or missing orientability the soup has. The side component of the outside has positive
volume, those of enclosed rooms negative; a face with both sides in one component is a sheet, without inside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd._native import poll_stop
from rlacd.solid.frame import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Faces closer in angle than this (radians) coincide to the precision of float32 files.
_SAME_ANGLE = 1e-4

_NEXT = np.array([1, 2, 0])


def nondegenerate(faces: IntArray) -> BoolArray:
    """Return ``[F]`` whether a face has three different corners."""
    a, b, c = faces.T
    result: BoolArray = (a != b) & (b != c) & (c != a)
    return result


def first_of_doubled(faces: IntArray, count: int) -> BoolArray:
    """Return ``[F]`` whether a face is the first with its three corners, in any order; ``count`` vertices exist."""
    ordered = np.sort(faces, axis=1).astype(np.uint64)
    if count < 2**21:
        key = (ordered[:, 0] << np.uint64(42)) | (ordered[:, 1] << np.uint64(21)) | ordered[:, 2]
        _, first = np.unique(key, return_index=True)
    else:
        order = np.lexsort(ordered.T[::-1])
        rows = ordered[order]
        new = np.ones(len(rows), dtype=bool)
        new[1:] = (rows[1:] != rows[:-1]).any(axis=1)
        first = order[new]  # lexsort is stable: the first of a run is the first in the file
    keep = np.zeros(len(faces), dtype=bool)
    keep[first] = True
    return keep


def components(count: int, a: IntArray, b: IntArray) -> tuple[int, IntArray]:
    """Connected components of ``count`` nodes under the links ``a[i] - b[i]``: their number, and a label per node.

    Labels are numbered by the first node of each component.
    """
    return _native.components(count, a, b)


@dataclass(frozen=True)
class Edges:
    """The undirected edges of a face list.

    Attributes
    ----------
    of_halfedge
        ``[3F]``, the edge of halfedge ``3f + c``, which runs from corner c of face f to its next corner.
    vertices
        ``[E, 2]``, the end vertices, smaller index first.
    valence
        ``[E]``, how many faces use the edge.
    """

    of_halfedge: IntArray
    vertices: IntArray
    valence: IntArray

    @classmethod
    def of(cls, faces: IntArray, count: int) -> Edges:
        """Collect the edges of faces ``[F, 3]`` over ``count`` vertices."""
        return cls(*_native.edges(faces, count))


def bodies_of(faces: IntArray, edges: Edges) -> tuple[int, IntArray]:
    """Group faces that share edges: the number of bodies, and ``[F]`` the body of each face."""
    face = np.repeat(np.arange(len(faces)), 3)
    first = np.empty(len(edges.valence), dtype=np.int64)
    first[edges.of_halfedge[::-1]] = face[::-1]
    return components(len(faces), face, first[edges.of_halfedge])


def is_balanced(faces: IntArray, edges: Edges) -> BoolArray:
    """Return ``[E]`` whether as many faces run along an edge in one direction as in the other."""
    forward = np.bincount(edges.of_halfedge, (faces < faces[:, _NEXT]).ravel(), len(edges.valence))
    return np.asarray(2 * forward == edges.valence)


NO_FILM = 1e-12
"""Films of less area than this are folds that rounding has closed."""


def detach_films(vertices: FloatArray, faces: IntArray, is_film: BoolArray) -> tuple[FloatArray, IntArray]:
    """Give films vertices of their own if the bodies they hang on are closed without them; drop those without an area.

    A film stands for as many faces wound one way as the other: a sheet with two sides, or a pocket closed by rounding.

    Parameters
    ----------
    vertices, faces
        ``[V, 3]`` and ``[F, 3]``.
    is_film
        ``[F]``.

    Returns
    -------
    tuple
        The vertices, copies last, and the faces.
    """
    if is_film.all() or not is_film.any():
        return vertices, faces
    edges = Edges.of(faces, len(vertices))
    halfedge = edges.of_halfedge.reshape(-1, 3)
    rest_edges = Edges.of(faces[~is_film], len(vertices))
    bodies, body = bodies_of(faces[~is_film], rest_edges)
    is_open = np.zeros(bodies, dtype=bool)
    uneven = ~is_balanced(faces[~is_film], rest_edges)
    is_open[body[uneven[rest_edges.of_halfedge].reshape(-1, 3).any(axis=1)]] = True
    beside_body, beside_open = np.zeros((2, len(edges.valence)), dtype=bool)
    beside_body[halfedge[~is_film]] = True
    beside_open[halfedge[~is_film][is_open[body]]] = True
    patches, patch = bodies_of(faces[is_film], Edges.of(faces[is_film], len(vertices)))
    hangs = np.bincount(patch, beside_body[halfedge[is_film]].any(axis=1), patches) > 0
    needed = np.bincount(patch, beside_open[halfedge[is_film]].any(axis=1), patches) > 0
    detached = np.flatnonzero(is_film)[(hangs & ~needed)[patch]]
    corners, index = np.unique(faces[detached], return_inverse=True)
    result = faces.copy()
    result[detached] = len(vertices) + index.reshape(-1, 3)
    a, b, c = vertices[faces[detached]].transpose(1, 0, 2)
    nothing = detached[np.linalg.norm(np.cross(b - a, c - a), axis=1) < 2 * NO_FILM]
    return np.concatenate([vertices, vertices[corners]]), np.delete(result, nothing, axis=0)


@dataclass(frozen=True)
class Sides:
    """How the sides of the faces connect around the edges.

    Attributes
    ----------
    wedges
        ``[W, 2]`` pairs of halfedges ``(h, g)``: going around their edge from its smaller to its larger vertex by the
        right-hand rule, g follows h with nothing in between. A boundary edge gives ``h == g``.
    label
        ``[2F]``, the component of every side.
    volume
        ``[C]``, the signed volume each component encloses.
    area
        ``[C]``, the area of its sides.
    sheet
        ``[F]``, whether both sides of the face lie in one component.
    """

    wedges: IntArray
    label: IntArray
    volume: FloatArray
    area: FloatArray
    sheet: BoolArray


def _angles_around(vertices: FloatArray, faces: IntArray, ends: IntArray, halfedges: IntArray) -> FloatArray:
    """Angle of the faces of halfedges around their edges ``ends`` ``[N, 2]``, from a direction fixed per edge."""
    tail = vertices[ends[:, 0]]
    axis = vertices[ends[:, 1]] - tail
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    poll_stop()
    apex = vertices[_apex(faces, halfedges)]
    across = apex - tail
    # Any direction not parallel to the axis can serve as zero, as long as all faces of the edge share it.
    helper = np.eye(3)[np.abs(axis).argmin(axis=1)]
    zero = np.cross(axis, helper)
    zero /= np.maximum(np.linalg.norm(zero, axis=1, keepdims=True), np.finfo(float).tiny)
    poll_stop()
    quarter = np.cross(axis, zero)
    angle: FloatArray = np.arctan2((across * quarter).sum(axis=1), (across * zero).sum(axis=1))
    return angle


def _apex(faces: IntArray, halfedges: IntArray) -> IntArray:
    corners: IntArray = faces[halfedges // 3, (halfedges % 3 + 2) % 3]
    return corners


def wedges_of(vertices: FloatArray, faces: IntArray, edges: Edges, trusted: BoolArray | None = None) -> IntArray:
    """Return the wedges ``[3F, 2]`` around all edges (see `Sides`).

    Around an edge with ``trusted`` ``[F]`` faces only, wedges alternate as the windings require, whatever the angles.
    """
    poll_stop()
    angle = np.zeros(3 * len(faces))
    crowded = np.flatnonzero(edges.valence[edges.of_halfedge] > 2)  # the order of one or two faces needs no angle
    if len(crowded):
        ends = edges.vertices[edges.of_halfedge[crowded]]
        angle[crowded] = _angles_around(vertices, faces, ends, crowded)
        poll_stop()
        order = np.lexsort((angle, edges.of_halfedge))
        doubted = np.ones(len(edges.valence), dtype=bool)
        if trusted is not None:
            doubted[:] = False
            doubted[edges.of_halfedge[np.repeat(~trusted, 3)]] = True
        _order_ties(order, angle, edges, (faces < faces[:, _NEXT]).ravel(), ~doubted)
    else:
        order = np.argsort(edges.of_halfedge, kind="stable")
    start = np.concatenate([[0], np.cumsum(edges.valence)])
    poll_stop()
    follower = np.arange(1, len(order) + 1)
    follower[start[1:] - 1] = start[:-1]  # the last face around an edge is followed by the first
    return np.stack([order, order[follower]], axis=1)


def _order_ties(order: IntArray, angle: FloatArray, edges: Edges, forward: BoolArray, trusted: BoolArray) -> None:
    """Put coincident faces around an edge into the order their windings require, in place.

    Their angles cannot tell which comes first, and a wrong guess would join the inside with the outside. If windings
    are consistent, both sides of a wedge are fronts or both are backs. Around ``trusted`` ``[E]`` edges all angles
    count as equal.
    """
    start = np.concatenate([[0], np.cumsum(edges.valence)])
    poll_stop()
    sorted_angle = angle[order]
    gap = np.empty(len(order))
    gap[:-1] = np.diff(sorted_angle)
    gap[start[1:] - 1] = sorted_angle[start[:-1]] + 2 * np.pi - sorted_angle[start[1:] - 1]
    tied = np.zeros(len(edges.valence), dtype=bool)
    gap[trusted[edges.of_halfedge[order]]] = 0
    tied[edges.of_halfedge[order[gap < _SAME_ANGLE]]] = True
    for edge in np.flatnonzero(tied & (edges.valence > 2)):
        poll_stop()
        here = slice(start[edge], start[edge + 1])
        ring, gaps = order[here], gap[here]
        alone = (gaps >= _SAME_ANGLE) & (np.roll(gaps, 1) >= _SAME_ANGLE)
        # Begin with a face whose position is certain, else after the widest wedge: no tie crosses it.
        turn = int(alone.argmax()) if alone.any() else int(gaps.argmax()) + 1
        ring, gaps = np.roll(ring, -turn), np.roll(gaps, -turn)
        result: list[int] = []
        for group in np.split(ring, np.flatnonzero(gaps[:-1] >= _SAME_ANGLE) + 1):
            left = group.tolist()
            while left:
                # The wedge after a face shows its front if it runs forward; the next face shows its front to the same
                # wedge if it runs backward. With nothing to go by, fronts face out.
                wanted = not forward[result[-1]] if result else False
                result.append(left.pop(next((i for i, h in enumerate(left) if forward[h] == wanted), 0)))
        order[here] = result


def facing_sides(faces: IntArray, wedges: IntArray) -> tuple[IntArray, IntArray]:
    """Return the sides ``[W]`` that bound each wedge, on its first and on its second halfedge."""
    forward = (faces < faces[:, _NEXT]).ravel()
    poll_stop()
    first, second = wedges.T
    # Seen along the edge, a face that runs with it shows its front to what follows counter-clockwise.
    return 2 * (first // 3) + ~forward[first], 2 * (second // 3) + forward[second]


def signed_tetrahedra(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return ``[F]`` the signed volume between the origin and each face."""
    return _native.signed_tetrahedra(vertices, faces)


def face_areas(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return ``[F]`` the area of each face."""
    return _native.face_areas(vertices, faces)


def _sums(group: IntArray, values: FloatArray, number: int) -> FloatArray:
    return np.bincount(group, values, number).astype(np.float64)


def sides_of(vertices: FloatArray, faces: IntArray, edges: Edges, trusted: BoolArray | None = None) -> Sides:
    """Join the sides of all faces across their wedges; see `wedges_of`."""
    wedges = wedges_of(vertices, faces, edges, trusted)
    poll_stop()
    first, second = facing_sides(faces, wedges)
    number, label = components(2 * len(faces), first, second)
    poll_stop()
    tetrahedra = signed_tetrahedra(vertices, faces)
    area = face_areas(vertices, faces)
    front, back = label[0::2], label[1::2]
    return Sides(
        wedges=wedges,
        label=label,
        volume=_sums(front, tetrahedra, number) - _sums(back, tetrahedra, number),
        area=_sums(front, area, number) + _sums(back, area, number),
        sheet=front == back,
    )
