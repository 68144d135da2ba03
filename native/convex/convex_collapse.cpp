#include "convex/convex_collapse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/stop.hpp"
#include "surface/edges.hpp"

namespace rlacd {
namespace {

// A collapse whose point is farther away than this (the hull is about 2 wide) adds too much volume to be useful.
constexpr double kReach = 50;

// A facet with less area than this share of a square on its longest side has no usable normal.
constexpr double kSliver = 1e-6;

// Safety factor on the tolerance, since normals and depths are rounded.
constexpr double kSafely = 1.1;

// From so many corners around a new one on, lines across flat sides are no longer tried as edges: a flat side of n
// corners has n of them after each collapse, and each takes time in n.
constexpr std::size_t kManyCorners = 64;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

ConvexCollapse::ConvexCollapse(const Mesh& hull, std::vector<Above> bounds, std::function<Vec3(Vec3)> placed,
                               double tolerance)
    : bounds_(std::move(bounds)), placed_(std::move(placed)), tolerance_(tolerance) {
  for (const Vec3 point : hull.vertices) add_corner(point);
  for (const Triangle& face : hull.faces) new_facet(face[0], face[1], face[2]);
  const std::vector<std::uint32_t> mate = mates_of(hull.faces, hull.vertices.size());
  std::vector<std::pair<std::int32_t, std::int32_t>> edges;
  for (std::size_t h = 0; h < mate.size(); ++h) {
    const std::int32_t from = hull.faces[h / 3][h % 3], to = hull.faces[h / 3][(h % 3 + 1) % 3];
    facets_[h / 3].neighbour[h % 3] = static_cast<std::int32_t>(mate[h] / 3);
    if (from < to) edges.emplace_back(from, to);
  }
  std::sort(edges.begin(), edges.end());
  for (const std::int32_t f : facet_of_) alive_ += f >= 0;
  for (const auto& [from, to] : edges) schedule(from, to);
}

std::vector<Vec3> ConvexCollapse::corners() const {
  std::vector<Vec3> alive;
  for (std::size_t v = 0; v < points_.size(); ++v)
    if (facet_of_[v] >= 0) alive.push_back(points_[v]);
  return alive;
}

std::int32_t ConvexCollapse::new_facet(std::int32_t a, std::int32_t b, std::int32_t c) {
  Facet facet;
  facet.corner = {a, b, c};
  const Vec3 product = cross(points_[b] - points_[a], points_[c] - points_[a]);
  const double length = norm(product);
  facet.area = 0.5 * length;
  facet.normal = length > 0 ? (1 / length) * product : Vec3{};
  facet.offset =
      std::max({dot(facet.normal, points_[a]), dot(facet.normal, points_[b]), dot(facet.normal, points_[c])});
  const std::int32_t f = add_facet(facet);
  facet_of_[a] = facet_of_[b] = facet_of_[c] = f;
  return f;
}

std::int32_t ConvexCollapse::add_corner(Vec3 point) {
  points_.push_back(point);
  if (placed_) places_.push_back(placed_(point));
  reach_.push_back(kUnknown);
  facet_of_.push_back(-1);
  version_.push_back(0);
  return static_cast<std::int32_t>(points_.size()) - 1;
}

// Whether the new corner of an edge may be within the tolerance of the hull. It lies above all facets around both ends.
// So a point of the hull within the tolerance of it is no deeper than that under these facets, and both ends are near
// that point.
bool ConvexCollapse::is_near(std::int32_t from, std::int32_t to) {
  return !placed_ || norm(places_[to] - places_[from]) <= kSafely * tolerance_ * (reach(from) + reach(to));
}

// The greatest distance from a corner to a point of the hull at most t deep under every facet around the corner, in
// multiples of t; infinity if no bound is known.
//
// The cone of the edges a -> v from a corner a contains the hull: x - a = sum c_v (v - a) with c_v >= 0. With N the
// mean of the normals of the facets around a, the mean depth of x is N . (a - x) = sum c_v N . (a - v) <= t, so that |x
// - a| <= sum c_v |v - a| is at most t times the greatest |v - a| / N . (a - v).
double ConvexCollapse::reach(std::int32_t corner) {
  double& reach = reach_[corner];
  if (!std::isnan(reach)) return reach;
  const Vec3 a = places_[corner];
  Vec3 normals;
  double facets = 0;
  reach = 0;
  edges_.clear();
  std::int32_t f = facet_of_[corner];
  do {
    const Facet& facet = facets_[f];
    const int i = facet.corner[0] == corner ? 0 : facet.corner[1] == corner ? 1 : 2;
    const Vec3 b = places_[facet.corner[(i + 1) % 3]] - a, c = places_[facet.corner[(i + 2) % 3]] - a;
    const Vec3 product = cross(b, c);
    if (norm(product) <= kSliver * std::max({norm2(b), norm2(c), norm2(c - b)})) return reach = kInfinity;
    normals = normals + normalized(product);
    ++facets;
    edges_.push_back(b);
    f = facet.neighbour[(i + 2) % 3];
  } while (f != facet_of_[corner]);
  for (const Vec3 edge : edges_) {
    const double depth = -dot(normals, edge) / facets;
    reach = std::max(reach, depth > 0 ? norm(edge) / depth : kInfinity);
  }
  return reach;
}

// The facets around two corners, which their new corner is to see; false when no edge joins the corners.
bool ConvexCollapse::gather(std::int32_t from, std::int32_t to) {
  begin_insertion();
  bool joined = false;
  for (const std::int32_t v : {from, to}) {
    std::int32_t f = facet_of_[v];
    do {
      const Facet& facet = facets_[f];
      const int i = facet.corner[0] == v ? 0 : facet.corner[1] == v ? 1 : 2;
      see(f);
      joined = joined || facet.corner[(i + 1) % 3] == to;
      f = facet.neighbour[(i + 2) % 3];
    } while (f != facet_of_[v]);
  }
  return joined;
}

// Facets whose plane a point misses by a hair count as visible, so that its new facets never lie in the plane of a
// neighbour and have nonzero area. A final scaling of that order makes up for the loss.
bool ConvexCollapse::find_horizon_of(Vec3 point) {
  return find_horizon([point](const Facet& f) { return dot(f.normal, point) - f.offset >= -kHair; });
}

std::optional<ConvexCollapse::Collapse> ConvexCollapse::plan(std::int32_t from, std::int32_t to) {
  if (!gather(from, to)) return std::nullopt;
  // The volume between the facets and a point that sees them is sum area (n . x - h) / 3, linear in x.
  Vec3 objective;
  above_ = bounds_;
  for (const std::int32_t f : visible_) {
    objective = objective + facets_[f].area * facets_[f].normal;
    above_.push_back({facets_[f].normal, facets_[f].offset});
  }
  const std::optional<Vec3> point = lowest_point(normalized(objective), above_, kReach);
  if (!point || max_abs(*point) > kReach) return std::nullopt;
  if (!find_horizon_of(*point)) return std::nullopt;
  Collapse collapse{0, from, to, version_[from], version_[to], *point};
  for (const std::int32_t f : visible_)
    collapse.cost += std::max(0.0, facets_[f].area * (dot(facets_[f].normal, *point) - facets_[f].offset)) / 3;
  return collapse;
}

void ConvexCollapse::schedule(std::int32_t from, std::int32_t to) {
  poll_stop();
  if (!is_near(from, to)) return;
  if (const std::optional<Collapse> collapse = plan(from, to)) {
    heap_.push_back(*collapse);
    std::push_heap(heap_.begin(), heap_.end());
  }
}

void ConvexCollapse::apply(const Collapse& collapse) {
  gather(collapse.from, collapse.to);
  if (!find_horizon_of(collapse.point)) return;
  std::vector<std::int32_t> touched;
  for (const std::int32_t f : visible_)
    for (const std::int32_t corner : facets_[f].corner) {
      if (facet_of_[corner] >= 0) touched.push_back(corner);
      facet_of_[corner] = -1;
    }
  const std::int32_t apex = add_corner(collapse.point);
  build_cone([&](std::int32_t from, std::int32_t to) { return new_facet(from, to, apex); });
  // The corners that remain are those on the horizon: the cone has given them a facet again.
  ++alive_;
  for (const std::int32_t corner : touched) alive_ -= facet_of_[corner] < 0;
  const std::vector<HorizonEdge> ring = horizon_;
  const std::vector<std::int32_t> fan = cone_;
  for (const HorizonEdge& edge : ring) {
    ++version_[edge.from];
    reach_[edge.from] = kUnknown;
  }
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Facet& before = facets_[fan[(i + ring.size() - 1) % ring.size()]];
    const bool is_across_flat = dot(before.normal, points_[ring[i].to]) - before.offset >= -kHair;
    if (ring.size() < kManyCorners || !is_across_flat) schedule(ring[i].from, apex);
  }
}

}  // namespace rlacd
