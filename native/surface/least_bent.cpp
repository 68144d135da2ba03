#include "surface/least_bent.hpp"

#include "core/elementary.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

// Weight of area against bending.
constexpr double kArea = 0.1;
// Cost of a chord that is taken: above everything else, but still better than no triangulation.
constexpr double kTaken = 1e3;

// Between unit vectors; a right angle for one that is zero.
double angle(Vec3 a, Vec3 b) {
  const double cosine = std::min(std::max(dot(a, b), -1.0), 1.0);
  return angle_of(std::sqrt(1 - cosine * cosine), cosine);
}

}  // namespace

std::vector<Triangle> least_bent(const Loop& loop) {
  const std::vector<Vec3>& points = loop.points;
  const int n = static_cast<int>(points.size());
  double longest = std::numeric_limits<double>::min();
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < i; ++k) longest = std::max(longest, norm(points[i] - points[k]));
  const double per_area = kArea / longest;

  struct Chord {
    double cost = 0;  // of the triangles behind it
    Vec3 normal;      // of the triangle right behind it
    double length = 0;
    int middle = -1;  // that triangle's third corner
  };
  std::vector<Chord> chords(static_cast<std::size_t>(n) * n);  // from i to k > i, at i n + k
  const auto chord = [&](int i, int k) -> Chord& { return chords[static_cast<std::size_t>(i) * n + k]; };
  for (int i = 0; i < n; ++i)
    for (int k = i + 1; k < n; ++k) chord(i, k).length = norm(points[i] - points[k]);
  // Triangles run with the loop, the faces beyond it against it.
  for (int i = 0; i + 1 < n; ++i) chord(i, i + 1).normal = -loop.beside[i];

  for (int span = 2; span < n; ++span) {
    poll_stop();
    for (int i = 0; i + span < n; ++i) {
      const int k = i + span;
      Chord best;
      best.cost = kInfinity;
      best.length = chord(i, k).length;
      best.middle = i + 1;  // where costs overflow
      for (int j = i + 1; j < k; ++j) {
        const Chord &before = chord(i, j), &after = chord(j, k);
        double cost = before.cost + after.cost;
        if (cost >= best.cost) continue;
        Vec3 normal = cross(points[j] - points[i], points[k] - points[i]);
        const double twice = norm(normal);
        normal = normal / std::max(twice, std::numeric_limits<double>::min());
        cost += per_area * twice;
        if (cost >= best.cost) continue;
        cost += before.length * angle(normal, before.normal);
        if (cost >= best.cost) continue;
        cost += after.length * angle(normal, after.normal);
        if (span == n - 1) cost += chord(0, n - 1).length * angle(normal, -loop.beside[n - 1]);
        if (cost < best.cost) best.cost = cost, best.normal = normal, best.middle = j;
      }
      if (!loop.taken.empty() && span < n - 1 && loop.taken[static_cast<std::size_t>(i) * n + k]) best.cost += kTaken;
      chord(i, k) = best;
    }
  }

  std::vector<Triangle> triangles;
  std::vector<std::pair<int, int>> open = {{0, n - 1}};
  while (!open.empty()) {
    const auto [i, k] = open.back();
    open.pop_back();
    if (k - i < 2) continue;
    const int j = chord(i, k).middle;
    triangles.push_back({i, j, k});
    open.push_back({i, j});
    open.push_back({j, k});
  }
  return triangles;
}

}  // namespace rlacd
