#include "navigable/hull_balls.hpp"

#include "base/stop.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kBetweenPolls = 256;

}  // namespace

std::vector<Intrusion> intrusions(const ConvexBody& hull, const std::vector<Vec3>& centres,
                                  const std::vector<double>& radii, const std::vector<std::int32_t>* candidates,
                                  double least, bool first) {
  std::vector<Intrusion> found;
  const Box& box = hull.box();
  const std::size_t count = candidates != nullptr ? candidates->size() : centres.size();
  std::int32_t separating = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i % kBetweenPolls == 0) poll_stop();
    const std::int32_t ball = candidates != nullptr ? (*candidates)[i] : static_cast<std::int32_t>(i);
    const Vec3 c = centres[ball];
    const double radius = radii[ball], enough = radius - least;
    if (!(enough > 0)) continue;
    if (c.x - enough > box.upper.x || c.x + enough < box.lower.x || c.y - enough > box.upper.y ||
        c.y + enough < box.lower.y || c.z - enough > box.upper.z || c.z + enough < box.lower.z)
      continue;
    if (-hull.planes().depth(separating, c) >= enough) continue;
    const ConvexPlanes::Nearest nearest = hull.planes().nearest(c);
    if (-nearest.depth >= enough) {
      separating = nearest.plane;
      continue;
    }
    const double distance = hull.distance(c, enough);
    if (!(distance < enough)) continue;
    found.push_back({ball, radius - distance});
    if (first) break;
  }
  return found;
}

}  // namespace rlacd
