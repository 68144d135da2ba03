#include "navigable/navigable_field.hpp"

namespace rlacd {

double NavigableField::above_ground(Vec3 x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const HalfSpace& closed : closed_) least = std::min(least, dot(closed.normal, x) - closed.offset);
  return least;
}

NavigableField::Value NavigableField::by_surface_and_ground(Vec3 x, std::int32_t hint, double margin) const {
  const Bvh::Hit hit = surface_.closest(x, hint);
  Value value = {std::sqrt(hit.distance2), normalized(x - hit.point), hit.slot, Limit::kSurface};
  for (const HalfSpace& closed : closed_) {
    const double above = dot(closed.normal, x) - closed.offset + margin;
    if (above < value.value) value.value = above, value.uphill = closed.normal, value.by = Limit::kGround;
  }
  return value;
}

}  // namespace rlacd
