#include "convex/polytope.hpp"

#include <cmath>

#include "convex/convex_planes.hpp"
#include "convex/hull.hpp"

namespace rlacd {

// The corners of the polytope are the facets of the hull of its planes' dual points.
std::optional<Polytope> in_general_position(const Mesh& hull, double nudge) {
  const ConvexPlanes planes(hull);
  Vec3 middle{0, 0, 0};
  for (const Vec3 p : hull.vertices) middle = middle + (1.0 / static_cast<double>(hull.vertices.size())) * p;
  std::vector<HalfSpace> all;
  std::vector<Vec3> duals;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const auto plane = static_cast<std::int32_t>(i);
    const double golden = 0.6180339887498949 * static_cast<double>(i + 1);
    all.push_back({planes.normal(plane), planes.offset(plane) + nudge * (1 + golden - std::floor(golden))});
    const double height = all.back().depth(middle);
    if (!(height > 0)) return std::nullopt;
    duals.push_back((1 / height) * all.back().normal);
  }
  const Hull dual = convex_hull(duals);
  if (dual.rank < 3) return std::nullopt;

  Polytope result;
  for (const std::int32_t i : dual.indices) result.facets.push_back(all[i]);
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> corner_left_of;
  for (std::size_t t = 0; t < dual.faces.size(); ++t) {
    const Triangle& face = dual.faces[t];
    const Vec3 a = duals[dual.indices[face[0]]], b = duals[dual.indices[face[1]]], c = duals[dual.indices[face[2]]];
    const Vec3 normal = cross(b - a, c - a);
    const double height = dot(normal, a);
    if (!(height > 0)) return std::nullopt;
    result.corners.push_back(middle + (1 / height) * normal);
    for (int k = 0; k < 3; ++k) corner_left_of[{face[k], face[(k + 1) % 3]}] = static_cast<std::int32_t>(t);
  }
  // Around facet i (seen from outside) the corners follow each other as the dual's faces do around point i: the corner
  // left of the dual edge i -> j comes after the one right of it.
  for (const auto& [pair, left] : corner_left_of) {
    const auto [i, j] = pair;
    if (i > j) continue;
    const auto right = corner_left_of.find({j, i});
    if (right == corner_left_of.end()) return std::nullopt;
    result.edge_between[pair] = static_cast<std::int32_t>(result.edges.size());
    result.edges.push_back({i, j, right->second, left});
  }
  return result;
}

}  // namespace rlacd
