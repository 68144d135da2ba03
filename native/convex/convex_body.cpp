#include "convex/convex_body.hpp"

#include <utility>

#include "convex/linear_program.hpp"

namespace rlacd {

ConvexBody::ConvexBody(Mesh mesh) : mesh_(std::move(mesh)), planes_(mesh_), box_(Box::of(mesh_.vertices)) {}

double ConvexBody::distance(Vec3 p, double enough) const {
  const double outside = -planes_.nearest(p).depth;
  if (outside <= 0 || outside >= enough) return outside;
  return std::sqrt(bvh().closest(p).distance2);
}

bool holds_ball(const Mesh& hull, double radius) {
  const Box box = Box::of(hull.vertices);
  const double size = max_abs(box.upper - box.lower);
  if (!(size > 0)) return false;
  Mesh unit = hull;  // the linear program's tolerances are absolute
  for (Vec3& p : unit.vertices) p = 1 / size * (p - 0.5 * (box.lower + box.upper));
  const ConvexPlanes planes(unit);
  std::vector<Above> inside;
  inside.reserve(planes.size());
  // Neighbouring facets make an order in which most constraints change the optimum; a fixed shuffle does not.
  std::uint64_t state = 1;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes.size()); ++i) {
    inside.push_back({-planes.normal(i), radius / size - planes.offset(i)});
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    std::swap(inside.back(), inside[(state >> 33) % inside.size()]);
  }
  return lowest_point({0, 0, 1}, inside, 1).has_value();
}

}  // namespace rlacd
