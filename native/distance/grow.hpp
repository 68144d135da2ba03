// A convex polytope grown from a hull through a solid, until the solid's surface stops it on all sides.
//
// In:  a closed solid and a tree over it, a convex hull of a part of it, a depth t.
// Out: half-spaces n . x <= d that hold the hull. If the solid's surface comes no deeper than t into the hull, it comes
//      no deeper into their intersection.
// How: faces are taken in the order of their distance from the hull, measured along the hull's facets. A face that
//      comes deeper than t into the intersection so far adds a half-space: under its own plane if the hull reaches
//      beyond that by no more than t, so that a bar keeps its sides and ends; otherwise under the plane of the hull's
//      facet that separates it best.
#pragma once

#include <vector>

#include "distance/bvh.hpp"

namespace rlacd {

struct HalfSpace {
  Vec3 normal;  // outwards
  double offset;
};

std::vector<HalfSpace> grow(const Mesh& solid, const Bvh& bvh, const Mesh& hull, double depth);

}  // namespace rlacd
