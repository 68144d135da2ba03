// Triangles between loops in the plane.
//
// Input:  loops of points, counter-clockwise around what they bound and clockwise around its holes. They may touch each
//         other; a loop that runs clockwise and lies in no other bounds an area that is upside down.
// Output: triangles that use every edge of the loops once, in its direction, and no other edge but twice, in opposite
//         directions: whatever the loops, they close a surface that ends at them. Where loops do not cross, none is
//         upside down and the triangulation is Delaunay's as far as the loops allow.
// Algorithm: a bridge joins each hole to the loop around it; ears are clipped (Eberly, "Triangulation by Ear Clipping",
//         2002); edges are flipped (Lawson, "Software for C1 Surface Interpolation", 1977).
#pragma once

#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

// The corners are places in the loops, counted from the first point of the first loop; `vertices` has a number for
// each, the same where loops touch in a vertex.
std::vector<Triangle> triangulate(const std::vector<std::vector<PlanePoint>>& loops,
                                  const std::vector<std::int32_t>& vertices);

}  // namespace rlacd
