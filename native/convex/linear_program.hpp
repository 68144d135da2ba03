// The lowest point above a few planes: linear programs in at most three variables.
//
// In:  an objective c and constraints n_i . x >= h_i, few of them, |n_i| about 1; a box [-reach, reach]^3.
// Out: the point of the box that minimises c . x, or none if no point satisfies all constraints.
// How: Seidel, "Small-Dimensional Linear Programming and Convex Hulls Made Easy" (1991), in the given order. If the
//      current optimum violates a constraint, the new optimum lies on its plane: a problem with one variable less.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "core/geometry.hpp"
#include "core/invariant.hpp"

namespace rlacd {

using Above = Plane;  // what lies above it: normal . x >= offset

namespace linear_program {

constexpr double kViolated = 1e-11;

struct Above2 {
  double x, y, offset;
};

// On a line start + t along, |t| <= reach; constraints [0, count).
inline std::optional<PlanePoint> on_line(PlanePoint start, PlanePoint along, double slope, const Above2* constraints,
                                         std::size_t count, double reach) {
  double low = -reach, high = reach;
  for (std::size_t i = 0; i < count; ++i) {
    const Above2& c = constraints[i];
    const double rate = c.x * along[0] + c.y * along[1], missing = c.offset - (c.x * start[0] + c.y * start[1]);
    if (rate > kRounding)
      low = std::max(low, missing / rate);
    else if (rate < -kRounding)
      high = std::min(high, missing / rate);
    else if (missing > kViolated)
      return std::nullopt;
  }
  if (low > high + kViolated) return std::nullopt;
  const double t = slope >= 0 ? low : high;
  return PlanePoint{start[0] + t * along[0], start[1] + t * along[1]};
}

inline std::optional<PlanePoint> lowest2(PlanePoint objective, const std::vector<Above2>& constraints, double reach) {
  PlanePoint best = {objective[0] > 0 ? -reach : reach, objective[1] > 0 ? -reach : reach};
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const Above2& c = constraints[i];
    if (c.x * best[0] + c.y * best[1] >= c.offset - kViolated) continue;
    const double length2 = c.x * c.x + c.y * c.y;
    if (!(length2 > kRounding * kRounding)) return std::nullopt;
    const double length = std::sqrt(length2);
    const PlanePoint start = {c.offset * c.x / length2, c.offset * c.y / length2},
                     along = {-c.y / length, c.x / length};
    const double slope = objective[0] * along[0] + objective[1] * along[1];
    const std::optional<PlanePoint> found = on_line(start, along, slope, constraints.data(), i, 2 * reach);
    if (!found) return std::nullopt;
    best = *found;
  }
  return best;
}

}  // namespace linear_program

inline std::optional<Vec3> lowest_point(Vec3 objective, const std::vector<Above>& constraints, double reach) {
  using namespace linear_program;
  Vec3 best = {objective.x > 0 ? -reach : reach, objective.y > 0 ? -reach : reach, objective.z > 0 ? -reach : reach};
  std::vector<Above2> flat;
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const Vec3 n = constraints[i].normal;
    if (dot(n, best) >= constraints[i].offset - kViolated) continue;
    RLACD_ASSERT(norm2(n) > 0.5 && norm2(n) < 2);  // a face without a plane would be a constraint that always holds
    const Vec3 origin = constraints[i].offset / norm2(n) * n;
    const Vec3 unit = normalized(n);
    const Vec3 helper = std::fabs(unit.x) < 0.6   ? Vec3{1, 0, 0}
                        : std::fabs(unit.y) < 0.6 ? Vec3{0, 1, 0}
                                                  : Vec3{0, 0, 1};
    const Vec3 u = normalized(cross(unit, helper)), v = cross(unit, u);
    flat.clear();
    for (std::size_t k = 0; k < i; ++k) {
      const Vec3 m = constraints[k].normal;
      flat.push_back({dot(m, u), dot(m, v), constraints[k].offset - dot(m, origin)});
    }
    const std::optional<PlanePoint> found = lowest2({dot(objective, u), dot(objective, v)}, flat, 2 * reach);
    if (!found) return std::nullopt;
    best = origin + (*found)[0] * u + (*found)[1] * v;
  }
  return best;
}

}  // namespace rlacd
