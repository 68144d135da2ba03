#include "convex/flush.hpp"

#include <algorithm>

#include "convex/hull.hpp"

namespace rlacd {

namespace {

constexpr double kOpposed = -0.9;      // cosine of the angle (154 degrees) from which on two sides may form a seam
constexpr double kBeside = 0.5;        // of the angle to sides that move too: they would leave the layer no room
constexpr double kLeastArea = 1e-8;    // smaller contacts are none: two boxes that share an edge
constexpr double kWithin = 0.3;        // share by which places are moved from the corners of a contact to its middle
constexpr double kReached = 1 - 1e-6;  // share of a depth that counts as all of it, for rounding

// What of a polygon lies below a plane.
Polygon cut(Polygon polygon, const Plane& plane) {
  if (!keep_below(polygon, [&](Vec3 p) { return -plane.depth(p); })) polygon.clear();
  return polygon;
}

struct Range {
  double least = kInfinity, most = -kInfinity;
};

// How far points lie beyond a plane.
Range beyond(const std::vector<Vec3>& points, const Plane& plane) {
  Range range;
  for (const Vec3 p : points) {
    const double x = -plane.depth(p);
    range = {std::min(range.least, x), std::max(range.most, x)};
  }
  return range;
}

Plane moved_out(const Plane& plane, double by) { return {plane.normal, plane.offset + by}; }

}  // namespace

Contact contact(const ConvexBody& body, const ConvexBody& other, double depth, double touch) {
  const std::vector<ConvexBody::Side>& sides = body.sides();
  const double reached = kReached * depth;
  Contact contact;
  std::vector<double> areas(sides.size(), 0.0);
  std::vector<Range> ranges(sides.size());
  std::vector<char> faces_it(sides.size());
  for (const ConvexBody::Side& facet : other.sides()) {
    bool may_touch = false;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      faces_it[i] = dot(sides[i].plane.normal, facet.plane.normal) <= kOpposed;
      may_touch |= faces_it[i] != 0;
    }
    if (!may_touch) continue;
    bool is_outside = may_touch = false;
    for (std::size_t i = 0; i < sides.size() && !is_outside; ++i) {
      ranges[i] = beyond(facet.polygon, sides[i].plane);
      is_outside = ranges[i].least > touch;
      may_touch |= faces_it[i] && ranges[i].most > -reached;
    }
    if (is_outside || !may_touch) continue;
    Polygon polygon = facet.polygon;
    for (std::size_t i = 0; i < sides.size() && !polygon.empty(); ++i) {
      // Sideways they touch only if they overlap, or parts that share an edge would.
      const double reach = faces_it[i] ? touch : 0;
      if (ranges[i].most > reach) polygon = cut(polygon, moved_out(sides[i].plane, reach));
    }
    if (polygon.empty()) continue;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      const Plane& plane = sides[i].plane;
      if (!faces_it[i] || ranges[i].most <= -reached || beyond(polygon, plane).most <= -reached) continue;
      const Polygon near = cut(polygon, {-plane.normal, reached - plane.offset});
      const double area = norm(polygon_normal(near)) / 2;
      areas[i] += area;
      if (area <= kLeastArea) continue;
      const Vec3 middle = middle_of(near);
      for (const Vec3 p : near) contact.places.push_back(p + kWithin * (middle - p));
    }
  }
  for (std::size_t i = 0; i < sides.size(); ++i)
    if (areas[i] > kLeastArea) contact.sides.push_back(static_cast<std::int32_t>(i));
  return contact;
}

std::vector<Vec3> layer(const ConvexBody& body, const ConvexBody& other, const std::vector<std::int32_t>& sides,
                        double depth, double touch) {
  Mesh hull = other.mesh();
  for (const ConvexBody::Side& side : body.sides()) {
    const bool moves = std::any_of(sides.begin(), sides.end(), [&](std::int32_t i) {
      return dot(side.plane.normal, body.sides()[i].plane.normal) >= kBeside;
    });
    const Plane plane = moved_out(side.plane, moves ? depth : 0);
    if (beyond(hull.vertices, plane).most > touch * kReached) hull = hull_below(hull, plane);
  }
  return hull.vertices;
}

}  // namespace rlacd
