// The convex hull of points in the plane.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace rlacd {

// The corners of the hull as indices into the points, counter-clockwise, without those on its sides up to rounding.
// Fewer than three if all points lie on a line up to rounding.
std::vector<std::int32_t> outline(const std::vector<std::array<double, 2>>& points);

}  // namespace rlacd
