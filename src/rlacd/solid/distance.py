"""Certified distances between surfaces, and between a decomposition and its input.

All lengths are in the frame of the given points (elsewhere in this package the normalised one). An interval
``(lower, upper)`` holds the true value: it comes from branch and bound over the triangles, not from samples. Rounding
is about 1e-8 of the lengths involved. Results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rlacd import _native
from rlacd.fit import RESOLVED
from rlacd.report import Point
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.hull import TOLERANCE, Hull

Interval = tuple[float, float]
"""A certified lower and upper bound."""

DISTANCE_ACCURACY = RESOLVED / 1000
"""Default width of the intervals, in the normalised frame. It costs no more than one a thousand times as wide, but near
zero, where a surface and hulls that lie on it would be cut into cells as small as that."""

PLACES = 2000
"""Number of places at which it is looked how something compares with what it stands for."""


@dataclass(frozen=True)
class HullDistances:
    """How closely hulls approximate a surface.

    Attributes
    ----------
    over
        Greatest distance from the surface of the union of the hulls to the input surface: what the hulls add. Facets,
        or parts of them, that lie inside another hull or touch one are not on that surface.
    under
        Greatest distance from the input surface to the union as a solid: what the hulls miss. Points inside a hull
        are at distance 0.
    over_at, under_at
        Points where the lower ends of these are reached; without meaning where they are 0.
    """

    over: Interval
    under: Interval
    over_at: Point = (0.0, 0.0, 0.0)
    under_at: Point = (0.0, 0.0, 0.0)


def hull_distances(
    hulls: Sequence[Hull],
    vertices: FloatArray,
    faces: IntArray,
    tolerance: float = DISTANCE_ACCURACY,
    floor: float = RESOLVED,
    threads: int | None = None,
    surface: _native.Surface | None = None,
) -> HullDistances:
    """Measure the union of convex hulls against a surface.

    Parameters
    ----------
    hulls : sequence of Hull
        Convex, closed, outward oriented; they may touch and overlap.
    vertices : float64 [N, 3]
    faces : int32 [F, 3]
        The input surface, of any quality.
    tolerance
        Width of both intervals,
    floor
        unless they end below this.
    threads
        None uses every core.
    surface
        The same surface, if it is known: made here otherwise.

    Notes
    -----
    Facets are clipped exactly against the other hulls, and the surface's triangles against all hulls; the maximum over
    the remaining pieces is found by branch and bound, with distance to a triangle or to a hull convex on each piece.
    Cracks between hulls narrower than `TOLERANCE` are closed: the two sides of a cut are not part of the union's
    surface. Without hulls, nothing is added (0) and everything is missed (infinity).
    """
    union = hull_union(hulls, threads)
    surface = surface or _native.Surface(vertices, faces)
    least_over, over, over_at = union.over(surface, tolerance, TOLERANCE, threads or 0, floor)
    least_under, under, under_at = union.under(vertices, faces, tolerance, threads or 0, floor)
    return HullDistances((least_over, over), (least_under, under), over_at, under_at)


def hull_union(hulls: Sequence[Hull], threads: int | None = None) -> _native.HullUnion:
    """Prepare the union of hulls for queries: ``distance(points)``, ``exposed()``, ``over(...)``, ``under(...)``."""
    return _native.HullUnion([hull.body for hull in hulls], threads or 0)
