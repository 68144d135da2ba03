#include "filling.hpp"

#include <algorithm>
#include <queue>

namespace rlacd {
namespace {

// Points of a facet that are looked at first, barycentric.
constexpr double kLookAt[7][3] = {
    {1. / 3, 1. / 3, 1. / 3}, {.5, .5, 0}, {0, .5, .5}, {.5, 0, .5}, {.6, .2, .2}, {.2, .6, .2}, {.2, .2, .6}};

constexpr double kInside = 0.5, kAccuracy = 2;

// Cells are looked at: so many, down to this share of the threshold.
constexpr int kMostCells = 400;
constexpr double kSmall = 0.2;

bool meet(const Box& a, const Box& b) {
  return a.lower.x <= b.upper.x && b.lower.x <= a.upper.x && a.lower.y <= b.upper.y && b.lower.y <= a.upper.y &&
         a.lower.z <= b.upper.z && b.lower.z <= a.upper.z;
}

// Whether some point of a triangle is deeper than t under all planes.
bool reaches_deeper(const ConvexPlanes& planes, Vec3 a, Vec3 b, Vec3 c, double t) {
  constexpr int kMost = 24;  // a plane adds one corner at most, and most planes none
  Vec3 polygon[kMost] = {a, b, c}, clipped[kMost];
  int count = 3;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const auto plane = static_cast<std::int32_t>(i);
    double depth[kMost];
    bool cuts = false;
    for (int k = 0; k < count; ++k) {
      depth[k] = planes.depth(plane, polygon[k]) - t;
      cuts |= depth[k] <= 0;
    }
    if (!cuts) continue;
    int kept = 0;
    for (int k = 0; k < count; ++k) {
      const int next = k + 1 < count ? k + 1 : 0;
      if (kept + 2 > kMost) return false;  // not known
      if (depth[k] > 0) clipped[kept++] = polygon[k];
      if ((depth[k] > 0) != (depth[next] > 0)) {
        const double share = depth[k] / (depth[k] - depth[next]);
        clipped[kept++] = polygon[k] + share * (polygon[next] - polygon[k]);
      }
    }
    if (kept == 0) return false;
    std::copy(clipped, clipped + kept, polygon);
    count = kept;
  }
  Vec3 middle{0, 0, 0};
  for (int k = 0; k < count; ++k) middle = middle + (1.0 / count) * polygon[k];
  return planes.nearest(middle).depth > t;
}

struct Cell {
  Vec3 corner[3];
  Vec3 middle;
  double radius;

  Cell(Vec3 a, Vec3 b, Vec3 c) : corner{a, b, c}, middle((1.0 / 3) * (a + b + c)) {
    radius = std::sqrt(std::max({norm2(a - middle), norm2(b - middle), norm2(c - middle)}));
  }
  bool operator<(const Cell& other) const { return radius < other.radius; }
};

}  // namespace

Chance Filling::chance(const Mesh& hull, double threshold) const {
  if (comes_deeper(hull, threshold)) return Chance::kNever;
  return is_missed(hull, threshold) ? Chance::kNone : Chance::kSome;
}

bool Filling::comes_deeper(const Mesh& hull, double threshold) const {
  const ConvexPlanes planes(hull);
  Box inner;
  for (const Vec3 p : hull.vertices) inner.extend(p);
  inner.lower = inner.lower + Vec3{threshold, threshold, threshold};
  inner.upper = inner.upper - Vec3{threshold, threshold, threshold};
  for (const Vec3 p : solid_.vertices)
    if (inner.holds(p) && planes.nearest(p).depth > threshold) return true;
  const std::vector<Bvh::Node>& nodes = surface_.bvh().nodes();
  std::vector<std::int32_t> open = {0};
  while (!open.empty()) {
    const Bvh::Node& node = nodes[open.back()];
    open.pop_back();
    for (int side = 0; side < 2; ++side) {
      if (!meet(node.box[side], inner)) continue;
      if (node.child[side] >= 0) {
        open.push_back(node.child[side]);
        continue;
      }
      for (std::int32_t i = 0; i < node.leaf_size[side]; ++i) {
        const Triangle& face = solid_.faces[surface_.bvh().face(~node.child[side] + i)];
        const Vec3 a = solid_.vertices[face[0]], b = solid_.vertices[face[1]], c = solid_.vertices[face[2]];
        if (reaches_deeper(planes, a, b, c, threshold)) return true;
      }
    }
  }
  return false;
}

bool Filling::is_missed(const Mesh& hull, double threshold) const {
  const auto is_outside = [&](Vec3 p) { return surface_.winding().at(p, kAccuracy) < kInside; };
  std::int32_t hint = -1;
  for (const Triangle& face : hull.faces) {
    const Vec3 a = hull.vertices[face[0]], b = hull.vertices[face[1]], c = hull.vertices[face[2]];
    for (const auto& [u, v, w] : kLookAt) {
      const Vec3 p = u * a + v * b + w * c;
      const Bvh::Hit hit = surface_.bvh().closest(p, hint, threshold);
      hint = hit.slot;
      if (hit.distance2 > threshold * threshold && is_outside(p)) return true;
    }
  }
  std::priority_queue<Cell> cells;
  for (const Triangle& face : hull.faces)
    cells.emplace(hull.vertices[face[0]], hull.vertices[face[1]], hull.vertices[face[2]]);
  for (int looked = 0; looked < kMostCells && !cells.empty(); ++looked) {
    const Cell cell = cells.top();
    cells.pop();
    if (cell.radius < kSmall * threshold) break;
    const double enough = std::max(0.0, threshold - cell.radius), within = threshold + cell.radius;
    const Bvh::Hit hit = surface_.bvh().closest(cell.middle, -1, enough, within);
    const double distance = std::sqrt(hit.distance2);  // `within` where there is nothing nearer
    if (distance > threshold && is_outside(cell.middle)) return true;
    if (distance + cell.radius <= threshold || distance >= within) continue;
    // Across the longest side: the cells stay as round as they are.
    int from = 0;
    for (int k = 1; k < 3; ++k)
      if (norm2(cell.corner[(k + 1) % 3] - cell.corner[k]) > norm2(cell.corner[(from + 1) % 3] - cell.corner[from]))
        from = k;
    const Vec3 p = cell.corner[from], q = cell.corner[(from + 1) % 3], tip = cell.corner[(from + 2) % 3];
    const Vec3 between = 0.5 * (p + q);
    cells.emplace(p, between, tip);
    cells.emplace(between, q, tip);
  }
  return false;
}

}  // namespace rlacd
