#include "distance/uncovered.hpp"

#include <algorithm>
#include <array>

#include "base/parallel.hpp"
#include "base/stop.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {
namespace {

constexpr double kRounding = 1e-12;  // points this far outside a plane count as on it

using Corners = std::array<Vec3, 3>;

// The side from corner k to corner k + 1 that is longest.
int longest_side(const Corners& corner) {
  int longest = 0;
  for (int k = 1; k < 3; ++k)
    if (norm2(corner[(k + 1) % 3] - corner[k]) > norm2(corner[(longest + 1) % 3] - corner[longest])) longest = k;
  return longest;
}

std::array<Corners, 2> halves(const Corners& corner) {
  const int k = longest_side(corner);
  const Vec3 p = corner[k], q = corner[(k + 1) % 3], tip = corner[(k + 2) % 3], middle = 0.5 * (p + q);
  return {{{p, middle, tip}, {middle, q, tip}}};
}

// How far a box reaches from its middle along a plane's normal.
double reach_along(Vec3 normal, Vec3 half) {
  return std::fabs(normal.x) * half.x + std::fabs(normal.y) * half.y + std::fabs(normal.z) * half.z;
}

struct Body {
  explicit Body(const Mesh& hull) : planes(hull) {
    for (const Vec3 p : hull.vertices) box.extend(p);
  }

  // How far the planes would have to move out to take in a point; at most 0 inside.
  double beyond(Vec3 p) const { return -planes.nearest(p).depth; }
  double beyond(const Corners& corner) const {
    return std::max({beyond(corner[0]), beyond(corner[1]), beyond(corner[2])});
  }
  bool holds(const Box& other) const {
    const Vec3 middle = 0.5 * (other.lower + other.upper), half = 0.5 * (other.upper - other.lower);
    for (std::size_t i = 0; i < planes.size(); ++i) {
      const auto plane = static_cast<std::int32_t>(i);
      if (planes.depth(plane, middle) < reach_along(planes.normal(plane), half)) return false;
    }
    return true;
  }
  bool is_near(const Box& other, double reach) const {
    return box.lower.x - reach <= other.upper.x && other.lower.x <= box.upper.x + reach &&
           box.lower.y - reach <= other.upper.y && other.lower.y <= box.upper.y + reach &&
           box.lower.z - reach <= other.upper.z && other.lower.z <= box.upper.z + reach;
  }

  ConvexPlanes planes;
  Box box;
};

using Group = std::vector<std::int32_t>;

constexpr int kLevels = 5;

// One child of a node of the tree, and the bodies that may be near it.
struct Branch {
  std::int32_t node;
  int side;
  Group near;
};

class Cover {
 public:
  Cover(const Mesh& solid, const Bvh& bvh, const std::vector<Body>& bodies, const Group& all, double reach,
        double grain)
      : solid_(solid), bvh_(bvh), bodies_(bodies), all_(all), reach_(reach), grain_(grain), taken_(bodies.size()) {}

  // Goes through one child of a node and everything below it.
  void visit(const Branch& branch) {
    poll_stop();
    const Bvh::Node& node = bvh_.nodes()[branch.node];
    const Box& box = node.box[branch.side];
    if (box.is_empty()) return;
    Group near;
    for (const std::int32_t i : branch.near) {
      if (!bodies_[i].is_near(box, reach_)) continue;
      if (bodies_[i].holds(box)) return;
      near.push_back(i);
    }
    if (near.empty()) near = all_;
    const std::int32_t child = node.child[branch.side];
    if (child >= 0) {
      for (int side = 0; side < 2; ++side) visit({child, side, near});
      return;
    }
    for (std::int32_t k = 0; k < node.leaf_size[branch.side]; ++k) {
      const Triangle& face = solid_.faces[bvh_.face(~child + k)];
      take({solid_.vertices[face[0]], solid_.vertices[face[1]], solid_.vertices[face[2]]}, near);
    }
  }

  const std::vector<std::vector<Vec3>>& taken() const { return taken_; }

 private:
  void take(const Corners& corner, const Group& candidates) {
    std::int32_t best = -1;
    double least = std::numeric_limits<double>::infinity();  // growth of the hull that takes the whole triangle
    Vec3 needed = {least, least, least};                     // growth for each corner, by whichever hull
    for (const std::int32_t i : candidates) {
      double most = 0;
      for (int k = 0; k < 3; ++k) {
        const double beyond = bodies_[i].beyond(corner[k]);
        needed[k] = std::min(needed[k], beyond);
        most = std::max(most, beyond);
      }
      if (most < least) least = most, best = i;
      if (least <= kRounding) return;
    }
    if (least <= std::max({needed.x, needed.y, needed.z, 0.0}) + grain_) {
      for (const Vec3 p : corner)
        if (bodies_[best].beyond(p) > 0) taken_[best].push_back(p);
      return;
    }
    poll_stop();
    for (const Corners& half : halves(corner)) take(half, candidates);
  }

  const Mesh& solid_;
  const Bvh& bvh_;
  const std::vector<Body>& bodies_;
  const Group& all_;
  const double reach_, grain_;
  std::vector<std::vector<Vec3>> taken_;
};

// The branches of the tree at a fixed depth: the same work for any number of threads.
std::vector<Branch> branches(const Bvh& bvh, const Group& all) {
  std::vector<Branch> found = {{0, 0, all}, {0, 1, all}};
  for (int level = 0; level < kLevels; ++level) {
    std::vector<Branch> below;
    for (const Branch& branch : found) {
      const std::int32_t child = bvh.nodes()[branch.node].child[branch.side];
      if (child < 0) {
        below.push_back(branch);
        continue;
      }
      for (int side = 0; side < 2; ++side) below.push_back({child, side, all});
    }
    found = std::move(below);
  }
  return found;
}

}  // namespace

std::vector<std::vector<Vec3>> uncovered(const Mesh& mesh, const Bvh& bvh, const std::vector<Mesh>& hulls, double reach,
                                         double grain, int threads) {
  std::vector<Body> bodies;
  Group all;
  for (const Mesh& hull : hulls) {
    all.push_back(static_cast<std::int32_t>(bodies.size()));
    bodies.emplace_back(hull);
  }
  const std::vector<Branch> work = branches(bvh, all);
  std::vector<std::vector<std::vector<Vec3>>> taken(work.size());
  parallel_for(work.size(), threads, [&](std::size_t i) {
    Cover cover(mesh, bvh, bodies, all, reach, grain);
    cover.visit(work[i]);
    taken[i] = cover.taken();
  });
  std::vector<std::vector<Vec3>> result(hulls.size());
  for (const auto& own : taken)
    for (std::size_t i = 0; i < own.size(); ++i) result[i].insert(result[i].end(), own[i].begin(), own[i].end());
  return result;
}

}  // namespace rlacd
