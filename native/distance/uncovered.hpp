// What of a surface is not covered by hulls that were made for a simpler copy of it, and which hull takes it in.
//
// In:  a triangle mesh and a tree of boxes over it; convex hulls whose union nearly covers it.
// Out: for each hull the points it has to take in, so that together the hulls cover the mesh.
// How: A hull that holds the corners of a triangle holds the triangle. The hull that has to grow least takes it;
//      triangles on the border of several hulls are halved until each piece is taken by the hull that its corners would
//      choose, or nearly so.
#pragma once

#include <vector>

#include "distance/bvh.hpp"

namespace rlacd {

// Hulls grow by at most `grain` more than they must. A hull whose box is farther from a triangle than `reach` takes it
// only if all are.
std::vector<std::vector<Vec3>> uncovered(const Mesh& mesh, const Bvh& bvh, const std::vector<Mesh>& hulls, double reach,
                                         double grain, int threads);

}  // namespace rlacd
