#include "hull/outline.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace rlacd {

// A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979).
std::vector<std::int32_t> outline(const std::vector<PlanePoint>& points) {
  std::vector<std::int32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return points[a] < points[b]; });
  double size = 0;
  for (const auto& p : points)
    for (int axis = 0; axis < 2; ++axis) size = std::max(size, std::abs(p[axis] - points[0][axis]));
  const double least = 1e-14 * size * size;  // twice the area of a triangle that is none
  const auto turns_left = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
    const auto &p = points[a], &q = points[b], &r = points[c];
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) > least;
  };
  std::vector<std::int32_t> corners;
  for (int side = 0; side < 2; ++side) {  // from left to right below the points, and back above them
    const std::size_t first = corners.size();
    for (const std::int32_t point : order) {
      while (corners.size() >= first + 2 && !turns_left(corners[corners.size() - 2], corners.back(), point))
        corners.pop_back();
      corners.push_back(point);
    }
    if (!corners.empty()) corners.pop_back();  // the other side begins with it
    std::reverse(order.begin(), order.end());
  }
  return corners;
}

}  // namespace rlacd
