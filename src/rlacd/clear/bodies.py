"""Rigid bodies as they were read and as hulls, as coal's shapes, and which of them come near each other."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
import trimesh

from rlacd import _native
from rlacd.errors import RlacdError, import_extra
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, IntArray, dots
from rlacd.solid.hull import Hull, limit_hull
from rlacd.solid.poses import moved
from rlacd.solid.topology import compacted

MOST_NEAR = 4_000_000
"""Pairs of boxes that come near each other along the x axis, over all samples; robots of a hundred links have fewer."""

MOST_NEIGHBOURS = 255
"""That coal takes of one corner of a polytope; the tip of a cone and the corners of a round plate can have more."""

PRIMITIVES = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "cone": 2, "ellipsoid": 3}
"""Kinds of primitives, and how many sizes each has."""


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
        self.place = np.eye(4)

    def __reduce__(self) -> Any:
        return Surface, (self.vertices, self.faces)

    @cached_property
    def used(self) -> FloatArray:
        """The corners of its triangles; without any, all points."""
        return compacted(self.vertices, self.faces)[0]

    @cached_property
    def box(self) -> FloatArray:
        """Lower and upper corner of the box around it [2, 3]."""
        return np.stack([self.used.min(axis=0), self.used.max(axis=0)])

    @cached_property
    def where(self) -> Any:
        """For coal, where its shapes are."""
        return get_coal().Transform3s(self.place[:3, :3], self.place[:3, 3])

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
        """For coal, a convex polytope; a simpler one that holds it if a corner has too many neighbours."""
        coal, hull = get_coal(), Hull(self.vertices, self.faces, 0.0)
        while np.bincount(hull.faces.ravel()).max() > MOST_NEIGHBOURS:
            hull = limit_hull(hull, HullLimits(3 * len(hull.vertices) // 4))
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend([*hull.vertices])
        triangles.extend([coal.Triangle(*face) for face in hull.faces.tolist()])
        return coal.Convex(points, triangles)

    @cached_property
    def walls(self) -> _native.Surface:
        """For winding numbers, its triangles."""
        return _native.Surface(self.vertices, self.faces, 1)

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


LARGEST_SIZE = 1e10
"""MuJoCo takes no larger number as a position."""


class Primitive(Surface):
    """A box, sphere, capsule, cylinder, cone or ellipsoid: exact as coal's shape, and just inside of its triangles.

    Its `sizes` are half the sides of a box, the radius of a sphere, the radius and half the length between the ends of
    a capsule, a cylinder or a cone along z, whose tip is above, and the radii of an ellipsoid.
    """

    def __init__(self, kind: str, sizes: Sequence[float], place: FloatArray) -> None:
        self.kind, self.sizes = kind, np.array(sizes[: PRIMITIVES[kind]], dtype=np.float64)
        hull = Hull.of(moved(place, _points_around(kind, self.sizes)))
        if hull is None:
            raise ValueError(f"a {kind} of the sizes {self.sizes.tolist()} is flat")
        super().__init__(hull.vertices, hull.faces)
        self.place = place

    @classmethod
    def read(cls, kind: str, sizes: Sequence[float], place: FloatArray) -> Primitive | None:
        """One that a file states; None for another kind, and where a size is missing or no simulator takes it."""
        own = [*sizes[: PRIMITIVES.get(kind, 0)]]
        is_whole = len(own) == PRIMITIVES.get(kind) and all(1 / LARGEST_SIZE < size < LARGEST_SIZE for size in own)
        return cls(kind, own, place) if is_whole and np.abs(place).max() < LARGEST_SIZE else None

    def __reduce__(self) -> Any:
        return Primitive, (self.kind, self.sizes, self.place)

    @property
    def outside(self) -> trimesh.Trimesh:
        """Its triangles."""
        return trimesh.Trimesh(self.vertices, self.faces, process=False)

    @cached_property
    def as_convex(self) -> Any:
        """For coal, the solid itself."""
        sizes = self.sizes * np.array(
            {"box": [2], "capsule": [1, 2], "cylinder": [1, 2], "cone": [1, 2]}.get(self.kind, [1])
        )
        return getattr(get_coal(), self.kind.capitalize())(*sizes.tolist())

    @cached_property
    def as_mesh(self) -> Any:
        """The same."""
        return self.as_convex


@cache
def _points_around_ball() -> FloatArray:
    """Corners of a polyhedron around a ball of radius 1."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    return np.asarray(ball.vertices / dots(ball.face_normals, ball.triangles[:, 0]).min())


def _points_around(kind: str, sizes: FloatArray) -> FloatArray:
    """Corners of a polyhedron around a primitive."""
    if kind == "box":
        return np.array([*product((-1.0, 1.0), repeat=3)]) * sizes
    if kind in ("sphere", "ellipsoid"):
        return _points_around_ball() * sizes
    turns = np.arange(64) * np.pi / 32
    ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1) / np.cos(np.pi / 64)
    end = sizes[0] * (_points_around_ball() if kind == "capsule" else ring)
    half = np.array([0, 0, sizes[1]])
    return np.concatenate([end - half, half[None] if kind == "cone" else end + half])


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body, its surface as it was read, its hulls, and its primitives, which stay.

    All are in its own frame, and in one unit for all bodies.
    """

    name: str
    mesh: Surface
    hulls: list[Surface] = field(default_factory=list)
    primitives: Sequence[Primitive] = ()
    is_whole: bool = True  # whether nothing else of it collides

    def with_hulls(self, hulls: Sequence[Surface]) -> Body:
        """The same body as other hulls."""
        return replace(self, hulls=[*hulls])

    @property
    def solids(self) -> list[Surface]:
        """What it was read as."""
        return [*([self.mesh] if len(self.mesh.faces) else []), *self.primitives]

    @property
    def shapes(self) -> list[Surface]:
        """What it collides as; hulls of points alone have nothing to be compared with."""
        return [*(self.hulls if len(self.mesh.faces) else []), *self.primitives]

    def holds(self, other: Body, pose: FloatArray) -> bool:
        """Whether a corner of another body, seen at a pose where the two do not touch, is within its walls."""
        if not len(self.mesh.faces):
            return False
        corners = moved(pose, other.mesh.used)
        corners = corners[((corners >= self.mesh.box[0]) & (corners <= self.mesh.box[1])).all(axis=1)]
        return bool((self.mesh.walls.winding(np.ascontiguousarray(corners), threads=1) > 1 / 2).any())

    @property
    def is_compared(self) -> bool:
        """Whether nothing of it collides but its `shapes`."""
        return self.is_whole and (not self.hulls or len(self.mesh.faces) > 0)

    @property
    def box(self) -> FloatArray:
        """Lower and upper corner of a box around all of it [2, 3]."""
        boxes = np.stack([each.box for each in (self.mesh, *self.hulls, *self.primitives) if len(each.used)])
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
