#include "hull/convex_body.hpp"

#include <utility>

namespace rlacd {

ConvexBody::ConvexBody(Mesh mesh) : mesh_(std::move(mesh)), planes_(mesh_), box_(Box::of(mesh_.vertices)) {}

double ConvexBody::distance(Vec3 p, double enough) const {
  const double outside = -planes_.nearest(p).depth;
  if (outside <= 0 || outside >= enough) return outside;
  return std::sqrt(bvh().closest(p).distance2);
}

}  // namespace rlacd
