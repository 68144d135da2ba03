#include "mesh/point_tree.hpp"

#include <numeric>

#include "base/stop.hpp"

namespace rlacd {
namespace {

constexpr std::int32_t kLeaf = 8;  // points

}  // namespace

PointTree::PointTree(std::vector<Vec3> points) : points_(std::move(points)), order_(points_.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (points_.empty()) return;
  build(0, static_cast<std::int32_t>(points_.size()));
  std::vector<Vec3> placed;
  placed.reserve(points_.size());
  for (const std::int32_t i : order_) placed.push_back(points_[i]);
  points_ = std::move(placed);
}

void PointTree::build(std::int32_t begin, std::int32_t end) {
  poll_stop();
  const std::size_t own = nodes_.size();
  Box box;
  for (std::int32_t i = begin; i < end; ++i) box.extend(points_[order_[i]]);
  nodes_.push_back({box, begin, end, 0, end - begin <= kLeaf});
  if (!nodes_[own].is_leaf) {
    const Vec3 extent = box.upper - box.lower;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const std::int32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](std::int32_t a, std::int32_t b) { return points_[a][axis] < points_[b][axis]; });
    build(begin, middle);
    build(middle, end);
  }
  nodes_[own].next = static_cast<std::int32_t>(nodes_.size());
}

void PointTree::within(Vec3 x, double radius, std::vector<std::int32_t>& found) const {
  const std::size_t first = found.size();
  const double most = radius * radius;
  for (std::size_t n = 0; n < nodes_.size();) {
    const Node& node = nodes_[n];
    if (node.box.distance2(x) > most) {
      n = node.next;
      continue;
    }
    if (node.is_leaf)
      for (std::int32_t i = node.begin; i < node.end; ++i)
        if (norm2(points_[i] - x) <= most) found.push_back(order_[i]);
    ++n;
  }
  std::sort(found.begin() + static_cast<std::ptrdiff_t>(first), found.end());
}

}  // namespace rlacd
