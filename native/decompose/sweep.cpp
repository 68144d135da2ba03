#include "decompose/sweep.hpp"

#include <algorithm>

#include "convex/hull.hpp"
#include "core/parallel.hpp"
#include "decompose/sections.hpp"

namespace rlacd {

namespace {

// The points that a slab adds to the hulls: the corners of its own hull, except those on the plane it shares with the
// hull so far, which already has them.
struct Slab {
  std::vector<Vec3> to_below, to_above;
};

class DirectionSweep {
 public:
  DirectionSweep(const SolidMesh& solid, Vec3 n, const std::vector<double>& offsets)
      : sections_(solid, n, offsets), scores_(offsets.size()) {}

  std::vector<PlaneScore> run() {
    build_slabs();
    measure_solid();
    grow_hulls(true);
    grow_hulls(false);
    return std::move(scores_);
  }

 private:
  void build_slabs() {
    const std::size_t planes = sections_.planes();
    slabs_.resize(planes + 1);
    HullBuilder hull(sections_.film());
    for (std::size_t j = 0; j <= planes; ++j) {
      if (j == 1)
        lowest_slab_ = std::move(hull), hull = HullBuilder(sections_.film());
      else
        hull.clear();
      std::vector<Vec3> points = j > 0 ? sections_.outline(j - 1) : std::vector<Vec3>();
      const std::size_t first_inside = points.size();
      sections_.for_each_inside(j, j + 1, [&points](Vec3 p) { points.push_back(p); });
      const std::size_t first_upper = points.size();
      if (j < planes) points.insert(points.end(), sections_.outline(j).begin(), sections_.outline(j).end());
      hull.add(points);
      if (planes == 1) continue;  // each of the two slabs is a whole side: no hull grows from its corners
      for (const std::int32_t corner : hull.corners()) {
        const auto i = static_cast<std::size_t>(corner);
        if (i >= first_inside) slabs_[j].to_below.push_back(points[i]);
        if (i < first_upper) slabs_[j].to_above.push_back(points[i]);
      }
    }
    highest_slab_ = std::move(hull);
  }

  void measure_solid() {
    const std::vector<Sections::Measures> measures = sections_.measure_sections();
    for (std::size_t j = 0; j < scores_.size(); ++j) {
      scores_[j].solid_below = sections_.solid_below(j);
      scores_[j].solid_above = sections_.solid_above(j);
      scores_[j].section_area = measures[j].area;
      scores_[j].section_perimeter = measures[j].perimeter;
    }
  }

  void grow_hulls(bool below) {
    HullBuilder& hull = below ? lowest_slab_ : highest_slab_;
    const auto planes = static_cast<std::ptrdiff_t>(scores_.size());
    const std::ptrdiff_t first = below ? 0 : planes - 1, step = below ? 1 : -1;
    for (std::ptrdiff_t j = first; j >= 0 && j < planes; j += step) {
      if (j != first) hull.add(below ? slabs_[j].to_below : slabs_[j + 1].to_above);
      const double offset = sections_.offset(static_cast<std::size_t>(j));
      const double thickness = below ? offset - sections_.lowest() : sections_.highest() - offset;
      const double extent =
          hull.points().empty() ? 0 : std::max(thickness, max_abs(hull.extent().upper - hull.extent().lower));
      PlaneScore& score = scores_[j];
      (below ? score.hull_below : score.hull_above) = hull.volume();
      (below ? score.thickness_below : score.thickness_above) = thickness;
      (below ? score.extent_below : score.extent_above) = extent;
    }
  }

  const Sections sections_;
  std::vector<PlaneScore> scores_;
  std::vector<Slab> slabs_;                 // M + 1 slabs
  HullBuilder lowest_slab_, highest_slab_;  // the hulls that the others grow from
};

}  // namespace

std::vector<PlaneScore> sweep(const Mesh& mesh, const std::vector<Vec3>& directions, const std::vector<double>& offsets,
                              int threads) {
  // Principal axes are often coordinate axes or parallel to face normals: equal directions share one sweep.
  const Bundles bundles = bundle_planes(directions, offsets);
  std::vector<std::vector<PlaneScore>> swept(bundles.all.size());
  const SolidMesh solid(mesh);
  parallel_for(swept.size(), threads, [&](std::size_t b) {
    swept[b] = DirectionSweep(solid, bundles.all[b].normal, bundles.all[b].offsets).run();
  });
  std::vector<PlaneScore> scores;
  scores.reserve(offsets.size());
  for (const Bundles::Place place : bundles.place) scores.push_back(swept[place.bundle][place.plane]);
  return scores;
}

}  // namespace rlacd
