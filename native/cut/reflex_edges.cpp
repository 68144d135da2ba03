// Reflex edges: see reflex_edges.hpp for input, output and algorithm.
#include "cut/reflex_edges.hpp"

#include <algorithm>

#include "base/stop.hpp"

namespace rlacd {

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kReflex = 10 * kPi / 180;  // flatter edges tessellate curves
constexpr double kFold =
    0.1 * kPi / 180;  // two faces this close in angle enclose a slit or a film: rounding decides which
constexpr double kThinnestFace = 1e-6;  // the normals of faces thinner than this are meaningless in single precision

struct Halfedge {
  std::int32_t high;  // the larger of its two vertices
  std::int32_t face;
  bool ascends;  // runs from the smaller vertex to the larger
};

// Halfedges by their smaller vertex v: those of v are at start[v] .. start[v + 1].
struct Buckets {
  std::vector<std::size_t> start;
  std::vector<Halfedge> halfedges;
};

Buckets by_smaller_vertex(const Mesh& mesh) {
  Buckets buckets;
  buckets.start.assign(mesh.vertices.size() + 1, 0);
  for (const Triangle& f : mesh.faces)
    for (int e = 0; e < 3; ++e) ++buckets.start[std::min(f[e], f[(e + 1) % 3]) + 1];
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) buckets.start[v + 1] += buckets.start[v];
  buckets.halfedges.resize(3 * mesh.faces.size());
  std::vector<std::size_t> next(buckets.start.begin(), buckets.start.end() - 1);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (int e = 0; e < 3; ++e) {
      const std::int32_t a = mesh.faces[f][e], b = mesh.faces[f][(e + 1) % 3];
      buckets.halfedges[next[std::min(a, b)]++] = {std::max(a, b), static_cast<std::int32_t>(f), a < b};
    }
  return buckets;
}

}  // namespace

std::vector<ReflexEdge> reflex_edges(const Mesh& mesh) {
  std::vector<Vec3> normals;
  std::vector<double> doubled_area;
  normals.reserve(mesh.faces.size());
  doubled_area.reserve(mesh.faces.size());
  for (const Triangle& f : mesh.faces) {
    const Vec3 a = mesh.vertices[f[0]], scaled = cross(mesh.vertices[f[1]] - a, mesh.vertices[f[2]] - a);
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

  Buckets buckets = by_smaller_vertex(mesh);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    poll_stop();
    const auto begin = buckets.halfedges.begin() + static_cast<std::ptrdiff_t>(buckets.start[v]);
    const auto end = buckets.halfedges.begin() + static_cast<std::ptrdiff_t>(buckets.start[v + 1]);
    std::sort(begin, end, [](const Halfedge& h, const Halfedge& g) {
      return h.high != g.high ? h.high < g.high : h.ascends != g.ascends ? h.ascends : h.face < g.face;
    });
    for (auto h = begin, next = h; h != end; h = next) {
      next = std::find_if(h, end, [h](const Halfedge& g) { return g.high != h->high; });
      const auto ascending = std::count_if(h, next, [](const Halfedge& g) { return g.ascends; });
      // A face with a repeated corner has a halfedge from a vertex to itself, which is not an edge.
      if (ascending == 1 && next - h == 2) add_if_reflex(static_cast<std::int32_t>(v), h->high, h->face, (h + 1)->face);
    }
  }
  return found;
}

}  // namespace rlacd
