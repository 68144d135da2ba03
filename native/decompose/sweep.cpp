#include "decompose/sweep.hpp"

#include <algorithm>

#include "convex/hull.hpp"
#include "core/parallel.hpp"
#include "decompose/sections.hpp"

namespace rlacd {

namespace {

// The scores of the planes of one direction.
std::vector<PlaneScore> scores_of(const Sections& sections) {
  std::vector<PlaneScore> scores(sections.planes());
  const std::vector<Sections::Measures> measures = sections.measure_sections();
  for (std::size_t j = 0; j < scores.size(); ++j) {
    scores[j].solid_below = sections.solid_below(j);
    scores[j].solid_above = sections.solid_above(j);
    scores[j].section_area = measures[j].area;
    scores[j].section_perimeter = measures[j].perimeter;
  }
  for (const bool below : {true, false}) {
    HullBuilder hull(sections.film());
    for (std::size_t i = 0; i < scores.size(); ++i) {
      const std::size_t j = below ? i : scores.size() - 1 - i, slab = below ? j : j + 1;
      std::vector<Vec3> points = sections.outline(j);
      sections.for_each_inside(slab, slab + 1, [&points](Vec3 p) { points.push_back(p); });
      hull.add(points);
      hull.drop_inner_points();
      const double thickness = below ? sections.offset(j) - sections.lowest() : sections.highest() - sections.offset(j);
      const double extent =
          hull.points().empty() ? 0 : std::max(thickness, max_abs(hull.extent().upper - hull.extent().lower));
      (below ? scores[j].hull_below : scores[j].hull_above) = hull.volume();
      (below ? scores[j].thickness_below : scores[j].thickness_above) = thickness;
      (below ? scores[j].extent_below : scores[j].extent_above) = extent;
    }
  }
  return scores;
}

}  // namespace

std::vector<PlaneScore> sweep(const Mesh& mesh, const std::vector<Vec3>& directions, const std::vector<double>& offsets,
                              int threads) {
  // Principal axes are often coordinate axes or parallel to face normals: equal directions share one sweep.
  const Bundles bundles = bundle_planes(directions, offsets);
  std::vector<std::vector<PlaneScore>> swept(bundles.all.size());
  const SolidMesh solid(mesh);
  parallel_for(swept.size(), threads, [&](std::size_t b) {
    swept[b] = scores_of(Sections(solid, bundles.all[b].normal, bundles.all[b].offsets));
  });
  std::vector<PlaneScore> scores;
  scores.reserve(offsets.size());
  for (const Bundles::Place place : bundles.place) scores.push_back(swept[place.bundle][place.plane]);
  return scores;
}

}  // namespace rlacd
