"""The faces of an input during repair, and the properties derived from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rlacd._native import components, face_areas, long_normals, poll_stop
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots
from rlacd.solid.hull import TOLERANCE
from rlacd.solid.topology import NO_AREA, Edges, Sides, is_balanced, marked, sides_of

FLAT = TOLERANCE
"""A closed body with less volume per area is flat: there is nothing to cut."""

FLAPS = 0.05
"""Greatest share of a solid's area that faces sticking out of it may have."""

MOST_UNITED = 4000
"""Most meshes united: more are composed, since uniting takes time for each even if none overlap."""

# Most sheets of a body that are thickened one by one; and average number of sheets in whose boxes a face lies above
# which a body of more than `MOST_UNITED` faces is layers, which would take minutes to unite.
MOST_PATCHES, _LAYERS = 100, 1.5
# Cosine of the angle between two faces below which a sheet is folded onto itself (20 degrees).
_FOLD = 0.94


@dataclass(frozen=True)
class Soup:
    """Faces during repair; `body` ``[F]`` is the body of each, by numbers that stay the same throughout."""

    vertices: FloatArray
    faces: Int64Array
    body: Int64Array

    @cached_property
    def edges(self) -> Edges:
        """Which faces meet at which edge."""
        return Edges.of(self.faces, len(self.vertices))

    @cached_property
    def sides(self) -> Sides:
        """The components that the sides of the faces form.

        Around an edge, faces follow each other by their angles; in closed bodies by their windings, if angles join the
        inside with the outside. Where corners were rounded, slivers fold over, and noise turns faces that nearly lie in
        one plane: then angles around an edge with four faces are wrong.
        """
        by_angles = sides_of(self.vertices, self.faces, self.edges)
        is_crowded = self.edges.face_count > 2
        if not is_crowded.any():
            return by_angles
        is_uneven = ~is_balanced(self.faces, self.edges)
        crowded, uneven = (
            marked(self.body[self.at_edges(some)], int(self.body.max()) + 1) for some in (is_crowded, is_uneven)
        )
        share = self.share(by_angles.sheet)
        doubted = crowded & ~uneven & (share > FLAPS)
        if not doubted.any():
            return by_angles
        by_windings = sides_of(self.vertices, self.faces, self.edges, doubted[self.body])
        better = doubted & (self.share(by_windings.sheet) < share / 2)
        return sides_of(self.vertices, self.faces, self.edges, better[self.body])

    @cached_property
    def area(self) -> FloatArray:
        """Areas of the faces [F]."""
        return face_areas(self.vertices, self.faces)

    def at_edges(self, marked: BoolArray) -> BoolArray:
        """Return ``[F]`` whether a face has a marked edge, given ``[E]`` marks."""
        return np.asarray(marked[self.edges.of_halfedge].reshape(-1, 3).any(axis=1))

    @cached_property
    def body_of_side(self) -> Int64Array:
        """Return ``[C]`` the body of each side component."""
        result = np.zeros(len(self.sides.volume), dtype=np.int64)
        result[self.sides.label] = np.repeat(self.body, 2)
        return result

    def share(self, faces: BoolArray, bodies: int = 0) -> FloatArray:
        """Return ``[bodies]`` the share of the area of each body that some faces ``[F]`` have."""
        whole = np.maximum(np.bincount(self.body, self.area, bodies), NO_AREA)
        return np.asarray(np.bincount(self.body, self.area * faces, bodies) / whole)

    def in_patches(self) -> Soup:
        """The same faces, split along folds and along every edge that more than two of them share.

        Sheets that meet at an edge are thickened one by one and united afterwards: if all corners of a sheet lie on
        others, or face both ways, no vertex would be left to give it thickness.
        """
        halfedge = np.argsort(self.edges.of_halfedge, kind="stable")
        halfedge = halfedge[self.edges.face_count[self.edges.of_halfedge[halfedge]] == 2].reshape(-1, 2)
        away = [across(self.vertices, self.faces, some) for some in halfedge.T]
        poll_stop()
        halfedge = halfedge[dots(*away) < _FOLD]
        count, patch = components(len(self.faces), halfedge[:, 0] // 3, halfedge[:, 1] // 3)
        poll_stop()
        patches = np.unique(self.body * count + patch) // max(count, 1)
        together = np.bincount(patches) > MOST_PATCHES
        for one in np.flatnonzero((np.bincount(self.body) > MOST_UNITED) & ~together):
            own = self.body == one
            together[one] = _layers(self.vertices[self.faces[own]], patch[own]) > _LAYERS
        patch = np.where(together[self.body], count + self.body, patch)
        count += int(self.body.max(initial=0)) + 1
        key = self.faces * count + patch[:, None]
        poll_stop()
        distinct, corner = np.unique(key, return_inverse=True)
        return Soup(self.vertices[distinct // max(count, 1)], corner.reshape(-1, 3), self.body)

    def only(self, keep: BoolArray) -> Soup:
        """The marked faces; the same soup if these are all."""
        if keep.all():
            return self
        return Soup(self.vertices, self.faces[keep], self.body[keep])


def _layers(corners: FloatArray, patch: Int64Array) -> float:
    """In how many boxes of patches a face lies on average, given its corners ``[F, 3, 3]`` and its patch ``[F]``."""
    lower, upper = boxes_of(corners, patch)
    middle = corners.mean(axis=1)
    inside = [((middle >= low) & (middle <= high)).all(axis=1).mean() for low, high in zip(lower, upper, strict=True)]
    return float(sum(inside))


def boxes_of(corners: FloatArray, patch: Int64Array) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corners ``[P, 3]`` of the boxes of patches, given the patch ``[F]`` of each face."""
    order = np.argsort(patch, kind="stable")
    first = np.flatnonzero(np.diff(patch[order], prepend=-1))
    lower = np.minimum.reduceat(corners.min(axis=1)[order], first)
    upper = np.maximum.reduceat(corners.max(axis=1)[order], first)
    return lower, upper


def across(vertices: FloatArray, faces: Int64Array, halfedges: Int64Array) -> FloatArray:
    """Return the unit direction ``[N, 3]`` in which each halfedge's face leads away from it."""
    face, corner = halfedges // 3, halfedges % 3
    a, b, c = (vertices[faces[face, (corner + i) % 3]] for i in range(3))
    poll_stop()
    along = (b - a) / np.maximum(np.linalg.norm(b - a, axis=1, keepdims=True), np.finfo(float).tiny)
    away = c - a - dots(c - a, along)[:, None] * along
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.finfo(float).tiny))


def face_normals(vertices: FloatArray, faces: Int64Array) -> FloatArray:
    """Return ``[F, 3]`` the unit normals of faces; zero for those without an area."""
    normal = long_normals(vertices, faces)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny))
