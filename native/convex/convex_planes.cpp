#include "convex/convex_planes.hpp"

#include <stdexcept>

#include "core/mesh_measures.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

// Planes whose normals are closer than this are one. Like every other it is pushed out to touch the hull, so merging
// the two changes a depth by at most this times the hull's diameter, and only upwards.

// A hull is thin if its mean thickness is below this share of its extent. The planes of its facets then meet at such
// small angles, or have such uncertain normals, that they hold far more than the hull: beyond the rim of a flat one,
// beyond the tip of a needle.
constexpr double kThin = 3e-4;

// Pushes planes out until they touch a point.
RLACD_WIDE void push_out(double* h, const double* x, const double* y, const double* z, std::size_t count, Vec3 p) {
  for (std::size_t i = 0; i < count; ++i) {
    const double height = x[i] * p.x + y[i] * p.y + z[i] * p.z;
    h[i] = h[i] > height ? h[i] : height;
  }
}

struct Facet {
  std::array<std::int64_t, 3> key;
  double area;
  Vec3 normal;
  Facet(double a, Vec3 n)
      : key{std::llround(n.x / kHair), std::llround(n.y / kHair), std::llround(n.z / kHair)}, area(a), normal(n) {}
  bool operator<(const Facet& other) const { return key != other.key ? key < other.key : area > other.area; }
};

// The planes around a thin hull: those across the largest facet that touch an edge, and those of its box.
void add_around(const Mesh& hull, double extent, std::vector<Facet>& facets) {
  const auto is_smaller = [](const Facet& a, const Facet& b) { return a.area < b.area; };
  const Vec3 flat = std::max_element(facets.begin(), facets.end(), is_smaller)->normal;
  std::vector<Facet> around;
  for (const Triangle& face : hull.faces)
    for (int k = 0; k < 3; ++k) {
      const Vec3 from = hull.vertices[face[k]], to = hull.vertices[face[(k + 1) % 3]];
      const Vec3 across = normalized(cross(to - from, flat));
      if (!(std::fabs(norm2(across) - 1) < kRounding)) continue;
      const double least = std::min(dot(across, from), dot(across, to)) + kRounding * extent;
      if (std::all_of(hull.vertices.begin(), hull.vertices.end(), [&](Vec3 p) { return dot(across, p) <= least; }))
        around.emplace_back(0, across);
    }
  facets.insert(facets.end(), around.begin(), around.end());
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      Vec3 along;
      along[axis] = sign;
      facets.emplace_back(0, along);
    }
}

}  // namespace

ConvexPlanes::ConvexPlanes(const Mesh& hull) {
  std::vector<Facet> facets;
  facets.reserve(hull.faces.size());
  for (const Triangle& face : hull.faces) {
    const Vec3 product = long_normal(hull, face);
    const double area = norm(product);
    if (!(area > 0)) continue;
    const Vec3 n = (1 / area) * product;
    if (!(std::fabs(norm2(n) - 1) < kRounding)) continue;  // underflow
    facets.emplace_back(area, n);
  }
  if (facets.empty()) throw std::invalid_argument("the hull has no facet with an area");
  const Box box = box_of_faces(hull);
  if (const double extent = norm(box.upper - box.lower); 2 * mesh_volume(hull) <= kThin * extent * mesh_area(hull))
    add_around(hull, extent, facets);
  std::sort(facets.begin(), facets.end());
  facets.erase(std::unique(facets.begin(), facets.end(), [](const Facet& a, const Facet& b) { return a.key == b.key; }),
               facets.end());

  count_ = facets.size();
  const std::size_t padded = (count_ + kBlock - 1) / kBlock * kBlock;
  x_.assign(padded, 0);
  y_.assign(padded, 0);
  z_.assign(padded, 0);
  h_.assign(padded, -kInfinity);
  for (std::size_t i = 0; i < count_; ++i) {
    x_[i] = facets[i].normal.x;
    y_[i] = facets[i].normal.y;
    z_[i] = facets[i].normal.z;
  }
  std::vector<bool> is_corner(hull.vertices.size(), false);
  for (const Triangle& face : hull.faces)
    for (const std::int32_t corner : face) is_corner[corner] = true;
  for (std::size_t v = 0; v < hull.vertices.size(); ++v) {
    if (!is_corner[v]) continue;
    poll_stop();
    push_out(h_.data(), x_.data(), y_.data(), z_.data(), padded, hull.vertices[v]);
  }
  std::fill(h_.begin() + static_cast<std::ptrdiff_t>(count_), h_.end(), kInfinity);
}

RLACD_WIDE ConvexPlanes::Nearest ConvexPlanes::nearest(Vec3 p) const {
  Nearest best;
  double depths[kBlock];
  for (std::size_t start = 0; start < h_.size(); start += kBlock) {
    double least = kInfinity;
    for (std::size_t i = 0; i < kBlock; ++i)
      depths[i] = h_[start + i] - (x_[start + i] * p.x + y_[start + i] * p.y + z_[start + i] * p.z);
    for (std::size_t i = 0; i < kBlock; ++i) least = depths[i] < least ? depths[i] : least;
    if (!(least < best.depth)) continue;
    best.depth = least;
    best.plane = static_cast<std::int32_t>(start + (std::find(depths, depths + kBlock, least) - depths));
  }
  return best;
}

RLACD_WIDE std::int32_t ConvexPlanes::first_within(Vec3 p, double t) const {
  for (std::size_t start = 0; start < h_.size(); start += kBlock) {
    bool is_within = false;
    for (std::size_t i = start; i < start + kBlock; ++i)
      is_within |= h_[i] - (x_[i] * p.x + y_[i] * p.y + z_[i] * p.z) <= t;
    if (!is_within) continue;
    for (std::size_t i = start; i < start + kBlock; ++i)
      if (h_[i] - (x_[i] * p.x + y_[i] * p.y + z_[i] * p.z) <= t) return static_cast<std::int32_t>(i);
  }
  return -1;
}

}  // namespace rlacd
