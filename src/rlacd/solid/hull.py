"""Convex hulls of points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.primitive import Primitive


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polytope.

    Attributes
    ----------
    vertices : float64 [H, 3]
        Its corners, all of them extreme points.
    faces : int32 [F, 3]
        Triangles, counter-clockwise seen from outside; coplanar triangles stay apart.
    volume : float
    primitive : Primitive or None
        What it stands for: a primitive inside it, which contains everything the hull has to. `volume` is then that of
        the primitive.
    """

    vertices: FloatArray
    faces: IntArray
    volume: float
    primitive: Primitive | None = None

    @cached_property
    def box(self) -> FloatArray:
        """Lower and upper corner of the bounding box [2, 3]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def corners(self) -> _native.HullCorners:
        """The vertices, prepared for tests of joint hulls."""
        return _native.HullCorners(self.vertices)

    @classmethod
    def of(cls, *points: FloatArray) -> Hull | None:
        """Return the hull of arrays of points [N, 3]; None when they all lie in one plane."""
        found = _native.joint_hull([np.ascontiguousarray(some, dtype=np.float64) for some in points])
        return found and cls(*found)

    @classmethod
    def around(cls, *hulls: Hull) -> Hull:
        """Return the joint hull of several hulls."""
        joint = cls.of(*(hull.vertices for hull in hulls))
        assert joint is not None, "the hull of solid hulls is solid"
        return joint
