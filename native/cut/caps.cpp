#include "cut/caps.hpp"

#include <cmath>

#include "cut/triangulate.hpp"
#include "cut/uncross.hpp"

namespace rlacd {

namespace {

using Rims = std::vector<std::vector<std::int32_t>>;
using Outlines = std::vector<std::vector<PlanePoint>>;

Outlines outlines_of(const std::vector<Vec3>& vertices, const Rims& rims, Vec3 outward) {
  Outlines outlines;
  for (const std::vector<std::int32_t>& rim : rims) {
    std::vector<Vec3> points;
    points.reserve(rim.size());
    for (const std::int32_t i : rim) points.push_back(vertices[i]);
    outlines.push_back(on_plane(points, outward));
  }
  return outlines;
}

// The vertex at each corner, and the corner as a point of the plane.
template <class Item>
std::vector<Item> joined(const std::vector<std::vector<Item>>& loops) {
  std::vector<Item> all;
  for (const std::vector<Item>& loop : loops) all.insert(all.end(), loop.begin(), loop.end());
  return all;
}

void append(std::vector<Triangle>& faces, const Rims& rims, const Outlines& outlines, int times, CapArea* area) {
  const std::vector<std::int32_t> vertex = joined(rims);
  const std::vector<PlanePoint> point = joined(outlines);
  for (const Triangle& t : triangulate(outlines, vertex)) {
    if (area != nullptr) {
      const double doubled = doubled_area(point[t[0]], point[t[1]], point[t[2]]);
      area->all += std::fabs(doubled);
      if (doubled < 0) area->folded -= doubled;
    }
    for (int i = 0; i < std::abs(times); ++i)
      faces.push_back(times > 0 ? Triangle{vertex[t[0]], vertex[t[1]], vertex[t[2]]}
                                : Triangle{vertex[t[0]], vertex[t[2]], vertex[t[1]]});
  }
}

}  // namespace

void add_caps(std::vector<Triangle>& faces, const std::vector<Vec3>& vertices, const Rims& rims, Vec3 outward,
              CapArea& area) {
  append(faces, rims, outlines_of(vertices, rims, outward), 1, &area);
}

Mesh capped(OpenSide side, Vec3 outward) {
  if (side.rims.empty()) return std::move(side.mesh);
  const Outlines outlines = outlines_of(side.mesh.vertices, side.rims, outward);
  const std::size_t open = side.mesh.faces.size();
  CapArea area;
  append(side.mesh.faces, side.rims, outlines, 1, &area);
  if (area.folded <= kFolded * area.all) return std::move(side.mesh);
  OpenSide again{side.mesh, side.rims};
  again.mesh.faces.resize(open);
  std::optional<UncrossedSide> apart = uncross(std::move(again), outlines);
  if (!apart) return std::move(side.mesh);
  for (const RimRegion& region : apart->regions)
    append(apart->mesh.faces, region.rims, region.outlines, region.winding, nullptr);
  return std::move(apart->mesh);
}

}  // namespace rlacd
