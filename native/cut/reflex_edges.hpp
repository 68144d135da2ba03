// Edges at which a solid is not convex.
//
// Input:  a triangle mesh, closed or nearly so.
// Output: the edges whose dihedral angle inside the solid exceeds pi, by ascending vertices.
// Algorithm: halfedges are put into one bucket per vertex (the smaller of the two) and matched there: an edge counts
// when exactly two faces use it, in opposite directions.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

struct ReflexEdge {
  std::int32_t end[2];   // vertices, ascending
  std::int32_t face[2];  // the first one runs from the first end to the second
  Vec3 normal[2];        // outward unit normals of the faces
  double angle;          // dihedral angle minus pi, in (0, pi)
};

// Folds, which rounding may turn inside out, and needle-thin faces are left out.
std::vector<ReflexEdge> reflex_edges(const Mesh& mesh);

}  // namespace rlacd
