#include "filling.hpp"

#include "convex_planes.hpp"

namespace rlacd {
namespace {

// Points of a facet that are looked at, barycentric.
constexpr double kLookAt[7][3] = {
    {1. / 3, 1. / 3, 1. / 3}, {.5, .5, 0}, {0, .5, .5}, {.5, 0, .5}, {.6, .2, .2}, {.2, .6, .2}, {.2, .2, .6}};

constexpr double kInside = 0.5, kAccuracy = 2;

}  // namespace

Chance Filling::chance(const Mesh& hull, double threshold) const {
  const ConvexPlanes planes(hull);
  Box inner;
  for (const Vec3 p : hull.vertices) inner.extend(p);
  inner.lower = inner.lower + Vec3{threshold, threshold, threshold};
  inner.upper = inner.upper - Vec3{threshold, threshold, threshold};
  for (const Vec3 p : corners_)
    if (inner.holds(p) && planes.nearest(p).depth > threshold) return Chance::kNever;
  std::int32_t hint = -1;
  for (const Triangle& face : hull.faces) {
    const Vec3 a = hull.vertices[face[0]], b = hull.vertices[face[1]], c = hull.vertices[face[2]];
    for (const auto& [u, v, w] : kLookAt) {
      const Vec3 p = u * a + v * b + w * c;
      const Bvh::Hit hit = surface_.bvh().closest(p, hint, threshold);
      hint = hit.slot;
      if (hit.distance2 > threshold * threshold && surface_.winding().at(p, kAccuracy) < kInside) return Chance::kNone;
    }
  }
  return Chance::kSome;
}

}  // namespace rlacd
