// Edge-connected pieces of a mesh: see bodies.hpp for input, output and algorithm.
#include "cut/bodies.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/edges.hpp"

namespace rlacd {

namespace {

bool ascends(const Mesh& mesh, std::int32_t low, const Run& run) {
  return mesh.faces[run.halfedge / 3][run.halfedge % 3] == low;
}

// Sorts the halfedges between two vertices by angle, such that the solid lies between an ascending one and the one
// before it. False if ascending and descending halfedges do not alternate.
bool sort_around(const Mesh& mesh, std::int32_t low, Run* begin, Run* end) {
  const Vec3 origin = mesh.vertices[low], along = normalized(mesh.vertices[begin->high] - origin);
  const auto apex = [&](const Run& run) {
    return mesh.vertices[mesh.faces[run.halfedge / 3][(run.halfedge + 2) % 3]] - origin;
  };
  const Vec3 u = normalized(cross(along, apex(*begin))), v = cross(along, u);
  const auto angle = [&](const Run& run) { return std::atan2(dot(v, apex(run)), dot(u, apex(run))); };
  std::sort(begin, end, [&](const Run& a, const Run& b) { return angle(a) < angle(b); });
  for (const Run* r = begin; r != end; ++r)
    if (ascends(mesh, low, *r) == ascends(mesh, low, r + 1 == end ? *begin : r[1])) return false;
  return true;
}

}  // namespace

std::vector<Mesh> bodies(const Mesh& mesh) {
  Groups groups(mesh.faces.size());
  const auto join = [&groups](const Run& a, const Run& b) { groups.join(a.halfedge / 3, b.halfedge / 3); };
  Buckets<Run> runs = sorted_halfedges(mesh.faces, mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto low = static_cast<std::int32_t>(v);
    const auto [begin, end] = runs.range(v);
    for (Run *first = begin, *after; first != end; first = after) {
      after = std::find_if(first, end, [first](const Run& run) { return run.high != first->high; });
      if (after - first > 2 && sort_around(mesh, low, first, after)) {
        for (const Run* r = first; r != after; ++r)
          if (ascends(mesh, low, *r)) join(*r, r == first ? after[-1] : r[-1]);
      } else {
        for (const Run* r = first + 1; r != after; ++r) join(*r, r[-1]);
      }
    }
  }
  const auto [count, body] = groups.labels();
  std::vector<std::vector<std::int32_t>> members(static_cast<std::size_t>(count));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) members[body[f]].push_back(static_cast<std::int32_t>(f));
  std::vector<Mesh> found;
  std::vector<std::int32_t> number(mesh.vertices.size()), owner(mesh.vertices.size(), -1);
  for (std::size_t b = 0; b < members.size(); ++b) {
    Mesh one;
    for (const std::int32_t f : members[b]) {
      Triangle face = mesh.faces[f];
      for (std::int32_t& corner : face) {
        if (owner[corner] != static_cast<std::int32_t>(b)) {
          owner[corner] = static_cast<std::int32_t>(b);
          number[corner] = static_cast<std::int32_t>(one.vertices.size());
          one.vertices.push_back(mesh.vertices[corner]);
        }
        corner = number[corner];
      }
      one.faces.push_back(face);
    }
    found.push_back(std::move(one));
  }
  return found;
}

}  // namespace rlacd
