"""Candidate planes at concave edges: where a component has to be cut anyway, equidistant planes only come near.

A component with a reflex edge is not convex, and it stays so until a plane through that edge (or nearly) separates its
two faces. Each edge offers the plane that halves the reflex angle and the planes of its two faces; of the many edges of
a mesh, few are asked: deep ones, sharp ones, long creases first, and spread out (Andrews, "Navigation-Driven
Approximate Convex Decomposition", SIGGRAPH 2024). The work is done in native/cut/concave_edges.hpp.
"""

from __future__ import annotations

from dataclasses import dataclass

from rlacd import _native
from rlacd.planes.candidates import Candidates
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component


@dataclass(frozen=True, eq=False)
class ConcaveEdges:
    """Reflex edges of a component.

    Attributes
    ----------
    ends : int32 [E, 2]
        Vertices of the component.
    faces : int32 [E, 2]
        The faces on both sides; the first one runs from the first end to the second.
    normals : float64 [E, 2, 3]
        Their outward unit normals.
    angle : float64 [E]
        By how much the dihedral angle inside the solid exceeds a straight one, in (0, pi).
    """

    ends: IntArray
    faces: IntArray
    normals: FloatArray
    angle: FloatArray

    def __len__(self) -> int:
        return len(self.ends)


def reflex_edges(component: Component) -> ConcaveEdges:
    """Find all edges whose dihedral angle exceeds 180 degrees by more than 10, folds and needles left out."""
    ends, faces, normals, angle = _native.reflex_edges(component.vertices, component.faces)
    return ConcaveEdges(ends, faces, normals.reshape(-1, 2, 3), angle)


def concave_edges(component: Component, count: int = 4) -> ConcaveEdges:
    """Choose up to `count` reflex edges of a component: deep, sharp ones of long creases first, and spread out.

    The first has the greatest depth x angle x length; depth is how far its midpoint lies below the hull's surface,
    length that of its whole crease. For each further one the product is multiplied by its distance from the nearest
    chosen one, and by how much its planes differ from those chosen; edges that offer no new plane are never chosen.

    Returns
    -------
    ConcaveEdges
        In the order of choice.
    """
    hull = component.hull
    ends, faces, normals, angle = _native.concave_edges(
        component.vertices, component.faces, hull.vertices, hull.faces, count
    )
    return ConcaveEdges(ends, faces, normals.reshape(-1, 2, 3), angle)


def concave_edge_planes(component: Component, count: int = 4) -> Candidates:
    """Candidates of one component: three planes for each of `count` concave edges, near-duplicates left out.

    Per edge, the plane that halves the reflex angle, and the planes of its two faces. A face plane is moved outwards
    until its face, and what is coplanar with it in single precision, lies wholly below: by nothing where the plane is
    normal to a coordinate axis (such cuts are exact), else by 1e-9. On the face itself, rounding would decide for
    every corner on which side it comes to lie, and the part beyond would carry the face along as a film.

    Returns
    -------
    Candidates
        K <= 3 * `count` directions with one plane each, in the order of choice; K = 0 for a convex component.
    """
    hull = component.hull
    normals, offsets = _native.concave_edge_planes(
        component.vertices, component.faces, hull.vertices, hull.faces, count
    )
    return Candidates(normals, offsets[:, None])
