#include "decompose/sections.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/invariant.hpp"
#include "core/mesh_measures.hpp"

namespace rlacd {

namespace {

int axis_of(Vec3 n) {
  for (int axis = 0; axis < 3; ++axis)
    if (std::fabs(n[axis]) == 1) return axis;
  return -1;
}

// Corners of the convex hull of points on a plane, by Andrew's monotone chain in the coordinates other than `drop`.
// Rounding may drop a corner that protrudes by about 1e-16, which no volume depends on.
template <int drop>
void reduce_to_planar_hull(std::vector<Vec3>& points) {
  if (points.size() < 4) return;
  constexpr int u = (drop + 1) % 3, v = (drop + 2) % 3;
  std::sort(points.begin(), points.end(), [](Vec3 a, Vec3 b) {
    return a[u] != b[u] ? a[u] < b[u] : a[v] != b[v] ? a[v] < b[v] : a[drop] < b[drop];
  });
  std::vector<Vec3> chain;
  chain.reserve(points.size() + 1);
  const auto extend = [&chain](Vec3 p, std::size_t base) {
    while (chain.size() >= base + 2) {
      const Vec3 a = chain[chain.size() - 2], b = chain.back();
      if ((b[u] - a[u]) * (p[v] - a[v]) - (b[v] - a[v]) * (p[u] - a[u]) > 0) break;
      chain.pop_back();
    }
    chain.push_back(p);
  };
  for (const Vec3 p : points) extend(p, 0);
  const std::size_t lower = chain.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) extend(points[i], lower);
  chain.pop_back();
  points = std::move(chain);
}

// The same, dropping the coordinate that the plane's normal determines best.
void reduce_to_planar_hull(std::vector<Vec3>& points, Vec3 n) {
  const int axis = longest_axis(n);
  axis == 0   ? reduce_to_planar_hull<0>(points)
  : axis == 1 ? reduce_to_planar_hull<1>(points)
              : reduce_to_planar_hull<2>(points);
}

// Integral of min(s - d, 0) over a triangle with corner values s0 <= s1 <= s2, divided by its area.
double mean_below(double s0, double s1, double s2, double d) {
  if (d <= s0) return 0;
  if (d >= s2) return (s0 + s1 + s2) / 3 - d;
  if (d <= s1) {
    const double t = (d - s0) * (d - s0) / ((s1 - s0) * (s2 - s0));
    return t * (s0 - d) / 3;
  }
  const double t = (s2 - d) * (s2 - d) / ((s2 - s0) * (s2 - s1));
  return (s0 + s1 + s2) / 3 - d - t * (s2 - d) / 3;
}

}  // namespace

SolidMesh::SolidMesh(const Mesh& solid) : mesh(solid), is_corner(solid.vertices.size(), 0) {
  area.reserve(mesh.faces.size());
  for (const Triangle& f : mesh.faces) {
    const Vec3 a = mesh.vertices[f[0]], b = mesh.vertices[f[1]], c = mesh.vertices[f[2]];
    area.push_back(0.5 * cross(b - a, c - a));
    for (const std::int32_t corner : f) is_corner[corner] = 1;
  }
  volume = mesh_volume(mesh);
}

Sections::Sections(const SolidMesh& solid, Vec3 normal, std::vector<double> offsets)
    : solid_(solid),
      mesh_(solid.mesh),
      normal_(normal),
      axis_(axis_of(normal)),
      offsets_(std::move(offsets)),
      slabs_(offsets_.size() + 1) {
  RLACD_ASSERT(std::is_sorted(offsets_.begin(), offsets_.end()));
  project();
  fill_slabs();
  cut_edges();
  measure_solid();
}

void Sections::project() {
  const std::size_t count = mesh_.vertices.size();
  heights_.resize(count);
  above_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = dot(normal_, mesh_.vertices[i]);
    heights_[i] = s;
    above_[i] = static_cast<std::int32_t>(std::upper_bound(offsets_.begin(), offsets_.end(), s) - offsets_.begin());
    if (!solid_.is_corner[i]) continue;
    is_on_plane_ = is_on_plane_ || (above_[i] > 0 && offsets_[above_[i] - 1] == s);
    lowest_ = std::min(lowest_, s);
    highest_ = std::max(highest_, s);
  }
  film_ = kRounding * (highest_ - lowest_);
}

std::size_t Sections::first_from(std::int32_t vertex) const {
  const auto j = static_cast<std::size_t>(above_[vertex]);
  return j > 0 && offsets_[j - 1] == heights_[vertex] ? j - 1 : j;
}

// A corner may be on the lower plane.
bool Sections::is_between_planes(const Triangle& f) const {
  return above_[f[0]] == above_[f[1]] && above_[f[1]] == above_[f[2]];
}

std::int32_t Sections::lowest_corner(const Triangle& f) const {
  const std::int32_t lower = heights_[f[1]] < heights_[f[0]] ? f[1] : f[0];
  return heights_[f[2]] < heights_[lower] ? f[2] : lower;
}

void Sections::fill_slabs() {
  // On which sides of a vertex on a plane its faces continue: 1 below, 2 above.
  std::vector<char> sides(mesh_.vertices.size(), 0);
  if (is_on_plane_)
    for (const Triangle& f : mesh_.faces) {
      const auto [low, high] = std::minmax({heights_[f[0]], heights_[f[1]], heights_[f[2]]});
      for (const std::int32_t c : f)
        sides[c] = static_cast<char>(sides[c] | (low < heights_[c] ? 1 : 0) | (high > heights_[c] ? 2 : 0));
    }
  struct Entry {
    std::size_t slab;
    std::int32_t vertex;
  };
  std::vector<Entry> entries;
  entries.reserve(sides.size());
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(sides.size()); ++i) {
    if (!solid_.is_corner[i]) continue;
    const auto j = static_cast<std::size_t>(above_[i]);
    const bool on_plane = j > 0 && offsets_[j - 1] == heights_[i];
    if (!on_plane || (sides[i] & 2) != 0) entries.push_back({j, i});
    if (on_plane && (sides[i] & 1) != 0) entries.push_back({j - 1, i});
  }
  for (const Entry& e : entries) slabs_.count(e.slab);
  slabs_.allocate();
  for (const Entry& e : entries) slabs_.add(e.slab, e.vertex);
}

// The point where an edge meets a plane; exactly on the plane when n is a coordinate axis.
Vec3 Sections::crossing(std::int32_t low, std::int32_t high, double offset) const {
  const Vec3 a = mesh_.vertices[low], b = mesh_.vertices[high];
  const double t = (offset - heights_[low]) / (heights_[high] - heights_[low]);
  Vec3 p = a + t * (b - a);
  if (axis_ >= 0) p[axis_] = offset * normal_[axis_];
  return p;
}

void Sections::cut_edges() {
  outlines_.resize(offsets_.size());
  for (const Triangle& f : mesh_.faces) {
    if (is_between_planes(f)) continue;
    for (int e = 0; e < 3; ++e) {
      // In a closed oriented mesh every edge occurs once in each direction: take the ascending one.
      const std::int32_t a = f[e], b = f[(e + 1) % 3];
      if (heights_[a] >= heights_[b]) continue;
      for (auto j = static_cast<std::size_t>(above_[a]); j < offsets_.size() && offsets_[j] < heights_[b]; ++j)
        outlines_[j].push_back(crossing(a, b, offsets_[j]));
    }
  }
  for (std::vector<Vec3>& points : outlines_) reduce_to_planar_hull(points, normal_);
}

double Sections::end_area(bool lowest) const {
  std::vector<Vec3> end;
  const std::size_t slab = lowest ? 0 : planes();
  for_each_inside(slab, slab + 1, [&](Vec3 p) {
    if (const double s = dot(normal_, p); lowest ? s <= lowest_ + film_ : s >= highest_ - film_) end.push_back(p);
  });
  reduce_to_planar_hull(end, normal_);
  return outline_area(end, normal_);
}

void Sections::measure_solid() {
  std::vector<double> slope(offsets_.size() + 1, 0), constant(offsets_.size() + 1, 0);
  solid_below_.assign(offsets_.size(), 0);
  for (std::size_t i = 0; i < mesh_.faces.size(); ++i) {
    const Triangle& f = mesh_.faces[i];
    const double flux = dot(normal_, solid_.area[i]);
    double s[3] = {heights_[f[0]], heights_[f[1]], heights_[f[2]]};
    if (s[0] > s[1]) std::swap(s[0], s[1]);
    if (s[1] > s[2]) std::swap(s[1], s[2]);
    if (s[0] > s[1]) std::swap(s[0], s[1]);
    std::size_t j = is_between_planes(f) && !is_on_plane_ ? above_[f[0]] : first_from(lowest_corner(f));
    for (; j < offsets_.size() && offsets_[j] < s[2]; ++j)
      solid_below_[j] += flux * mean_below(s[0], s[1], s[2], offsets_[j]);
    // From here on the whole triangle lies below: flux * (mean - d), accumulated as a linear function of d.
    slope[j] += flux;
    constant[j] += flux * ((s[0] + s[1] + s[2]) / 3);
  }
  double flux = 0, moment = 0;
  for (std::size_t j = 0; j < offsets_.size(); ++j) {
    flux += slope[j];
    moment += constant[j];
    solid_below_[j] = solid_below_[j] + moment - flux * offsets_[j];
  }
}

// Every triangle that a plane crosses adds a segment to the section's perimeter and, as a directed edge, to its area.
std::vector<Sections::Measures> Sections::measure_sections() const {
  std::vector<Measures> measures(offsets_.size());
  std::vector<Vec3> area(offsets_.size());
  for (const Triangle& f : mesh_.faces) {
    // A section is taken just above its plane, so a corner on the plane counts as below.
    const double high = std::max({heights_[f[0]], heights_[f[1]], heights_[f[2]]});
    for (std::size_t j = first_from(lowest_corner(f)); j < offsets_.size() && offsets_[j] < high; ++j) {
      Vec3 up, down;  // where the boundary of the triangle crosses the plane upwards and downwards
      bool has_up = false, has_down = false;
      for (int e = 0; e < 3; ++e) {
        const std::int32_t a = f[e], b = f[(e + 1) % 3];
        const bool below_a = heights_[a] <= offsets_[j], below_b = heights_[b] <= offsets_[j];
        if (below_a && !below_b) up = crossing(a, b, offsets_[j]), has_up = true;
        if (!below_a && below_b) down = crossing(b, a, offsets_[j]), has_down = true;
      }
      if (!has_up || !has_down) continue;
      const Vec3 origin = offsets_[j] * normal_;
      measures[j].perimeter += norm(down - up);
      area[j] = area[j] + cross(up - origin, down - origin);
    }
  }
  for (std::size_t j = 0; j < measures.size(); ++j) measures[j].area = std::fabs(dot(normal_, area[j])) / 2;
  return measures;
}

double outline_area(const std::vector<Vec3>& outline, Vec3 n) { return std::fabs(dot(n, polygon_normal(outline))) / 2; }

Bundles bundle_planes(const std::vector<Vec3>& directions, const std::vector<double>& offsets) {
  Bundles bundles;
  if (directions.empty()) return bundles;
  if (offsets.size() % directions.size() != 0) throw std::invalid_argument("every direction needs as many offsets");
  const std::size_t planes = offsets.size() / directions.size();
  bundles.place.resize(offsets.size());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const auto row = offsets.begin() + static_cast<std::ptrdiff_t>(k * planes);
    const auto row_end = row + static_cast<std::ptrdiff_t>(planes);
    if (!std::is_sorted(row, row_end) || !std::all_of(row, row_end, [](double d) { return std::isfinite(d); }))
      throw std::invalid_argument("offsets must be finite and ascend");
    const auto known = std::find_if(bundles.all.begin(), bundles.all.end(),
                                    [&](const Bundle& bundle) { return bundle.normal == directions[k]; });
    const auto b = static_cast<std::size_t>(known - bundles.all.begin());
    if (b == bundles.all.size()) bundles.all.push_back({directions[k], {}});
    std::vector<double>& d = bundles.all[b].offsets;
    d.insert(d.end(), row, row_end);
    for (std::size_t j = 0; j < planes; ++j) bundles.place[k * planes + j].bundle = b;
  }
  for (Bundle& bundle : bundles.all) {
    std::sort(bundle.offsets.begin(), bundle.offsets.end());
    bundle.offsets.erase(std::unique(bundle.offsets.begin(), bundle.offsets.end()), bundle.offsets.end());
  }
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const std::vector<double>& d = bundles.all[bundles.place[i].bundle].offsets;
    bundles.place[i].plane = static_cast<std::size_t>(std::lower_bound(d.begin(), d.end(), offsets[i]) - d.begin());
  }
  return bundles;
}

}  // namespace rlacd
