#include "convex/hull.hpp"

#include <cmath>
#include <cstdlib>
#include <numeric>

#include "core/invariant.hpp"
#include "core/predicates.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace {

constexpr double kRoundoff = 0x1p-53;
constexpr int kExactRange = 100;  // coordinates with binary exponents beyond this, either way, are scaled
constexpr double kFat = 1e-2;     // least ratio of inradius to extent at which the tolerance applies

}  // namespace

void HullBuilder::drop_inner_points() {
  if (rank_ < 3) return;
  std::vector<Vec3> corners;
  Renumbered numbered(points_, corners);
  for (Facet& f : facets_)
    if (f.alive) f.corner = numbered(f.corner);
  points_ = std::move(corners);
  next_outside_.assign(points_.size(), -1);
}

inline bool HullBuilder::sees(const Facet& f, Vec3 p) const {
  const double h = dot(f.normal, p) - f.offset;
  const double bound = f.error * reach_;
  if (h > bound) return true;
  if (h < -bound) return false;
  return sees_closely(f, p);
}

bool HullBuilder::sees_closely(const Facet& f, Vec3 p) const {
  const double h = height(f, p);
  const double bound = f.error * max_abs(p - f.origin);
  if (h > bound) return true;
  if (h < -bound) return false;
  return orient3d_exact(points_[f.corner[0]], points_[f.corner[1]], points_[f.corner[2]], p) > 0;
}

std::int32_t HullBuilder::new_facet(std::int32_t a, std::int32_t b, std::int32_t c) {
  const Vec3 origin = points_[a], ab = points_[b] - origin, ac = points_[c] - origin;
  Facet f;
  f.corner = {a, b, c};
  f.normal = cross(ab, ac);
  f.origin = origin;
  f.offset = dot(f.normal, origin);
  // Each component of the cross product is off by less than 6 u |ab||ac| and the dot product adds 3 terms of relative
  // error 5 u, all in the maximum norm: 40 u |ab||ac||p - a| covers their sum. Without the difference p - a, its two
  // dot products are off by 36 u |ab||ac| of the longest |p| each, and the normal counts twice: 40 u |ab||ac| 4 |p|.
  f.error = 40 * kRoundoff * max_abs(ab) * max_abs(ac);
  f.outside = -1;
  return add_facet(f);
}

template <class Sees>
void HullBuilder::assign(std::int32_t point, const std::vector<std::int32_t>& facets, const Sees& sees) {
  const Vec3 p = points_[point];
  for (const std::int32_t id : facets) {
    Facet& f = facets_[id];
    if (sees(f, p)) {
      next_outside_[point] = f.outside;
      f.outside = point;
      return;
    }
  }
}

// Finds four points in general position, if any, and makes them the first hull.
bool HullBuilder::initialise() {
  const auto count = static_cast<std::int32_t>(points_.size());
  if (count == 0) return false;
  const auto lexicographic = [this](std::int32_t i, std::int32_t j) {
    const Vec3 a = points_[i], b = points_[j];
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z != b.z ? a.z < b.z : i < j;
  };
  std::vector<std::int32_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  const std::int32_t p0 = *std::min_element(order.begin(), order.end(), lexicographic);

  const auto argmax = [count](const auto& value) {
    std::int32_t best = 0;
    double best_value = value(0);
    for (std::int32_t i = 1; i < count; ++i)
      if (const double v = value(i); v > best_value) best = i, best_value = v;
    return best;
  };
  rank_ = 0;
  const std::int32_t p1 = argmax([&](std::int32_t i) { return norm2(points_[i] - points_[p0]); });
  if (points_[p1] == points_[p0]) return false;

  rank_ = 1;
  const Vec3 axis = points_[p1] - points_[p0];
  std::int32_t p2 = argmax([&](std::int32_t i) { return norm2(cross(axis, points_[i] - points_[p0])); });
  if (collinear_exact(points_[p0], points_[p1],
                      points_[p2])) {  // rounding may have hidden the only non-collinear point
    p2 = -1;
    for (std::int32_t i = 0; i < count && p2 < 0; ++i)
      if (!collinear_exact(points_[p0], points_[p1], points_[i])) p2 = i;
    if (p2 < 0) return false;
  }

  rank_ = 2;
  const Vec3 normal = cross(axis, points_[p2] - points_[p0]);
  std::int32_t p3 = argmax([&](std::int32_t i) { return std::fabs(dot(normal, points_[i] - points_[p0])); });
  int side = orient3d_exact(points_[p0], points_[p1], points_[p2], points_[p3]);
  if (side == 0) {
    for (std::int32_t i = 0; i < count && side == 0; ++i) {
      side = orient3d_exact(points_[p0], points_[p1], points_[p2], points_[i]);
      p3 = i;
    }
    if (side == 0) return false;
  }

  rank_ = 3;
  const std::int32_t a = p0, b = side > 0 ? p2 : p1, c = side > 0 ? p1 : p2, d = p3;
  facets_.clear();
  free_.clear();
  const std::int32_t f[4] = {new_facet(a, b, c), new_facet(a, d, b), new_facet(b, d, c), new_facet(c, d, a)};
  const std::int32_t neighbours[4][3] = {
      {f[1], f[2], f[3]}, {f[3], f[2], f[0]}, {f[1], f[3], f[0]}, {f[2], f[1], f[0]}};
  for (int i = 0; i < 4; ++i) std::copy_n(neighbours[i], 3, facets_[f[i]].neighbour);
  return true;
}

void HullBuilder::add(const std::vector<Vec3>& points) {
  auto first = static_cast<std::int32_t>(points_.size());
  points_.insert(points_.end(), points.begin(), points.end());
  next_outside_.resize(points_.size(), -1);
  for (const Vec3 p : points) extent_.extend(p);
  reach_ = 4 * std::max(max_abs(extent_.lower), max_abs(extent_.upper));
  if (rank_ < 3) {
    if (!initialise()) return;
    first = 0;
  }
  std::vector<std::int32_t> alive;  // newest first: points in sorted order mostly see these
  alive.reserve(facets_.size());
  for (std::size_t i = facets_.size(); i-- > 0;)
    if (facets_[i].alive) alive.push_back(static_cast<std::int32_t>(i));
  // Points below every facet's plane moved out by the tolerance t lie within t D / r of a hull of diameter D and
  // inradius r: nothing, unless the hull is flat. The inradius is at least volume / area.
  const bool fat = tolerance_ > 0 && volume() > kFat * area() * max_abs(extent_.upper - extent_.lower);
  const auto clearly = [this, fat](const Facet& f, Vec3 p) {
    if (dot(f.normal, p) - f.offset < -f.error * reach_) return false;  // most facets are clearly not seen
    return (!fat || height(f, p) >= tolerance_ * norm(f.normal)) && sees(f, p);
  };
  for (auto i = first; i < static_cast<std::int32_t>(points_.size()); ++i) {
    poll_stop(i - first);
    assign(i, alive, clearly);
  }
  std::vector<std::int32_t> pending;
  for (const std::int32_t id : alive)
    if (facets_[id].outside >= 0) pending.push_back(id);
  expand(pending);
}

// Invariant between insertions: every point that lies outside the hull is in the list of one facet that sees it, and
// every facet with such a list is in `pending`.
void HullBuilder::expand(std::vector<std::int32_t>& pending) {
  while (!pending.empty()) {
    poll_stop();
    const std::int32_t id = pending.back();
    const Facet& f = facets_[id];
    if (!f.alive || f.outside < 0) {
      pending.pop_back();
      continue;
    }
    std::int32_t farthest = f.outside;
    double farthest_height = height(f, points_[farthest]);
    for (std::int32_t i = next_outside_[farthest]; i >= 0; i = next_outside_[i]) {
      const double h = height(f, points_[i]);
      if (h > farthest_height || (h == farthest_height && i < farthest)) farthest = i, farthest_height = h;
    }
    insert(farthest, id, pending);
  }
}

// Replaces the facets that the point sees by a cone of triangles over their horizon.
void HullBuilder::insert(std::int32_t point, std::int32_t facet, std::vector<std::int32_t>& pending) {
  const Vec3 p = points_[point];
  begin_insertion();
  see(facet);
  const bool is_loop = find_horizon([&](const Facet& f) { return sees(f, p); });
  RLACD_ASSERT(is_loop);  // since signs are exact
  static_cast<void>(is_loop);
  orphans_.clear();
  for (const std::int32_t id : visible_) {
    Facet& f = facets_[id];
    for (std::int32_t i = f.outside; i >= 0; i = next_outside_[i])
      if (i != point) orphans_.push_back(i);
    f.outside = -1;
  }
  build_cone([&](std::int32_t from, std::int32_t to) { return new_facet(from, to, point); });

  // A point that saw a removed facet and still lies outside sees one of the new facets, so only those are searched. It
  // may see them by less than the tolerance and another facet by more: no such point is dropped here.
  const auto strictly = [this](const Facet& f, Vec3 q) { return sees(f, q); };
  for (const std::int32_t orphan : orphans_) assign(orphan, cone_, strictly);
  for (const std::int32_t id : cone_)
    if (facets_[id].outside >= 0) pending.push_back(id);
}

double HullBuilder::volume() const {
  if (rank_ < 3) return 0;
  Vec3 apex;
  bool found = false;
  double sum = 0;
  for (const Facet& f : facets_) {
    if (!f.alive) continue;
    if (!found) apex = f.origin, found = true;
    sum += dot(f.normal, f.origin - apex);
  }
  return sum / 6;
}

double HullBuilder::area() const {
  double sum = 0;
  for (const Facet& f : facets_)
    if (f.alive) sum += norm(f.normal);
  return sum / 2;
}

std::vector<Triangle> HullBuilder::triangles() const {
  std::vector<Triangle> result;
  for (const Facet& f : facets_)
    if (f.alive) result.push_back(f.corner);
  return result;
}

// A corner is extreme if at least three of the edges around it are creases (their two facets not exactly coplanar).
// None or two creases mean that it lies inside a facet or an edge of the polytope.
std::vector<std::int32_t> HullBuilder::extreme_corners() const {
  std::vector<std::int32_t> creases(points_.size(), 0);
  for (std::size_t id = 0; id < facets_.size(); ++id) {
    const Facet& f = facets_[id];
    if (!f.alive) continue;
    for (int e = 0; e < 3; ++e) {
      if (f.neighbour[e] < static_cast<std::int32_t>(id)) continue;  // every edge once
      const std::int32_t a = f.corner[e], b = f.corner[(e + 1) % 3];
      const Triangle& across = facets_[f.neighbour[e]].corner;
      const std::int32_t opposite = across[0] != a && across[0] != b   ? across[0]
                                    : across[1] != a && across[1] != b ? across[1]
                                                                       : across[2];
      const Vec3 offset = points_[opposite] - f.origin;
      if (dot(f.normal, offset) < -f.error * max_abs(offset) ||
          orient3d_exact(points_[f.corner[0]], points_[f.corner[1]], points_[f.corner[2]], points_[opposite]) != 0) {
        ++creases[a];
        ++creases[b];
      }
    }
  }
  std::vector<std::int32_t> extreme;
  for (std::size_t i = 0; i < creases.size(); ++i)
    if (creases[i] >= 3) extreme.push_back(static_cast<std::int32_t>(i));
  return extreme;
}

namespace {

// The exponent of the power of two that brings the points into the range where the predicates are exact; 0 inside it.
int exponent_out_of_range(const std::vector<Vec3>& points) {
  double largest = 0;
  for (const Vec3 p : points) largest = std::max(largest, max_abs(p));
  if (largest == 0) return 0;
  const int exponent = std::ilogb(largest);
  return std::abs(exponent) > kExactRange ? exponent : 0;
}

}  // namespace

Hull convex_hull(const std::vector<Vec3>& points) {
  Hull hull;
  // Scaling by a power of two is exact, so no decision changes.
  if (const int exponent = exponent_out_of_range(points); exponent != 0) {
    std::vector<Vec3> scaled = points;
    for (Vec3& p : scaled) p = {std::ldexp(p.x, -exponent), std::ldexp(p.y, -exponent), std::ldexp(p.z, -exponent)};
    return convex_hull(scaled);
  }
  HullBuilder builder;
  builder.add(points);
  hull.rank = builder.rank();
  if (hull.rank < 3) return hull;

  hull.faces = builder.triangles();
  hull.indices = builder.extreme_corners();
  if (hull.faces.size() > 2 * hull.indices.size() - 4) {  // a corner inside a facet or an edge of the polytope
    std::vector<Vec3> extreme;
    for (const std::int32_t i : hull.indices) extreme.push_back(points[i]);
    HullBuilder again;
    again.add(extreme);
    hull.faces = again.triangles();
    return hull;
  }
  std::vector<std::int32_t> rank_of(points.size(), -1);
  for (std::size_t i = 0; i < hull.indices.size(); ++i) rank_of[hull.indices[i]] = static_cast<std::int32_t>(i);
  for (Triangle& face : hull.faces)
    for (std::int32_t& c : face) c = rank_of[c];
  return hull;
}

Mesh hull_mesh(const std::vector<Vec3>& points) {
  const Hull hull = convex_hull(points);
  Mesh mesh;
  mesh.vertices.reserve(hull.indices.size());
  for (const std::int32_t i : hull.indices) mesh.vertices.push_back(points[i]);
  mesh.faces = hull.faces;
  return mesh;
}

Mesh hull_below(const Mesh& hull, const Plane& plane) {
  std::vector<Vec3> points;
  std::vector<double> heights;
  for (const Vec3 p : hull.vertices) {
    heights.push_back(-plane.depth(p));
    if (heights.back() <= 0) points.push_back(p);
  }
  for (const Triangle& face : hull.faces)
    for (int e = 0; e < 3; ++e) {
      const std::int32_t a = face[e], b = face[(e + 1) % 3];
      if (heights[a] <= 0 && heights[b] > 0)
        points.push_back(hull.vertices[a] +
                         heights[a] / (heights[a] - heights[b]) * (hull.vertices[b] - hull.vertices[a]));
    }
  return hull_mesh(points);
}

}  // namespace rlacd
