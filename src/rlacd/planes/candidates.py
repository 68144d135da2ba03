"""Candidate planes: the paper's, equidistant along the coordinate axes and the component's principal axes, and those at
reflex edges, where a component has to be cut anyway and equidistant planes only come close.

A component with a reflex edge is not convex, and stays non-convex until a plane through (or close to) that edge
separates its two faces. Each edge offers the plane that bisects the reflex angle and the planes of its two faces. Of
the many edges of a mesh, a few are chosen: deep, sharp and long ones first, and spread out (Andrews,
"Navigation-Driven Approximate Convex Decomposition", SIGGRAPH 2024). Implemented in native/decompose/concave_edges.hpp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

OFFSETS_PER_AXIS = 25
"""25 planes along each of 6 axes make the paper's 150."""

EDGES_PER_COMPONENT = 4
"""Maximum number of reflex edges whose planes are tried."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """K directions with M parallel planes each.

    Attributes
    ----------
    directions : float64 [K, 3]
        Unit normals.
    offsets : float64 [K, M]
        Ascending offsets d of the planes n.x = d.
    """

    directions: FloatArray
    offsets: FloatArray

    def __len__(self) -> int:
        return self.offsets.size

    @classmethod
    def joined(cls, *blocks: Candidates) -> Candidates:
        """Concatenate the planes of several blocks, one per row; the sweep groups rows of equal direction."""
        directions = [np.repeat(block.directions, block.offsets.shape[1], axis=0) for block in blocks]
        offsets = [block.offsets.reshape(-1, 1) for block in blocks]
        return cls(np.concatenate(directions), np.concatenate(offsets))

    def plane(self, index: int) -> Plane:
        """Get plane number `index` of the K * M, numbered direction by direction."""
        k, j = divmod(index, self.offsets.shape[1])
        x, y, z = (float(c) for c in self.directions[k])
        return Plane((x, y, z), float(self.offsets[k, j]))


def reflex_edge_planes(component: Component, count: int = EDGES_PER_COMPONENT) -> Candidates:
    """Candidates of one component: three planes for each of `count` reflex edges, without near-duplicates.

    Edges are deep, sharp ones of long creases first, and spread out. The first has the greatest depth x angle x length:
    the depth of its midpoint below the hull's surface, and the length of its whole crease. For each further edge, the
    product is multiplied by its distance from the nearest chosen one and by how much its planes differ from those
    chosen. Edges that offer no new plane are never chosen.

    Each edge gives the plane that bisects the reflex angle, and the planes of its two faces. A face plane is moved
    outwards by 1e-9, so that its face and all that is coplanar with it in single precision lie below; planes normal to
    a coordinate axis stay in place, because such cuts are exact. In the plane of the face itself, rounding would decide
    the side of each corner, and the piece beyond would carry the face along as a sliver.

    Returns
    -------
    Candidates
        K <= 3 * `count` directions with one plane each, in the order of choice; K = 0 for a convex component.
    """
    return all_planes(component, 0, count)


def all_planes(component: Component, per_axis: int, edges: int) -> Candidates:
    """So many planes along each of x, y, z and the component's principal axes, and `reflex_edge_planes`.

    The planes divide the component's extent along each direction into equal slabs (the paper, 3.2).
    Principal axes within 0.001 radians of a coordinate axis are replaced by it.

    Returns
    -------
    Candidates
        Each plane with its own direction.
    """
    planes = _native.candidate_planes(component.vertices, component.faces, component.hull.body, per_axis, edges)
    return Candidates(np.ascontiguousarray(planes[:, :3]), np.ascontiguousarray(planes[:, 3:]))
