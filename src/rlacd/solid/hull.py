"""Convex hulls of points, and simpler hulls around them: each vertex costs time in every contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rlacd import _native
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

PRIMITIVE = "primitive"
"""The key in the metadata of an output hull under which the primitive that it stands for is described."""


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
    def limited(self) -> dict[object, Hull]:
        """What `limit_hull` made of it: cutting, merging and finishing ask for the same."""
        return {}

    @cached_property
    def box(self) -> FloatArray:
        """Lower and upper corner of the bounding box [2, 3]."""
        return self.body.box

    @cached_property
    def body(self) -> _native.ConvexBody:
        """The same for kernels, which keep what they make of it."""
        return _native.ConvexBody(self.vertices, self.faces)

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


TOLERANCE = 1e-6
"""Lengths in the frame that do not count: corners that change the hull by no more are always removed, hulls that are no
farther apart touch, and one that moves no farther on its way to the input's unit is not measured again."""

SLIVER_RADIUS = 0.01
"""A hull is a sliver if the radius of its inscribed ball is below this share of its largest extent."""

_NO_LIMIT = np.iinfo(np.int32).max

NO_SIDES = np.empty((0, 4))


NO_LIMITS = HullLimits()


def keeps(hull: Hull, limits: HullLimits) -> bool:
    """Tell whether a hull has no more vertices and triangles than the limits allow."""
    return limits.allow(len(hull.vertices), len(hull.faces))


def is_sliver(hull: Hull, radius: float = SLIVER_RADIUS) -> bool:
    """Whether the radius of the hull's inscribed ball is less than `radius` times its largest extent."""
    least = radius * float(np.ptp(hull.vertices, axis=0).max())
    # A convex body's inradius lies between volume / area and three times that.
    ratio = hull.volume / _native.mesh_area(hull.vertices, hull.faces)
    return ratio <= least and (3 * ratio < least or not _native.holds_ball(hull.vertices, hull.faces, least))


def limit_hull(
    hull: Hull,
    limits: HullLimits = NO_LIMITS,
    tolerance: float = TOLERANCE,
    sides: FloatArray = NO_SIDES,
    enough: float = math.inf,
) -> Hull:
    """Enclose a hull in one with at most the given numbers of corners and triangles, adding little volume.

    Parameters
    ----------
    hull : Hull
        Convex, closed, oriented outwards.
    limits : HullLimits, optional
    tolerance : float
        Removing nearly redundant corners and facets, which is always done, moves no point of the result farther than
        this from the hull.
    sides : FloatArray
        Half-spaces n.x <= d that hold the hull, rows of unit n and d [P, 4]. The result stays in them, unless the
        limits leave no such hull.
    enough : float
        Without sides, a hull over the limits whose limited one would stick out farther than this gets one that sticks
        out little instead.

    Returns
    -------
    Hull
        Convex; contains the given hull (up to rounding, about 1e-12). The given hull itself if nothing changed.

    Notes
    -----
    Edges are collapsed outwards, cheapest first, each by solving a linear program (progressive hulls: Sander et al.,
    "Silhouette Clipping", SIGGRAPH 2000). Then the remaining corners are moved one at a time to minimise the volume
    while the hull stays convex and contains the given one. If it sticks out too far, all corners are moved at once to
    stick out about equally (``native/convex/even_out.hpp``).
    """
    asked = limits, tolerance, enough, sides.tobytes()
    if asked not in hull.limited:
        most, most_faces = (min(limit or _NO_LIMIT, _NO_LIMIT) for limit in limits)
        vertices, faces = _native.simplify_hull(hull.body, most, most_faces, tolerance, sides, enough)
        is_same = len(vertices) == len(hull.vertices) and (vertices == hull.vertices).all()
        hull.limited[asked] = hull if is_same else Hull(vertices, faces, _native.mesh_volume(vertices, faces))
    return hull.limited[asked]
