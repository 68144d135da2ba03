// What of a surface is not covered by hulls that were made for a simpler copy of it, and which hull takes it in.
//
// In:  a triangle mesh and a tree of boxes over it; convex hulls whose union nearly covers it.
// Out: for each hull the points it has to take in, so that together the hulls cover the mesh.
// How: A hull that holds the corners of a triangle holds the triangle. The hull that has to grow least takes it;
//      triangles on the border of several hulls are halved until each piece is taken by the hull that its corners would
//      choose, or nearly so.

#include <algorithm>

#include "base/parallel.hpp"
#include "base/stop.hpp"
#include "distance/filling.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {
namespace {

constexpr double kRounding = 1e-12;  // points this far outside a plane count as on it
constexpr std::size_t kChunk = 256;  // leaves

struct Body {
  explicit Body(const Mesh& hull) : planes(hull), box(Box::of(hull.vertices)) {}

  // How far the planes would have to move out to take in a point; 0 inside.
  double beyond(Vec3 p) const { return std::max(-planes.nearest(p).depth, 0.0); }
  bool holds(const Box& own) const {
    const Vec3 middle = 0.5 * (own.lower + own.upper), half = 0.5 * (own.upper - own.lower);
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(planes.size()); ++k)
      if (planes.depth(k, middle) < reach_along(planes.normal(k), half)) return false;
    return true;
  }

  ConvexPlanes planes;
  Box box;
};

// Some points that a body has to take in.
struct Taken {
  std::size_t body;
  Vec3 point;
};

void take(const Corners& corner, const std::vector<Body>& bodies, const std::vector<std::size_t>& near, double grain,
          std::vector<Taken>& taken) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();  // growth of the hull that takes the whole triangle
  Vec3 needed = {least, least, least};                     // growth for each corner, by whichever hull
  for (const std::size_t body : near) {
    double most = 0;
    for (int k = 0; k < 3; ++k) {
      const double growth = bodies[body].beyond(corner[k]);
      needed[k] = std::min(needed[k], growth);
      most = std::max(most, growth);
    }
    if (most < least) least = most, best = body;
    if (least <= kRounding) return;
  }
  if (least <= std::max({needed.x, needed.y, needed.z}) + grain) {
    for (const Vec3 p : corner)
      if (bodies[best].beyond(p) > 0) taken.push_back({best, p});
    return;
  }
  poll_stop();
  const int k = longest_side(corner);
  const Vec3 p = corner[k], q = corner[(k + 1) % 3], tip = corner[(k + 2) % 3], middle = 0.5 * (p + q);
  take({p, middle, tip}, bodies, near, grain, taken);
  take({middle, q, tip}, bodies, near, grain, taken);
}

}  // namespace

std::vector<std::vector<Vec3>> uncovered(const Mesh& mesh, const Bvh& bvh, const std::vector<Mesh>& hulls, double reach,
                                         double grain, int threads) {
  struct Leaf {
    Box box;
    std::int32_t slot, size;
  };
  std::vector<Leaf> leaves;
  for (const Bvh::Node& node : bvh.nodes())
    for (int side = 0; side < 2; ++side)
      if (node.leaf_size[side] > 0) leaves.push_back({node.box[side], ~node.child[side], node.leaf_size[side]});
  std::sort(leaves.begin(), leaves.end(), [](const Leaf& a, const Leaf& b) { return a.slot < b.slot; });
  std::vector<Body> bodies;
  std::vector<std::size_t> all;
  for (const Mesh& hull : hulls) all.push_back(bodies.size()), bodies.emplace_back(hull);
  std::vector<std::vector<Taken>> taken((leaves.size() + kChunk - 1) / kChunk);
  parallel_for(taken.size(), threads, [&](std::size_t chunk) {
    for (std::size_t i = chunk * kChunk; i < std::min(leaves.size(), (chunk + 1) * kChunk); ++i) {
      const Leaf& leaf = leaves[i];
      std::vector<std::size_t> near;
      for (const std::size_t body : all)
        if (bodies[body].box.meets(leaf.box, reach)) near.push_back(body);
      if (std::any_of(near.begin(), near.end(), [&](std::size_t body) { return bodies[body].holds(leaf.box); }))
        continue;
      for (std::int32_t slot = leaf.slot; slot < leaf.slot + leaf.size;
           ++slot)  // where none is near, all are looked at
        take(corners_of(mesh, mesh.faces[bvh.face(slot)]), bodies, near.empty() ? all : near, grain, taken[chunk]);
    }
  });
  std::vector<std::vector<Vec3>> result(hulls.size());
  for (const std::vector<Taken>& some : taken)
    for (const auto& [body, point] : some) result[body].push_back(point);
  return result;
}

}  // namespace rlacd
