#include "convex/convex_body.hpp"

#include <map>
#include <utility>

#include "convex/linear_program.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kFew = 40;     // corners; with more than this it pays to test some of them first
constexpr double kSameNormal = 1e7;  // normals that agree to so many parts are equal

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

// The corners farthest in 26 directions.
std::vector<Vec3> outermost(const std::vector<Vec3>& all) {
  std::vector<std::size_t> chosen;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        const Vec3 towards = {static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        const auto farthest = std::max_element(all.begin(), all.end(),
                                               [towards](Vec3 p, Vec3 q) { return dot(towards, p) < dot(towards, q); });
        chosen.push_back(static_cast<std::size_t>(farthest - all.begin()));
      }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::vector<Vec3> some;
  for (const std::size_t i : chosen) some.push_back(all[i]);
  return some;
}

std::vector<ConvexBody::Side> sides_of(const Mesh& hull) {
  std::map<std::array<std::int64_t, 3>, std::size_t> known;
  std::vector<std::vector<std::int32_t>> corners;
  std::vector<ConvexBody::Side> sides;
  for (const Triangle& face : hull.faces) {
    const Vec3 normal = normalized(long_normal(hull, face));
    if (norm2(normal) == 0) continue;  // a sliver without a direction
    const std::array<std::int64_t, 3> key = {std::llround(kSameNormal * normal.x), std::llround(kSameNormal * normal.y),
                                             std::llround(kSameNormal * normal.z)};
    const auto [found, is_new] = known.emplace(key, sides.size());
    if (is_new) {
      sides.push_back({{normal, -kInfinity}, {}});
      corners.emplace_back();
    }
    std::vector<std::int32_t>& own = corners[found->second];
    own.insert(own.end(), face.begin(), face.end());
  }
  for (std::size_t i = 0; i < sides.size(); ++i) {
    auto& [plane, polygon] = sides[i];
    // The farthest corner: the inexact normal of a sliver then cuts nothing off.
    for (const Vec3 p : hull.vertices) plane.offset = std::max(plane.offset, dot(plane.normal, p));
    std::sort(corners[i].begin(), corners[i].end());
    corners[i].erase(std::unique(corners[i].begin(), corners[i].end()), corners[i].end());
    for (const std::int32_t corner : corners[i]) polygon.push_back(hull.vertices[corner]);
    polygon = ordered(polygon, plane.normal);
  }
  return sides;
}

}  // namespace

ConvexBody::ConvexBody(Mesh mesh) : mesh_(std::move(mesh)), box_(Box::of(mesh_.vertices)) {}

double ConvexBody::distance(Vec3 p, double enough) const {
  const double outside = -planes().nearest(p).depth;
  if (outside <= 0 || outside >= enough) return outside;
  return std::sqrt(bvh().closest(p).distance2);
}

const std::vector<ConvexBody::Side>& ConvexBody::sides() const {
  return sides_.get([this] { return sides_of(mesh_); });
}

const std::vector<Vec3>& ConvexBody::few_corners() const {
  if (mesh_.vertices.size() <= kFew) return mesh_.vertices;
  return few_corners_.get([this] { return outermost(mesh_.vertices); });
}

bool holds_ball(const Mesh& hull, double radius) {
  const Box box = Box::of(hull.vertices);
  const double size = max_abs(box.upper - box.lower);
  if (!(size > 0)) return false;
  Mesh unit = hull;  // the linear program's tolerances are absolute
  for (Vec3& p : unit.vertices) p = 1 / size * (p - 0.5 * (box.lower + box.upper));
  const ConvexPlanes planes(unit);
  std::vector<Above> inside;
  inside.reserve(planes.size());
  // Neighbouring facets make an order in which most constraints change the optimum; a fixed shuffle does not.
  std::uint64_t state = 1;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes.size()); ++i) {
    inside.push_back({-planes.normal(i), radius / size - planes.offset(i)});
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    std::swap(inside.back(), inside[(state >> 33) % inside.size()]);
  }
  return lowest_point({0, 0, 1}, inside, 1).has_value();
}

}  // namespace rlacd
