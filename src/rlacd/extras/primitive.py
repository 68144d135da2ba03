"""Boxes, spheres, capsules and cylinders: shapes that physics engines collide faster than hulls."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import trimesh

from rlacd.options.names import PrimitiveKind
from rlacd.solid.arrays import FloatArray, dots, heights
from rlacd.solid.frame import Frame

SIDES = (12, 24)
"""Sides of the prisms that stand for a cylinder."""

SUBDIVISIONS = (1, 2)
"""Of the icosahedra that stand for a ball; they have 42 and 162 vertices."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """A box, sphere, capsule or cylinder.

    Attributes
    ----------
    kind : str
        ``"box"``, ``"sphere"``, ``"capsule"`` or ``"cylinder"``.
    centre : float64 [3]
    axes : float64 [3, 3]
        A rotation; its columns are the primitive's own x, y and z. Capsules and cylinders lie along z.
    size : tuple of float
        Box: its three edge lengths. Sphere: radius. Capsule and cylinder: radius and length, for a capsule that between
        the centres of its ends.
    """

    kind: PrimitiveKind
    centre: FloatArray
    axes: FloatArray
    size: tuple[float, ...]

    @property
    def volume(self) -> float:
        """Its volume."""
        if self.kind == "box":
            return math.prod(self.size)
        radius, *length = self.size
        disc = math.pi * radius * radius
        ball = 4 / 3 * disc * radius
        return {"sphere": ball, "capsule": ball + disc * sum(length), "cylinder": disc * sum(length)}[self.kind]

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation `axes` as (w, x, y, z)."""
        w, x, y, z = trimesh.transformations.quaternion_from_matrix(self.axes).tolist()
        return w, x, y, z

    @property
    def roll_pitch_yaw(self) -> tuple[float, float, float]:
        """The rotation `axes` as angles about the fixed x, then y, then z axis."""
        roll, pitch, yaw = trimesh.transformations.euler_from_matrix(self.axes)
        return roll, pitch, yaw

    def beyond(self, points: FloatArray) -> float:
        """How far the farthest of points [N, 3] lies outside; 0 if none does, at most sqrt(3) too little."""
        own = heights(points - self.centre, np.ascontiguousarray(self.axes.T))
        if self.kind == "box":
            outside = np.abs(own) - np.array(self.size) / 2
        elif self.kind == "cylinder":
            radius, length = self.size
            outside = np.stack([np.sqrt(own[:, 0] ** 2 + own[:, 1] ** 2) - radius, np.abs(own[:, 2]) - length / 2])
        else:
            radius, length = (*self.size, 0.0)[:2]
            along = np.maximum(np.abs(own[:, 2]) - length / 2, 0.0)
            outside = np.sqrt(own[:, 0] ** 2 + own[:, 1] ** 2 + along**2) - radius
        return max(0.0, float(outside.max()))

    def grown(self, margin: float) -> Primitive:
        """The same, larger by a margin on every side."""
        size = [value + (2 * margin if self.kind == "box" else margin) for value in self.size]
        if self.kind == "cylinder":
            size[1] += margin
        elif self.kind == "capsule":
            size[1] = self.size[1]
        return Primitive(self.kind, self.centre, self.axes, tuple(size))

    def in_input(self, frame: Frame) -> Primitive:
        """Carry it from the frame to the input's unit."""
        size = tuple(value / frame.scale for value in self.size)
        return Primitive(self.kind, frame.to_input(self.centre[None])[0], self.axes, size)

    def polyhedra(self) -> Iterator[FloatArray]:
        """Corners [N, 3] of convex polyhedra that contain it and touch all of its sides: coarser ones first."""
        for corners in _polyhedra(self.kind, self.size):
            yield heights(corners, self.axes) + self.centre

    def as_plain(self) -> dict[str, Any]:
        """Plain values that ``json`` can write."""
        return {
            "kind": self.kind,
            "centre": self.centre.tolist(),
            "axes": self.axes.tolist(),
            "size": list(self.size),
        }

    @classmethod
    def of_plain(cls, plain: Mapping[str, Any]) -> Primitive:
        """The primitive that `as_plain` describes."""
        return cls(plain["kind"], np.array(plain["centre"]), np.array(plain["axes"]), tuple(plain["size"]))


def _polyhedra(kind: PrimitiveKind, size: tuple[float, ...]) -> Iterator[FloatArray]:
    """Corners about the origin."""
    if kind == "box":
        yield np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size
        return
    radius, length = (*size, 0.0)[:2]
    ends = np.array([[0.0, 0.0, -length / 2], [0.0, 0.0, length / 2]])
    if kind == "cylinder":
        for sides in SIDES:
            yield (ends[:, None] + radius * _around_unit_circle(sides)).reshape(-1, 3)
        return
    for subdivisions in SUBDIVISIONS:
        ball = radius * _around_unit_ball(subdivisions)
        yield ball if kind == "sphere" else (ends[:, None] + ball).reshape(-1, 3)


@cache
def _around_unit_circle(sides: int) -> FloatArray:
    """Corners [N, 3] of a polygon whose sides are all at least 1 from its centre."""
    angles = 2 * np.pi / sides * np.arange(sides)
    ring = np.round(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1), _DECIMALS)
    middles = (ring + np.roll(ring, 1, axis=0)) / 2
    return _at_least_one(ring, np.sqrt(dots(middles, middles)))


@cache
def _around_unit_ball(subdivisions: int) -> FloatArray:
    """Vertices [N, 3] of a polyhedron whose facets are all at least 1 from its centre."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    points = np.round(ball.vertices, _DECIMALS)
    a, b, c = points[ball.faces.T]
    normals = np.cross(b - a, c - a)
    return _at_least_one(points, dots(normals, a) / np.sqrt(dots(normals, normals)))


def _at_least_one(points: FloatArray, distances: FloatArray) -> FloatArray:
    """Corners [N, 3] scaled so that facets at these distances [F] are all at least 1 away."""
    return points / (float(distances.min()) * (1 - 1e-9))


_DECIMALS = 12
"""What libraries compute in their own ways is rounded to so many, so that it is the same bits everywhere."""
