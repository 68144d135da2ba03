#include "hull/convex_relax.hpp"

#include <map>
#include <utility>

#include "base/mesh_measures.hpp"
#include "base/stop.hpp"
#include "hull/hull.hpp"
#include "hull/linear_program.hpp"

namespace rlacd {
namespace {

constexpr double kEnoughProgress = 2e-4;  // relative change of the volume in one sweep
constexpr double kReach = 100;

struct RingEdge {
  std::int32_t from, to, beyond;  // beyond: the corner across the edge
};

// The edges opposite to each corner in its facets, with what lies across them.
std::vector<std::vector<RingEdge>> rings(const Mesh& mesh) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> opposite;
  for (const Triangle& face : mesh.faces)
    for (int i = 0; i < 3; ++i) opposite[{face[i], face[(i + 1) % 3]}] = face[(i + 2) % 3];
  std::vector<std::vector<RingEdge>> around(mesh.vertices.size());
  for (const Triangle& face : mesh.faces)
    for (int i = 0; i < 3; ++i) {
      const std::int32_t from = face[(i + 1) % 3], to = face[(i + 2) % 3];
      around[face[i]].push_back({from, to, opposite.at({to, from})});
    }
  return around;
}

// The plane through the edge a -> b, rotated down from the facet (a, b, w) until it touches the inner hull. In the
// frame (across the facet, along its normal) every inner point lies below; the plane first meets the one with the
// smallest angle below it.
Above touching_plane(Vec3 a, Vec3 b, Vec3 w, const Mesh& inner) {
  const Vec3 normal = normalized(cross(b - a, w - a)), across = normalized(cross(normal, b - a));
  double x = -1, y = 0;  // half a turn: no restriction
  for (const Vec3 p : inner.vertices) {
    const double px = dot(across, p - a), py = std::max(0.0, -dot(normal, p - a));
    if (px * y - py * x > 0 || (py == 0 && px > 0)) x = px, y = py;
  }
  const double length = std::hypot(x, y);
  const Vec3 turned = (x / length) * normal + (y / length) * across;
  return {turned, dot(turned, a)};
}

}  // namespace

Mesh relax_around(Mesh outer, const Mesh& inner, const std::vector<Above>& bounds, int sweeps) {
  double volume = mesh_volume(outer.vertices, outer.faces);
  std::vector<Above> constraints;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    const std::vector<std::vector<RingEdge>> around = rings(outer);
    std::vector<Vec3>& v = outer.vertices;
    for (std::size_t w = 0; w < v.size(); ++w) {
      poll_stop();
      constraints = bounds;
      Vec3 objective;
      bool sound = true;
      for (const RingEdge& edge : around[w]) {
        const Vec3 a = v[edge.from], b = v[edge.to];
        objective = objective + cross(a - v[w], b - v[w]);
        const Vec3 beyond = normalized(cross(a - b, v[edge.beyond] - b));
        constraints.push_back(touching_plane(a, b, v[w], inner));
        constraints.push_back({-beyond, -std::max(dot(beyond, a), dot(beyond, v[w]))});
        sound = sound && norm2(beyond) > 0.5 && norm2(constraints[constraints.size() - 2].normal) > 0.5;
      }
      if (!sound || !(norm2(objective) > 0)) continue;
      objective = normalized(objective);
      const std::optional<Vec3> lowest = lowest_point(objective, constraints, kReach);
      if (lowest && dot(objective, *lowest) < dot(objective, v[w]) - 1e-12) v[w] = *lowest;
    }
    Mesh next = hull_mesh(v);
    const double reached = mesh_volume(next.vertices, next.faces);
    outer = std::move(next);
    if (!(reached < (1 - kEnoughProgress) * volume)) break;
    volume = reached;
  }
  return outer;
}

}  // namespace rlacd
