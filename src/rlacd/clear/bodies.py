"""Rigid bodies as they were read and as hulls, as coal's shapes, and which of them come near each other."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rlacd import _native
from rlacd.errors import RlacdError, import_extra
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, IntArray, dots
from rlacd.solid.topology import used_points

MOST_NEAR = 4_000_000
"""Pairs of boxes that come near each other along the x axis, over all samples; robots of a hundred links have fewer."""


class CrowdedError(RlacdError, ValueError):
    """More bodies stand in each other than can be checked."""


def get_coal() -> Any:
    """The library coal; raises MissingExtraError."""
    return sys.modules.get("coal") or import_extra("coal", "checking that bodies stay clear of each other", "clear")


class Surface:
    """Vertices float64 [V, 3] and triangles int32 [F, 3], with the shapes that coal makes of them when first needed."""

    def __init__(self, vertices: FloatArray, faces: Int64Array | IntArray) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int32)
        self.met: dict[tuple[Surface, bytes], bool] = {}  # whether it touches others, seen at a pose

    def __reduce__(self) -> Any:
        return Surface, (self.vertices, self.faces)

    @cached_property
    def used(self) -> FloatArray:
        """The corners of its triangles; without any, all points."""
        return used_points(self.vertices, self.faces) if len(self.faces) else self.vertices

    @cached_property
    def box(self) -> FloatArray:
        """Lower and upper corner of the box around it [2, 3]."""
        return np.stack([self.used.min(axis=0), self.used.max(axis=0)])

    @cached_property
    def as_mesh(self) -> Any:
        """For coal, a surface."""
        model = get_coal().BVHModelOBBRSS()
        model.beginModel(len(self.faces), len(self.vertices))
        model.addVertices(self.vertices)
        model.addTriangles(self.faces.astype(np.int64))
        model.endModel()
        return model

    @cached_property
    def as_convex(self) -> Any:
        """For coal, a convex polytope."""
        coal = get_coal()
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend([*self.vertices])
        triangles.extend([coal.Triangle(*face) for face in self.faces.tolist()])
        return coal.Convex(points, triangles)

    @cached_property
    def corner(self) -> FloatArray:
        """The point [1, 3] farthest from its middle: hardly ever in the box of another body."""
        away = self.used - self.box.mean(axis=0)
        return self.used[[dots(away, away).argmax()]]

    @cached_property
    def _winding(self) -> _native.Surface:
        return _native.Surface(self.vertices, self.faces)

    def holds(self, point: FloatArray) -> bool:
        """Whether it holds a point [1, 3] of another surface that does not cross it, and so all of that."""
        if (point < self.box[0]).any() or (point > self.box[1]).any():
            return False
        return bool(self._winding.winding(point, accuracy=4.0, threads=1)[0] > 0.5)


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body, its surface as it was read, and its hulls; in its own frame, and in one unit for all bodies."""

    name: str
    mesh: Surface
    hulls: list[Surface] = field(default_factory=list)

    def with_hulls(self, hulls: Sequence[Surface]) -> Body:
        """The same body as other hulls."""
        return replace(self, hulls=[*hulls])

    @property
    def is_filled(self) -> bool:
        """Whether it can touch others."""
        return bool(self.hulls and len(self.mesh.faces))

    @property
    def box(self) -> FloatArray:
        """Lower and upper corner of a box around mesh and hulls [2, 3]."""
        boxes = np.stack([surface.box for surface in (self.mesh, *self.hulls) if len(surface.used)])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def may_touch(bodies: Sequence[Body]) -> bool:
    """Whether boxes of hulls of two bodies that share a frame overlap."""
    owner = np.array([i for i, body in enumerate(bodies) for _ in body.hulls])
    pairs = overlapping(np.stack([hull.box for body in bodies for hull in body.hulls])[None])[:, 1:]
    return bool((owner[pairs[:, 0]] != owner[pairs[:, 1]]).any())


def placed_boxes(boxes: FloatArray, poses: FloatArray) -> FloatArray:
    """Boxes [N, 2, 3] around boxes placed by poses [S, N, 4, 4], or all by each of [S, 1, 4, 4]: [S, N, 2, 3]."""
    middle, half = boxes.mean(axis=1), np.ptp(boxes, axis=1) / 2
    turn = poses[..., :3, :3]
    centre = (turn * middle[:, None, :]).sum(axis=-1) + poses[..., :3, 3]
    reach = (np.abs(turn) * half[:, None, :]).sum(axis=-1)
    return np.stack([centre - reach, centre + reach], axis=2)


def overlapping(boxes: FloatArray) -> Int64Array:
    """Find the pairs of boxes [S, N, 2, 3] that overlap in the same sample: rows of sample, first, second [P, 3].

    Boxes are swept along the x axis, all samples one behind the other, so the work grows with the pairs that come near
    along it.

    Raises
    ------
    CrowdedError
        More than `MOST_NEAR` do.
    """
    samples, count = boxes.shape[:2]
    span = np.ptp(boxes[..., 0]) + 1.0
    shift = span * np.arange(samples)[:, None] - boxes[..., 0].min()
    lower, upper = (boxes[..., 0, 0] + shift).ravel(), (boxes[..., 1, 0] + shift).ravel()
    order = np.argsort(lower, kind="stable")
    begin = np.arange(1, len(order) + 1)
    behind = np.maximum(np.searchsorted(lower[order], upper[order], side="right") - begin, 0)
    if behind.sum() > MOST_NEAR:
        raise CrowdedError(f"more than {MOST_NEAR:,} pairs of them stand in each other")
    ahead = np.repeat(begin - 1, behind)
    within = np.arange(behind.sum()) - np.repeat(np.cumsum(behind) - behind, behind)
    first, second = order[ahead], order[ahead + 1 + within]
    flat = boxes.reshape(-1, 2, 3)
    meets: BoolArray = (flat[first, 0] <= flat[second, 1]).all(axis=1) & (flat[second, 0] <= flat[first, 1]).all(axis=1)
    first, second = first[meets], second[meets]
    rows = np.stack([first // count, np.minimum(first, second) % count, np.maximum(first, second) % count], axis=1)
    return rows[np.lexsort(rows.T[::-1])]
