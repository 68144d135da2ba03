// The convex hull of points in the plane.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.hpp"

namespace rlacd {

// The corners of the hull as indices into the points, counter-clockwise, without those on its sides up to rounding.
// Fewer than three if all points lie on a line up to rounding.
std::vector<std::int32_t> outline(const std::vector<PlanePoint>& points);

}  // namespace rlacd
