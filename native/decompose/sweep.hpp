// Plane sweep: evaluates every candidate plane of a component without cutting it.
//
// Input:  a closed triangle mesh and, for each of K unit directions n, M ascending offsets d (planes n.x = d).
// Output: for every plane, the volumes of the convex hulls of the parts below and above it, the volumes of the solid
//         below and above, the area and perimeter of the section, and the thickness and largest extent of both sides.
// Algorithm: the planes of one direction cut the mesh into M + 1 slabs. Each slab's points are the vertices inside it
// and the points where edges cross its two planes. The hull below plane j grows from the hull below plane j - 1 by the
// points of slab j, since the hull of a union is the hull of the hulls; the hulls above grow in the other direction.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

struct PlaneScore {
  double hull_below = 0, hull_above = 0;            // volumes of the convex hulls of the two sides
  double solid_below = 0, solid_above = 0;          // volumes of the two sides
  double section_area = 0, section_perimeter = 0;   // of the solid's cross-section
  double thickness_below = 0, thickness_above = 0;  // extents of the two sides along n
  double extent_below = 0, extent_above = 0;        // largest extents of the two sides' boxes along n, u, v
};

// Scores [K * M] of K directions times M offsets (row-major), the directions spread over threads. Rows with the same
// direction are swept together.
std::vector<PlaneScore> sweep(const Mesh& mesh, const std::vector<Vec3>& directions, const std::vector<double>& offsets,
                              int threads);

}  // namespace rlacd
