"""Sides on which a solid can rest: on its hulls it stands at the same height, and straight."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part
from rlacd.solid.hull import Hull

SIDE_AREA = 0.02
"""A side has at least this share of the area of the convex hull: the facets of curved surfaces have less."""

FLUSH = 1e-6
"""What lies within this of a side's plane is in it, and hulls stay within it."""


def resting_sides(solid: Component) -> FloatArray:
    """Find the sides of a solid's convex hull over which its centre of mass lies.

    Returns
    -------
    FloatArray
        Half-spaces n.x <= d around the solid: rows of unit n, and d, [P, 4].
    """
    hull, (_, centre, _) = solid.hull, _native.mesh_mass(solid.vertices, solid.faces)
    corners = hull.vertices[hull.faces]
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    outwards = np.cross(edges, normals[:, None])
    below = (np.einsum("fec,fec->fe", outwards, centre - corners) <= 0).all(axis=1)  # the centre, in each facet's prism
    sides, seen = [], areas == 0
    for face in np.flatnonzero(below):
        if seen[face]:
            continue
        normal = normals[face] / areas[face]
        offset = (corners[face] @ normal).max()
        coplanar = (corners @ normal > offset - FLUSH).all(axis=1)
        seen |= coplanar
        if areas[coplanar].sum() >= SIDE_AREA * areas.sum():
            sides.append([*normal, offset + FLUSH])
    return np.array(sides).reshape(-1, 4)


def within_reach(sides: FloatArray, hull: Hull, growth: float) -> FloatArray:
    """Those of the half-spaces that a hull could leave by growing so much."""
    reach = (hull.vertices @ sides[:, :3].T).max(axis=0)
    return np.ascontiguousarray(sides[reach > sides[:, 3] - growth])


def kept_within(part: Part, sides: FloatArray, criterion: Criterion) -> Part:
    """Get the part without what its hull, that of a simpler copy of the solid, has beyond the half-spaces.

    The part stays as it is if nothing is beyond, or if it would no longer meet the criterion.
    """
    hull = part.hull
    for *normal, offset in sides:
        beyond = hull.vertices @ normal - offset
        if beyond.max() > 0:
            a, b = (hull.faces[:, [0, 1, 2]].ravel(), hull.faces[:, [1, 2, 0]].ravel())
            crossing = (beyond[a] <= 0) & (beyond[b] > 0)
            a, b = a[crossing], b[crossing]
            share = beyond[a] / (beyond[a] - beyond[b])
            on_plane = hull.vertices[a] + share[:, None] * (hull.vertices[b] - hull.vertices[a])
            hull = Hull.of(np.concatenate([hull.vertices[beyond <= 0], on_plane])) or hull
    if hull is part.hull:
        return part
    clipped = part.with_hull(hull)
    return clipped if criterion.is_met(clipped) or not criterion.is_met(part) else part
