// Flat convex polygons, in space or in a plane, split by a plane or a line.
//
// In:  the corners of a polygon, in order, and their heights.
// Out: what of it lies below height 0, and what above; corners and crossings at 0 belong to both.
// How: Sutherland and Hodgman, "Reentrant Polygon Clipping" (1974).
#pragma once

#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

using Polygon = std::vector<Vec3>;

enum class Lies { kBelow, kAbove, kAcross };

inline Vec3 middle_of(const std::vector<Vec3>& points) {
  Vec3 sum;
  for (const Vec3 p : points) sum = sum + p;
  return (1.0 / static_cast<double>(points.size())) * sum;
}

inline Vec3 on_the_way(Vec3 p, Vec3 q, double share) { return p + share * (q - p); }
inline PlanePoint on_the_way(PlanePoint p, PlanePoint q, double share) {
  return {p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])};
}

// Only a polygon across is split. One that touches the plane lies on its own side; one in the plane lies below.
template <class Point, class Height>
Lies split(const std::vector<Point>& polygon, const Height& height, std::vector<Point>& below,
           std::vector<Point>& above) {
  double least = kInfinity, most = -least;
  for (const Point& p : polygon) {
    const double h = height(p);
    least = std::min(least, h), most = std::max(most, h);
  }
  if (most <= 0) return Lies::kBelow;
  if (least >= 0) return Lies::kAbove;
  below.clear(), above.clear();
  double here = height(polygon[0]);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point &p = polygon[i], &q = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    const double next = height(q);
    if (here <= 0) below.push_back(p);
    if (here >= 0) above.push_back(p);
    if ((here < 0 && next > 0) || (here > 0 && next < 0)) {
      below.push_back(on_the_way(p, q, here / (here - next)));
      above.push_back(below.back());
    }
    here = next;
  }
  return Lies::kAcross;
}

// Keeps what of a polygon lies below height 0; false, and nothing is changed, if it lies above.
template <class Point, class Height>
bool keep_below(std::vector<Point>& polygon, const Height& height) {
  thread_local std::vector<Point> below, above;  // many small polygons would allocate them again and again
  const Lies lies = split(polygon, height, below, above);
  if (lies == Lies::kAcross) polygon.swap(below);
  return lies != Lies::kAbove;
}

}  // namespace rlacd
