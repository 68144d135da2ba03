// Candidate planes at concave edges of a solid.
//
// Input:  a closed triangle mesh, its convex hull, and the number of edges wanted.
// Output: up to three planes for each edge, in the order of choice: the bisector of the reflex angle and the planes of
//         the edge's two faces, without near-duplicates, each by its unit normal with a positive largest coordinate.
// Algorithm: every reflex edge is weighted by its depth below the hull's surface, its angle and the length of its whole
// crease. Edges are chosen one after the other, the weight multiplied by the distance to the nearest chosen one and by
// how much the edge's planes differ from those already chosen. (J. Andrews, "Navigation-Driven Approximate Convex
// Decomposition", SIGGRAPH 2024.)
#pragma once

#include <cstddef>
#include <vector>

#include "convex/convex_body.hpp"

namespace rlacd {

// The planes of up to `count` reflex edges. A face's plane is moved out until the face, and everything coplanar with it
// in single precision, lies wholly on one side: not at all if the plane is normal to a coordinate axis (such cuts are
// exact), else by a hair. A cut exactly through the face would let rounding decide the side of each corner, and the
// part beyond would carry the face along as a film.
std::vector<Plane> concave_planes(const Mesh& mesh, const ConvexBody& hull, std::size_t count);

// The paper's candidates: along x, y, z and the principal axes of a mesh, planes that divide its hull's extent into
// equal slabs. Principal axes that hardly differ from a coordinate axis are replaced by it.
std::vector<Plane> equidistant_planes(const Mesh& mesh, const ConvexBody& hull, int per_axis);

}  // namespace rlacd
