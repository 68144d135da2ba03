// Convex polygons in space, cut by planes: what is left of a polygon outside a convex polytope.
#pragma once

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "geometry.hpp"

namespace rlacd {

using Polygon = std::vector<Vec3>;  // convex and flat

struct HalfSpace {
  Vec3 normal;
  double offset;  // the points with normal . x <= offset
};

// Corners this close to a plane lie on it: a cut leaves no polygon thinner than rounding.
constexpr double kOnPlane = 1e-12;

// The parts of a polygon inside and outside a half-space. A polygon that only touches the plane stays whole: outside,
// or inside when it lies in the plane.
inline void split(const Polygon& polygon, const HalfSpace& half, Polygon& inside, Polygon& outside) {
  inside.clear();
  outside.clear();
  double least = 0, most = 0;
  const auto height = [&](Vec3 p) {
    const double h = dot(half.normal, p) - half.offset;
    return std::fabs(h) <= kOnPlane ? 0.0 : h;
  };
  for (const Vec3 p : polygon) {
    least = std::min(least, height(p));
    most = std::max(most, height(p));
  }
  if (most <= 0) {
    inside = polygon;
    return;
  }
  if (least >= 0) {
    outside = polygon;
    return;
  }
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 p = polygon[i], q = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    const double hp = height(p), hq = height(q);
    if (hp <= 0) inside.push_back(p);
    if (hp >= 0) outside.push_back(p);
    if ((hp < 0 && hq > 0) || (hp > 0 && hq < 0)) {
      const Vec3 crossing = p + (hp / (hp - hq)) * (q - p);
      inside.push_back(crossing);
      outside.push_back(crossing);
    }
  }
}

// Whether one of the half-spaces alone shows that a polygon does not reach inside all of them.
inline bool separated(const Polygon& polygon, const std::vector<HalfSpace>& convex) {
  return std::any_of(convex.begin(), convex.end(), [&](const HalfSpace& half) {
    return std::all_of(polygon.begin(), polygon.end(),
                       [&](Vec3 p) { return dot(half.normal, p) - half.offset >= -kOnPlane; });
  });
}

// Replaces every polygon by what is left of it outside the intersection of half-spaces. One that does not meet the
// intersection stays whole.
inline void subtract(std::vector<Polygon>& polygons, const std::vector<HalfSpace>& convex) {
  std::vector<Polygon> left, cut_off;
  Polygon rest, inside, outside;
  for (Polygon& polygon : polygons) {
    if (separated(polygon, convex)) {
      left.push_back(std::move(polygon));
      continue;
    }
    cut_off.clear();
    rest = polygon;
    for (const HalfSpace& half : convex) {
      const auto is_inside = [&half](Vec3 p) { return dot(half.normal, p) - half.offset <= kOnPlane; };
      if (std::all_of(rest.begin(), rest.end(), is_inside)) continue;
      split(rest, half, inside, outside);
      rest.swap(inside);
      if (rest.empty()) break;
      if (!outside.empty()) cut_off.push_back(outside);
    }
    if (rest.empty())
      left.push_back(std::move(polygon));
    else
      std::move(cut_off.begin(), cut_off.end(), std::back_inserter(left));
  }
  polygons.swap(left);
}

}  // namespace rlacd
