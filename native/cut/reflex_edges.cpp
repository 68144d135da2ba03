// Reflex edges: see reflex_edges.hpp for input, output and algorithm.
#include "cut/reflex_edges.hpp"

#include <algorithm>

#include "base/stop.hpp"
#include "mesh/edges.hpp"

namespace rlacd {

namespace {

constexpr double kReflex = 10 * kPi / 180;  // flatter edges tessellate curves
constexpr double kFold =
    0.1 * kPi / 180;  // two faces this close in angle enclose a slit or a film: rounding decides which
constexpr double kThinnestFace = 1e-6;  // the normals of faces thinner than this are meaningless in single precision

}  // namespace

std::vector<ReflexEdge> reflex_edges(const Mesh& mesh) {
  std::vector<Vec3> normals;
  std::vector<double> doubled_area;
  normals.reserve(mesh.faces.size());
  doubled_area.reserve(mesh.faces.size());
  for (const Triangle& f : mesh.faces) {
    const Vec3 scaled = long_normal(mesh, f);
    doubled_area.push_back(norm(scaled));
    const double length = std::max(doubled_area.back(), std::numeric_limits<double>::min());
    normals.push_back({scaled.x / length, scaled.y / length, scaled.z / length});
  }

  std::vector<ReflexEdge> found;
  const auto add_if_reflex = [&](std::int32_t low, std::int32_t high, std::int32_t f, std::int32_t g) {
    // Seen along the edge, outward normals turn to the left over a ridge and to the right in a valley.
    const Vec3 along = mesh.vertices[high] - mesh.vertices[low];
    const double turn = dot(cross(normals[g], normals[f]), along);
    if (!(turn > 0)) return;
    const double length = norm(along);
    const double angle = std::atan2(turn, length * dot(normals[f], normals[g]));
    if (angle > kReflex && angle < kPi - kFold && std::min(doubled_area[f], doubled_area[g]) > kThinnestFace * length)
      found.push_back({{low, high}, {f, g}, {normals[f], normals[g]}, angle});
  };

  Buckets<Run> runs = sorted_halfedges(mesh.faces, mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    poll_stop();
    const auto [begin, end] = runs.range(v);
    for (const Run *r = begin, *next; r != end; r = next) {
      next = std::find_if(r, static_cast<const Run*>(end), [r](const Run& other) { return other.high != r->high; });
      if (next - r != 2 || r->high == static_cast<std::int32_t>(v)) continue;
      const auto face_of = [](const Run& run) { return static_cast<std::int32_t>(run.halfedge / 3); };
      const auto ascends = [&](const Run& run) {
        return mesh.faces[run.halfedge / 3][run.halfedge % 3] == static_cast<std::int32_t>(v);
      };
      if (ascends(r[0]) == ascends(r[1])) continue;
      const Run &up = ascends(r[0]) ? r[0] : r[1], &down = ascends(r[0]) ? r[1] : r[0];
      add_if_reflex(static_cast<std::int32_t>(v), r->high, face_of(up), face_of(down));
    }
  }
  return found;
}

}  // namespace rlacd
