#include "surface/pushed.hpp"

#include <utility>

#include "core/parallel.hpp"

namespace rlacd {

Pushed pushed(const Bvh& surface, std::vector<Vec3> points, const std::vector<Vec3>& against,
              const std::vector<double>& steps, int times, int threads) {
  Pushed result{points, std::vector<double>(points.size(), 0.0), std::move(points)};
  const auto push = [&](std::size_t i) {
    std::int32_t near = -1;
    Vec3& at = result.ends[i];
    for (int step = 0; step < times; ++step) {
      const Bvh::Hit hit = surface.closest_near(at, near);
      near = hit.slot;
      const Vec3 away = at - hit.point;
      const double distance = norm(away);
      if (distance > result.radii[i]) result.radii[i] = distance, result.best[i] = at;
      at = at + (steps[i] / (distance > 0 ? distance : 1)) * (away - 2 * dot(away, against[i]) * against[i]);
    }
  };
  parallel_for(result.ends.size(), threads, push, 8);
  return result;
}

}  // namespace rlacd
