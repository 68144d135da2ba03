#include "cut/halve.hpp"

#include <algorithm>

#include "base/stop.hpp"
#include "hull/hull.hpp"

namespace rlacd {

namespace {

double growth(const HullAround& hull, const std::vector<Vec3>& corners) {
  std::vector<Vec3> all = *hull.corners;
  all.insert(all.end(), corners.begin(), corners.end());
  HullBuilder joint;
  joint.add(all);
  return joint.volume() - hull.volume;
}

Vec3 middle(const std::vector<Vec3>& points) {
  Vec3 sum;
  for (const Vec3 p : points) sum = sum + p;
  const auto count = static_cast<double>(points.size());
  return {sum.x / count, sum.y / count, sum.z / count};
}

}  // namespace

std::array<std::optional<Piece>, 2> halve(const Mesh& piece, const std::vector<Vec3>& corners,
                                          const std::vector<HullAround>& around, double share, double least) {
  if (around.size() < 2 || corners.empty()) return {};  // what one cannot take, it cannot take in halves
  std::vector<std::pair<double, std::size_t>> by_growth;
  for (std::size_t i = 0; i < around.size(); ++i) {
    poll_stop();
    by_growth.emplace_back(growth(around[i], corners), i);
  }
  std::partial_sort(by_growth.begin(), by_growth.begin() + 2, by_growth.end());
  const Vec3 along = middle(*around[by_growth[1].second].corners) - middle(*around[by_growth[0].second].corners);
  const double length = norm(along);
  if (length == 0) return {};
  const Vec3 direction = {along.x / length, along.y / length, along.z / length};
  const auto [lowest, highest] = std::minmax_element(
      corners.begin(), corners.end(), [&](Vec3 p, Vec3 q) { return dot(p, direction) < dot(q, direction); });
  const double from = dot(*lowest, direction), to = dot(*highest, direction);
  return cut(piece, direction, from + share * (to - from), least);
}

}  // namespace rlacd
