#include "convex/polytope.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "convex/hull.hpp"
#include "surface/edges.hpp"

namespace rlacd {

// The corners of the polytope are the facets of the hull of its planes' dual points.
std::optional<Polytope> in_general_position(const ConvexBody& hull, double nudge) {
  const ConvexPlanes& planes = hull.planes();
  const Vec3 middle = middle_of(hull.mesh().vertices);
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
  for (std::size_t t = 0; t < dual.faces.size(); ++t) {
    const Triangle& face = dual.faces[t];
    const Vec3 a = duals[dual.indices[face[0]]], b = duals[dual.indices[face[1]]], c = duals[dual.indices[face[2]]];
    const Vec3 normal = cross(b - a, c - a);
    const double height = dot(normal, a);
    if (!(height > 0)) return std::nullopt;
    result.corners.push_back(middle + (1 / height) * normal);
  }
  // Around facet i (seen from outside) the corners follow each other as the dual's faces do around point i: the corner
  // left of the dual edge i -> j comes after the one right of it.
  const std::vector<std::uint32_t> mate = mates_of(dual.faces, dual.indices.size());
  if (mate.empty()) return std::nullopt;
  for (std::size_t h = 0; h < mate.size(); ++h) {
    const Triangle& face = dual.faces[h / 3];
    const std::int32_t i = face[h % 3], j = face[(h % 3 + 1) % 3];
    if (i < j) result.edges.push_back({i, j, static_cast<std::int32_t>(mate[h] / 3), static_cast<std::int32_t>(h / 3)});
  }
  std::sort(result.edges.begin(), result.edges.end(), [](const Polytope::Edge& a, const Polytope::Edge& b) {
    return std::tie(a.left, a.right) < std::tie(b.left, b.right);
  });
  return result;
}

std::int32_t Polytope::edge_between(std::int32_t left, std::int32_t right) const {
  if (left > right) std::swap(left, right);
  const auto found = std::lower_bound(edges.begin(), edges.end(), std::pair(left, right),
                                      [](const Edge& e, auto pair) { return std::pair(e.left, e.right) < pair; });
  const bool is_there = found != edges.end() && found->left == left && found->right == right;
  return is_there ? static_cast<std::int32_t>(found - edges.begin()) : -1;
}

}  // namespace rlacd
