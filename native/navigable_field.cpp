#include "navigable_field.hpp"

namespace rlacd {
namespace {

NavigableField::Value to_surface(const Bvh& surface, Vec3 x, std::int32_t hint) {
  const Bvh::Hit hit = surface.closest(x, hint);
  const double distance = std::sqrt(hit.distance2);
  return {distance, normalized(x - hit.point), hit.slot};
}

}  // namespace

void NavigableField::lower_by_ground(Vec3 x, double margin, Value& value) const {
  for (const HalfSpace& closed : closed_) {
    const double above = dot(closed.normal, x) - closed.offset + margin;
    if (above < value.value) value.value = above, value.uphill = closed.normal;
  }
}

double NavigableField::above_ground(Vec3 x) const {
  double least = std::numeric_limits<double>::infinity();
  for (const HalfSpace& closed : closed_) least = std::min(least, dot(closed.normal, x) - closed.offset);
  return least;
}

NavigableField::Value NavigableField::clearance(Vec3 x, std::int32_t hint) const {
  Value value = to_surface(surface_, x, hint);
  lower_by_ground(x, 0, value);
  return value;
}

NavigableField::Value NavigableField::room(Vec3 x, std::int32_t hint) const {
  Value value = to_surface(surface_, x, hint);
  const double most_away = value.value;  // the hull is no farther than the surface
  lower_by_ground(x, tolerance_, value);
  if (value.value <= room_by_hull(most_away)) return value;
  const double away = hull_.distance(x);
  if (away > 0 && room_by_hull(away) < value.value) {
    value.value = room_by_hull(away);
    value.uphill = normalized(hull_.closest(x) - x);
  }
  return value;
}

}  // namespace rlacd
