"""Final hulls: with few corners, inside limits, flat where the solid can rest.

They grow to points just outside them, where repair moved the surface or a sliver was dropped.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray, dots, heights
from rlacd.solid.component import DENSE, Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import NO_SIDES, TOLERANCE, Hull, keeps, limit_hull

LARGEST = float(np.finfo(np.float64).max)
"""The largest coordinate."""

SHARE_OF_OVERHANG = 0.2
"""A simple hull grows by at most this share of what the criterion allows beyond a part."""

GROWTHS_TRIED = 3
"""If the criterion is no longer met, half the growth is tried, and so on."""


def simple_part(part: Part, criterion: Criterion, limits: HullLimits, sides: FloatArray = NO_SIDES) -> Part:
    """Get the part with a hull of few corners that still meets the criterion; the same part if there is none.

    A criterion that does not bound how far a hull may reach beyond its part leaves hulls as they are. A hull that
    exceeds the limits is left for `limit_part`. For `sides` see `limit_hull`.
    """
    if not math.isfinite(criterion.overhang):
        return part
    growth = SHARE_OF_OVERHANG * criterion.overhang
    for _ in range(GROWTHS_TRIED):
        hull = limit_hull(part.hull, limits, growth, sides)
        if hull is part.hull:
            return part
        simple = part.with_hull(hull)
        if criterion.is_met(simple):
            return simple
        growth /= 2
    return part


def limit_part(
    part: Part, limits: HullLimits, criterion: Criterion | None = None, sides: FloatArray = NO_SIDES
) -> Part:
    """Get the part with a hull inside the limits and without nearly redundant corners; the same part if unchanged.

    Without such corners a hull is up to 1e-6 larger. They stay if the part would then no longer meet a given criterion.
    For `sides` see `limit_hull`; if the limits leave no room for them, the criterion comes first.
    """
    hull = limit_hull(part.hull, limits, sides=sides)
    if hull is part.hull:
        return part
    limited = part.with_hull(hull)
    if len(sides) and criterion is not None and not criterion.is_met(limited):
        return limit_part(part, limits, criterion)
    fits = criterion is not None and keeps(part.hull, limits)
    spoilt = fits and criterion is not None and not criterion.is_met(limited) and criterion.is_met(part)
    return part if spoilt else limited


def limit_roughly(part: Part, limits: HullLimits) -> Part:
    """Get the part with a hull inside the limits, cheaply: if its hull exceeds them, a box or tetrahedron around it."""
    return part if keeps(part.hull, limits) else part.with_hull(plain_hull(part.hull.vertices, limits))


SIDE_AREA = 0.02
"""A side has at least this share of the area of the convex hull: the facets of curved surfaces have less."""


def resting_sides(solid: Component) -> FloatArray:
    """Find the sides of a solid's convex hull over which its centre of mass lies.

    Returns
    -------
    FloatArray
        Half-spaces n.x <= d around the solid: rows of unit n, and d, [P, 4]. What lies within `TOLERANCE` of a side's
        plane is in it.
    """
    hull, (_, centre, _) = solid.hull, _native.mesh_mass(solid.vertices, solid.faces)
    corners = hull.vertices[hull.faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.sqrt(dots(normals, normals))
    outwards = np.cross(edges, normals[:, None])
    below = (dots(outwards, centre - corners) <= 0).all(axis=1)  # whether the centre is in each facet's prism
    sides, seen = [], areas == 0
    for face in np.flatnonzero(below):
        if seen[face]:
            continue
        normal = normals[face] / areas[face]
        offset = dots(corners[face], normal).max()
        coplanar = (dots(corners, normal) > offset - TOLERANCE).all(axis=1)
        seen |= coplanar
        if areas[coplanar].sum() >= SIDE_AREA * areas.sum():
            sides.append([*normal, offset + TOLERANCE])
    return np.array(sides).reshape(-1, 4)


def within_reach(sides: FloatArray, hull: Hull, growth: float) -> FloatArray:
    """Those of the half-spaces that a hull could leave by growing so much."""
    reach = heights(hull.vertices, sides[:, :3]).max(axis=0)
    return np.ascontiguousarray(sides[reach > sides[:, 3] - growth])


def kept_within(part: Part, sides: FloatArray, criterion: Criterion) -> Part:
    """Get the part without what its hull, that of a simpler copy of the solid, has beyond the half-spaces.

    The part stays as it is if nothing is beyond, or if it would no longer meet the criterion.
    """
    hull = part.hull
    for side in sides:
        beyond = dots(hull.vertices, side[:3]) - side[3]
        if beyond.max() > 0:
            a, b = hull.faces.ravel(), np.roll(hull.faces, -1, axis=1).ravel()
            crossing = (beyond[a] <= 0) & (beyond[b] > 0)
            a, b = a[crossing], b[crossing]
            share = beyond[a] / (beyond[a] - beyond[b])
            on_plane = hull.vertices[a] + share[:, None] * (hull.vertices[b] - hull.vertices[a])
            hull = Hull.of(np.concatenate([hull.vertices[beyond <= 0], on_plane])) or hull
    if hull is part.hull:
        return part
    clipped = part.with_hull(hull)
    return clipped if criterion.is_met(clipped) or not criterion.is_met(part) else part


def take_in(parts: Sequence[Part], points: FloatArray, criterion: Criterion) -> list[Part]:
    """Grow the hull nearest to each point to take it in, unless the hull's part then breaks the criterion.

    Parameters
    ----------
    parts : sequence of Part
    points : float64 [N, 3]
        A hull that holds one already is skipped: its part is going to be dropped. Of more than `DENSE`, only every
        second, third, ... is looked at.
    criterion : Criterion

    Returns
    -------
    list of Part
        In the same order, some with larger hulls.
    """
    points = points[:: 1 + len(points) // DENSE]
    distance = np.array([hull_union([part.hull], 1).distance(points, 1) for part in parts])
    taker = np.where(distance > 0, distance, np.inf).argmin(axis=0)
    grown = list(parts)
    for i in np.unique(taker):
        part = parts[i]
        hull = Hull.of(np.concatenate([part.hull.vertices, points[taker == i]]))
        if hull is None:
            continue
        larger = part.with_hull(hull)
        if criterion.is_met(larger) or not criterion.is_met(part):
            grown[i] = larger
    return grown


def plain_hull(points: FloatArray, limits: HullLimits) -> Hull:
    """Get a box around points [N, 3], or a tetrahedron if a box has too many vertices or triangles."""
    hull = Hull.of(_box_around(points) if limits.allow(vertices=8, faces=12) else _tetrahedron_around(points))
    assert hull is not None
    return hull


def _box_around(points: FloatArray) -> FloatArray:
    """Corners [8, 3] of a box around the points, padded on every side by the resolution of their largest coordinate.

    One floating-point step along an axis may vanish next to a large coordinate on another axis.
    """
    step = step_of(points)
    lower = np.maximum(points.min(axis=0), step - LARGEST) - step
    upper = np.minimum(points.max(axis=0), LARGEST - step) + step
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))


def step_of(points: FloatArray) -> float:
    """The resolution of the points' largest coordinate."""
    limits = np.finfo(np.float64)
    return float(np.abs(points).max() * limits.eps + limits.smallest_subnormal)


def _tetrahedron_around(points: FloatArray) -> FloatArray:
    """Corners [4, 3] of a tetrahedron around that box: one of its corners and three on the extended edges."""
    box = _box_around(points)
    lower, upper = box[0], box[-1]
    to_lower = lower / 2 + upper / 2 > 0  # edges lead towards the origin, where coordinates do not overflow
    corner, edge = np.where(to_lower, upper, lower), np.where(to_lower, lower - upper, upper - lower)
    # 1/4 + 1/4 + 1/4 < 1: the far corner of the box stays inside in spite of rounding.
    return np.concatenate([corner[None], corner + np.diag(4 * edge)])
