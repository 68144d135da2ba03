// Points of a solid of which no two can lie in one hull: they bound the number of hulls from below.
//
// In:  a closed surface, the reach T, and points of the solid. No point of a hull's surface is farther than T from the
//      solid.
// Out: indices of some of the points; any two of them are *apart*: the segment between them meets the exterior, which
//      are the points farther than T from the solid that a path at such distances joins to infinity. A hull that held
//      both would hold the segment, and the path would leave it farther than T from the solid.
// How: an exterior ball (c, R) has its centre in the exterior and no surface inside; all within R - T of c is exterior.
//      Balls come from paths of straight rays, whose steps are as long as the distance to the surface allows. What is
//      not found makes the bound smaller, never wrong. The set of points is a clique in the graph of pairs that are
//      apart: packed greedily from the first, then one point is exchanged for two while that is possible.
#pragma once

#include <cstdint>
#include <vector>

#include "surface/surface.hpp"

namespace rlacd {

// The search ends when `enough` are found, or its bound of work is reached.
std::vector<std::int32_t> apart_points(const Surface& surface, const std::vector<Vec3>& points, double reach,
                                       std::size_t enough);

}  // namespace rlacd
