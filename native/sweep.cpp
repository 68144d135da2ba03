// Plane sweep: see sweep.hpp for input, output and algorithm.
#include "sweep.hpp"

#include <algorithm>
#include <stdexcept>

#include "hull.hpp"
#include "parallel.hpp"

namespace rlacd {

namespace {

int axis_of(Vec3 n) {
  for (int axis = 0; axis < 3; ++axis)
    if (std::fabs(n[axis]) == 1) return axis;
  return -1;
}

// The point where the segment a-b meets the plane n.x = d; on the plane to the last bit when n is a coordinate axis.
Vec3 crossing(Vec3 a, Vec3 b, double sa, double sb, double d, Vec3 n, int axis) {
  const double t = (d - sa) / (sb - sa);
  Vec3 p = a + t * (b - a);
  if (axis >= 0) p[axis] = d * n[axis];
  return p;
}

// Corners of the convex hull of points on a plane, by Andrew's monotone chain in the coordinates that the plane's
// normal allows. Rounding may drop a corner that stands out by some 1e-16, which no volume notices.
void reduce_to_planar_hull(std::vector<Vec3>& points, Vec3 n) {
  if (points.size() < 4) return;
  const int drop = std::fabs(n.x) >= std::fabs(n.y) && std::fabs(n.x) >= std::fabs(n.z) ? 0
                   : std::fabs(n.y) >= std::fabs(n.z)                                   ? 1
                                                                                        : 2;
  const int u = (drop + 1) % 3, v = (drop + 2) % 3;
  std::sort(points.begin(), points.end(), [u, v, drop](Vec3 a, Vec3 b) {
    return a[u] != b[u] ? a[u] < b[u] : a[v] != b[v] ? a[v] < b[v] : a[drop] < b[drop];
  });
  std::vector<Vec3> chain;
  const auto extend = [&](Vec3 p, std::size_t base) {
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

// What a slab adds to the hulls: the corners of its own hull, but for those on the plane that it shares with the hull
// so far, which are in it already.
struct Slab {
  std::vector<Vec3> to_below, to_above;
};

// Points that stick out of a hull by less than this, relative to the mesh, are rounding: the crossings of one long edge
// with many planes are collinear but for the last bits.
constexpr double kFilm = 1e-13;

class DirectionSweep {
 public:
  DirectionSweep(const Mesh& mesh, Vec3 n, const std::vector<double>& offsets)
      : mesh_(mesh), n_(n), axis_(axis_of(n)), d_(offsets), scores_(offsets.size()) {}

  std::vector<PlaneScore> run() {
    project();
    fill_slabs();
    measure_solid();
    grow_hulls(true);
    grow_hulls(false);
    return std::move(scores_);
  }

 private:
  void project() {
    s_.resize(mesh_.vertices.size());
    used_.assign(mesh_.vertices.size(), false);
    for (const Triangle& f : mesh_.faces)
      for (const std::int32_t c : f) used_[c] = true;
    for (std::size_t i = 0; i < s_.size(); ++i) {
      s_[i] = dot(n_, mesh_.vertices[i]);
      if (!used_[i]) continue;
      lowest_ = std::min(lowest_, s_[i]);
      highest_ = std::max(highest_, s_[i]);
    }
    film_ = kFilm * (highest_ - lowest_);
    lowest_around_ = highest_around_ = s_;
    for (const Triangle& f : mesh_.faces) {
      const auto [low, high] = std::minmax({s_[f[0]], s_[f[1]], s_[f[2]]});
      for (const std::int32_t c : f) {
        lowest_around_[c] = std::min(lowest_around_[c], low);
        highest_around_[c] = std::max(highest_around_[c], high);
      }
    }
  }

  // First plane with offset > s.
  std::size_t first_above(double s) const { return std::upper_bound(d_.begin(), d_.end(), s) - d_.begin(); }

  void fill_slabs() {
    inside_.resize(d_.size() + 1);
    crossings_.resize(d_.size());
    for (std::size_t i = 0; i < s_.size(); ++i) {
      if (!used_[i]) continue;
      const std::size_t j = first_above(s_[i]);
      // A vertex on a plane belongs to a side when the surface goes on there: a face that lies in the plane bounds the
      // solid on one side of it only.
      const bool on_plane = j > 0 && d_[j - 1] == s_[i];
      if (!on_plane || highest_around_[i] > s_[i]) inside_[j].push_back(mesh_.vertices[i]);
      if (on_plane && lowest_around_[i] < s_[i]) inside_[j - 1].push_back(mesh_.vertices[i]);
    }
    for (const Triangle& f : mesh_.faces)
      for (int e = 0; e < 3; ++e) {
        // In a closed oriented mesh every edge is run through once in each direction: take the ascending one.
        const std::int32_t a = f[e], b = f[(e + 1) % 3];
        if (s_[a] >= s_[b]) continue;
        for (std::size_t j = first_above(s_[a]); j < d_.size() && d_[j] < s_[b]; ++j)
          crossings_[j].push_back(crossing(mesh_.vertices[a], mesh_.vertices[b], s_[a], s_[b], d_[j], n_, axis_));
      }
    for (std::vector<Vec3>& points : crossings_) reduce_to_planar_hull(points, n_);
    slabs_.resize(d_.size() + 1);
    HullBuilder hull(film_);
    for (std::size_t j = 0; j <= d_.size(); ++j) {
      if (j == 1)
        lowest_slab_ = std::move(hull), hull = HullBuilder(film_);
      else
        hull.clear();
      std::vector<Vec3> points = j > 0 ? crossings_[j - 1] : std::vector<Vec3>();
      const std::size_t first_inside = points.size();
      points.insert(points.end(), inside_[j].begin(), inside_[j].end());
      const std::size_t first_upper = points.size();
      if (j < d_.size()) points.insert(points.end(), crossings_[j].begin(), crossings_[j].end());
      hull.add(points);
      if (d_.size() == 1) continue;  // each of the two slabs is a whole side: nothing grows from its corners
      for (const std::int32_t corner : hull.corners()) {
        const auto i = static_cast<std::size_t>(corner);
        if (i >= first_inside) slabs_[j].to_below.push_back(points[i]);
        if (i < first_upper) slabs_[j].to_above.push_back(points[i]);
      }
    }
    highest_slab_ = std::move(hull);
  }

  void measure_solid() {
    std::vector<double> slope(d_.size() + 1, 0), constant(d_.size() + 1, 0), partial(d_.size(), 0);
    std::vector<Vec3> area(d_.size());
    for (const Triangle& f : mesh_.faces) {
      const Vec3 a = mesh_.vertices[f[0]], b = mesh_.vertices[f[1]], c = mesh_.vertices[f[2]];
      const double flux = dot(n_, cross(b - a, c - a)) / 2;
      double s[3] = {s_[f[0]], s_[f[1]], s_[f[2]]};
      if (s[0] > s[1]) std::swap(s[0], s[1]);
      if (s[1] > s[2]) std::swap(s[1], s[2]);
      if (s[0] > s[1]) std::swap(s[0], s[1]);
      // A section is taken just above its plane, so a corner on the plane counts as below.
      std::size_t j = std::lower_bound(d_.begin(), d_.end(), s[0]) - d_.begin();
      for (; j < d_.size() && d_[j] < s[2]; ++j) {
        partial[j] += flux * mean_below(s[0], s[1], s[2], d_[j]);
        section_edge(f, j, area[j]);
      }
      // From here on the whole triangle lies below: flux * (mean - d), summed up as a line in d.
      slope[j] += flux;
      constant[j] += flux * ((s[0] + s[1] + s[2]) / 3);
    }
    double flux = 0, moment = 0;
    const double total = mesh_volume(mesh_.vertices, mesh_.faces);
    for (std::size_t j = 0; j < d_.size(); ++j) {
      flux += slope[j];
      moment += constant[j];
      scores_[j].solid_below = partial[j] + moment - flux * d_[j];
      scores_[j].solid_above = total - scores_[j].solid_below;
      scores_[j].section_area = std::fabs(dot(n_, area[j])) / 2;
    }
  }

  // Adds the segment in which plane j cuts the triangle to the section's perimeter and (as a directed edge) its area.
  void section_edge(const Triangle& f, std::size_t j, Vec3& area) {
    Vec3 up, down;  // where the boundary of the triangle crosses the plane upwards and downwards
    bool has_up = false, has_down = false;
    for (int e = 0; e < 3; ++e) {
      const std::int32_t a = f[e], b = f[(e + 1) % 3];
      const bool below_a = s_[a] <= d_[j], below_b = s_[b] <= d_[j];
      if (below_a == below_b) continue;
      const Vec3 p = below_a ? crossing(mesh_.vertices[a], mesh_.vertices[b], s_[a], s_[b], d_[j], n_, axis_)
                             : crossing(mesh_.vertices[b], mesh_.vertices[a], s_[b], s_[a], d_[j], n_, axis_);
      if (below_a)
        up = p, has_up = true;
      else
        down = p, has_down = true;
    }
    if (!has_up || !has_down) return;
    const Vec3 origin = d_[j] * n_;
    scores_[j].section_perimeter += norm(down - up);
    area = area + cross(up - origin, down - origin);
  }

  void grow_hulls(bool below) {
    HullBuilder& hull = below ? lowest_slab_ : highest_slab_;
    const auto planes = static_cast<std::ptrdiff_t>(d_.size());
    const std::ptrdiff_t first = below ? 0 : planes - 1, step = below ? 1 : -1;
    for (std::ptrdiff_t j = first; j >= 0 && j < planes; j += step) {
      if (j != first) hull.add(below ? slabs_[j].to_below : slabs_[j + 1].to_above);
      const double thickness = below ? d_[j] - lowest_ : highest_ - d_[j];
      const double extent =
          hull.points().empty() ? 0 : std::max(thickness, max_abs(hull.extent().upper - hull.extent().lower));
      PlaneScore& score = scores_[j];
      (below ? score.hull_below : score.hull_above) = hull.volume();
      (below ? score.thickness_below : score.thickness_above) = thickness;
      (below ? score.extent_below : score.extent_above) = extent;
    }
  }

  const Mesh& mesh_;
  const Vec3 n_;
  const int axis_;
  const std::vector<double>& d_;
  std::vector<PlaneScore> scores_;
  std::vector<double> s_;  // n.x of every vertex, and the least and greatest of the faces around it
  std::vector<double> lowest_around_, highest_around_;
  std::vector<bool> used_;
  double lowest_ = std::numeric_limits<double>::infinity();
  double highest_ = -std::numeric_limits<double>::infinity();
  double film_ = 0;
  std::vector<std::vector<Vec3>> inside_;     // M + 1 slabs: their vertices
  std::vector<std::vector<Vec3>> crossings_;  // M planes: corners of the section's convex hull
  std::vector<Slab> slabs_;                   // M + 1 slabs
  HullBuilder lowest_slab_, highest_slab_;    // which the hulls grow from
};

}  // namespace

std::vector<PlaneScore> sweep_direction(const Mesh& mesh, Vec3 direction, const std::vector<double>& offsets) {
  return DirectionSweep(mesh, direction, offsets).run();
}

std::vector<PlaneScore> sweep(const Mesh& mesh, const std::vector<Vec3>& directions, const std::vector<double>& offsets,
                              int threads) {
  if (directions.empty()) return {};
  if (offsets.size() % directions.size() != 0) throw std::invalid_argument("every direction needs as many offsets");
  const std::size_t planes = offsets.size() / directions.size();
  // Principal axes are often coordinate axes, and faces parallel to them: equal directions share one sweep, in which
  // every plane counts once.
  std::vector<Vec3> distinct;
  std::vector<std::vector<double>> merged;
  std::vector<std::size_t> group(directions.size());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const auto row = offsets.begin() + static_cast<std::ptrdiff_t>(k * planes);
    const auto row_end = row + static_cast<std::ptrdiff_t>(planes);
    if (!std::is_sorted(row, row_end) || !std::all_of(row, row_end, [](double d) { return std::isfinite(d); }))
      throw std::invalid_argument("offsets must be finite and ascend");
    group[k] = static_cast<std::size_t>(std::find(distinct.begin(), distinct.end(), directions[k]) - distinct.begin());
    if (group[k] == distinct.size()) {
      distinct.push_back(directions[k]);
      merged.emplace_back();
    }
    merged[group[k]].insert(merged[group[k]].end(), row, row_end);
  }
  for (std::vector<double>& d : merged) {
    std::sort(d.begin(), d.end());
    d.erase(std::unique(d.begin(), d.end()), d.end());
  }
  std::vector<std::vector<PlaneScore>> swept(distinct.size());
  parallel_for(distinct.size(), threads,
               [&](std::size_t g) { swept[g] = sweep_direction(mesh, distinct[g], merged[g]); });
  std::vector<PlaneScore> scores;
  scores.reserve(offsets.size());
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const std::vector<double>& d = merged[group[i / planes]];
    const auto place = std::lower_bound(d.begin(), d.end(), offsets[i]) - d.begin();
    scores.push_back(swept[group[i / planes]][static_cast<std::size_t>(place)]);
  }
  return scores;
}

}  // namespace rlacd
