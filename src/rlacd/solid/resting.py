"""The flat sides on which a solid comes to rest: hulls keep their planes."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, dots, heights
from rlacd.solid.component import Component
from rlacd.solid.hull import TOLERANCE, Hull
from rlacd.solid.topology import Edges

SIDE_AREA = 0.02
"""From at least this share of the area of the convex hull, the solid rolls onto a side: the facets of curved surfaces
have less."""


def resting_sides(solid: Component) -> FloatArray:
    """Find the sides of a solid's convex hull on which it comes to rest.

    On a facet that its centre of mass is not above, it rolls on over the edge that the centre is farthest beyond.

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
    beyond = dots(np.cross(edges, normals[:, None]), centre - corners) / np.sqrt(dots(edges, edges))
    halfedges = Edges.of(hull.faces.astype(np.int64), len(hull.vertices)).halfedges
    face, across = np.arange(len(areas)), np.empty(beyond.shape, dtype=np.int64)
    np.put(across, halfedges, halfedges[::-1] // 3)
    rests_on = np.where((beyond <= 0).all(axis=1), face, across[face, beyond.argmax(axis=1)])
    for _ in range(len(face).bit_length()):  # each time, twice as far
        rests_on = rests_on[rests_on]
    share = np.bincount(rests_on, areas / areas.sum(), len(face))
    sides = []
    for side in np.flatnonzero((share >= SIDE_AREA / 2) & (areas > 0)):  # two facets if the centre is above an edge
        normal = normals[side] / areas[side]
        offset = dots(corners[side], normal).max()
        coplanar = (dots(corners, normal) > offset - TOLERANCE).all(axis=1)
        if share[coplanar].sum() >= SIDE_AREA:
            sides.append([*normal, offset + TOLERANCE])
            share[coplanar] = 0
    return np.array(sides).reshape(-1, 4)


def within_reach(sides: FloatArray, hull: Hull, growth: float) -> FloatArray:
    """Those of the half-spaces that a hull could leave by growing so much."""
    reach = heights(hull.vertices, sides[:, :3]).max(axis=0)
    return np.ascontiguousarray(sides[reach > sides[:, 3] - growth])
