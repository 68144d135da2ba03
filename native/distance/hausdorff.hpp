// One-sided Hausdorff distance between surfaces, certified.
//
// In:  a mesh and a surface with its tree of boxes; both of any quality.
// Out: an interval, at most `tolerance` wide, that holds the greatest distance from a point of the mesh's faces to the
//      surface. (Wider only if more than 4 million cells did not suffice.)
// How: branch_and_bound.hpp over the mesh's triangles, many threads, the same bits for any number of them.
#pragma once

#include "distance/branch_and_bound.hpp"
#include "distance/bvh.hpp"

namespace rlacd {

Interval directed_hausdorff(const Mesh& from, const Bvh& to, double tolerance, int threads);

}  // namespace rlacd
