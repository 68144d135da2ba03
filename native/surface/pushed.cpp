#include "surface/pushed.hpp"

#include <utility>

#include "core/parallel.hpp"

namespace rlacd {

Pushed pushed(const Bvh& surface, std::vector<Vec3> points, const std::vector<Vec3>& against,
              const std::vector<double>& steps, int times, double least, int threads) {
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
      if (distance < least) return;
      at = at + (steps[i] / (distance > 0 ? distance : 1)) * (away - 2 * dot(away, against[i]) * against[i]);
    }
  };
  parallel_for(result.ends.size(), threads, push, kSlower);
  return result;
}

std::vector<double> held_balls(const Bvh& surface, const std::vector<Vec3>& points, const std::vector<Vec3>& normals,
                               double least, double most, int threads) {
  constexpr int kShrinks = 32;        // in the holes of a thin plate it halves each time
  constexpr double kTouches = 0.999;  // of the radius
  std::vector<double> radii(points.size());
  const auto shrink = [&](std::size_t i) {
    std::int32_t near = -1;
    double radius = most;
    for (int k = 0; k < kShrinks; ++k) {
      const Bvh::Hit hit = surface.closest(points[i] + radius * normals[i], near, 0, kTouches * radius);
      const Vec3 chord = hit.point - points[i];
      const double rise = dot(chord, normals[i]), smaller = norm2(chord) / (2 * rise);
      // A wall that goes on at less of an angle stops it, so that the sides of a round hole do not count as creases.
      if (hit.slot < 0 || !(rise > 0) || norm2(chord) < smaller * smaller) return;
      radii[i] = smaller < least ? 0 : smaller;
      if (smaller < least) return;
      near = hit.slot, radius = smaller;
    }
  };
  parallel_for(points.size(), threads, shrink, kSlower);
  return radii;
}

}  // namespace rlacd
