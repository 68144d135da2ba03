// What of a surface is not covered by hulls that were made for a simpler copy of it, and which hull takes it in.
//
// In:  a triangle mesh and a tree of boxes over it; convex hulls whose union nearly covers it.
// Out: for each hull the points it has to take in, so that together the hulls cover the mesh.
// How: A hull that holds the corners of a triangle holds the triangle. The hull that has to grow least takes it;
//      triangles on the border of several hulls are halved until each piece is taken by the hull that its corners would
//      choose, or nearly so.

#include <algorithm>

#include "core/parallel.hpp"
#include "core/stop.hpp"
#include "solid/against.hpp"

namespace rlacd {
namespace {

constexpr int kLevels = 5;

// One child of a node of the tree.
struct Branch {
  std::int32_t node;
  int side;
};

class Cover {
 public:
  Cover(const Mesh& solid, const Bvh& bvh, const std::vector<const ConvexBody*>& bodies, double reach, double grain)
      : solid_(solid), bvh_(bvh), bodies_(bodies), reach_(reach), grain_(grain), taken_(bodies.size()) {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const std::size_t first = planes_.size();
      for (std::size_t k = 0; k < bodies[i]->planes().size(); ++k) planes_.push_back(static_cast<std::int32_t>(k));
      near_.push_back({static_cast<std::int32_t>(i), first, planes_.size()});
    }
  }

  // Goes through one child of a node and everything below it.
  void visit(const Branch& branch) { visit(branch, {0, near_.size()}); }

  const std::vector<std::vector<Vec3>>& taken() const { return taken_; }

 private:
  // A body, and those of its planes that what is looked at may reach beyond: planes_[first, last).
  struct Near {
    std::int32_t body;
    std::size_t first, last;
  };
  struct Range {
    std::size_t first, last;  // of near_
  };

  void visit(const Branch& branch, Range above) {
    poll_stop();
    const Bvh::Node& node = bvh_.nodes()[branch.node];
    const Box& box = node.box[branch.side];
    if (box.is_empty()) return;
    const std::size_t planes_before = planes_.size(), first = near_.size();
    if (!is_held(box, above)) {
      // Where none is near, all are looked at.
      const Range near = near_.size() > first ? Range{first, near_.size()} : Range{0, bodies_.size()};
      const std::int32_t child = node.child[branch.side];
      if (child >= 0) {
        for (int side = 0; side < 2; ++side) visit({child, side}, near);
      } else {
        for (std::int32_t k = 0; k < node.leaf_size[branch.side]; ++k)
          take(corners_of(solid_, solid_.faces[bvh_.face(~child + k)]), near);
      }
    }
    near_.resize(first);
    planes_.resize(planes_before);
  }

  // Appends the bodies near a box, each with the planes that the box reaches beyond; true if a body holds it.
  bool is_held(const Box& box, Range above) {
    const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
    for (std::size_t i = above.first; i < above.last; ++i) {
      const Near candidate = near_[i];
      const ConvexBody& body = *bodies_[candidate.body];
      if (!body.box().meets(box, reach_)) continue;
      const std::size_t first = planes_.size();
      for (std::size_t k = candidate.first; k < candidate.last; ++k) {
        const std::int32_t plane = planes_[k];
        if (body.planes().depth(plane, middle) < reach_along(body.planes().normal(plane), half))
          planes_.push_back(plane);
      }
      if (planes_.size() == first) return true;
      near_.push_back({candidate.body, first, planes_.size()});
    }
    return false;
  }

  // How far a body's planes would have to move out to take in a point; 0 inside.
  double beyond(const Near& near, Vec3 p) const {
    const ConvexPlanes& planes = bodies_[near.body]->planes();
    double most = 0;
    for (std::size_t k = near.first; k < near.last; ++k) most = std::max(most, -planes.depth(planes_[k], p));
    return most;
  }

  void take(const Corners& corner, Range candidates) {
    std::size_t best = candidates.first;
    double least = kInfinity;             // growth of the hull that takes the whole triangle
    Vec3 needed = {least, least, least};  // growth for each corner, by whichever hull
    for (std::size_t i = candidates.first; i < candidates.last; ++i) {
      double most = 0;
      for (int k = 0; k < 3; ++k) {
        const double growth = beyond(near_[i], corner[k]);
        needed[k] = std::min(needed[k], growth);
        most = std::max(most, growth);
      }
      if (most < least) least = most, best = i;
      if (least <= kRounding) return;
    }
    if (least <= std::max({needed.x, needed.y, needed.z}) + grain_) {
      for (const Vec3 p : corner)
        if (beyond(near_[best], p) > 0) taken_[near_[best].body].push_back(p);
      return;
    }
    poll_stop();
    for (const Corners& half : halves(corner)) {
      const std::size_t planes_before = planes_.size(), first = near_.size();
      if (!is_held(Box::of(half), candidates))
        take(half, near_.size() > first ? Range{first, near_.size()} : candidates);
      near_.resize(first);
      planes_.resize(planes_before);
    }
  }

  const Mesh& solid_;
  const Bvh& bvh_;
  const std::vector<const ConvexBody*>& bodies_;
  const double reach_, grain_;
  // First all bodies with all their planes, then those near each node, and each half of a triangle, on the way to what
  // is looked at.
  std::vector<Near> near_;
  std::vector<std::int32_t> planes_;
  std::vector<std::vector<Vec3>> taken_;
};

// The branches of the tree at a fixed depth: the same work for any number of threads.
std::vector<Branch> branches(const Bvh& bvh) {
  std::vector<Branch> found = {{0, 0}, {0, 1}};
  for (int level = 0; level < kLevels; ++level) {
    std::vector<Branch> below;
    for (const Branch& branch : found) {
      const std::int32_t child = bvh.nodes()[branch.node].child[branch.side];
      if (child < 0) {
        below.push_back(branch);
        continue;
      }
      for (int side = 0; side < 2; ++side) below.push_back({child, side});
    }
    found = std::move(below);
  }
  return found;
}

}  // namespace

std::vector<std::vector<Vec3>> Against::uncovered(const std::vector<const ConvexBody*>& hulls, double reach,
                                                  double grain, int threads) const {
  const std::vector<Branch> work = branches(surface_.bvh());
  std::vector<std::vector<std::vector<Vec3>>> taken(work.size());
  parallel_for(work.size(), threads, [&](std::size_t i) {
    Cover cover(solid_, surface_.bvh(), hulls, reach, grain);
    cover.visit(work[i]);
    taken[i] = cover.taken();
  });
  std::vector<std::vector<Vec3>> result(hulls.size());
  for (const auto& own : taken)
    for (std::size_t i = 0; i < own.size(); ++i) result[i].insert(result[i].end(), own[i].begin(), own[i].end());
  return result;
}

}  // namespace rlacd
