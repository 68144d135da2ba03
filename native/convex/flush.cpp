#include "convex/flush.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "convex/hull.hpp"

namespace rlacd {

namespace {

constexpr double kOpposed = -0.9;      // cosine of the angle (154 degrees) from which on two sides may form a seam
constexpr double kBeside = 0.5;        // of the angle to sides that move too: they would leave the layer no room
constexpr double kLeastArea = 1e-8;    // smaller contacts are none: two boxes that share an edge
constexpr double kWithin = 0.3;        // share by which places are moved from the corners of a contact to its middle
constexpr double kReached = 1 - 1e-6;  // share of a depth that counts as all of it, for rounding
constexpr double kSameNormal = 1e7;    // normals that agree to so many parts are equal

// What of a polygon lies in the half-space normal . x <= offset.
Polygon cut(const Polygon& polygon, Vec3 normal, double offset) {
  Polygon below, above;
  const Lies lies = split(polygon, [&](Vec3 p) { return dot(normal, p) - offset; }, below, above);
  return lies == Lies::kBelow ? polygon : below;
}

Vec3 middle_of(const Polygon& polygon) {
  Vec3 sum;
  for (const Vec3 p : polygon) sum = sum + p;
  return (1.0 / static_cast<double>(polygon.size())) * sum;
}

// The corners of a convex polygon, counter-clockwise around a normal.
Polygon ordered(const std::vector<Vec3>& corners, Vec3 normal) {
  const Vec3 middle = middle_of(corners);
  Vec3 across;
  for (const Vec3 p : corners)
    if (norm2(p - middle) > norm2(across)) across = p - middle;
  const Vec3 up = cross(normal, across);
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3 spoke = corners[i] - middle;
    // Grows with the angle, and is the same on every processor, as the arctangent need not be.
    const double x = dot(spoke, across), y = dot(spoke, up), size = std::fabs(x) + std::fabs(y);
    const double cosine = size > 0 ? x / size : 1;
    order.emplace_back(y < 0 ? cosine - 1 : 1 - cosine, i);
  }
  std::sort(order.begin(), order.end());
  Polygon polygon;
  for (const auto& [angle, i] : order) polygon.push_back(corners[i]);
  return polygon;
}

struct Range {
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();
};

// How far the corners of a polygon lie beyond a plane.
Range beyond(const Polygon& polygon, Vec3 normal, double offset) {
  Range range;
  for (const Vec3 p : polygon) {
    const double x = dot(normal, p) - offset;
    range = {std::min(range.least, x), std::max(range.most, x)};
  }
  return range;
}

}  // namespace

FlushBody::FlushBody(Mesh hull) : hull_(std::move(hull)) {
  std::map<std::array<std::int64_t, 3>, std::size_t> known;
  std::vector<std::vector<std::int32_t>> corners;
  for (const Triangle& face : hull_.faces) {
    const Vec3 normal = normalized(long_normal(hull_, face));
    if (norm2(normal) == 0) continue;  // a sliver without a direction
    const std::array<std::int64_t, 3> key = {std::llround(kSameNormal * normal.x), std::llround(kSameNormal * normal.y),
                                             std::llround(kSameNormal * normal.z)};
    const auto [found, is_new] = known.emplace(key, sides_.size());
    if (is_new) {
      sides_.push_back({normal, 0, {}});
      corners.emplace_back();
    }
    std::vector<std::int32_t>& own = corners[found->second];
    own.insert(own.end(), face.begin(), face.end());
  }
  for (std::size_t i = 0; i < sides_.size(); ++i) {
    Side& side = sides_[i];
    // The farthest corner: the inexact normal of a sliver then cuts nothing off.
    side.offset = beyond(hull_.vertices, side.normal, 0).most;
    std::sort(corners[i].begin(), corners[i].end());
    corners[i].erase(std::unique(corners[i].begin(), corners[i].end()), corners[i].end());
    for (const std::int32_t corner : corners[i]) side.polygon.push_back(hull_.vertices[corner]);
    side.polygon = ordered(side.polygon, side.normal);
  }
}

double FlushBody::depth(Vec3 point) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Side& side : sides_) least = std::min(least, side.offset - dot(side.normal, point));
  return least;
}

FlushBody::Contact FlushBody::contact(const FlushBody& other, double depth, double touch) const {
  const double reached = kReached * depth;
  Contact contact;
  std::vector<double> areas(sides_.size(), 0.0);
  std::vector<Range> ranges(sides_.size());
  std::vector<char> faces_it(sides_.size());
  for (const Side& facet : other.sides_) {
    bool may_touch = false;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      faces_it[i] = dot(sides_[i].normal, facet.normal) <= kOpposed;
      may_touch |= faces_it[i] != 0;
    }
    if (!may_touch) continue;
    bool is_outside = may_touch = false;
    for (std::size_t i = 0; i < sides_.size() && !is_outside; ++i) {
      ranges[i] = beyond(facet.polygon, sides_[i].normal, sides_[i].offset);
      is_outside = ranges[i].least > touch;
      may_touch |= faces_it[i] && ranges[i].most > -reached;
    }
    if (is_outside || !may_touch) continue;
    Polygon polygon = facet.polygon;
    for (std::size_t i = 0; i < sides_.size() && !polygon.empty(); ++i) {
      // Sideways they touch only if they overlap, or parts that share an edge would.
      const double reach = faces_it[i] ? touch : 0;
      if (ranges[i].most > reach) polygon = cut(polygon, sides_[i].normal, sides_[i].offset + reach);
    }
    if (polygon.empty()) continue;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Side& side = sides_[i];
      if (!faces_it[i] || ranges[i].most <= -reached || beyond(polygon, side.normal, side.offset).most <= -reached)
        continue;
      const Polygon near = cut(polygon, -side.normal, reached - side.offset);
      const double area = norm(polygon_normal(near)) / 2;
      areas[i] += area;
      if (area <= kLeastArea) continue;
      const Vec3 middle = middle_of(near);
      for (const Vec3 p : near) contact.places.push_back(p + kWithin * (middle - p));
    }
  }
  for (std::size_t i = 0; i < sides_.size(); ++i)
    if (areas[i] > kLeastArea) contact.sides.push_back(static_cast<std::int32_t>(i));
  return contact;
}

std::vector<Vec3> FlushBody::layer(const FlushBody& other, const std::vector<std::int32_t>& sides, double depth,
                                   double touch) const {
  Mesh hull = other.hull_;
  for (const Side& side : sides_) {
    const bool moves = std::any_of(sides.begin(), sides.end(),
                                   [&](std::int32_t i) { return dot(side.normal, sides_[i].normal) >= kBeside; });
    const double offset = side.offset + (moves ? depth : 0);
    if (beyond(hull.vertices, side.normal, offset).most > touch * kReached)
      hull = hull_below(hull, {side.normal, offset});
  }
  return hull.vertices;
}

}  // namespace rlacd
